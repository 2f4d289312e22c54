"""A torque that is measured with noise: what is known of it by its command, and what that is worth.

Plant and drive are linear and written here; scipy advances them exactly.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.signal import lfilter

from campaign.estimate import Estimate
from campaign.estimation.long_run import bandwidths
from campaign.estimation.presliding_dynamics.driven_torque import Driven, driven_torques
from campaign.estimation.presliding_dynamics.presliding_fit import (
    PreslidingDynamics,
    identify_presliding_dynamics,
)
from campaign.estimation.presliding_dynamics.record import Record
from campaign.estimation.presliding_dynamics.uncertainty import by_scores, scores_of
from tests.estimation.bristle_plants import Array
from tests.estimation.coverage import holds, rejected

STEP, COUNT, FINER = 0.005, 1200, 10
INERTIA, DAMPING, STIFFNESS = 2.0, 40.0, 2000.0
DRIVE, BACK_EMF = 0.01, 60.0
"""Time constant of the current (s); torque that a rate takes from it (N m s/rad)."""
LINES = 0.375 * np.arange(1, 40, 2)
NOISE = 0.12
"""of the torque's sensor (N m); the torque itself is of 0.5 N m rms."""
TRUTH = {"bristle_stiffness": STIFFNESS, "damping": DAMPING, "inertia": INERTIA}


class Command:
    """A multisine that begins at nothing."""

    def __init__(self, seed: int) -> None:
        self.phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(LINES))

    def __call__(self, time: Array) -> Array:
        turned = 2.0 * np.pi * np.multiply.outer(time, LINES) + self.phases
        return np.asarray(0.2 * (np.sin(turned) - np.sin(self.phases)).sum(axis=-1))


@cache
def driven(seed: int) -> tuple[Array, Array]:
    """Torque and rate at the samples, by fine steps with a command that is straight in each."""
    h = STEP / FINER
    # States: angle, rate, torque; then the command and its slope.
    system = np.zeros((5, 5))
    system[0, 1] = 1.0
    system[1, :3] = -STIFFNESS / INERTIA, -DAMPING / INERTIA, 1.0 / INERTIA
    system[2, 1:4] = -BACK_EMF / DRIVE, -1.0 / DRIVE, 1.0 / DRIVE
    system[3, 4] = 1.0
    move = expm(system * h)
    commands = Command(seed)(h * np.arange(COUNT * FINER + 1))
    state, found = np.zeros(5), np.empty((COUNT, 2))
    for index in range(COUNT * FINER):
        state[3:] = commands[index], (commands[index + 1] - commands[index]) / h
        if index % FINER == 0:
            found[index // FINER] = state[2], state[1]
        state = move @ state
    return found[:, 0], found[:, 1]


def measured(seed: int, noise: float = NOISE) -> list[tuple[Driven, Array]]:
    """Two trials with noise of both sensors: what the drive did, and the rate."""
    rng, found = np.random.default_rng(seed), []
    for number in (1, 2):
        torque, rate = driven(number)
        seen = rate + 0.02 * np.std(rate) * rng.standard_normal(COUNT)
        noisy = torque + noise * rng.standard_normal(COUNT)
        found.append((Driven(noisy, Command(number)), seen))
    return found


def told(seed: int, noise: float = NOISE) -> list[tuple[Array, Array]]:
    return driven_torques([each for each, _ in measured(seed, noise)], STEP, float(LINES[-1]))


def identified(seed: int, doubt: bool) -> PreslidingDynamics:
    records = [
        Record(STEP, torque, rate=rate, doubt=columns if doubt else None)
        for (torque, columns), (_, rate) in zip(told(seed), measured(seed), strict=True)
    ]
    return identify_presliding_dynamics(records)


def known(estimate: Estimate, truth: float) -> bool:
    """Whether it has an interval, and that holds."""
    return estimate.has_interval and holds(estimate, truth)


def test_a_torque_loses_most_of_its_noise_and_nothing_else() -> None:
    for number, (torque, _) in enumerate(told(0), start=1):
        off = torque - driven(number)[0]
        assert np.std(off) < 0.2 * NOISE
    # With half the noise half of that is left: it is not what the lags cannot tell.
    for number, (torque, _) in enumerate(told(0, 0.5 * NOISE), start=1):
        assert np.std(torque - driven(number)[0]) < 0.15 * NOISE


@cache
def yielding(seed: int) -> tuple[Array, Array]:
    """As `driven`, of a load whose spring bears 2 N m at most."""

    def slopes(time: float, state: Array) -> list[float]:
        angle, rate, torque = state
        held = STIFFNESS * 1e-3 * np.tanh(angle / 1e-3)
        asked = command(np.array(time)) - BACK_EMF * rate
        return [rate, (torque - DAMPING * rate - held) / INERTIA, (asked - torque) / DRIVE]

    command, times = Command(seed), STEP * np.arange(COUNT)
    found = solve_ivp(slopes, (0.0, times[-1]), np.zeros(3), "DOP853", times, rtol=1e-8, atol=1e-9)
    return found.y[2], found.y[1]


def test_back_emf_of_a_load_that_yields_is_told_by_its_motion() -> None:
    """The mean over many draws of the noise, which a linear answer to the command misses."""
    highest, missed = float(LINES[-1]), []
    for moved in (False, True):
        sums = np.zeros((2, COUNT))
        for draw in range(20):
            rng = np.random.default_rng(draw)
            trials = [
                Driven(
                    yielding(n)[0] + NOISE * rng.standard_normal(COUNT),
                    Command(n),
                    yielding(n)[1] if moved else None,
                )
                for n in (1, 2)
            ]
            sums += [torque for torque, _ in driven_torques(trials, STEP, highest)]
        missed.append(np.std(sums / 20 - [yielding(1)[0], yielding(2)[0]]))
    assert missed[1] < 0.3 * missed[0]


@pytest.mark.slow
def test_what_a_torque_is_off_by_is_told_by_standard_normal_factors() -> None:
    factors = []
    for seed in range(30):
        pairs = told(seed)
        off = [driven(n)[0] - t for n, (t, _) in enumerate(pairs, start=1)]
        level = [each - np.mean(each) for each in off]
        columns = np.concatenate([doubt - np.mean(doubt, axis=0) for _, doubt in pairs])
        factors.append(np.linalg.lstsq(columns, np.concatenate(level), rcond=None)[0])
    # Some 25 factors in each of 30 draws: their mean square has a deviation of 5 %.
    assert np.mean(np.concatenate(factors) ** 2) == pytest.approx(1.0, abs=0.2)


def test_a_clean_torque_is_taken_as_it_was_measured() -> None:
    trials = [each for each, _ in measured(0, 1e-3)]
    for trial, (torque, doubt) in zip(trials, told(0, 1e-3), strict=True):
        assert np.array_equal(torque, trial.torque)
        assert doubt.shape == (COUNT, 0)


@pytest.mark.slow
@pytest.mark.parametrize("count", [3, pytest.param(40, marks=pytest.mark.statistics)])
def test_a_torque_with_little_noise_is_regressed_where_the_rate_has_less(count: int) -> None:
    held = []
    for seed in range(count):
        rng, records = np.random.default_rng(seed), []
        trials = [each for each, _ in measured(seed, 0.036)]
        pairs = driven_torques(trials, STEP, float(LINES[-1]))
        for number, (torque, columns) in enumerate(pairs, start=1):
            rate = driven(number)[1]
            seen = rate + 0.002 * np.std(rate) * rng.standard_normal(COUNT)
            records.append(Record(STEP, torque, rate=seen, doubt=columns))
        found = identify_presliding_dynamics(records)
        held += [known(found.estimates[name], truth) for name, truth in TRUTH.items()]
    assert not rejected({"all": held}, "less")


def test_noise_that_is_coloured_is_counted_where_the_torque_matters() -> None:
    factors = []
    for seed in range(20):
        rng, trials = np.random.default_rng(seed), []
        for number in (1, 2):
            white = rng.standard_normal(COUNT + 100)
            coloured = lfilter([NOISE * np.sqrt(0.75)], [1.0, -0.5], white)[100:]
            trials.append(Driven(driven(number)[0] + coloured, Command(number)))
        pairs = driven_torques(trials, STEP, float(LINES[-1]))
        off = [driven(n)[0] - t for n, (t, _) in enumerate(pairs, start=1)]
        level = np.concatenate([each - np.mean(each) for each in off])
        columns = np.concatenate([doubt for _, doubt in pairs])
        factors.append(np.linalg.lstsq(columns, level, rcond=None)[0])
    assert np.mean(np.concatenate(factors) ** 2) == pytest.approx(1.0, abs=0.25)


def test_short_trials_are_regressed_on_fewer_commands_or_refused() -> None:
    torque, _ = driven(1)
    short = Driven(torque[:150] + NOISE * np.ones(150), Command(1))
    ((found, doubt),) = driven_torques([short], STEP, float(LINES[-1]))
    assert len(found) == len(doubt) == 150
    with pytest.raises(ValueError, match="record longer"):
        driven_torques([Driven(torque[:100], Command(1))], STEP, 0.5)


@pytest.mark.slow
def test_noise_of_the_torque_stiffens_what_is_found_where_it_is_taken_for_torque() -> None:
    records = [Record(STEP, drive.torque, rate=rate) for drive, rate in measured(0, 0.3)]
    assert identify_presliding_dynamics(records).fit.plant.inertia > 1.05 * INERTIA


def hits(seed: int, doubt: bool) -> list[bool]:
    """Whether each interval of one identification holds; one that is not told does not."""
    found = identified(seed, doubt)
    return [known(found.estimates[name], truth) for name, truth in TRUTH.items()]


@pytest.mark.slow
def test_a_sample_of_intervals_holds_with_what_is_left_to_doubt_of_the_torque() -> None:
    told = [each for seed in range(6) for each in hits(seed, doubt=True)]
    assert not rejected({"all": told}, "less")
    assert all(hits(11, doubt=True))
    assert not all(hits(11, doubt=False))


@pytest.mark.statistics
def test_intervals_hold_with_what_is_left_to_doubt_of_the_torque() -> None:
    told = {doubt: np.array([hits(seed, doubt) for seed in range(40)]) for doubt in (True, False)}
    names = dict(zip(TRUTH, told[True].T.tolist(), strict=True))
    assert not rejected(names, "less")
    assert max(told[False].mean(axis=0)) < 0.88


@pytest.mark.slow
def test_deviations_by_scores_know_what_is_left_to_doubt_of_the_torque() -> None:
    """Of white noise they are those of independent residuals and of what is known beforehand."""
    fit = identified(3, doubt=True).fit
    inverse, scores = np.linalg.inv(fit.information), scores_of(fit)
    deviation = np.sqrt(np.diag(by_scores(fit, inverse, scores, bandwidths(scores)[1])))
    assert deviation == pytest.approx(np.sqrt(np.diag(inverse))[: len(deviation)], rel=0.1)


def test_records_that_doubt_other_things_are_not_fitted_together() -> None:
    first, second = (
        Record(STEP, torque, rate=rate, doubt=columns)
        for (torque, columns), (_, rate) in zip(told(0), measured(0), strict=True)
    )
    with pytest.raises(ValueError, match="doubt"):
        identify_presliding_dynamics([first, Record(STEP, second.torque, rate=second.rate)])
    padded = Record(STEP, second.torque, rate=second.rate).with_doubts(first.doubts.shape[1])
    assert padded.doubts.shape[1] == first.doubts.shape[1]
    assert not np.any(padded.doubts)
