"""Recordings as other laboratories have them: what is told of each, and what is not."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign.cli.identify import identify_run
from campaign.errors import NoResultError
from campaign.estimate import Estimate, Origin
from campaign.experiments.friction_map.curves import places
from tests.identify.unseen import curve, identified, imported, notes, random, staircase, told

RATE = 200.0


def holds(one: Estimate, truth: float) -> bool:
    low, high = one.combined
    return low is not None and high is not None and low <= truth <= high


def joint(seed: int) -> dict[str, tuple[str, np.ndarray]]:
    """Static friction below Coulomb friction in the positive direction, above in the other."""
    rate = staircase(np.tile(np.geomspace(0.05, 2.0, 10), 2), 0.8, 0.2, RATE)
    # What was recorded between two samples has moved half of it.
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) / RATE
    up = curve(np.abs(rate), 3.0, 2.0, 0.1, 1.0)
    down = curve(np.abs(rate), 3.4, 4.0, 0.1, 1.2)
    torque = np.where(rate > 0, up, np.where(rate < 0, -down, 0.0))
    torque += 0.05 * np.gradient(rate, 1.0 / RATE)
    torque += 0.03 * random(seed).standard_normal(len(rate))
    return {"relative_angle": ("rad", angle), "drive_torque": ("N m", torque)}


def test_each_direction_has_static_friction_of_its_own(tmp_path: Path) -> None:
    results = imported(tmp_path, joint(1), RATE)
    section = identified(results, "friction_map", 'friction_map.slowest="1 deg/s"')
    found = told(section)
    for name, truth in (
        ("static_torque_positive", 2.0), ("coulomb_torque_positive", 3.0),
        ("static_torque_negative", 4.0), ("coulomb_torque_negative", 3.4),
    ):  # fmt: skip
        assert holds(found[name], truth), name
    said = notes(section)
    assert "In the positive direction static friction lies below Coulomb friction" in said
    assert "In the negative direction static friction lies above Coulomb friction" in said


@pytest.mark.slow
def test_whole_models_do_not_share_static_friction_between_directions(tmp_path: Path) -> None:
    section = identified(imported(tmp_path, joint(2), RATE), "whole_model")
    found = told(section)
    for way, truth in (("positive", 2.0 / 3.0), ("negative", 4.0 / 3.4)):
        assert found[f"static_over_coulomb_{way}"].value == pytest.approx(truth, rel=0.02)
    for name, truth in (("coulomb_positive", 3.0), ("coulomb_negative", 3.4)):
        assert found[name].value == pytest.approx(truth, rel=0.01)
    assert "In the positive direction static friction lies below Coulomb friction" in notes(section)
    # Nothing was slow enough for bristles to show.
    for name in {"bristle_stiffness", "bristle_damping"} & set(found):
        assert found[name].origin is Origin.NOT_DETERMINED


def test_a_line_has_no_stribeck_part(tmp_path: Path) -> None:
    rate = staircase(np.tile(np.geomspace(0.1, 2.0, 9), 2), 0.8, 0.2, RATE)
    torque = np.sign(rate) * (3.0 + np.abs(rate)) + 0.05 * random(3).standard_normal(len(rate))
    columns = {"relative_rate": ("rad/s", rate), "drive_torque": ("N m", torque)}
    section = identified(imported(tmp_path, columns, RATE), "friction_map")
    assert "no Stribeck part that these speeds could identify" in notes(section)
    assert "below Coulomb" not in notes(section)


@pytest.mark.slow
def test_motion_in_one_direction(tmp_path: Path) -> None:
    """Inertia, and what that direction takes; the sensor's noise at rest is no other direction."""
    time = np.arange(8000) / RATE
    rate = -np.maximum(0.0, 1.5 + np.sin(1.3 * time) + 0.5 * np.sin(3.1 * time))
    rate += 0.004 * random(4).standard_normal(len(rate))
    acceleration = -(1.3 * np.cos(1.3 * time) + 1.55 * np.cos(3.1 * time))
    torque = 0.4 * acceleration - 2.0 + 0.7 * rate + 0.02 * random(5).standard_normal(len(rate))
    columns = {"relative_rate": ("rad/s", rate), "drive_torque": ("N m", torque)}
    results = imported(tmp_path, columns, RATE)
    section = identified(results, "inverse_dynamics")
    found = told(section)
    assert set(found) >= {"inertia", "viscous_negative", "coulomb_negative"}
    assert not any(name.endswith("positive") for name in found)
    assert holds(found["inertia"], 0.4)
    assert holds(found["viscous_negative"], 0.7)
    assert holds(found["coulomb_negative"], 2.0)
    assert section.result is not None
    keys = {each.bench for each in section.identified.parameters}
    assert not any(key.startswith("friction") for key in keys)
    assert not section.identified.settings
    assert "in the negative direction only" in notes(section)
    whole = identified(results, "whole_model")
    assert "does not slide in the positive direction" in whole.problem


def test_half_a_second_is_enough_where_it_is_all_there_is(tmp_path: Path) -> None:
    rate = 1500.0
    time = np.arange(800) / rate
    speed = 0.35 * (1.0 - np.cos(2 * np.pi * time / 0.5333))
    force = 24.7 * np.gradient(speed, 1.0 / rate) + 40.0 * speed + 18.0 * (speed > 0)
    force += 0.5 * random(6).standard_normal(len(time))
    columns = {"relative_rate": ("m/s", speed), "drive_torque": ("N", force)}
    results = imported(tmp_path, columns, rate, kind="linear")
    found = told(identified(results, "inverse_dynamics"))
    assert found["inertia"].value == pytest.approx(24.7, rel=0.03)
    assert holds(found["inertia"], 24.7)
    # One sine in one direction: a delay turns it as inertia and viscous friction do.
    assert found["delay"].origin is Origin.NOT_DETERMINED
    assert "looks like other terms" in str(found["delay"].reason)
    assert holds(found["viscous_positive"], 40.0)


@pytest.mark.slow
def test_a_joints_torque_stands_in_for_the_drives(tmp_path: Path) -> None:
    columns = joint(7)
    columns["joint_torque"] = columns.pop("drive_torque")
    section = identified(imported(tmp_path, columns, RATE), "inverse_dynamics")
    assert told(section)["coulomb_positive"].value == pytest.approx(2.9, rel=0.15)
    assert "The force is joint_torque" in notes(section)


@pytest.mark.slow
def test_ripple_shows_beside_gravity_and_friction_that_warms(tmp_path: Path) -> None:
    time = np.arange(round(80 * RATE)) / RATE
    angle = 0.9 * np.sin(0.82 * time) + 0.5 * np.sin(1.95 * time + 1) + 0.1 * np.sin(6.9 * time)
    rate = np.gradient(angle, 1.0 / RATE)
    warm = 25.0 + 12.0 * (1.0 - np.exp(-time / 40.0))
    torque = 1.2 * np.gradient(rate, 1.0 / RATE) + 6.0 * rate + 20.0 * np.sin(angle)
    torque += (5.0 - 0.08 * (warm - 20.0)) * np.sign(rate)
    torque += 0.8 * np.sin(2.0 * np.pi * angle / 0.157)
    torque += 0.15 * random(8).standard_normal(len(time))
    columns = {
        "relative_angle": ("rad", angle),
        "drive_torque": ("N m", torque),
        "temperature": ("degC", warm),
    }
    found = told(identified(imported(tmp_path, columns, RATE), "inverse_dynamics"))
    assert found["gravity_sine"].value == pytest.approx(20.0, rel=0.01)
    assert np.hypot(found["cogging_sine"].value, found["cogging_cosine"].value) == pytest.approx(
        0.8, rel=0.1
    )
    assert found["coulomb_over_temperature"].value == pytest.approx(-0.08, rel=0.1)
    # Dry friction is that at 20 degC, and not at the freezing point.
    assert found["coulomb_positive"].value == pytest.approx(5.0, rel=0.03)


def sliding(loads: tuple[float, ...], speeds: np.ndarray) -> dict[str, tuple[str, np.ndarray]]:
    """A tribometer: friction coefficient 0.12 + 0.05 exp(-(v / 10 mm/s)^2) + 0.1 s/m v."""
    rate = staircase(speeds, 1.2, 0.1, 100.0)
    speed = np.tile(rate, len(loads))
    load = np.repeat(loads, len(rate)) + 0.02 * random(9).standard_normal(len(speed))
    ratio = curve(np.abs(speed), 0.12, 0.17, 0.01, 0.1)
    force = np.sign(speed) * ratio * np.repeat(loads, len(rate))
    return {
        "relative_rate": ("m/s", speed + 1e-5 * random(10).standard_normal(len(speed))),
        "joint_torque": ("N", force + 0.01 * random(11).standard_normal(len(speed))),
        "normal_load": ("N", load),
    }


def test_a_tribometer_with_several_loads_tells_coefficients(tmp_path: Path) -> None:
    columns = sliding((5.0, 10.0, 20.0), np.geomspace(5e-4, 0.2, 9))
    results = imported(tmp_path, columns, 100.0, kind="linear")
    section = identified(results, "friction_map", 'friction_map.slowest="0.2 mm/s"')
    found = told(section)
    for way in ("positive", "negative"):
        assert holds(found[f"coulomb_coefficient_{way}"], 0.12)
        assert holds(found[f"static_coefficient_{way}"], 0.17)
        assert holds(found[f"stribeck_velocity_{way}"], 0.01)
    # Of several loads there is no friction curve, and a bench gets none.
    assert not any(name.startswith("coulomb_torque") for name in found)
    assert section.result is not None
    assert not any(each.bench for each in section.identified.parameters)
    assert not section.identified.settings
    assert "Normal loads differ" in notes(section)


def test_one_speed_tells_the_friction_at_it(tmp_path: Path) -> None:
    columns = sliding((5.0,), np.full(6, 0.05))
    results = imported(tmp_path, columns, 100.0, kind="linear")
    found = told(identified(results, "friction_map"))
    assert set(found) == {
        "friction_positive", "friction_negative",
        "friction_coefficient_positive", "friction_coefficient_negative",
    }  # fmt: skip
    assert found["friction_coefficient_positive"].value == pytest.approx(0.125, rel=0.01)
    assert found["friction_negative"].value == pytest.approx(0.625, rel=0.01)


def test_friction_that_drives_is_told(tmp_path: Path) -> None:
    """A force on the part that rests has the other sign."""
    columns = sliding((5.0,), np.geomspace(0.02, 0.2, 5))
    right = identified(imported(tmp_path, columns, 100.0, kind="linear"), "friction_map")
    assert "acts with the motion" not in notes(right)
    unit, force = columns["joint_torque"]
    columns["joint_torque"] = unit, -force
    results = imported(tmp_path, columns, 100.0, kind="linear", name="turned")
    assert "acts with the motion" in notes(identified(results, "friction_map"))


def test_many_speeds_close_to_each_other_are_many() -> None:
    speed = np.geomspace(0.1, 1.0, 300)  # 0.8 % apart
    assert len(np.unique(places(speed))) > 90
    assert len(np.unique(places(np.array([1.0, 1.01, 0.995, 2.0])))) == 2


def test_what_no_method_can_use_is_told_line_by_line(tmp_path: Path) -> None:
    rate = np.sin(np.arange(90) / 5)
    columns = {"relative_rate": ("rad/s", rate), "drive_torque": ("N m", 2.0 * np.sign(rate))}
    results = imported(tmp_path, columns, RATE)
    run = next(path for path in results.glob("*.nxs") if not path.stem.endswith("-results"))
    with pytest.raises(NoResultError) as refused:
        identify_run(run.stem, results)
    first, *others = str(refused.value).splitlines()
    assert first.endswith("no parameter can be identified")
    assert sum(line.startswith("  inverse_dynamics: nothing is recorded") for line in others) == 1
    assert all(line.startswith("  ") for line in others)
