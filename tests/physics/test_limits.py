"""Margins against hand calculations."""

from __future__ import annotations

import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from campaign.physics.bench import Bench
from campaign.physics.limits import margins, motion, worst_friction
from campaign.signals import MultiSine, Polyline, Signal, Sine, Zero
from campaign.trial import Task

BENCH = Path(__file__).parents[2] / "protocols" / "benches" / "simulink.toml"
DEG = math.pi / 180


@pytest.fixture(scope="module")
def bench() -> Bench:
    return Bench.model_validate(tomllib.loads(BENCH.read_text()))


def rate_task(
    command: Signal, base: Signal | None = None, duration: float = 10.0, start: float = 0.0
) -> Task:
    return Task(
        mode="rate",
        command=command,
        base_acceleration=base or Zero(),
        duration=duration,
        window=(0.0, duration),
        sample_rate=100.0,
        start_angle=start,
    )


def values(bench: Bench, task: Task) -> dict[str, float]:
    return {margin.limit: margin.value for margin in margins(bench, task)}


def test_stabilization_at_the_thesis_condition(bench: Bench) -> None:
    omega = 2 * math.pi * 0.24
    base = Sine(amplitude=18 * DEG, frequency=0.24)
    found = values(bench, rate_task(Zero(), base, 20.0, start=10 * DEG))
    assert found["angle"] == pytest.approx(10 * DEG + 18 * DEG / omega**2, rel=1e-9)
    assert found["rate"] == pytest.approx(18 * DEG / omega, rel=1e-9)
    assert found["acceleration"] == pytest.approx(18 * DEG, rel=1e-9)
    # The load stands still in space, so the drive only holds against friction: static torques of
    # 32 N m and of 0.04 N m at the motor, N = 141.176, and the viscous parts of both.
    torque = 32 + 141.176 * 0.04 + (4 + 141.176 * 0.001) * 18 * DEG / omega
    assert found["torque"] == pytest.approx(torque, rel=1e-6)
    assert found["current"] == pytest.approx(torque / (141.176 * 0.086), rel=1e-6)
    assert found["duration"] == 20.0


def test_the_row_that_cannot_have_been_run(bench: Bench) -> None:
    # 36 deg/s^2 at 0.1 Hz is a motion of 91 deg either way; 90 deg are allowed.
    task = rate_task(Zero(), Sine(amplitude=36 * DEG, frequency=0.1), 20.0)
    broken = [margin for margin in margins(bench, task) if margin.broken]
    assert [margin.limit for margin in broken] == ["angle"]
    assert broken[0].value / DEG == pytest.approx(36 / (0.2 * math.pi) ** 2, rel=1e-9)


def test_a_trapezoid_of_rate(bench: Bench) -> None:
    command = Polyline(times=(0, 1, 2, 5, 6), values=(0, 0, 0.5, 0.5, 0))
    found = values(bench, rate_task(command, start=-1.0))
    assert found["angle"] == pytest.approx(1.0)  # from -1.0 up to -1.0 + 0.25 + 1.5 + 0.25 = +1.0
    assert found["rate"] == pytest.approx(0.5)
    assert found["acceleration"] == pytest.approx(0.5)
    friction = 32 + 141.176 * 0.04 + (4 + 141.176 * 0.001) * 0.5
    assert found["torque"] == pytest.approx(35 * 0.5 + friction, rel=1e-6)


def test_out_and_back_is_furthest_where_the_rate_crosses_zero(bench: Bench) -> None:
    command = Polyline(times=(0, 1, 3.7), values=(0, 1.0, -1.7))
    # Up to 1 in 1 s, down with slope 1: zero at 2 s, so 0.5 + 0.5 rad.
    assert values(bench, rate_task(command, duration=3.7))["angle"] == pytest.approx(1.0, rel=1e-12)


def test_only_what_happens_within_the_duration_counts(bench: Bench) -> None:
    command = Polyline(times=(0, 10, 11), values=(0, 1, 100))
    found = values(bench, rate_task(command, duration=5.0))
    assert found["rate"] == pytest.approx(0.5)
    assert found["acceleration"] == pytest.approx(0.1)
    assert found["angle"] == pytest.approx(0.5 * 0.1 * 25)


@pytest.mark.parametrize(
    "command",
    [
        Polyline(times=(0, 1, 1, 2), values=(0, 0, 0.1, 0.1)),
        Polyline(times=(0,), values=(0.1,)),
        Sine(amplitude=0.1, frequency=1.0, phase=0.5),
    ],
    ids=["step", "step at the start", "sine with a phase"],
)
def test_a_jump_of_the_rate_command_is_an_infinite_acceleration(bench, command: Signal) -> None:
    margin = next(m for m in margins(bench, rate_task(command)) if m.limit == "acceleration")
    assert math.isinf(margin.value)
    assert margin.broken


def test_a_jump_after_the_end_or_by_rounding_is_none(bench: Bench) -> None:
    late = Polyline(times=(0, 20, 20), values=(0, 0, 1))
    rounding = Polyline(times=(0, 1, 1), values=(0, 0, 1e-9))
    for command in (late, rounding):
        assert values(bench, rate_task(command))["acceleration"] == 0.0


def test_a_sine_rate_command(bench: Bench) -> None:
    found = motion(rate_task(Sine(amplitude=0.3, frequency=2.0)))
    assert found.rate == pytest.approx(0.3, rel=1e-12)
    assert found.load_acceleration == pytest.approx(0.3 * 4 * math.pi, rel=1e-12)
    # The angle swings between 0 and twice the amplitude, because it starts at the turning point.
    assert found.angle == pytest.approx(2 * 0.3 / (4 * math.pi), rel=1e-12)


def test_a_hull_that_jerks_from_rest(bench: Bench) -> None:
    # 1 rad/s^2 for 2 s, then none: 2 rad/s, and 2 rad by then; at 5 s 8 rad.
    base = Polyline(times=(0, 2, 2), values=(1, 1, 0))
    found = values(bench, rate_task(Zero(), base, 5.0))
    assert found["rate"] == pytest.approx(2.0, rel=1e-12)
    assert found["angle"] == pytest.approx(8.0, rel=1e-12)
    assert found["acceleration"] == pytest.approx(1.0)


def test_command_and_base_motion_together() -> None:
    # Against plain numerical integration on a fine grid.
    command = Polyline(times=(0, 1, 4, 6), values=(0, 0.4, -0.2, 0.3))
    base = Sine(amplitude=0.5, frequency=0.3, phase=0.7)
    time = np.linspace(0, 10, 200_001)
    omega = 2 * math.pi * 0.3
    hull_rate = -0.5 / omega * np.cos(omega * time + 0.7)
    rate = np.interp(time, command.times, command.values) - hull_rate
    angle = 0.2 + cumulative_trapezoid(rate, time, initial=0.0)
    found = motion(rate_task(command, base, 10.0, start=0.2))
    assert found.rate == pytest.approx(np.max(np.abs(rate)), rel=2e-3)
    assert found.angle == pytest.approx(np.max(np.abs(angle)), rel=2e-3)
    assert found.load_acceleration == pytest.approx(0.4)
    assert found.hull_acceleration == pytest.approx(0.5)


def test_a_torque_ramp_is_its_own_estimate(bench: Bench) -> None:
    task = Task(
        mode="torque",
        command=Polyline(times=(0, 60), values=(0, -60)),
        duration=50.0,
        window=(0.0, 50.0),
        sample_rate=100.0,
        start_angle=-0.5,
    )
    found = values(bench, task)
    assert found["torque"] == pytest.approx(50.0)
    assert found["current"] == pytest.approx(50.0 / (141.176 * 0.086))
    assert found["angle"] == 0.5
    assert found["rate"] == found["acceleration"] == 0.0


def test_exactly_at_a_limit_is_allowed(bench: Bench) -> None:
    limit = bench.limits.rate
    task = rate_task(Polyline(times=(0, 1, 2), values=(0, limit, 0)), duration=2.0, start=-1.0)
    margin = next(m for m in margins(bench, task) if m.limit == "rate")
    assert margin.fraction == pytest.approx(1.0)
    assert not margin.broken


def test_friction_driven_by_the_motor_s_rate(bench: Bench) -> None:
    tree = tomllib.loads(BENCH.read_text())
    del tree["friction"]["load"]
    tree["friction"]["motor"]["velocity"] = "motor"
    motor = Bench.model_validate(tree)
    # N times a torque whose viscous part sees N times the rate.
    expected = 141.176 * (0.04 + 0.001 * 141.176 * 0.5)
    assert worst_friction(motor, 0.5) == pytest.approx(expected, rel=1e-6)
    assert worst_friction(bench, 0.0) == 0.0


def test_friction_whose_static_torque_is_the_smaller(bench: Bench) -> None:
    tree = tomllib.loads(BENCH.read_text())
    del tree["friction"]["motor"]
    tree["friction"]["load"] |= {"static_torque": "20 N m", "viscous_friction": "0 N m s/rad"}
    assert worst_friction(Bench.model_validate(tree), 1.0) == pytest.approx(26.0, rel=1e-6)


def test_friction_that_is_larger_backwards() -> None:
    tree = tomllib.loads(BENCH.read_text())
    del tree["friction"]["motor"]
    tree["friction"]["load"]["negative"] = {"static_torque": "40 N m"}
    assert worst_friction(Bench.model_validate(tree), 0.5) == pytest.approx(40 + 4 * 0.5, rel=1e-6)


def test_irregular_motion_of_hull_and_load(bench: Bench) -> None:
    """Against cumulative trapezoids on a grid of 1 ms; the largest swing is far from the start."""
    sines = MultiSine(amplitudes=(0.2, 0.15, 0.1), frequencies=(0.1, 0.11, 0.23), phases=(1, 2, 3))
    time = np.arange(0.0, 60.0, 1e-3)
    acceleration = sum(
        a * np.sin(2 * np.pi * f * time + p)
        for a, f, p in zip(sines.amplitudes, sines.frequencies, sines.phases, strict=True)
    )
    rate = cumulative_trapezoid(acceleration, time, initial=0.0)
    omega = 2 * np.pi * np.array(sines.frequencies)
    rate -= np.sum(np.array(sines.amplitudes) / omega * np.cos(np.array(sines.phases)))
    angle = cumulative_trapezoid(rate, time, initial=0.0)

    hull = Task(mode="rate", base_acceleration=sines, duration=60, window=(0, 60), sample_rate=100)
    found = motion(hull)
    assert found.hull_acceleration == pytest.approx(np.max(np.abs(acceleration)), rel=2e-3)
    assert found.rate == pytest.approx(np.max(np.abs(rate)), rel=2e-3)
    assert found.angle == pytest.approx(np.max(np.abs(angle)), rel=2e-3)
    assert found.load_acceleration == 0.0

    load = Task(mode="rate", command=sines, duration=60, window=(0, 60), sample_rate=100)
    assert motion(load).load_acceleration == math.inf  # it would start with a jump
    level = sines.model_copy(update={"phases": (0.0, 0.0, 0.0)})
    slope = np.gradient(level.sample(time), time)
    smooth = motion(load.model_copy(update={"command": level}))
    assert smooth.load_acceleration == pytest.approx(np.max(np.abs(slope)), rel=2e-3)
    assert smooth.rate == pytest.approx(np.max(np.abs(level.sample(time))), rel=2e-3)
