"""Instruments from a simulated motion: where noise biases least squares, where they are weak."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin, Systematic
from campaign.estimation.inverse.motion import (
    FilterSettings,
    Motion,
    motion_of_position,
    motion_of_rate,
)
from campaign.estimation.inverse.simulation import find_loop, followed_motion
from campaign.estimation.inverse.terms import DIRECTIONAL, SYMMETRIC, TERMS
from campaign.experiments.any_motion.instrument_estimates import (
    Instruments,
    held_against,
    instruments,
    judged_delay,
)
from campaign.experiments.any_motion.inverse_fit import BENDS, InverseDynamics, find
from campaign.experiments.any_motion.motions import MotionPiece, with_slowest
from campaign.experiments.any_motion.tables import instruments_table
from campaign.reason import Reason
from tests.estimation.coverage import holds

RATE = 1000.0
TRUTH = {
    "inertia": 2.0,
    "viscous_positive": 1.0,
    "viscous_negative": 1.0,
    "coulomb_positive": 3.0,
    "coulomb_negative": 3.0,
}
TERMS_OF_IT = [TERMS[name] for name in DIRECTIONAL]
STIFF, DAMPED = 800.0, 70.0
TIME = np.arange(20_000) / RATE


def wanted_motion(size: float = 1.0) -> tuple[Array, Array]:
    draw = np.random.default_rng(3)
    omega = 2 * np.pi * draw.uniform(0.2, 1.5, 6)
    turned = omega * TIME[:, None] + draw.uniform(0, 2 * np.pi, 6)
    rate = size * np.sin(turned).sum(1) / 3.0
    return np.cumsum(rate) / RATE, rate


def recorded(
    noise: float, shaking: float = 0.0, size: float = 1.0, seed: int = 1
) -> tuple[MotionPiece, Array]:
    """A rig with a tachometer that has `noise` (rad/s), shaken by `shaking` (N m); its true rate.

    The loop acts on the noise; it knows the true angle. The force acts half a sample late.
    """
    draw = np.random.default_rng(seed)
    place, speed = wanted_motion(size)
    angle, rate = place[0], 0.0
    seen, force, true = np.empty(len(TIME)), np.empty(len(TIME)), np.empty(len(TIME))
    hum = np.convolve(draw.standard_normal(len(TIME)), np.ones(100) / 10.0, "same") * shaking
    fine, step = 5, 1.0 / (RATE * 5)
    for k in range(len(TIME)):
        true[k] = rate
        seen[k] = rate + noise * draw.standard_normal()
        force[k] = STIFF * (place[k] - angle) + DAMPED * (speed[k] - seen[k])
        for _ in range(fine):
            acting = force[k] + hum[k]
            if rate == 0.0:
                net = max(abs(acting) - 3.0, 0.0) * np.sign(acting)
            else:
                net = acting - 3.0 * np.sign(rate) - rate
            new = rate + step * net / 2.0
            new = 0.0 if rate * new < 0.0 else new
            angle, rate = angle + 0.5 * step * (rate + new), new
    filtering = FilterSettings.for_rate(RATE)
    measured = motion_of_rate(TIME, seen, force, filtering.low_pass)
    wanted = motion_of_position(TIME, place, force, filtering.low_pass)
    return MotionPiece(1, measured, wanted, of_rate=True), true


def identified(piece: MotionPiece) -> InverseDynamics:
    filtering = with_slowest(FilterSettings.for_rate(RATE), [piece], None)
    return find([piece], [], filtering, terms=TERMS_OF_IT)


@pytest.fixture(scope="module")
def noisy() -> MotionPiece:
    return recorded(noise=0.15)[0]


@pytest.fixture(scope="module")
def told(noisy: MotionPiece) -> InverseDynamics:
    return identified(noisy)


def test_a_noisy_rate_takes_from_the_inertia_and_instruments_hold_it(told: InverseDynamics) -> None:
    squares = told.squares["inertia"]
    assert squares.high is not None
    assert squares.high < 0.5 * TRUTH["inertia"]  # of scatter alone
    assert told.instruments is not None
    assert told.instruments.of_wanted
    for name, truth in TRUTH.items():
        assert holds(told.instruments.estimates[name], truth), name
    assert told.instruments.estimates["inertia"].half_width < 0.1 * TRUTH["inertia"]


def test_what_is_biased_is_said_and_instruments_are_told(told: InverseDynamics) -> None:
    assert told.biased
    assert told.instruments is not None
    assert told.estimates == told.instruments.estimates
    table = instruments_table(told, told.instruments)
    assert "biases least squares" in table.note
    assert table.rows[0]["squares"] == told.squares["inertia"]
    assert "along the wanted motion" in table.title


def test_without_what_was_wanted_the_force_stands_in_and_decides_nothing(
    noisy: MotionPiece,
) -> None:
    found = identified(replace(noisy, wanted=None))
    assert found.instruments is not None
    assert not found.instruments.of_wanted
    assert not found.biased
    assert found.no_instruments == "the commanded motion was not recorded"
    for name, one in found.estimates.items():
        assert one.value == found.squares[name].value
        [part] = [p for p in one.systematic if p.source == "instruments"]
        other = found.instruments.estimates[name]
        assert part.standard_uncertainty == pytest.approx(abs(one.value - other.value))
    # Nobody knows whether a loop made it look late: it may be no delay at all.
    assert holds(found.delay, 0.0)
    assert "loop" in [part.source for part in found.delay.systematic]


def test_of_a_quiet_rate_both_say_the_same() -> None:
    found = identified(recorded(noise=1e-4)[0])
    assert found.instruments is not None
    for name, truth in TRUTH.items():
        assert holds(found.estimates[name], truth), name
        assert found.instruments.estimates[name].value == pytest.approx(truth, rel=0.02)
        assert found.squares[name].value == pytest.approx(truth, rel=0.02)
    assert holds(found.delay, 0.5 / RATE)


def test_instruments_that_hardly_tell_a_term_are_refused() -> None:
    """What shakes the axis moves it; what was wanted is next to nothing."""
    piece, _ = recorded(noise=1e-3, shaking=30.0, size=0.02)
    filtering = with_slowest(FilterSettings.for_rate(RATE), [piece], None)
    values = np.array(list(TRUTH.values()))
    found, why = instruments([piece], TERMS_OF_IT, values, filtering, 0.0)
    assert "hardly determines" in why
    assert found is None or not found.of_wanted


def test_a_force_that_follows_nothing_wanted_has_no_loop() -> None:
    motion = recorded(noise=1e-3)[0].motion
    draw = np.random.default_rng(5)
    other = replace(motion, force=draw.standard_normal(len(motion.time)))
    wanted = motion_of_position(TIME, wanted_motion()[0], motion.force, 100.0)
    with pytest.raises(ValueError, match="does not follow from the setpoints"):
        find_loop(other, wanted, 100.0)


def test_the_loop_is_found_and_its_motion_is_that_without_noise() -> None:
    piece, true = recorded(noise=0.02)
    assert piece.wanted is not None
    loop = find_loop(piece.motion, piece.wanted, 100.0)
    assert loop.explained > 0.9
    made = followed_motion(
        piece.motion, piece.wanted, loop, TERMS_OF_IT, np.array(list(TRUTH.values()))
    )
    off = made.rate - true[: len(made.rate)]
    assert np.sqrt(np.mean(off**2)) < 0.1 * np.sqrt(np.mean(true**2))


def test_estimates_that_differ_within_their_intervals_are_those_of_least_squares() -> None:
    one = Estimate("inertia", 2.0, "kg m^2", 1.9, 2.1, 0.95, standard_error=0.05)
    assert held_against({"inertia": one}, None) == ({"inertia": one}, False)
    held = instrumented(replace(one, value=2.05, low=1.95, high=2.15), of_wanted=True)
    estimates, biased = held_against({"inertia": one}, held)
    assert not biased
    assert estimates["inertia"].value == 2.0
    assert estimates["inertia"].systematic == (Systematic("instruments", pytest.approx(0.05)),)
    far = replace(one, value=2.3, low=2.2, high=2.4)
    assert held_against({"inertia": one}, instrumented(far, of_wanted=True)) == (
        {"inertia": far},
        True,
    )
    estimates, biased = held_against({"inertia": one}, instrumented(far, of_wanted=False))
    assert not biased
    assert estimates["inertia"].half_width > 0.5
    # What is systematic in least squares is that very noise: it hides no difference.
    wide = replace(one, systematic=(Systematic("band", 1.0),))
    assert held_against({"inertia": wide}, instrumented(far, of_wanted=True))[1]


def instrumented(one: Estimate, *, of_wanted: bool) -> Instruments:
    return Instruments("", of_wanted, cast("Any", None), {one.name: one}, None)


def test_a_delay_without_instruments_may_be_what_a_loop_makes_of_noise() -> None:
    late = Estimate.without_interval(
        "delay", 1e-3, "s", Reason("test", "stated"), origin=Origin.GIVEN
    )
    assert judged_delay(late, None) is late
    found = Estimate("delay", 2e-3, "s", 1.5e-3, 2.5e-3, 0.95)
    assert judged_delay(found, None).combined[0] == pytest.approx(
        2e-3 - np.hypot(0.5e-3, 2e-3), rel=1e-3
    )


@pytest.mark.parametrize("stated", [False, True])
def test_shares_of_what_bends_have_no_interval_unless_somebody_states_them(stated: bool) -> None:
    draw = np.random.default_rng(7)
    omega = 2 * np.pi * draw.uniform(0.1, 2.0, 8)
    size, phase = draw.uniform(0.2, 1.0, 8), draw.uniform(0, 2 * np.pi, 8)
    turned = omega * np.arange(20_000)[:, None] / 500.0 + phase
    rate, change = (size * np.cos(turned)).sum(1), (-size * omega * np.sin(turned)).sum(1)
    place = (size / omega * np.sin(turned)).sum(1)
    motion = Motion(np.arange(20_000) / 500.0, place, rate, change, np.zeros(20_000))
    names = ("inertia", "viscous", "coulomb", "square_root")
    force = sum(TERMS[n].column(motion) for n in names) + 0.05 * draw.standard_normal(20_000)
    piece = MotionPiece(1, replace(motion, force=np.asarray(force)), None)
    terms = [*(TERMS[name] for name in SYMMETRIC), TERMS["square_root"]] if stated else None
    found = find([piece], [], FilterSettings(100.0, 5, 0, 0.05), terms=terms, linear=True)
    assert "square_root" in found.estimates
    assert holds(found.estimates["inertia"], 1.0)
    for name, one in found.estimates.items():
        if name.startswith(("viscous", "coulomb", "square_root")):
            assert one.has_interval == stated
            assert (one.reason in BENDS) != stated
