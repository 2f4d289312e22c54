"""Commands to identify from: what is proved of multisines, chirps, noise and searched series."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.excitation_design.fourier import (
    STILL,
    FourierSeries,
    Room,
    best_series,
    condition,
)
from campaign.estimation.excitation_design.multisines import crest_factor, odd_multisine
from campaign.estimation.excitation_design.noise import band_noise
from campaign.estimation.excitation_design.sweep import Law, chirp
from campaign.estimation.frequency.multisine import odd_grid

PERIOD = 8.0
TERMS = ("inertia", "viscous", "coulomb_positive", "coulomb_negative")
ROOM = Room(angle=0.9, rate=1.8, acceleration=6.0)


# Multisines


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("order", [0, 1])
def test_a_multisine_has_power_only_on_its_odd_lines(seed: int, order: int) -> None:
    grid = odd_grid(0.5, 30.0, PERIOD, seed)
    signal = odd_multisine(grid, seed, 5, lowered=True, order=order)
    time = np.arange(8000) / 1000.0
    size = 2.0 * np.abs(np.fft.rfft(signal.sample(time))) / len(time)
    others = np.ones(len(size), dtype=bool)
    others[grid.excited] = False
    assert size[grid.excited] == pytest.approx(np.array(signal.amplitudes), rel=1e-9)
    assert np.max(size[others]) < 1e-9 * np.min(size[grid.excited])
    assert not np.any(grid.excited % 2 == 0)
    begun = signal.integral(np.zeros(1), order)[0] if order else signal.sample(np.zeros(1))[0]
    assert abs(begun) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_its_crest_factor_is_lowered(seed: int) -> None:
    grid = odd_grid(0.5, 30.0, PERIOD, seed)
    random, lowered = (
        odd_multisine(grid, seed, 20, lowered=each, order=0) for each in (False, True)
    )
    assert crest_factor(lowered, PERIOD) < 1.7 < 2.0 < crest_factor(random, PERIOD)
    # Against a finer grid than that of the function itself.
    values = lowered.sample(np.linspace(0.0, PERIOD, 100_003))
    rms = np.sqrt(0.5 * np.sum(np.square(lowered.amplitudes)))
    assert np.max(np.abs(values)) / rms == pytest.approx(crest_factor(lowered, PERIOD), rel=2e-3)
    assert lowered == odd_multisine(grid, seed, 20, lowered=True, order=0)


# Chirps


@pytest.mark.slow
@pytest.mark.parametrize("law", ["linear", "logarithmic"])
def test_a_chirp_has_the_frequency_that_it_says(law: Law) -> None:
    found = chirp(0.5, 20.0, 30.0, law)
    assert found.duration == pytest.approx(30.0, rel=0.1)
    time = np.linspace(0.0, found.duration, 200_001)
    counted = np.gradient(found.phase(time), time) / (2.0 * np.pi)
    share = time / found.duration
    frequency = 0.5 + 19.5 * share if law == "linear" else 0.5 * 40.0**share
    assert counted[1:-1] == pytest.approx(frequency[1:-1], rel=1e-4)
    whole = found.phase(np.array([found.duration]))[0] / (2.0 * np.pi)
    assert whole == pytest.approx(round(whole), abs=1e-6)
    # Straight lines between its points keep to the sine, and even steps of phase are its points.
    points = found.points()
    drawn = np.interp(time, points, np.sin(found.phase(points)))
    assert np.max(np.abs(drawn - np.sin(found.phase(time)))) < 0.006


@pytest.mark.parametrize(("lowest", "highest", "duration"), [(5.0, 5.0, 9.0), (0.1, 0.2, 1.0)])
def test_no_chirp(lowest: float, highest: float, duration: float) -> None:
    with pytest.raises(ValueError, match=r"must be above|cycle"):
        chirp(lowest, highest, duration, "linear")


# Noise


@pytest.mark.parametrize("order", [0, 1])
def test_noise_has_its_band_and_no_other(order: int) -> None:
    noise = band_noise(2.0, 10.0, 60.0, 200.0, 7, order)
    assert len(noise) == 12_001
    assert noise[0] == noise[-1]
    if order == 0:
        assert noise[0] == 0.0
        assert abs(noise[1]) < 2.0 * np.pi * 10.0 / 200.0 * np.max(np.abs(noise))  # Bernstein
    power = np.abs(np.fft.rfft(noise[:-1])) ** 2
    frequency = np.fft.rfftfreq(12_000, 1.0 / 200.0)
    inside = (frequency > 2.0 - 1e-9) & (frequency < 10.0 + 1e-9)
    assert np.sum(power[~inside]) < 1e-20 * np.sum(power)
    # Flat, as chi-square of two degrees of freedom scatters: mean of 240 lines, 1 in 15.
    halves = np.array_split(power[inside], 2)
    assert np.mean(halves[0]) == pytest.approx(np.mean(halves[1]), rel=0.4)
    assert np.sqrt(np.mean(noise[:-1] ** 2)) == pytest.approx(1.0)
    assert np.array_equal(noise, band_noise(2.0, 10.0, 60.0, 200.0, 7, order))
    assert not np.array_equal(noise, band_noise(2.0, 10.0, 60.0, 200.0, 8, order))


def test_a_band_has_the_lines_at_its_ends() -> None:
    """0.29 Hz of 100 s is line 29, although the product is a little less."""
    assert 0.29 * 100.0 < 29.0
    power = np.abs(np.fft.rfft(band_noise(0.1, 0.29, 100.0, 10.0, 7)[:-1])) ** 2
    present = np.flatnonzero(power > 1e-12 * np.max(power))
    assert (present[0], present[-1]) == (10, 29)


def test_no_noise() -> None:
    with pytest.raises(ValueError, match="duration of"):
        band_noise(1.0, 1.1, 2.0, 100.0, 1)
    with pytest.raises(ValueError, match="samples/s"):
        band_noise(1.0, 60.0, 20.0, 100.0, 1)


# Fourier series


def searched(seed: int = 1, generations: int = 60) -> FourierSeries:
    return best_series(PERIOD, 5, TERMS, ROOM, 0.0, generations, seed)


@pytest.mark.parametrize("seed", range(3))
def test_a_search_finds_a_lower_condition_number_than_chance(seed: int) -> None:
    # Each the best of 40 random series.
    chance = [condition(searched(5 * seed + k, 0).motion(), TERMS) for k in range(5)]
    assert condition(searched(seed).motion(), TERMS) < min(chance)


def test_more_generations_are_never_worse_and_a_seed_is_the_same_search() -> None:
    scores = [condition(searched(4, count).motion(), TERMS) for count in (0, 20, 60)]
    assert scores == sorted(scores, reverse=True)
    assert scores[0] > scores[-1]
    best_series.cache_clear()
    once = searched(4)
    best_series.cache_clear()
    assert once == searched(4)
    assert once != searched(5)


@pytest.mark.parametrize("room", [ROOM, Room(0.05, 5.0, 90.0), Room(3.0, 5.0, 0.7)])
def test_limits_hold_everywhere_and_one_is_reached(room: Room) -> None:
    series = best_series(PERIOD, 5, TERMS, room, 0.0, 20, 2)
    time = np.linspace(0.0, PERIOD, 80_001)
    bounds = (room.angle, room.rate, room.acceleration)
    used = [np.max(np.abs(series.sample(time, order))) / bounds[order] for order in range(3)]
    assert max(used) <= 1.0
    assert max(used) > 0.995


def test_its_derivatives_are_those_of_its_angle_and_it_begins_at_rest() -> None:
    series = searched()
    time = np.linspace(0.0, PERIOD, 40_001)
    for order in (1, 2):
        by_hand = np.gradient(series.sample(time, order - 1), time)
        largest = np.max(np.abs(by_hand))
        assert series.sample(time, order)[1:-1] == pytest.approx(by_hand[1:-1], abs=1e-5 * largest)
        assert abs(series.sample(np.zeros(1), order)[0]) < 1e-12
    assert series.rate.sample(time) == pytest.approx(series.sample(time, 1), abs=1e-9)


def test_the_condition_number_is_that_of_unit_columns_where_it_moves() -> None:
    motion = searched().motion()
    moves = np.abs(motion.rate) >= STILL * np.max(np.abs(motion.rate))
    rate, ahead = motion.rate[moves], motion.rate[moves] > 0
    columns = np.stack([motion.acceleration[moves], rate, 1.0 * ahead, -1.0 * ~ahead], axis=1)
    columns /= np.linalg.norm(columns, axis=0)
    assert condition(motion, TERMS) == pytest.approx(np.linalg.cond(columns), rel=1e-9)


def test_gravity_is_told_around_the_middle() -> None:
    terms = (*TERMS, "gravity_sine", "gravity_cosine")
    series = best_series(PERIOD, 5, terms, ROOM, 0.4, 40, 1)
    assert condition(series.motion(0.4), terms) < 20.0
    assert condition(series.motion(0.4), terms) != condition(series.motion(0.0), terms)


@pytest.mark.parametrize(
    ("harmonics", "terms", "room", "said"),
    [
        (5, ("inertia", "mass"), ROOM, "there is no term 'mass'"),
        (1, TERMS, ROOM, "two are the fewest"),
        (5, TERMS, Room(0.0, 1.0, 1.0), "no room"),
        (5, ("coulomb", "coulomb_positive", "coulomb_negative"), ROOM, "leave out one of them"),
    ],
)
def test_no_series(harmonics: int, terms: tuple[str, ...], room: Room, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        best_series(PERIOD, harmonics, terms, room, 0.0, 5, 1)
