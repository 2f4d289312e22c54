"""What a bench file may not say: flaws of a sampled controller on a continuous one."""

from __future__ import annotations

from typing import Any

import pytest
from pydantic import ValidationError

from tests.physics.benches import bench

SENSORS = {"gyro": "rad/s", "encoder": "rad", "resolver": "rad", "current": "A"}
FLAWS = [
    (sensor, name, f"1e-3 {unit}")
    for sensor, own in SENSORS.items()
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
