"""The step that a trial needs: every rule in closed form, and what happens without it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from campaign.physics import step_choice
from campaign.physics.bench import Bench
from campaign.physics.loop import make_compensator
from campaign.physics.step_choice import HALVINGS, LONGEST, longest_step, stuck_poles
from campaign.signals import MultiSine, Polyline, Sine
from campaign.trial import Task
from tests.physics.bench_equations import poles
from tests.physics.bench_reference import reference
from tests.physics.benches import INERTIA, Tree, bench, run, stribeck, task
from tests.physics.dry_cases import errors, thesis
from tests.physics.engine_errors import TOLERANCE, error_of
from tests.physics.random_benches import random_bench

TORQUE = 20.0  # N m, sliding and static


def contact(
    stiffness: float, damping: float, sampled: bool = True, own: Tree | None = None, **more: Any
) -> Bench:
    """35 kg m^2 on one interface of Coulomb friction with bristles; nothing else is a spring."""
    tree = bench().model_dump(mode="json")
    tree["friction"] = {
        "load": {
            "model": "lugre",
            "static_torque": TORQUE,
            "coulomb_torque": TORQUE,
            "stribeck_velocity": 0.03,
            "bristle_stiffness": stiffness,
            "bristle_damping": damping,
            **(own or {}),
        }
    }
    tree["controller"]["sample_rate"] = 1e3 if sampled else None
    return Bench.model_validate({**tree, **more}, context={"si": True})


def damped(frequency: float) -> tuple[float, float]:
    """Stiffness, and the critical damping: a double pole at `frequency` (rad/s)."""
    return INERTIA * frequency**2, 2.0 * INERTIA * frequency


def swing(acceleration: float, phase: float = 0.5 * math.pi) -> Sine:
    """Of the hull, 1 Hz; it starts from rest unless told otherwise."""
    return Sine(amplitude=acceleration, frequency=1.0, phase=phase)


def test_the_step_is_the_next_finer_one_of_a_ladder_of_halves() -> None:
    found = longest_step(contact(*damped(2000.0)), task())
    assert found.needed == pytest.approx(0.2 / (2.0 * 2000.0))  # 50 us
    assert found.step == 1e-3 / 32
    assert found.refused is None


APPENDAGE = {"inertia": 7.0, "frequency": 5.0, "damping_ratio": 0.02}
# tau_p = 1 / 100 and tau_r = sqrt(Tc / sigma0 / a)
REVERSAL = 0.05 * math.sqrt(math.sqrt(TORQUE / damped(100.0)[0] / 2.0) / 100.0)
# With p = 100 i for T = 60 s: t = T / 2, and 0.2 / sqrt(|p|^3 t sqrt(t / T)).
RINGING = 0.2 / math.sqrt(100.0**3 * 30.0 * math.sqrt(0.5))


@pytest.mark.parametrize(
    ("bristles", "more", "of", "needed", "because"),
    [
        ((1e4, 2e4), {}, {}, 0.2 * INERTIA / 2e4, "bristle damping of"),
        ((1e4, 2e4), {"appendage": APPENDAGE}, {}, 0.2 * (INERTIA - 7) / 2e4, "bristle damping of"),
        (
            damped(100.0),
            {},
            {"base_acceleration": swing(2.0)},
            REVERSAL,
            "reversals on the bristles",
        ),
        ((INERTIA * 100.0**2, 700.0), {}, {"mode": "torque"}, 0.05 / 100.0, "bristle stiffness of"),
        ((INERTIA * 100.0**2, 700.0), {}, {"mode": "spring"}, 0.05 / 100.0, "bristle stiffness of"),
        ((INERTIA * 1e4, 0.0), {}, {"mode": "torque", "duration": 60.0}, RINGING, "ringing on the"),
    ],
)
def test_what_decides(bristles: Any, more: Tree, of: Tree, needed: float, because: str) -> None:
    """0.2 J / sigma1 at rest, 0.05 sqrt(tau_p tau_r) at reversals, 0.05 sqrt(J / sigma0) pulled."""
    found = longest_step(contact(*bristles, **more), task(**of))
    assert found.needed == pytest.approx(needed, rel=1e-6)
    assert found.because.startswith(because)
    assert found.because.endswith("friction.load")


def test_a_commanded_rate_reverses_as_a_hull_does() -> None:
    on = contact(*damped(100.0))
    wave = Sine(amplitude=0.5, frequency=2.0)
    sum_of_one = MultiSine(amplitudes=(0.5,), frequencies=(2.0,), phases=(0.3,))
    zigzag = Polyline(times=(0.0, 1.0, 1.0, 2.0), values=(0.0, 2.0 * math.pi, 0.0, 0.0))
    needed = [longest_step(on, task(command=each)).needed for each in (wave, sum_of_one, zigzag)]
    by_hull = longest_step(on, task(base_acceleration=swing(2.0 * math.pi))).needed
    assert needed == pytest.approx([by_hull] * 3)


def test_the_start_decides_where_friction_holds_the_load() -> None:
    """0.03 tau_l: under way at the start, and then shaken by 0.09 of the friction."""
    held = 0.09 * TORQUE / INERTIA
    on = contact(*damped(100.0))
    found = longest_step(on, task(base_acceleration=swing(held, phase=0.0)))
    assert found.needed == pytest.approx(0.03 / 100.0, rel=1e-6)
    assert found.because == "the start of a load that the bristles of friction.load hold"
    for other in (swing(held), swing(1.2 * held, phase=0.0)):
        assert not longest_step(on, task(base_acceleration=other)).because.startswith("the start")


def test_a_motor_side_contact_counts_by_the_gear() -> None:
    """N of torque and N of rate: N^2 of damping; z, of the load's angle, N times less."""
    own = {
        "side": "motor",
        "velocity": "motor",
        "static_torque": TORQUE / 10,
        "coulomb_torque": TORQUE / 10,
        "stribeck_velocity": 0.3,
    }
    stiffness, damping = damped(200.0)
    at_load = contact(stiffness, damping)
    at_motor = contact(stiffness / 100, damping / 100, own=own, gear={"ratio": 10.0})
    for of in (task(), task(base_acceleration=swing(2.0))):
        assert longest_step(at_motor, of).needed == pytest.approx(longest_step(at_load, of).needed)


@pytest.mark.parametrize("seed", [6, 24, 30, 68, 85, 99])
def test_the_loop_with_controller_and_compensation_gives_the_fastest_pole(seed: int) -> None:
    """Against the poles of the equations that the reference solves, filters included."""
    on, of = random_bench(seed, extreme=False)
    found = longest_step(on, of)
    assert found.because.startswith("reversals")
    stiffness = slowest = 0.0
    for options in on.friction.values():
        at = on.gear.ratio if options.side == "motor" else 1.0
        rate = on.gear.ratio if options.velocity == "motor" else 1.0
        stiffness += at * rate * options.bristle_stiffness
        slowest += at * _least(options, np.linspace(-20.0, 20.0, 400_001))
    acceleration, under_way = _reversing(of)
    if on.controller.relative_rate_filter and of.compensation == "lugre":
        acceleration += under_way / on.controller.relative_rate_filter
    fastest = 1.0 / float(np.max(np.abs(poles(on, of, stuck=True))))
    bending = math.sqrt(slowest / stiffness / acceleration)
    assert found.needed == pytest.approx(0.05 * math.sqrt(fastest * bending), rel=5e-3)


@pytest.mark.parametrize("seed", [44, 68, 125])
def test_a_compensation_behind_a_low_pass_has_the_poles_of_the_equations(seed: int) -> None:
    """Poles of the reference's equations; besides, both have states that stand still."""
    on, of = random_bench(seed, extreme=False)
    assert of.compensation == "lugre"
    assert on.controller.relative_rate_filter > 0.0
    found = stuck_poles(on, of, make_compensator(on, "lugre"))
    for expected in poles(on, of, stuck=True):
        if abs(expected) > 1.0:
            assert np.min(np.abs(found - expected)) < 1e-4 * abs(expected)


def test_the_weaker_direction_counts() -> None:
    """z is that of the direction in which friction is a quarter: tau_r halves."""
    back = {"static_torque": TORQUE / 4, "coulomb_torque": TORQUE / 4}
    weak = contact(*damped(100.0), own={"negative": back})
    swinging = task(base_acceleration=swing(2.0))
    found = longest_step(weak, swinging).needed
    assert found == pytest.approx(longest_step(contact(*damped(100.0)), swinging).needed / 2**0.5)


def _least(options: Any, rate: np.ndarray) -> float:
    """Least torque of steady sliding at any of the rates."""

    def parameter(name: str) -> np.ndarray:
        back = getattr(options.negative, name)
        there = getattr(options, name)
        return np.where(rate >= 0.0, there, there if back is None else back)

    coulomb, static = parameter("coulomb_torque"), parameter("static_torque")
    fall = (np.abs(rate) / parameter("stribeck_velocity")) ** parameter("stribeck_exponent")
    dry = coulomb + (static - coulomb) * np.exp(-fall)
    return float(np.min(dry + parameter("viscous_friction") * np.abs(rate)))


def _reversing(of: Task) -> tuple[float, float]:
    """Amplitude of the acceleration of hull and command, and the hull's rate at the start."""
    acceleration = start = 0.0
    for signal, order in ((of.base_acceleration, 0), (of.command, 1)):
        parts: list[tuple[float, float, float]] = []
        if isinstance(signal, Sine):
            parts = [(signal.amplitude, signal.frequency, signal.phase)]
        elif isinstance(signal, MultiSine):
            parts = list(zip(signal.amplitudes, signal.frequencies, signal.phases, strict=True))
        for amplitude, frequency, phase in parts:
            omega = 2.0 * math.pi * frequency
            acceleration += amplitude * omega**order
            start += amplitude / omega * math.cos(phase) if order == 0 else 0.0
    return acceleration, abs(start)


def test_stiffer_more_damped_or_faster_never_takes_a_longer_step() -> None:
    def steps(stiffness: float, damping: float, acceleration: float, mode: Any) -> float:
        fields = {"base_acceleration": swing(acceleration), "mode": mode}
        return longest_step(contact(stiffness, damping, mode == "rate"), task(**fields)).needed

    for mode in ("rate", "torque"):
        grows = [steps(1e4, 1e3, a, mode) for a in np.geomspace(1e-3, 1e3, 25).tolist()]
        assert np.all(np.diff(grows) <= 0.0)
        grows = [steps(k, 1e3, 1.0, mode) for k in np.geomspace(1e4, 1e9, 25).tolist()]
        assert np.all(np.diff(grows) <= 0.0)
        grows = [steps(1e6, c, 1.0, mode) for c in np.geomspace(2e4, 1e7, 25).tolist()]
        assert np.all(np.diff(grows) <= 0.0)


def test_what_is_too_stiff_is_refused_in_words() -> None:
    found = longest_step(contact(1e4, 1e8), task())
    assert found.step == LONGEST / 2**HALVINGS
    assert found.refused.startswith("bristle damping of friction.load needs steps of 0.07 us")


def test_nothing_is_needed_without_friction_or_without_a_plant() -> None:
    def free(tree: Tree) -> None:
        tree["friction"] = {}

    shaken = task(base_acceleration=swing(50.0))
    stiff = contact(1e10, 1e7)
    assert longest_step(stiff, shaken).refused is not None
    for on, of in (
        (bench(free), shaken),
        (stiff, task(mode="prescribed", command=Sine(amplitude=1.0, frequency=5.0))),
    ):
        found = longest_step(on, of)
        assert (found.step, found.needed, found.refused) == (LONGEST, LONGEST, None)
        assert found.because == "nothing in this trial needs a shorter one"


def test_a_compensation_with_bristles_counts_on_a_dry_bench() -> None:
    def dry(tree: Tree) -> None:
        tree["friction"] = {"load": stribeck(32.0, 26.0)}

    found = longest_step(bench(dry), task(base_acceleration=swing(1.0), compensation="lugre"))
    assert found.because == "reversals on the bristles of compensation.lugre"


def test_dry_friction_has_a_step_of_its_own() -> None:
    """Its torque jumps at every reversal; against the engine at 1/64 of the step."""

    def dry(tree: Tree) -> None:
        tree["friction"] = {"load": stribeck(32.0, 26.0, 4.0)}

    on, of = bench(dry), task(base_acceleration=swing(1.5))
    found = longest_step(on, of)
    assert (found.step, found.because) == (LONGEST / 4.0, "dry friction.load")
    _, fine = run(on, of, found.step / 64.0)

    def off(step: float) -> float:
        _, out = run(on, of, step)
        changes = out["friction_torque"] - fine["friction_torque"]
        return float(np.sqrt(np.mean(changes**2) / np.mean(fine["friction_torque"] ** 2)))

    assert off(found.step) < TOLERANCE / 2 < off(LONGEST)


@pytest.mark.parametrize("static", [(32.0, 26.0), (37.65, 30.24), (45.0, 40.0)])
def test_a_compensation_that_jumps_with_dry_friction_leaves_what_is_right(
    static: tuple[float, float],
) -> None:
    """Exact, a sixth too weak, a third too weak; what is left is the difference of two jumps."""

    def dry(tree: Tree) -> None:
        tree["friction"] = {"load": stribeck(*static, 4.0)}

    on = bench(dry)
    of = task(base_acceleration=swing(1.5), compensation="static", duration=2.0)
    found = longest_step(on, of)
    assert found.because == "jumps of dry friction at compensation.static"
    _, fine = run(on, of, found.step / 4.0)

    def off(step: float) -> float:
        _, out = run(on, of, step)
        change = out["load_rate"] - fine["load_rate"]
        return float(np.sqrt(np.mean(change**2) / np.mean(fine["load_rate"] ** 2)))

    assert off(found.step) < TOLERANCE < off(0.5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("compensation", "step"), [("static", 0.03125e-3), ("observer", 0.125e-3)])
def test_what_compensates_a_dry_bench_meets_its_jumps_in_shorter_steps(
    compensation: str, step: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = thesis(compensation, periods=1.5)
    found = longest_step(case.bench, task(base_acceleration=case.base, compensation=compensation))
    assert found.because == f"jumps of dry friction at compensation.{compensation}"
    assert found.step == step
    expected = case.expected()
    of = ("load_rate", "pointing_angle", "relative_angle", "motor_current")

    def worst() -> float:
        chosen = errors(case, expected, None)
        return max(chosen[name] for name in of)

    assert worst() < TOLERANCE / 2
    for limit in ("JUMPS", "FED", "DRY"):
        monkeypatch.setattr(step_choice, limit, 1e9)
    assert worst() > TOLERANCE


@pytest.mark.parametrize(
    ("constant", "seed", "extreme", "times"),
    [
        ("DAMPING", 67, True, 3.0),
        ("REVERSAL", 28, False, 6.0),
        ("REVERSAL", 99, False, 6.0),
        ("REVERSAL", 121, False, 6.0),
        ("HELD", 8, True, 3.0),
        ("RESTING", 10, True, 3.0),
        ("RINGING", 55, True, 3.0),
    ],
)
def test_every_rule_is_needed(
    constant: str, seed: int, extreme: bool, times: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A random bench that the rule keeps within tolerance, and some times its constant does not."""
    on, of = random_bench(seed, extreme)
    expected = reference(on, of)

    def error() -> float:
        return max(error_of(on, of, longest_step(on, of).step, expected).values())

    assert error() < TOLERANCE
    monkeypatch.setattr(step_choice, constant, times * getattr(step_choice, constant))
    assert not error() < TOLERANCE
