"""What a bench file may not say: flaws of a sampled controller on a continuous one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from campaign.physics.variation import as_it_is
from tests.physics.benches import bench

FLAWS = [
    (sensor, name, f"1e-3 {unit}")
    for sensor, own in (
        ("gyro", "rad/s"),
        ("encoder", "rad"),
        ("resolver", "rad"),
        ("current", "A"),
    )
    for name, unit in (("noise", own), ("resolution", own), ("delay", "s"))
]


def faults(edit: Any) -> list[tuple[tuple[Any, ...], str]]:
    with pytest.raises(ValidationError) as error:
        bench(edit)
    return [(each["loc"], each["msg"]) for each in error.value.errors()]


@pytest.mark.parametrize(("sensor", "name", "value"), FLAWS)
def test_a_sensor_s_flaw_needs_a_sampled_controller(sensor: str, name: str, value: str) -> None:
    def flawed(tree: dict[str, Any]) -> None:
        tree["sensors"] = {sensor: {name: value}}

    def sampled(tree: dict[str, Any]) -> None:
        flawed(tree)
        tree["controller"]["sample_rate"] = "1 kHz"

    ((place, message),) = faults(flawed)
    assert place == ("sensors",)
    assert f"'{sensor}.{name}' needs controller.sample_rate" in message
    assert getattr(getattr(bench(sampled).sensors, sensor), name) == pytest.approx(1e-3)


def test_a_delay_of_the_controller_needs_a_sampled_one() -> None:
    ((place, message),) = faults(lambda tree: tree["controller"].update(delay="1 ms"))
    assert place == ("controller", "delay")
    assert "'delay' needs controller.sample_rate" in message


@pytest.mark.parametrize("rate", ["-1 kHz", "fast"])
def test_a_wrong_sample_rate_is_the_only_mistake_then(rate: str) -> None:
    def wrong(tree: dict[str, Any]) -> None:
        tree["controller"] |= {"sample_rate": rate, "delay": "1 ms"}
        tree["sensors"] = {"gyro": {"delay": "1 ms"}}

    ((place, _),) = faults(wrong)
    assert place == ("controller", "sample_rate")


def test_sensors_without_flaws_may_stand_in_a_continuous_bench() -> None:
    on = bench(lambda tree: tree.update(sensors={"gyro": {"noise": "0 rad/s", "delay": "0 s"}}))
    assert on.sensors == bench().sensors


def test_the_mistake_is_shown_at_its_table(tmp_path: Path) -> None:
    from campaign.errors import ProtocolError
    from campaign.experiments import experiments
    from campaign.protocol import load_protocol
    from campaign.resources import protocols_folder
    from tests.physics.benches import SIMULINK

    text = SIMULINK.read_text(encoding="utf-8") + '\n[sensors]\ngyro = { noise = "1 mrad/s" }\n'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    line = text.splitlines().index("[sensors]") + 1
    protocol = tmp_path / "protocol.toml"
    protocol.write_text(
        'title = "t"\n[[test]]\nname = "t"\nkind = "stabilization"\nbench = "mine.toml"\n',
        encoding="utf-8",
    )
    with pytest.raises(ProtocolError) as error:
        load_protocol(protocol, experiments(), overrides=(), shipped=protocols_folder())
    assert f"mine.toml:{line}:" in str(error.value)


def test_the_scatter_of_a_trial_is_one_factor_on_coulomb_and_static_torque_alone() -> None:
    plain = bench().friction["load"]
    together = {"paths": ["coulomb_torque", "static_torque"], "relative": 0.1}
    scatter = {"trial_to_trial": {"torques": together}}
    varied = as_it_is(bench(lambda tree: tree.update(variation=scatter)), seed=5)
    found = varied.friction["load"]
    changed = {
        name: getattr(found, name) / value for name, value in plain if value != getattr(found, name)
    }
    assert changed.keys() == {"coulomb_torque", "static_torque"}
    assert changed["coulomb_torque"] == pytest.approx(changed["static_torque"])
