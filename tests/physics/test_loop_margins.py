"""Margins and poles of the loop: against the engine's own small motions, and against closed forms.

The engine knows nothing of `open_loop`: it steps friction models, sensors, delays and controller
one by one. Small motions of it are what the linear loop must predict.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.friction import friction_models
from campaign.physics.linear_friction import NoLoopError, Regime, bench_friction
from campaign.physics.loop_margins import LoopMargins, Response, margins_of
from campaign.physics.open_loop import Mode, OpenLoop, open_loop
from campaign.physics.plan_loops import loops_used
from campaign.physics.variation import of_its_day
from campaign.signals import Polyline, Sine, Zero
from tests.physics.benches import INERTIA, KPV, RATIO, Tree, bench, run, stribeck, task

Edit = Callable[[Tree], object]


def sampled(tree: Tree) -> None:
    """1 kHz, every kind of delay, a filter, and compensation that is wrong in every parameter."""
    tree["controller"] |= {
        "sample_rate": "1 kHz",
        "delay": "0.6 ms",
        "relative_rate_filter": "3 ms",
    }
    tree["sensors"] = {
        "gyro": {"delay": "2 ms"},
        "encoder": {"delay": "1 ms"},
        "resolver": {"delay": "3 ms"},
        "current": {"delay": "1 ms"},
    }
    detuned(tree)


def detuned(tree: Tree) -> None:
    """Compensation that is not the plant's own friction, so that nothing cancels by chance."""
    lugre = tree["compensation"]["lugre"]
    lugre["gain"] = 0.7
    lugre["friction"]["load"]["bristle_damping"] = "1100 N m s/rad"
    lugre["friction"]["motor"]["bristle_stiffness"] = "700 N m/rad"
    static = tree["compensation"]["static"]
    static["gain"] = 0.8
    for interface in static["friction"].values():
        interface["sign_smoothing"] = "0.2 rad/s"
    tree["compensation"]["observer"]["gain"] = f"{2 * math.pi * 8 * INERTIA / RATIO} N m s/rad"


def with_filter(tree: Tree) -> None:
    tree["controller"]["relative_rate_filter"] = "5 ms"
    detuned(tree)


def elastic(tree: Tree) -> None:
    tree["appendage"] = {"inertia": "2 kg m^2", "frequency": "11 Hz", "damping_ratio": 0.05}
    sampled(tree)
    tree["controller"]["delay"] = "1.25 ms"


BENCHES: dict[str, Edit] = {
    "continuous": detuned,
    "filtered": with_filter,
    "sampled": sampled,
    "elastic": elastic,
}
BIAS = Polyline(times=(0.0, 1e-3, 1e-3, 1.0), values=(-1e4, -1e4, 0.0, 0.0))
"""The hull is set turning at -10 rad/s: the load slides far above its Stribeck velocity."""


def engine_response(
    on: Bench, compensation: str, mode: Mode, regime: Regime, frequency: float
) -> complex:
    """What a small sine of the command comes back as: gyro rate, or compensation torque."""
    seen = "gyro_rate" if mode == "rate" else "compensation_torque"
    size = 1e-6 if mode == "rate" else 1e-5  # presliding spans mrad, and 26 N m
    growth = margins_of(open_loop(on, compensation, mode, regime)).growth
    # What drags the load along under a mere torque is slower than the sine, and told from it.
    settle = 1.5 if (mode, regime) == ("torque", "sliding") else max(1.5, 12.0 / -growth)
    duration = settle + 8 / frequency
    hull = BIAS if regime == "sliding" else Zero()

    def response(command: Any) -> np.ndarray:
        motion = task(
            mode=mode,
            command=command,
            base_acceleration=hull,
            compensation=compensation,
            duration=duration,
        )
        return run(on, motion, 0.05e-3)[1][seen]

    sine = Sine(amplitude=size, frequency=frequency)
    value = response(sine) - (response(Zero()) if regime == "sliding" else 0.0)
    time = np.arange(len(value)) * 1e-3
    late = time >= settle
    turned = np.exp(2j * np.pi * frequency * time[late])
    trend = [(time[late] - settle) ** power for power in range(4)]
    basis = np.stack([turned.imag, turned.real, *trend], axis=1)
    sine_part, cosine_part = np.linalg.lstsq(basis, value[late], rcond=None)[0][:2]
    return complex(sine_part, cosine_part) / size


@pytest.mark.parametrize("regime", ["stuck", "sliding"])
@pytest.mark.parametrize("compensation", ["none", "static", "lugre", "observer"])
@pytest.mark.parametrize("name", BENCHES)
def test_the_rate_loop_answers_as_the_engine_does(
    name: str, compensation: str, regime: Regime
) -> None:
    """w / r = L / (1 + L), at, below and above the crossover."""
    on = bench(BENCHES[name])
    response = Response(open_loop(on, compensation, "rate", regime))
    for frequency in (2.0, 10.0, 31.0):
        l = response(np.array([2 * np.pi * frequency]))[0]
        found = engine_response(on, compensation, "rate", regime, frequency)
        assert abs(found / (l / (1 + l)) - 1) < 5e-4, (frequency, found, l / (1 + l))


@pytest.mark.parametrize("regime", ["stuck", "sliding"])
@pytest.mark.parametrize("compensation", ["lugre", "observer"])
@pytest.mark.parametrize("name", BENCHES)
def test_compensation_answers_a_torque_as_the_engine_does(
    name: str, compensation: str, regime: Regime
) -> None:
    """Tc / T = -L / (1 + L) under a commanded torque T."""
    on = bench(BENCHES[name])
    response = Response(open_loop(on, compensation, "torque", regime))
    l = response(np.array([2 * np.pi * 10.0]))[0]
    found = engine_response(on, compensation, "torque", regime, 10.0)
    assert abs(found / (-l / (1 + l)) - 1) < 1e-3, (found, -l / (1 + l))


def engine_growth(
    on: Bench, compensation: str, regime: Regime, wait: float = 0.5, window: float = 0.5
) -> float:
    """How fast what is left of a knock grows (1/s): rms of the rate in two windows (s)."""
    hull = BIAS if regime == "sliding" else Zero()
    knock = Polyline(times=(0.0, 0.1, 0.1, 0.11, 0.11), values=(0.0, 0.0, 1e-4, 1e-4, 0.0))

    def rate(disturbance: Any) -> np.ndarray:
        moving = task(
            base_acceleration=hull,
            disturbance=disturbance,
            compensation=compensation,
            duration=wait + 2 * window,
        )
        return run(on, moving, 0.05e-3)[1]["load_rate"]

    value = rate(knock) - (rate(Zero()) if regime == "sliding" else 0.0)
    first, second = np.split(value[int(wait * 1000) :], 2)
    return float(np.log(np.std(second) / np.std(first)) / window)


def with_gain(edit: Edit, factor: float) -> Bench:
    """The bench with its whole rate controller times `factor`: in ideal form Kpv is all of it."""

    def faster(tree: Tree) -> None:
        edit(tree)
        tree["controller"]["rate"]["proportional"] = f"{KPV * factor} A s/deg"

    return bench(faster)


@pytest.mark.parametrize("regime", ["stuck", "sliding"])
@pytest.mark.parametrize("compensation", ["none", "static", "lugre", "observer"])
def test_the_gain_margin_is_where_the_engine_begins_to_grow(
    compensation: str, regime: Regime
) -> None:
    """1 % below it a knock dies away, 1 % above it grows, as fast as the pole says."""
    margins = margins_of(open_loop(bench(sampled), compensation, "rate", regime))
    assert margins.stable
    for factor in (0.99, 1.01):
        on = with_gain(sampled, factor * margins.gain_margin)
        growth = margins_of(open_loop(on, compensation, "rate", regime)).growth
        assert growth == pytest.approx(engine_growth(on, compensation, regime), rel=0.02, abs=0.02)
        assert (growth > 0) is (factor > 1)


@pytest.mark.parametrize("regime", ["stuck", "sliding"])
def test_the_delay_margin_is_where_the_engine_begins_to_grow(regime: Regime) -> None:
    """Added to the controller's own 0.6 ms; a fraction of a sample counts as such."""

    def late(seconds: float) -> Bench:
        def edit(tree: Tree) -> None:
            sampled(tree)
            tree["controller"]["delay"] = f"{seconds!r} s"

        return bench(edit)

    margin = margins_of(open_loop(bench(sampled), "none", "rate", regime)).delay_margin
    quarter = 0.25e-3
    below = math.floor((0.6e-3 + margin) / quarter) * quarter - quarter
    for delay in (below, below + 3 * quarter):
        growth = margins_of(open_loop(late(delay), "none", "rate", regime)).growth
        found = engine_growth(late(delay), "none", regime, 1.0, 2.0)
        assert growth == pytest.approx(found, rel=0.05)
        assert (growth > 0) is (delay > below)


def test_overcompensated_bristles_are_no_longer_stable() -> None:
    """Compensation that takes away more stiffness than there is, and what the integral gives."""

    def edit(tree: Tree) -> None:
        with_filter(tree)
        tree["compensation"]["lugre"]["gain"] = 2.0

    on = bench(edit)
    stuck = margins_of(open_loop(on, "lugre", "rate", "stuck"))
    assert not stuck.stable
    # It grows fast: watch it while it is still small.
    assert stuck.growth == pytest.approx(engine_growth(on, "lugre", "stuck", 0.3), rel=0.02)
    assert margins_of(open_loop(on, "lugre", "rate", "sliding")).stable


def test_rigid_undeclared_and_jumping_friction_have_no_linear_loop_when_stuck() -> None:
    def dry(tree: Tree) -> None:
        tree["friction"]["load"] = stribeck(32.0, 26.0)

    with pytest.raises(NoLoopError, match=r"friction\.load is dry"):
        open_loop(bench(dry), "none", "rate", "stuck")
    with pytest.raises(NoLoopError, match="jumps"):
        open_loop(bench(), "static", "rate", "stuck")
    with pytest.raises(NoLoopError, match="no friction"):
        open_loop(bench(lambda tree: tree.update(friction={})), "none", "rate", "stuck")
    with pytest.raises(NoLoopError, match="closes no loop"):
        open_loop(bench(), "none", "torque", "sliding")


def test_a_friction_model_that_declares_nothing_is_known_only_while_it_slides(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    models = friction_models()
    silent = replace(models["lugre"], small_signal=None)
    monkeypatch.setattr(
        "campaign.physics.friction.friction_models", lambda: {**models, "lugre": silent}
    )
    with pytest.raises(NoLoopError, match="'lugre' does not declare"):
        open_loop(bench(), "none", "rate", "stuck")
    assert margins_of(open_loop(bench(), "none", "rate", "sliding")).stable


def test_a_resonance_without_damping_is_no_rounding_error() -> None:
    """It swings for ever by itself, whatever the last digit of its pole says."""

    def undamped(tree: Tree) -> None:
        tree["appendage"] = {"inertia": "1.3 kg m^2", "frequency": "11 Hz", "damping_ratio": 0.0}
        tree["friction"] = {}

    on = bench(undamped)
    assert margins_of(open_loop(on, "none", "rate", "sliding")).stable
    under_torque = margins_of(open_loop(on, "observer", "torque", "sliding"))
    assert under_torque.stable


def test_the_friction_is_that_of_the_day_and_of_its_side_of_the_gear() -> None:
    """Stuck on day 7 the bristles are those that `of_its_day` gives; N times counts at the load."""

    def day(tree: Tree) -> None:
        days = {"bristle_stiffness": 0.3, "viscous_friction": 0.3}
        tree["variation"] = {"seed": 3, "day": 7, "day_to_day": days}

    today = bench_friction(of_its_day(bench(day)), "stuck")
    assert today.stiffness != pytest.approx(18000 + RATIO * 1000, rel=1e-3)
    found = open_loop(bench(day), "none", "rate", "stuck")
    without = of_its_day(bench(day)).model_copy(update={"variation": None})
    np.testing.assert_array_equal(found.a, open_loop(without, "none", "rate", "stuck").a)
    plain = bench_friction(bench(), "stuck")
    assert plain.stiffness == pytest.approx(18000 + RATIO * 1000)
    assert plain.damping == pytest.approx(800 + RATIO * 0.5)
    assert plain.viscous == pytest.approx(4 + RATIO * 0.001)
    motor = bench(lambda tree: tree["friction"]["motor"].update(velocity="motor"))
    assert bench_friction(motor, "stuck").stiffness == pytest.approx(18000 + RATIO**2 * 1000)


EDITS: dict[str, Edit] = {
    "inertia": lambda t: t["axis"].update(inertia="30 kg m^2"),
    "delay": lambda t: t["controller"].update(delay="0.7 ms"),
    "filter": lambda t: t["controller"].update(relative_rate_filter="4 ms"),
    "gain": lambda t: t["controller"]["rate"].update(proportional="2 A s/deg"),
    "gyro": lambda t: t["sensors"]["gyro"].update(delay="3 ms"),
    "encoder": lambda t: t["sensors"]["encoder"].update(delay="4 ms"),
    "ratio": lambda t: t["gear"].update(ratio=100.0),
    "motor": lambda t: t["motor"].update(resistance="0.3 ohm"),
    "bristles": lambda t: t["friction"]["load"].update(bristle_stiffness="9000 N m/rad"),
    "model": lambda t: t["compensation"]["lugre"].update(gain=0.4),
    "appendage": elastic,
}


@pytest.mark.parametrize("name", EDITS)
def test_a_loop_is_computed_once_for_equal_values_and_anew_for_others(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Limits, names and torques decide the size of a motion and not the loop; all else does."""
    computed = []

    def counting(loop: OpenLoop) -> LoopMargins:
        computed.append(loop)
        return margins_of(loop)

    monkeypatch.setattr("campaign.physics.plan_loops.margins_of", counting)

    def edit(tree: Tree) -> None:
        sampled(tree)
        EDITS[name](tree)

    def same(tree: Tree) -> None:
        sampled(tree)
        tree["name"] = "another"
        tree["limits"]["rate"] = "80 deg/s"
        tree["friction"]["load"]["coulomb_torque"] = "20 N m"

    moving = task(compensation="lugre")
    benches = [bench(sampled), bench(sampled), bench(same), bench(edit)]
    uses = loops_used((i, moving, on) for i, on in enumerate(benches, start=1))
    assert len(computed) == 4  # stuck and sliding, of two different benches
    assert {use.trial for use in uses} <= {1, 4}
    assert [use.margins.tightness for use in uses] == sorted(u.margins.tightness for u in uses)
    only = loops_used([(9, moving, benches[-1])])
    for use in uses:
        again = next(one for one in only if one.regime == use.regime)
        assert use.margins.tightness <= again.margins.tightness


def transfer(*poles: float, gain: float = 1.0) -> OpenLoop:
    """gain / product of (s - pole), as a chain of integrators."""
    a = np.diag(np.array(poles)) + np.diag(np.ones(len(poles) - 1), -1)
    b, c = np.zeros(len(poles)), np.zeros(len(poles))
    b[0], c[-1] = gain, 1.0
    return OpenLoop(a, b, c, None)


def test_second_order_margins() -> None:
    """wn^2 / (s (s + 2 zeta wn)): the textbook's crossover and phase margin; no gain margin."""
    zeta, wn = 0.3, 20.0
    found = margins_of(transfer(0.0, -2 * zeta * wn, gain=wn**2))
    root = math.sqrt(math.sqrt(1 + 4 * zeta**4) - 2 * zeta**2)
    phase = math.atan(2 * zeta / root)
    assert found.crossover == pytest.approx(wn * root, rel=1e-8)
    assert found.phase_margin == pytest.approx(phase, rel=1e-7)
    assert found.delay_margin == pytest.approx(phase / (wn * root), rel=1e-7)
    assert found.gain_margin is None
    pole = found.poles[0]
    assert pole.real == pytest.approx(-zeta * wn)
    assert -found.least_damped.real / abs(found.least_damped) == pytest.approx(zeta)


def test_third_order_gain_margin() -> None:
    """k / (s (s + 1) (s + 2)) is stable up to k = 6, at sqrt(2) rad/s (Routh)."""
    found = margins_of(transfer(0.0, -1.0, -2.0, gain=1.5))
    assert found.gain_margin == pytest.approx(4.0, rel=1e-7)
    assert found.gain_crossing == pytest.approx(math.sqrt(2.0), rel=1e-7)
    assert found.stable
    assert not margins_of(transfer(0.0, -1.0, -2.0, gain=6.1)).stable


def test_both_ends_of_a_gain_that_may_neither_fall_nor_rise_count() -> None:
    """k / ((s - 1) (s / 10 + 1)^2) needs 1 < k < 16.2, there at sqrt(80) rad/s; the nearer one."""
    for gain, margin, at in ((1.25, 1 / 1.25, 0.0), (14.0, 16.2 / 14.0, math.sqrt(80.0))):
        found = margins_of(transfer(1.0, -10.0, -10.0, gain=100.0 * gain))
        assert found.stable
        assert found.gain_margin == pytest.approx(margin, rel=1e-4)
        assert found.gain_crossing == pytest.approx(at, rel=1e-6, abs=0.01)


def test_a_turn_the_other_way_is_a_phase_margin_too() -> None:
    """50 s^2 / ((s + 1)^2 (s / 100 + 1)) leads by almost half a turn where it first crosses 1."""
    a = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-100.0, -201.0, -102.0]])
    found = margins_of(OpenLoop(a, np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, 5000.0]), None))
    assert found.stable
    omega = found.crossovers[0]
    s = 1j * omega
    assert abs(50 * s**2 / ((s + 1) ** 2 * (s / 100 + 1))) == pytest.approx(1.0, rel=1e-8)
    lead = math.pi - 2 * math.atan(omega) - math.atan(omega / 100)
    assert found.crossover == omega
    assert found.phase_margin == pytest.approx(math.pi - lead, rel=1e-6)
    # Only a delay that turns it all the way round does harm there; the last crossing is sooner.
    assert found.delay_margin < math.pi / found.crossovers[-1]


def resonance(gain: float) -> OpenLoop:
    """gain / s behind 30 rad/s with a damping ratio of 0.005, a peak of 1 % of its frequency."""
    a = np.array([[0.0, 1.0, 0.0], [-900.0, -0.3, 900.0], [0.0, 0.0, 0.0]])
    return OpenLoop(a, np.array([0.0, 0.0, gain]), np.array([1.0, 0.0, 0.0]), None)


def test_a_narrow_resonance_is_not_stepped_over() -> None:
    """It lifts L over 1 again; and below that it is the gain margin, 0.3 / gain (Routh)."""
    omega = np.array(margins_of(resonance(0.6)).crossovers)
    value = 0.6 / (1j * omega) * 900.0 / (900.0 - omega**2 + 0.3j * omega)
    assert len(omega) == 3
    np.testing.assert_allclose(np.abs(value), 1.0, rtol=1e-7)
    assert margins_of(resonance(0.29)).gain_margin == pytest.approx(0.3 / 0.29, rel=1e-6)
    assert not margins_of(resonance(0.31)).stable


def test_a_sampled_integrator_late_by_a_share_of_a_sample() -> None:
    """x' = x - k ((1 - d) u + d u_before): z^2 - z + k (1 - d) z + k d, marginal at k = 1 / d."""
    share, gain = 0.6, 1.2
    loop = OpenLoop(
        np.array([[1.0, gain * share], [0.0, 0.0]]),
        np.array([gain * (1 - share), 1.0]),
        np.array([1.0, 0.0]),
        1e-3,
    )
    found = margins_of(loop)
    assert found.gain_margin == pytest.approx(1 / share / gain, rel=1e-7)
    roots = np.roots([1.0, gain * (1 - share) - 1.0, gain * share])
    assert found.growth == pytest.approx(math.log(np.max(np.abs(roots))) * 1e3)


@pytest.mark.parametrize("sensor", ["gyro", "encoder", "resolver"])
@pytest.mark.parametrize(("written", "samples"), [("1.6 ms", 2), ("1.4 ms", 1), ("0.4 ms", 0)])
def test_a_sensor_is_late_by_the_nearest_number_of_samples(
    sensor: str, written: str, samples: int
) -> None:
    """At 1 kHz, in the linear loop as in the engine."""

    def late(delay: str) -> Bench:
        def edit(tree: Tree) -> None:
            sampled(tree)
            tree["sensors"][sensor]["delay"] = delay

        return bench(edit)

    exact, rounded = late(f"{samples} ms"), late(written)
    for regime in ("stuck", "sliding"):
        one, other = (open_loop(each, "lugre", "rate", regime) for each in (exact, rounded))  # type: ignore[arg-type]
        np.testing.assert_array_equal(one.a, other.a)
    push = task(command=Sine(amplitude=0.2, frequency=3.0), compensation="lugre", duration=0.2)
    _, true = run(exact, push)
    _, mine = run(rounded, push)
    assert mine["gyro_rate"].tobytes() == true["gyro_rate"].tobytes()


def test_margins_are_low_below_20_deg_or_3_db() -> None:
    def made(phase: float | None, gain: float | None, pole: complex = -1.0) -> LoopMargins:
        phase = None if phase is None else math.radians(phase)
        return LoopMargins((), None, phase, gain, None, None, (pole,), None)

    assert made(19.0, None).low
    assert not made(21.0, None).low
    assert made(60.0, 1.4).low
    assert made(60.0, 1 / 1.4).low
    assert not made(60.0, 1.42).low
    assert not made(None, None).low
    assert not made(10.0, None, 1.0).low  # unstable is worse than low
    assert made(10.0, None, 1.0).tightness < made(1.0, None).tightness


def test_a_loop_that_the_encoder_feeds_is_half_a_sample_later() -> None:
    """A difference of angles is the mean rate of the sample: sinc(w T / 2) exp(-i w T / 2)."""

    def phase(feedback: str) -> LoopMargins:
        on = bench(
            lambda tree: tree["controller"].update(
                {"sample_rate": "200 Hz", "rate_feedback": feedback}
            )
        )
        return margins_of(open_loop(complete(on), "none", "rate", "sliding"))

    gyro, encoder = phase("gyro"), phase("encoder")
    assert gyro.crossover
    assert gyro.phase_margin
    assert encoder.phase_margin
    lost = gyro.phase_margin - encoder.phase_margin
    assert lost == pytest.approx(0.5 * gyro.crossover / 200.0, rel=0.02)
