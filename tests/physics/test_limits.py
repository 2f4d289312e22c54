"""Margins against hand calculations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid

from campaign.physics.limits import TINY_RATE, Extremes, Margin, margins, motion, worst_friction
from campaign.signals import MultiSine, Polyline, Signal, Sine, Zero
from campaign.trial import Task
from tests.physics.benches import RATIO, Tree, bench

DEG = math.pi / 180


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


def values(task: Task) -> dict[str, float]:
    return {margin.limit: margin.value for margin in margins(bench(), task)}


def test_stabilization_at_the_thesis_condition() -> None:
    omega = 2 * math.pi * 0.24
    base = Sine(amplitude=18 * DEG, frequency=0.24)
    found = values(rate_task(Zero(), base, 20.0, start=10 * DEG))
    assert found["angle"] == pytest.approx(10 * DEG + 18 * DEG / omega**2, rel=1e-9)
    assert found["rate"] == pytest.approx(18 * DEG / omega, rel=1e-9)
    assert found["acceleration"] == pytest.approx(18 * DEG, rel=1e-9)
    # The load stands still in space, so the drive only holds against friction: static torques of
    # 32 N m and of 0.04 N m at the motor, N = 141.176, and the viscous parts of both.
    torque = 32 + 141.176 * 0.04 + (4 + 141.176 * 0.001) * 18 * DEG / omega
    assert found["torque"] == pytest.approx(torque, rel=1e-6)
    assert found["current"] == pytest.approx(torque / (141.176 * 0.086), rel=1e-6)
    assert found["duration"] == 20.0


def test_a_trapezoid_of_rate() -> None:
    command = Polyline(times=(0, 1, 2, 5, 6), values=(0, 0, 0.5, 0.5, 0))
    found = values(rate_task(command, start=-1.0))
    assert found["angle"] == pytest.approx(1.0)  # from -1.0 up to -1.0 + 0.25 + 1.5 + 0.25 = +1.0
    assert found["rate"] == pytest.approx(0.5)
    assert found["acceleration"] == pytest.approx(0.5)
    friction = 32 + 141.176 * 0.04 + (4 + 141.176 * 0.001) * 0.5
    assert found["torque"] == pytest.approx(35 * 0.5 + friction, rel=1e-6)


def test_out_and_back_is_furthest_where_the_rate_crosses_zero() -> None:
    command = Polyline(times=(0, 1, 3.7), values=(0, 0.1, -0.17))
    # Up to 0.1 in 1 s, down with slope 0.1: zero at 2 s, so 0.05 + 0.05 rad.
    assert values(rate_task(command, duration=3.7))["angle"] == pytest.approx(0.1, rel=1e-12)


def test_a_hull_that_jerks_from_rest() -> None:
    # 1 rad/s^2 for 2 s, then none: 2 rad/s, and 2 rad by then; at 5 s 8 rad.
    base = Polyline(times=(0, 2, 2), values=(1, 1, 0))
    found = values(rate_task(Zero(), base, 5.0))
    assert found["rate"] == pytest.approx(2.0, rel=1e-12)
    assert found["angle"] == pytest.approx(8.0, rel=1e-12)
    assert found["acceleration"] == pytest.approx(1.0)


def test_a_torque_ramp_is_its_own_estimate() -> None:
    task = Task(
        mode="torque",
        command=Polyline(times=(0, 60), values=(0, -60)),
        duration=50.0,
        window=(0.0, 50.0),
        sample_rate=100.0,
        start_angle=-0.5,
    )
    found = values(task)
    assert found["torque"] == pytest.approx(50.0)
    assert found["current"] == pytest.approx(50.0 / (141.176 * 0.086))
    assert found["angle"] == 0.5
    assert found["rate"] == found["acceleration"] == 0.0


def test_the_disturbance_has_to_be_held_as_well() -> None:
    task = rate_task(Polyline(times=(0, 1, 2), values=(0, 0.5, 0.5)))
    disturbed = task.model_copy(update={"disturbance": Sine(amplitude=-3.0, frequency=1.0)})
    held = values(task)["torque"] + 3.0
    assert values(disturbed)["torque"] == pytest.approx(held, rel=1e-12)


def test_a_motion_that_is_given_needs_no_drive_and_knows_no_hull() -> None:
    task = rate_task(Sine(amplitude=0.3, frequency=2.0), Sine(amplitude=5.0, frequency=0.1))
    found = values(task.model_copy(update={"mode": "prescribed"}))
    assert found["torque"] == found["current"] == 0.0
    assert found["rate"] == pytest.approx(0.3, rel=1e-12)
    assert found["angle"] == pytest.approx(2 * 0.3 / (4 * math.pi), rel=1e-12)
    assert found["acceleration"] == pytest.approx(0.3 * 4 * math.pi, rel=1e-12)


def spring(command: Signal, start: float, stiffness: float = 20.0) -> Task:
    task = rate_task(command, start=start)
    return task.model_copy(update={"mode": "spring", "spring_stiffness": stiffness})


def test_a_spring_pulls_with_what_it_is_stretched_by() -> None:
    ramp = Polyline(times=(0, 10), values=(0.5, -0.8))
    found = values(spring(ramp, start=0.5))
    assert found["torque"] == pytest.approx(20.0 * 1.3)
    assert found["current"] == 0.0
    assert found["angle"] == pytest.approx(0.8)
    back = Polyline(times=(0, 10), values=(0.5, 0.2))
    assert values(spring(back, start=0.5))["torque"] == pytest.approx(20.0 * 0.3)
    wave = spring(Sine(amplitude=0.3, frequency=1.0), start=-0.5)
    assert values(wave)["torque"] == pytest.approx(20.0 * 0.8)
    assert values(wave)["angle"] == pytest.approx(0.5)
    slack = spring(ramp, start=0.5, stiffness=0.0)
    assert values(slack)["angle"] == 0.5
    assert values(spring(ramp, start=0.5, stiffness=0.5))["angle"] == pytest.approx(0.8)


def test_a_torque_moves_nobody_knows_how_whatever_stiffness_is_left_over() -> None:
    task = spring(Polyline(times=(0, 10), values=(0, 30)), start=-0.5)
    assert motion(task.model_copy(update={"mode": "torque"})) == Extremes(0.5, 0.0, 0.0, 0.0)


def test_a_margin_is_broken_beyond_rounding_and_by_what_is_no_number() -> None:
    for value, broken in ((1.0 + 1e-9, False), (1.0 + 3e-9, True), (math.nan, True)):
        margin = Margin("rate", 2.0 * value, 2.0, "rad/s")
        assert margin.broken is broken
    assert len({Margin("rate", 1.0, 2.0, "rad/s"), Margin("rate", 1.0, 2.0, "rad/s")}) == 1
    assert len({motion(rate_task(Zero())), motion(rate_task(Zero()))}) == 1


@pytest.mark.parametrize("beyond", [1.0, 1.0 + 1e-9])
def test_a_jump_of_the_rate_is_one_from_where_rounding_ends(beyond: float) -> None:
    level, turn = beyond * TINY_RATE, math.pi / 2
    for command in (
        Polyline(times=(0, 1, 1), values=(0, 0, level)),
        Polyline(times=(0,), values=(level,)),
        Sine(amplitude=level, frequency=1.0, phase=turn),
        MultiSine(amplitudes=(level,), frequencies=(1.0,), phases=(turn,)),
    ):
        assert math.isinf(motion(rate_task(command)).load_acceleration) is (beyond > 1)


def test_a_motion_may_be_largest_where_it_begins() -> None:
    """Behind its fastest point the hull of a steady sine gets slower until the next quarter."""
    hull = Sine(amplitude=0.3, frequency=0.1, phase=0.3)
    found = motion(rate_task(Zero(), hull, duration=1.5, start=-0.5))
    assert found.rate == pytest.approx(0.3 / (2 * math.pi * 0.1) * math.cos(0.3), rel=1e-12)
    assert found.angle == pytest.approx(0.5, rel=1e-12)  # the hull comes towards the load


@pytest.mark.parametrize(
    ("times", "values", "largest"),
    [
        ((-1, 4), (3, -1), 2.2),  # on its way at the start
        ((2, 4), (0.7, 0), 0.7),  # held before its first knot
        ((0, 1, 1, 5), (0, 2, 0, 0), 2.0),  # just before a jump
        ((0, 1, 1, 5), (0, 0, 2, 0), 2.0),  # just after one
    ],
)
def test_a_line_is_largest_at_its_ends_its_knots_and_beside_its_jumps(
    times: tuple[float, ...], values: tuple[float, ...], largest: float
) -> None:
    hull = Polyline(times=times, values=values)
    task = rate_task(Zero(), hull, duration=3.0)
    assert motion(task).hull_acceleration == pytest.approx(largest, rel=1e-12)


def test_what_is_before_the_start_or_at_the_very_end_is_no_motion() -> None:
    before = Polyline(times=(-3, -0.5, -0.5, 0, 0, 5), values=(0, 9, 7, 3, 0, 1))
    found = motion(rate_task(before, before, duration=5.0, start=0.4))
    assert found.load_acceleration == pytest.approx(0.2)
    assert found.hull_acceleration == pytest.approx(1.0)
    assert found.rate == pytest.approx(1.5)  # the hull gets to 2.5 rad/s
    late = Polyline(times=(0, 5, 5, 6), values=(0, 1, 4, 90))
    assert motion(rate_task(late, duration=5.0)).load_acceleration == pytest.approx(0.2)
    assert motion(rate_task(Zero(), late, duration=5.0)).hull_acceleration == 4.0  # it may begin
    assert motion(rate_task(Polyline(times=(0,), values=(0,)))).load_acceleration == 0.0


FLAT = {"static_torque": "20 N m", "viscous_friction": "0 N m s/rad"}
BACKWARDS = {"negative": {"static_torque": "40 N m"}}
RIPPLED = {"ripple": {"amplitude": 0.1, "periods": 67}}


@pytest.mark.parametrize(
    ("side", "edit", "rate", "expected"),
    [
        ("load", {}, 0.0, 0.0),
        # N times a torque whose viscous part sees N times the rate.
        ("motor", {"velocity": "motor"}, 0.5, RATIO * (0.04 + 0.001 * RATIO * 0.5)),
        ("load", FLAT, 1.0, 26.0),  # the static torque is the smaller
        ("load", FLAT, 0.003, 26 - 6 * math.exp(-(0.1**2))),  # slower than the curve falls
        ("load", BACKWARDS, 0.5, 40 + 4 * 0.5),
        ("load", RIPPLED, 0.5, 1.1 * 32 + 4 * 0.5),  # the worst place of a turn
    ],
)
def test_the_worst_friction(side: str, edit: Tree, rate: float, expected: float) -> None:
    def alone(tree: Tree) -> None:
        tree["friction"] = {side: tree["friction"][side] | edit}

    assert worst_friction(bench(alone), rate) == pytest.approx(expected, rel=1e-6)


def drawn_signal(chance: np.random.Generator, *, from_zero: bool) -> Signal:
    """Anything a task may command; `from_zero`: as far as it must not begin with a jump."""
    kind = chance.integers(4)
    if kind == 0:
        return Zero()
    if kind == 1:
        phase = chance.choice([0.0, np.pi]) if from_zero else chance.uniform(-7, 7)
        return Sine(amplitude=chance.normal(), frequency=chance.uniform(0.05, 2), phase=phase)
    if kind == 2:
        phases = np.zeros(3) if from_zero else chance.uniform(-7, 7, 3)
        return MultiSine(
            amplitudes=chance.normal(size=3), frequencies=chance.uniform(0.05, 2, 3), phases=phases
        )
    times = np.cumsum(chance.uniform(0.05, 3, 5))
    return Polyline(times=(0, *times), values=(0, *chance.normal(size=5)))


def integrals(signal: Signal, time: NDArray, *, hull: bool) -> tuple[NDArray, NDArray]:
    """By trapezoids on a fine grid; the rate of a hull's sines has zero mean."""
    first = cumulative_trapezoid(signal.sample(time), time, initial=0.0)
    if hull:
        match signal:
            case Sine(amplitude=a, frequency=f, phase=p):
                first -= a / (2 * np.pi * f) * np.cos(p)
            case MultiSine(amplitudes=a, frequencies=f, phases=p):
                first -= np.sum(np.array(a) / (2 * np.pi * np.array(f)) * np.cos(p))
    return first, cumulative_trapezoid(first, time, initial=0.0)


@pytest.mark.parametrize("seed", range(200))
def test_any_motion_against_plain_integration(seed: int) -> None:
    chance = np.random.default_rng(seed)
    command = drawn_signal(chance, from_zero=bool(seed % 2))
    base = drawn_signal(chance, from_zero=False)
    duration = float(np.exp(chance.uniform(np.log(0.1), np.log(12.0))))
    start = float(chance.normal())
    knots = [signal.times for signal in (command, base) if isinstance(signal, Polyline)]
    time = np.unique(np.concatenate([np.linspace(0.0, duration, 40_001), *knots]))
    time = time[time <= duration]
    hull_rate, hull_angle = integrals(base, time, hull=True)
    load_angle, _ = integrals(command, time, hull=False)
    found = motion(rate_task(command, base, duration, start))

    def largest(values: NDArray) -> object:
        both = not isinstance(command, Zero) and not isinstance(base, Zero)
        irregular = both or isinstance(command, MultiSine) or isinstance(base, MultiSine)
        return pytest.approx(np.max(np.abs(values)), rel=2e-3 if irregular else 1e-5, abs=1e-9)

    assert found.angle == largest(start + load_angle - hull_angle)
    assert found.rate == largest(command.sample(time) - hull_rate)
    assert found.hull_acceleration == largest(base.sample(time))
    slope = np.max(np.abs(np.diff(command.sample(time)) / np.diff(time)))
    if abs(command.sample(np.zeros(1))[0]) > TINY_RATE:
        slope = math.inf
    assert found.load_acceleration == pytest.approx(slope, rel=3e-3, abs=1e-9)
