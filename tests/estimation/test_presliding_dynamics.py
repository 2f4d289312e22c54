"""The joint fit below breakaway, against plants that scipy simulates and against closed forms."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import lfilter
from scipy.stats import binomtest

from campaign.estimate import Origin
from campaign.estimation.intervals import MODEL_MISFIT
from campaign.estimation.presliding_dynamics.fit import fit_presliding_dynamics
from campaign.estimation.presliding_dynamics.plant import Appendage, Bristles, Plant
from campaign.estimation.presliding_dynamics.presliding_fit import identify_presliding_dynamics
from campaign.estimation.presliding_dynamics.record import Assumptions, Record
from campaign.estimation.presliding_dynamics.shape import ANSWER_MISSED
from campaign.estimation.presliding_dynamics.simulation import (
    simulate,
    steps_per_sample,
    torque_on_grid,
)
from campaign.estimation.presliding_dynamics.uncertainty import spread_of
from tests.estimation.bristle_plants import LUGRE_1995, Array, Interface, Torque, Truth, multisine
from tests.estimation.coverage import holds

SLOW = Truth(2.0, 0.0, (Interface(2000.0, 40.0, 5.0, 5.0, 1.0),))
"""5 Hz, damping ratio 0.32, a curve that does not fall."""
TWO = Truth(
    2.0, 0.0, (Interface(1500.0, 20.0, 0.3, 0.3, 1.0), Interface(500.0, 20.0, 5.0, 5.0, 1.0))
)
"""Most of the stiffness slips early."""
STEP = 0.005
MEASURED = ("bristle_stiffness", "damping", "inertia")


def plant_of(truth: Truth) -> Plant:
    """The same numbers for the program."""
    bristles = tuple(
        Bristles(i.s0, i.s1, 1.0 / i.ts, i.tc / i.ts, i.vs, i.delta) for i in truth.interfaces
    )
    part = None if truth.appendage is None else Appendage(*truth.appendage)
    return Plant(truth.inertia, bristles, truth.s2, part)


@cache
def answered(
    truth: Truth, seed: int, amplitude: float, step: float, count: int, highest: float
) -> tuple[Array, Array, Array]:
    """Torque, angle and rate without noise, (count,) each."""
    time = step * np.arange(count)
    torque = multisine(seed, amplitude, highest / 40.0, highest)
    return torque(time), *truth.answer(torque, time)


def records(
    truth: Truth,
    amplitudes: tuple[float, ...],
    noise: float,
    seed: int = 1,
    count: int = 1200,
    highest: float = 15.0,
    correlation: float = 0.0,
) -> list[Record]:
    """Multisines with gyro noise, offset and drift; noise as a share of the rate's deviation."""
    rng = np.random.default_rng(seed)
    found = []
    for number, amplitude in enumerate(amplitudes):
        torque, _, rate = answered(truth, 10 + number, amplitude, STEP, count, highest)
        white = rng.standard_normal(count + 200)
        colour = np.sqrt(1.0 - correlation**2)
        rough = lfilter([colour], [1.0, -correlation], white)[200:]
        size = float(np.std(rate))
        seen = rate + noise * size * rough + size * (0.5 + 0.3 * np.linspace(0.0, 1.0, count))
        found.append(Record(STEP, torque, rate=seen, label=f"{amplitude} N m"))
    return found


def true_values(truth: Truth) -> dict[str, float]:
    (one,) = truth.interfaces
    whole = one.s1 + truth.s2
    return {"bristle_stiffness": one.s0, "damping": whole, "inertia": truth.inertia}


# The simulation ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "amplitude", "highest"),
    [
        (LUGRE_1995, 0.5, 100.0),
        (
            Truth(
                69.0,
                4.0,
                (
                    Interface(15e3, 970.0, 20.0, 16.0, 0.03, 0.9),
                    Interface(4e5, 210.0, 12.0, 9.0, 0.03),
                ),
                (1.3, 11.0, 0.02),
            ),
            5.0,
            40.0,
        ),
    ],
)  # fmt: skip
def test_the_simulation_agrees_with_radau(truth: Truth, amplitude: float, highest: float) -> None:
    time = 1e-3 * np.arange(151)
    torque = multisine(3, amplitude, 4.0, highest)
    angle, rate = truth.answer(torque, time, "Radau", max_step=2e-4)
    plant = plant_of(truth)
    finer = steps_per_sample(plant, 1e-3, highest)
    motion = simulate(plant, torque_on_grid(torque(time), finer), 1e-3, per_sample=finer)
    assert np.max(np.abs(motion.rate_at(0.0) - rate)) < 1.5e-4 * np.max(np.abs(rate))
    assert np.max(np.abs(motion.angle_at(0.0) - angle)) < 1.5e-4 * np.max(np.abs(angle))


def test_a_held_torque_moves_a_spring_as_the_closed_form_has_it() -> None:
    torque = np.random.default_rng(5).standard_normal(200)
    held = np.column_stack([torque[:-1]] * 3)
    motion = simulate(Plant(2.0, (Bristles(800.0, 9.0),), 1.0), held, 0.01, bristle_torque=0.0)
    system = np.array([[0.0, 1.0, 0.0], [-400.0, -5.0, 0.5], [0.0, 0.0, 0.0]])
    step = expm(system * 0.01)
    state = np.zeros(2)
    for index, applied in enumerate(torque[:-1]):
        state = (step @ [*state, applied])[:2]
        assert motion.angle[index + 1] == pytest.approx(state[0], rel=1e-9, abs=1e-12)
        assert motion.rate[index + 1] == pytest.approx(state[1], rel=1e-9, abs=1e-12)


def test_a_delayed_channel_shows_what_was_before() -> None:
    plant, time = plant_of(SLOW), STEP * np.arange(400)
    torque = multisine(1, 1.0, 0.5, 10.0)
    late = simulate(plant, torque_on_grid(torque(time - 0.3 * STEP), 4), STEP, per_sample=4)
    motion = simulate(plant, torque_on_grid(torque(time), 4), STEP, per_sample=4)
    size = np.max(np.abs(motion.rate))
    shown = motion.rate_at(0.3 * STEP)
    assert shown == pytest.approx(late.rate_at(0.0), abs=1e-4 * size)
    assert np.max(np.abs(shown - motion.rate_at(0.0))) > 1e-2 * size


# What is recovered -------------------------------------------------------------------------------


def test_the_parameters_of_1995_are_found_without_noise() -> None:
    truth = replace(LUGRE_1995, interfaces=(replace(LUGRE_1995.interfaces[0], tc=1.5),))
    found = []
    for number, amplitude in enumerate((0.15, 0.5)):
        torque, _, rate = answered(truth, number, amplitude, 1e-3, 1000, 120.0)
        found.append(Record(1e-3, torque, rate=rate + 1e-3))
    fit = fit_presliding_dynamics(found)
    (bristles,) = fit.plant.bristles
    assert bristles.stiffness == pytest.approx(1e5, rel=3e-4)
    assert bristles.damping + fit.plant.viscous == pytest.approx(np.sqrt(1e5) + 0.4, rel=4e-4)
    assert fit.plant.inertia == pytest.approx(1.0, rel=4e-4)
    assert 1.0 / bristles.compliance == pytest.approx(1.5, rel=5e-3)


def test_gyro_and_encoder_together_say_more_than_the_encoder_alone() -> None:
    torque, angle, rate = answered(SLOW, 12, 2.0, STEP, 1200, 15.0)
    count = np.ptp(angle) / 40.0
    coarse = count * np.round((angle + 0.3 * count) / count) + 0.7
    noisy = rate + 0.05 * np.std(rate) * np.random.default_rng(2).standard_normal(len(rate))
    alone = identify_presliding_dynamics([Record(STEP, torque, angle=coarse)])
    both = identify_presliding_dynamics([Record(STEP, torque, rate=noisy, angle=coarse)])
    for name, truth in true_values(SLOW).items():
        assert holds(alone.estimates[name], truth), name
        assert holds(both.estimates[name], truth), name
        assert both.estimates[name].half_width < alone.estimates[name].half_width


def test_a_record_that_begins_in_motion_is_fitted_with_what_it_begins_with() -> None:
    torque, _, rate = answered(SLOW, 12, 2.0, STEP, 1200, 15.0)
    noise = 0.01 * np.std(rate) * np.random.default_rng(2).standard_normal(len(rate))
    cut = slice(137, 1000)
    record = Record(STEP, torque[cut], rate=(rate + noise)[cut], at_rest=False)
    found = identify_presliding_dynamics([record])
    for name, truth in true_values(SLOW).items():
        assert holds(found.estimates[name], truth), name
    wrong = identify_presliding_dynamics([replace(record, at_rest=True)])
    wide = wrong.estimates["bristle_stiffness"].half_width
    assert wrong.reason or wide > 5.0 * found.estimates["bristle_stiffness"].half_width


def test_lost_samples_cost_only_themselves() -> None:
    (whole,) = records(SLOW, (2.0,), 0.02)
    rate = whole.rate.copy()
    rate[300:330] = np.nan
    found = identify_presliding_dynamics([replace(whole, rate=rate)])
    for name, truth in true_values(SLOW).items():
        assert holds(found.estimates[name], truth), name


# Intervals that hold -----------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("correlation", [0.0, 0.9])
@pytest.mark.parametrize("draws", [10, pytest.param(32, marks=pytest.mark.statistics)])
def test_intervals_hold_the_truth_as_often_as_they_say(draws: int, correlation: float) -> None:
    """Of 32 draws of noise 25 or fewer would be a chance of 1 in 1000, of 10 it is 6 or fewer.

    Of 64 draws one is refused: noise of that correlation looks like another shape of the bristles.
    """
    hits, refused = dict.fromkeys(MEASURED, 0), 0
    for seed in range(draws):
        every = records(SLOW, (1.0, 2.0), 0.1, seed=seed, count=600, correlation=correlation)
        found = identify_presliding_dynamics(every)
        if found.reason:
            refused += 1
            continue
        for name, truth in true_values(SLOW).items():
            hits[name] += holds(found.estimates[name], truth)
    assert refused <= draws // 30
    assert binomtest(min(hits.values()), draws - refused, 0.95, "less").pvalue > 0.0015, hits


@pytest.mark.slow
def test_records_that_differ_widen_the_intervals() -> None:
    alike = records(SLOW, (1.0, 1.5, 2.0), 0.01)
    other = Truth(2.0, 0.0, (replace(SLOW.interfaces[0], s0=2060.0),))
    apart = [*alike[:2], *records(other, (1.0, 1.5, 2.0), 0.01)[2:]]
    one, mixed = identify_presliding_dynamics(alike), identify_presliding_dynamics(apart)
    index = mixed.fit.parameters.names.index("bristle_stiffness")
    assert mixed.spread.freedom[index] == 2.0
    narrow = one.estimates["bristle_stiffness"].standard_error
    wide = mixed.estimates["bristle_stiffness"].standard_error
    assert wide > 5.0 * narrow


# What is refused ---------------------------------------------------------------------------------


@pytest.mark.slow
def test_an_elastic_part_that_nobody_tells_is_a_misfit_and_one_that_is_told_is_not() -> None:
    truth = replace(SLOW, appendage=(0.2, 7.0, 0.02))
    every = records(truth, (1.0, 2.0), 0.01)
    alone = identify_presliding_dynamics(every)
    assert alone.reason in MODEL_MISFIT
    assert alone.misfit.reason in ANSWER_MISSED
    assert all(not each.has_interval and each.reason for each in alone.estimates.values())
    guess = Assumptions(appendage=Appendage(0.15, 7.3, 0.03), appendage_free=True)
    told = identify_presliding_dynamics(every, guess)
    assert not told.reason
    own = {"appendage_inertia": 0.2, "appendage_frequency": 7.0, "appendage_damping_ratio": 0.02}
    for name, value in (true_values(truth) | own).items():
        assert holds(told.estimates[name], value), name
    assert told.estimates["damping"].half_width < 0.05 * 40.0


def test_what_is_missed_for_certain_but_is_little_widens_the_interval() -> None:
    truth = replace(SLOW, appendage=(0.012, 7.0, 0.1))
    found = identify_presliding_dynamics(records(truth, (1.0, 2.0), 0.005))
    assert not found.reason
    for name, value in true_values(truth).items():
        estimate = found.estimates[name]
        parts = {part.source: part.standard_uncertainty or 0.0 for part in estimate.systematic}
        assert parts["what the model misses"] > 1e-3 * value
        assert holds(estimate, value), name


def test_interfaces_that_slip_at_different_angles_are_a_misfit() -> None:
    found = identify_presliding_dynamics(records(TWO, (0.3, 1.0), 0.002))
    assert found.reason in MODEL_MISFIT
    assert not any(each.has_interval for each in found.estimates.values())


def test_below_the_first_slip_they_are_one_bristle_and_their_sum_is_found() -> None:
    found = identify_presliding_dynamics(records(TWO, (0.005, 0.01), 0.02))
    assert not found.reason
    assert holds(found.estimates["bristle_stiffness"], 2000.0)
    assert holds(found.estimates["damping"], 40.0)


def test_a_load_that_breaks_away_is_refused() -> None:
    time = STEP * np.arange(1200)
    torque = multisine(10, 8.0, 0.375, 15.0)
    slow = Truth(2.0, 0.0, (replace(SLOW.interfaces[0], ts=2.0, tc=2.0),))
    _, rate = slow.answer(torque, time)
    found = identify_presliding_dynamics([Record(STEP, torque(time), rate=rate)])
    assert found.reason
    assert not any(each.has_interval for each in found.estimates.values())


def _slow_motion(torque: Torque, count: int, noise: float) -> Record:
    time = 0.02 * np.arange(count)
    _, rate = SLOW.answer(torque, time)
    rough = noise * float(np.std(rate)) * np.random.default_rng(4).standard_normal(count)
    return Record(0.02, torque(time), rate=rate + rough)


@pytest.mark.slow
def test_slow_reversals_say_nothing_of_inertia_and_damping() -> None:
    def slow(time: Array) -> Array:
        return np.asarray(3.0 * np.sin(2.0 * np.pi * 0.05 * time))

    found = identify_presliding_dynamics([_slow_motion(slow, 4000, 1.0)])
    assert holds(found.estimates["bristle_stiffness"], 2000.0)
    for name in ("damping", "inertia"):
        assert found.estimates[name].origin in (Origin.NOT_DETERMINED, Origin.AT_BOUND), name
        assert found.estimates[name].reason


def test_errors_that_repeat_with_the_torque_make_no_interval_narrower() -> None:
    period = 400
    time = STEP * np.arange(6 * period)
    torque = multisine(3, 2.0, 1.0 / (period * STEP), 15.0)
    angle, _ = SLOW.answer(torque, time)
    count = np.ptp(angle) / 6.0
    coarse = count * np.round(angle / count)
    alike = Record(STEP, torque(time), angle=coarse, period=period * STEP)
    told = fit_presliding_dynamics([alike])
    # A period of more than half of the record is none: all errors then count as different.
    untold = replace(told, records=(replace(alike, period=STEP * len(time)),))
    assert np.all(spread_of(told).deviation[:4] > 1.3 * spread_of(untold).deviation[:4])


def test_both_dampings_cannot_be_told_apart_below_the_first_slip() -> None:
    found = identify_presliding_dynamics(records(SLOW, (0.2, 0.4), 0.02)).estimates
    assert found["viscous_friction"].origin is not Origin.MEASURED
    assert holds(found["damping"], 40.0)
    assert holds(found["bristle_damping"], 40.0)
    assert 20.0 * found["damping"].half_width < found["bristle_damping"].half_width


def test_what_does_not_come_back_has_no_stiffness() -> None:
    time = STEP * np.arange(1000)
    torque = multisine(1, 1.0, 0.5, 10.0)
    rate = np.cumsum(torque(time)) * STEP / 2.0
    with pytest.raises(ValueError, match="no stiffness"):
        fit_presliding_dynamics([Record(STEP, torque(time), rate=rate)])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": None}, "neither rate nor angle"),
        ({"torque": np.zeros(200)}, "never changes"),
        ({"torque": np.full(200, np.nan)}, "finite samples"),
        ({"rate": np.zeros(50)}, "differ in length"),
        ({"rate": np.zeros(200)}, "holds nothing"),
        ({"rate": np.full(200, np.nan)}, "holds nothing"),
    ],
)
def test_records_that_hold_nothing_are_refused(change: dict[str, object], message: str) -> None:
    whole = {"step": 0.01, "torque": np.sin(np.arange(200.0)), "rate": np.arange(200.0)}
    with pytest.raises(ValueError, match=message):
        Record(**{**whole, **change})  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="no record"):
        fit_presliding_dynamics([])
