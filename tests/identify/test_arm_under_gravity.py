"""A joint whose torque is mostly gravity, recorded stroke by stroke into one file.

Each stroke has a clock of its own, whose times are written with four digits: the strokes' sample
rates differ in the sixth. Gravity is three times the friction, and steady nowhere.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.cli.import_command import import_recordings
from campaign.errors import ExitCode
from campaign.estimate import Estimate, Origin
from campaign.estimation.angle_dependence import over_a_turn
from campaign.estimation.steady_sliding import steady_sliding
from campaign.experiments.friction_map.points import Point
from campaign.identify.agreement import disagreements
from tests.identify.unseen import curve, identified, notes, told

RATE = 66.85
UP, DOWN = (12.0, 9.0, 0.05, 3.0), (11.0, 11.0, 0.05, 2.5)
"""Coulomb, static, Stribeck velocity and viscous friction: static lies below in one direction."""
GRAVITY, TWICE = 38.0, 2.0
MAPPING = """
schema = 2
title = "An arm under gravity"
published = "none"

[columns.own.time]
column = "t"
unit = "s"
repair = ["resample"]

[columns.own.relative_angle]
column = "q"
unit = "deg"

[columns.own.relative_rate]
column = "qd"
unit = "deg/s"

[columns.own.drive_torque]
column = "tau"
unit = "N m"

[[test]]
name = "strokes"
kind = "motion"
bench = "./rig.toml"

[[test.recording]]
file = "strokes.csv"
restarts = true
"""


def stroke(speed: float, random: np.random.Generator) -> np.ndarray:
    """Time, angle, rate and torque of one; from rest, to rest."""
    count = round(min(4.0, 2.5 / abs(speed)) * RATE)
    time = np.arange(count) / RATE + random.uniform(0.0, 0.01)
    ramp = 0.2
    rate = speed * np.clip(np.minimum(time, time[-1] - time) / ramp, 0.0, 1.0)
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1])) / RATE])
    dry = np.where(rate > 0, curve(np.abs(rate), *UP), -curve(np.abs(rate), *DOWN)) * (rate != 0)
    torque = dry + GRAVITY * np.sin(angle) + TWICE * np.sin(2 * angle)
    torque += 2.5 * np.gradient(rate, 1 / RATE) + 0.2 * random.standard_normal(count)
    return np.column_stack([np.round(time, 4), np.rad2deg(angle), np.rad2deg(rate), torque])


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("arm")
    random = np.random.default_rng(1)
    speeds = [sign * speed for speed in np.geomspace(0.01, 1.5, 18) for sign in (1.0, -1.0)]
    rows = np.concatenate([stroke(speed, random) for speed in speeds])
    np.savetxt(folder / "strokes.csv", rows, "%.6g", ",", header="t,q,qd,tau", comments="")
    rig = 'schema = 3\nname = "arm"\n[axis]\nname = "joint"\nkind = "rotary"\n'
    (folder / "rig.toml").write_text(rig)
    (folder / "arm.toml").write_text(MAPPING)
    assert import_recordings([str(folder / "arm.toml")], folder / "results") is ExitCode.DONE
    return folder / "results"


def holds(one: Estimate, truth: float) -> bool:
    low, high = one.combined
    return low is not None and high is not None and low <= truth <= high


@pytest.mark.slow
def test_gravity_is_no_friction(results: Path) -> None:
    section = identified(results, "friction_map", 'friction_map.slowest="0.1 deg/s"')
    found = told(section)
    for direction, truth in (("positive", UP), ("negative", DOWN)):
        for name, value in (("coulomb_torque", truth[0]), ("viscous_friction", truth[3])):
            one = found[f"{name}_{direction}"]
            assert holds(one, value), (name, direction, one)
            assert one.half_width < 0.35 * value
    assert holds(found["static_torque_positive"], UP[1])
    said = notes(section)
    assert "changes with the angle, as gravity does: by 38" in said
    assert "In the positive direction static friction lies below Coulomb friction" in said
    assert "negative direction static friction is not distinguishable from Coulomb" in said


@pytest.mark.slow
def test_strokes_with_clocks_of_their_own_are_fitted_together(results: Path) -> None:
    found = told(identified(results, "inverse_dynamics"))
    assert holds(found["gravity_sine"], GRAVITY) or found["gravity_sine"].value == pytest.approx(
        GRAVITY, rel=0.05
    )
    assert found["viscous_positive"].value == pytest.approx(UP[3], rel=0.2)


def test_friction_that_differs_from_stretch_to_stretch_is_left_alone() -> None:
    """A level of its own for each: what does not change within one is nobody's gravity."""
    random = np.random.default_rng(3)
    stretches = []
    for _ in range(30):
        angle = random.uniform(-3, 3) + np.linspace(0.0, random.uniform(0.2, 2.0), 200)
        torque = 5.0 * np.sin(angle.mean()) + 0.3 * random.standard_normal(200)
        stretches.append((np.arange(200) / 100.0, angle, torque))
    assert over_a_turn(stretches) is None
    held = [(time, angle, torque + 2.0 * np.cos(angle)) for time, angle, torque in stretches]
    found = over_a_turn(held)
    assert found is not None
    assert found.amplitudes[0] == pytest.approx(2.0, rel=0.05)
    assert over_a_turn(held[:5]) is None


def test_friction_that_falls_as_it_warms_up_is_no_gravity() -> None:
    """Strokes out and back at several speeds: later in each the torque is less, as is the angle."""
    random = np.random.default_rng(4)
    cold, warm, start = [], [], 0.0
    for speed in np.tile([0.1, 0.2, 0.4, 0.8], 6):
        for way in (1.0, -1.0):
            time = start + np.linspace(0.0, 1.5 / speed, 200)
            angle = way * (speed * (time - start) - 0.75)
            friction = way * (0.8 + 0.3 * np.exp(-time / 200.0))
            noise = 0.002 * random.standard_normal(200)
            warm.append((time, angle, friction + noise))
            cold.append((time, angle, friction + 0.2 * np.cos(angle - 0.7) + noise))
            start = float(time[-1]) + 1.0
    assert over_a_turn(warm) is None
    found = over_a_turn(cold)
    assert found is not None
    assert found.amplitudes[0] == pytest.approx(0.2, rel=0.1)


def test_a_point_is_moved_with_its_interval() -> None:
    """A doubt may be larger than what a stretch scatters."""
    time = np.arange(400) / 100.0
    torque = 2.0 + 1e-3 * np.random.default_rng(1).standard_normal(400)
    own = steady_sliding(time, np.full(400, 0.5), torque, None, None)
    moved = Point.of(own, 1, 0.0, 4.0, doubts=(0.5,)).off_by(0).torque
    assert moved.value == pytest.approx(1.5, abs=1e-3)
    assert moved.low is not None
    assert moved.high is not None
    assert moved.low < moved.value < moved.high


def test_methods_that_disagree_are_told() -> None:
    """Only where intervals exclude each other by more than a tenth."""

    def section(
        method: str, name: str, value: float, half: float, *beside: str, origin: Any = None
    ) -> Any:
        one = Estimate(name, value, "N m", value - half, value + half, 0.95, "m", freedom=20.0)
        one = replace(one, origin=origin or Origin.MEASURED)
        found = [one, *(replace(one, name=each) for each in beside)]
        parameters = tuple(SimpleNamespace(estimate=each, display="") for each in found)
        identified = SimpleNamespace(parameters=parameters)
        model = SimpleNamespace(name=method)
        return SimpleNamespace(model=model, identified=identified, result=None)

    first = section("friction_map", "coulomb_torque_positive", 1.55, 0.08)
    (said,) = disagreements([first, section("inverse_dynamics", "coulomb_positive", 3.07, 0.16)])
    assert "about coulomb positive: friction_map finds 1.550 ± 0.080 N·m, inverse" in said
    for other in (("coulomb_positive", 1.7, 0.2), ("coulomb_negative", 3.0, 0.1),
                  ("coulomb_positive", 1.65, 0.001)):  # fmt: skip
        assert not list(disagreements([first, section("inverse_dynamics", *other)]))
    undetermined = ("coulomb_positive", 3.07, 0.16)
    assert not list(
        disagreements(
            [first, section("inverse_dynamics", *undetermined, origin=Origin.NOT_DETERMINED)]
        )
    )
    at_one = section("inverse_dynamics", "coulomb_positive", 3.07, 0.16, "coulomb_over_temperature")
    assert not list(disagreements([first, at_one])), "a mean over temperatures, and a value at one"
