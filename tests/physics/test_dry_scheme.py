"""The step of dry friction: exact for a rigid mass, of second order in a loop."""

from __future__ import annotations

import math
from functools import cache
from typing import NamedTuple

import numpy as np
import pytest

from campaign.physics import rows
from campaign.physics.blocks import Dry
from campaign.physics.dry_friction import solve_dry
from campaign.physics.dry_step import crossing
from campaign.physics.lanes import Lane, together
from campaign.signals import Sine
from tests.physics.benches import Tree, bench, run, stribeck, task
from tests.physics.dry_cases import Case, drawn, errors, steep_rise, swing, thesis
from tests.physics.event_reference import DryLoop, simulate_sampled

J, H, TC = 35.0, 1e-3, 26.0
RIGID = np.zeros((2, 3, 1))
"""v' = -T / J: what a line does to rate and angle is known."""
RIGID[rows.MEAN, rows.RATE], RIGID[rows.CHANGE, rows.RATE] = -H / J, 0.0
RIGID[rows.MEAN, rows.RELATIVE_ANGLE] = -(H**2) / (2 * J)
RIGID[rows.CHANGE, rows.RELATIVE_ANGLE] = H**2 / (12 * J)
COULOMB = (TC, TC, 0.03, 2.0, TC, TC, 0.03, 2.0, 0.0)


def free(v0: float, torque: float, ramp: float) -> tuple[float, float]:
    """Rate and motion of the mass without friction, under `torque` + `ramp` t."""
    rate = v0 + (torque * H + ramp * H**2 / 2) / J
    return rate, v0 * H + (torque * H**2 / 2 + ramp * H**3 / 6) / J


class Step(NamedTuple):
    """What the engine makes of a step; as `campaign.physics.dry_step.DryStep`."""

    mean: float
    change: float
    start: float
    end: float
    direction: float
    rate_end: float
    motion: float
    leaves: float
    begins: float


@cache
def one_interface() -> Dry:
    """The engine's arrays of one trial with one dry interface."""

    def only(tree: Tree) -> None:
        tree["friction"] = {"load": stribeck(TC, TC)}

    lane = Lane.of(bench(only), task(mode="torque"), seed=1, longest_step=H)
    return together([lane], 1).friction.dry


def dry_step(
    curve: tuple[float, ...], direction: float, v0: float, v1: float, motion: float
) -> Step:
    """One step of the mass with friction of `curve`: `stribeck.curve_parameters`."""
    dry, met = one_interface(), np.zeros((rows.MEETS, 1))
    dry.fixed[0, rows.HAS : rows.HAS + len(curve), 0] = curve
    dry.limits[0, :, 0] = curve[1], curve[5], curve[1], curve[5]
    dry.state[rows.DRY_DIRECTION] = direction
    met[rows.MEETS_RATE_START], met[rows.MEETS_RATE_END] = v0, v1
    met[rows.MEETS_RATE_MEAN] = motion / H
    met[rows.MEETS_STEP], met[rows.MEETS_PER_STEP] = H, 1.0 / H
    solve_dry(1, dry, RIGID, met)
    names = ("MEAN", "CHANGE", "START", "END", "DIRECTION")
    done = [float(dry.state[getattr(rows, f"DRY_{name}"), 0]) for name in names]
    names = ("MOTION", "LEAVES", "BEGINS")
    more = [float(dry.state[getattr(rows, f"DRY_{name}"), 0]) for name in names]
    return Step(*done, float(met[rows.MEETS_RATE_END, 0]), *more)


@pytest.mark.slow
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_stops_where_coulomb_friction_stops_it(way: float) -> None:
    part = 0.3
    v0 = way * TC / J * part * H
    done = dry_step(COULOMB, way, v0, *free(v0, 0.0, 0.0))
    assert done.direction == 0.0
    assert done.leaves == pytest.approx(part, rel=1e-9)
    assert (done.rate_end, done.begins) == (0.0, 1.0)
    assert done.motion == pytest.approx(v0**2 * J / (2 * TC) * way, rel=1e-9)
    assert done.start == way * TC
    # Friction at TC until then and at zero after it, by its mean.
    assert done.mean == pytest.approx(way * TC * part, rel=1e-9)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_breaks_away_when_the_ramp_reaches_the_static_torque(way: float) -> None:
    torque, ramp = way * 25.99, way * 25.0
    wait = (TC - 25.99) / 25.0
    done = dry_step(COULOMB, 0.0, 0.0, *free(0.0, torque, ramp))
    left = H - wait
    assert done.direction == way
    assert done.begins == pytest.approx(wait / H, rel=1e-6)
    assert done.rate_end == pytest.approx(ramp * left**2 / (2 * J), rel=1e-6)
    assert done.motion == pytest.approx(ramp * left**3 / (6 * J), rel=1e-6)
    assert done.start == pytest.approx(torque, rel=1e-9)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_it_turns_round_where_friction_cannot_hold_it(way: float) -> None:
    part, drive = 0.4, -3 * TC
    slowing, leaving = (TC - drive) / J, (-TC - drive) / J
    v0 = way * slowing * part * H
    done = dry_step(COULOMB, way, v0, *free(v0, way * drive, 0.0))
    left = (1 - part) * H
    assert done.direction == -way
    assert (done.leaves, done.begins) == pytest.approx((part, part), rel=1e-9)
    assert done.rate_end == pytest.approx(-way * leaving * left, rel=1e-9)
    forth = way * slowing * (part * H) ** 2 / 2
    assert done.motion == pytest.approx(forth - way * leaving * left**2 / 2, rel=1e-9)


def test_it_holds_a_ramp_with_the_ramp_itself() -> None:
    done = dry_step(COULOMB, 0.0, 0.0, *free(0.0, 10.0, 2000.0))
    assert (done.direction, done.rate_end, done.motion) == (0.0, 0.0, 0.0)
    assert (done.mean, done.change, done.start) == pytest.approx((11.0, 2.0, 10.0), rel=1e-9)


def test_a_torque_that_jumps_beyond_the_limit_moves_it_from_the_start() -> None:
    done = dry_step(COULOMB, 0.0, 0.0, *free(0.0, -40.0, 0.0))
    assert (done.direction, done.begins, done.start) == (-1.0, 0.0, -TC)
    assert done.rate_end == pytest.approx(-(40.0 - TC) * H / J, rel=1e-9)


def test_a_torque_that_falls_below_the_limit_moves_it_at_first() -> None:
    """From 27 to 25 N m: beyond 26 in the first half of the step."""
    done = dry_step(COULOMB, 0.0, 0.0, *free(0.0, 27.0, -2000.0))
    assert done.direction == 1.0
    assert done.rate_end == pytest.approx(0.25 * H / J, rel=1e-9)


def test_without_any_torque_of_its_own_it_does_nothing() -> None:
    nothing = (0.0, 0.0, 0.03, 2.0, 0.0, 0.0, 0.03, 2.0, 0.0)
    for direction, v0 in ((0.0, 0.0), (1.0, 2e-5), (1.0, 0.1)):
        rate, motion = free(v0, -3.0, 500.0)
        done = dry_step(nothing, direction, v0, rate, motion)
        assert (done.mean, done.change) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert done.rate_end == pytest.approx(rate, rel=1e-9)


def test_the_crossing_of_a_parabola() -> None:
    """v = 1 - 2.1 u + 0.1 u^2, of mean -1/60; its straight line crosses at a half."""
    root = (2.1 - math.sqrt(2.1**2 - 0.4)) / 0.2
    assert abs(0.5 - root) > 0.01
    assert crossing(1.0, -1.0, 1.0 - 2.1 / 2 + 0.1 / 3) == pytest.approx(root, abs=5e-5)
    assert crossing(-1.0, 1.0, -1.0 + 2.1 / 2 - 0.1 / 3) == pytest.approx(root, abs=5e-5)


def test_whatever_acts_friction_stays_within_its_limits() -> None:
    """Steps drawn at random, up to torques that swing from beyond one limit to beyond the other."""
    random = np.random.default_rng(1)
    for _ in range(5000):
        direction = float(random.integers(-1, 2))
        v0 = direction * 10.0 ** random.uniform(-9, 0)
        coulomb, static = random.uniform(0.0, 40.0, 2)
        curve = (coulomb, static, 10.0 ** random.uniform(-3, -1), random.uniform(0.5, 3.0))
        torque = random.normal() * 10.0 ** random.uniform(0.0, 2.5)
        ramp = random.normal() * 10.0 ** random.uniform(0.0, 6.0)
        done = dry_step((*curve, *curve, 0.0), direction, v0, *free(v0, torque, ramp))
        most = max(coulomb, static) + 1e-6
        assert max(abs(done.mean), abs(done.start), abs(done.end)) < most
        assert done.direction * done.rate_end >= 0.0
        assert (done.rate_end == 0.0) == (done.direction == 0.0)
        assert 0.0 <= done.leaves <= done.begins <= 1.0


STEPS = (2e-3, 1e-3, 0.25e-3)
PLAIN = thesis(periods=2.0)
CASES = {
    # Bound at 1 ms of the rate over time.
    "dry": (PLAIN, 1e-4),
    "dry, LuGre compensation": (thesis("lugre", periods=1.5), 5e-4),
    "dry, LuGre compensation, filtered": (thesis("lugre", periods=1.5, low_pass=1e-3), 1e-4),
    "dry, static compensation": (thesis("static", periods=1.5), 1e-3),
    "dry, observer": (thesis("observer", periods=1.5), 5e-3),
    "LuGre, static compensation": (thesis("static", bristles=True, periods=2.0), 1e-3),
    "steep rise": (steep_rise(), 3e-4),
    **{f"drawn {seed}": (drawn(seed), 3e-5) for seed in (0, 1, 2, 8)},
}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_the_engine_is_of_second_order_in_the_step(name: str) -> None:
    case, rate = CASES[name]
    expected = case.expected()
    coarse, middle, fine = (errors(case, expected, step) for step in STEPS)
    assert abs(middle["stabilization"]) < 1e-4
    assert middle["load_rate"] < rate
    # From 2 ms to 0.25 ms: 64 times, if events fell alike in their steps, which they do not.
    for output in ("load_rate", "pointing_angle"):
        assert coarse[output] > 25 * fine[output], output


@pytest.mark.slow
def test_behind_a_sampled_controller_it_is_of_second_order_too() -> None:
    """A command held over each millisecond: it sticks now and then."""
    base = Sine(amplitude=1.0, frequency=1.0)
    reference = simulate_sampled(DryLoop(**swing(base)), 1500)  # type: ignore[arg-type]
    still = reference["load_rate"] - np.vectorize(swing(base)["base_rate"])(np.arange(1500) * 1e-3)
    assert np.count_nonzero(np.abs(still) < 1e-9) > 40

    def edit(tree: Tree) -> None:
        tree["friction"] = {
            "load": stribeck(32.0, 26.0, 4.0),
            "motor": stribeck(0.04, 0.03, 0.001, side="motor"),
        }
        tree["controller"]["sample_rate"] = "1 kHz"

    on = task(duration=1.5, base_acceleration=base)
    found = [run(bench(edit), on, step)[1] for step in (1e-3, 0.25e-3)]
    for name, bound in (("load_rate", 1e-4), ("relative_angle", 1e-5)):
        true = reference[name]
        coarse, fine = (np.std(out[name] - true) / np.std(true) for out in found)
        assert coarse < bound
        assert coarse > 10 * fine


@pytest.mark.slow
def test_what_is_held_is_recorded_without_lag() -> None:
    """The friction torque of a load that sticks to an accelerating hull.

    The hull's rate is a line over each step, so a step's own torque line lags by half a step at
    either end: 0.02 N m here.
    """
    case = drawn(7)
    expected = case.expected()["friction_torque"]
    true, found = expected[3650:3900], case.found(1e-3)["friction_torque"][3650:3900]
    assert np.ptp(true) > 5.0
    assert np.max(np.abs(found - true)) < 1e-3


def test_a_stuck_load_does_not_creep_while_its_compensation_does() -> None:
    """Behind a low-pass its bristles still move: what holds is found again with their line."""
    case = thesis("lugre", periods=2.0, low_pass=5e-3)
    found = case.found(1e-3)
    hull = [case.reference.base_rate(n * 1e-3) for n in range(len(found["load_rate"]))]
    stuck = np.abs(found["load_rate"] - hull) < 1e-14
    inside = stuck[1:-2] & stuck[2:-1] & stuck[:-3] & stuck[3:]
    moved = np.diff(found["relative_angle"])[1:-1]
    assert np.count_nonzero(inside) > 150
    assert np.ptp(found["compensation_torque"][1:-2][inside]) > 1.0
    assert np.max(np.abs(moved[inside])) < 1e-15


@pytest.mark.slow
@pytest.mark.parametrize("case", [PLAIN, drawn(9)], ids=lambda case: case.name)
def test_it_stops_and_breaks_away_when_the_reference_does(case: Case) -> None:
    """No chatter: the same directions in the same order, each within a step of 1 ms."""
    times = np.arange(round(case.duration * 1000)) * 1e-3
    _, history = case.solved
    direction = np.sign(case.found(1e-3)["relative_rate"])
    switched = np.flatnonzero(np.diff(direction))
    assert [direction[0], *direction[switched + 1]] == [way for _, way in history]
    instants = [at for at, _ in history[1:]]
    np.testing.assert_allclose(times[switched + 1], instants, atol=1.01e-3)
