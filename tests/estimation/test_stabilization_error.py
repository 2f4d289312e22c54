"""Stabilization errors: closed forms, and how often intervals hold what synthetic records are."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.sampled_curve import LOST
from campaign.estimation.stabilization_error import (
    NO_SCATTER,
    OF_ONE_TRIAL,
    SHORT,
    SHORT_BLOCK,
    TOO_FEW_FOR_BLOCKS,
    correlation_time,
    decrease,
    over_blocks,
    over_cycles,
    over_trials,
    quotient,
    whole_cycles,
)
from tests.estimation.coverage import autoregressive, draws, holds, rejected

PER_CYCLE = 400
T3 = 3.182446  # Student's t with 3 degrees of freedom, 97.5 %: any table


def test_a_sine_has_its_amplitude_over_root_two_over_whole_cycles() -> None:
    """What is beyond the last whole cycle does not count, nor does the mean."""
    time = np.arange(2625) / 1000.0  # 2.625 cycles of 1 Hz
    found = over_cycles(3e-3 * np.sin(2 * np.pi * time + 0.4) + 0.1, 1000.0)
    assert found.value == pytest.approx(3e-3 / np.sqrt(2), rel=1e-9)
    assert (found.low, found.reason) == (None, NO_SCATTER())


def test_two_cycles_that_are_not_of_whole_samples_are_two() -> None:
    """0.24 Hz at 1 kHz: 8333.3 samples, of which a window has 8333."""
    angle = 2 * np.pi * 0.24 * np.arange(8333) / 1000.0
    noise = 1e-2 * np.random.default_rng(3).standard_normal(8333)
    assert over_cycles(np.sin(angle) + noise, 1000 / 0.24).freedom == 3
    assert over_cycles((np.sin(angle) + noise)[:8320], 1000 / 0.24).freedom == 1


@pytest.mark.parametrize("sample_rate", [200.0, 1000.0])
def test_a_window_of_whole_cycles_has_all_of_them(sample_rate: float) -> None:
    """As a recording has it: up to the last sample before its end, from half a sample early on."""
    for frequency in np.arange(0.05, 3.0, 0.01):
        for cycles in (1, 6):
            start, stop = 2.0 / frequency, 2.0 / frequency + cycles / frequency
            time = np.arange(np.floor(stop * sample_rate + 1e-9)) / sample_rate
            inside = time[time >= start - 0.5 / sample_rate]
            found_rate = (len(inside) - 1) / np.ptp(inside)
            assert whole_cycles(len(inside), found_rate / frequency) == cycles


def test_the_interval_of_half_cycles_of_known_size() -> None:
    """Half cycles of +-a with a^2 = 1, 2, 3, 2: mean 2, sd sqrt(2/3), error of ln s sd/(2 2 2)."""
    flips = np.resize([1.0, -1.0], 50)
    samples = np.concatenate([np.sqrt(square) * flips for square in (1.0, 2.0, 3.0, 2.0)])
    found = over_cycles(samples, 100.0)
    error = np.sqrt(2.0 / 3.0) / 8.0
    assert found.value == pytest.approx(np.sqrt(2.0))
    assert found.low == pytest.approx(np.sqrt(2.0) * np.exp(-T3 * error), rel=1e-6)
    assert found.high == pytest.approx(np.sqrt(2.0) * np.exp(T3 * error), rel=1e-6)
    assert found.freedom == 3
    assert found.reason in OF_ONE_TRIAL


def test_what_has_no_interval_says_why() -> None:
    assert over_cycles(np.arange(50.0), 100.0).reason in SHORT
    lost = over_cycles(np.array([1.0, np.nan] * 100), 100.0)
    assert (np.isnan(lost.value), lost.reason, lost.origin) == (True, LOST(), "not determined")
    assert over_cycles(np.zeros(200), 100.0).value == 0.0
    slow = np.sin(np.linspace(0.0, 3.0, 600))
    assert over_blocks(slow).reason in SHORT_BLOCK
    assert over_blocks(np.arange(5.0)).reason in TOO_FEW_FOR_BLOCKS


def test_the_correlation_time_of_an_autoregressive_series() -> None:
    """(1 + r) / (1 - r): 9 for r = 0.8."""
    series = autoregressive(np.random.default_rng(0), 400_000, 0.8)
    assert correlation_time(series, 100) == pytest.approx(9.0, rel=0.05)


def estimates(values: Array) -> list[Estimate]:
    return [Estimate("error", float(value), "rad") for value in values]


def test_one_trial_is_itself_and_trials_alike_have_no_scatter() -> None:
    noise = np.random.default_rng(1).standard_normal(4 * PER_CYCLE)
    one = over_cycles(friction_error(4) + 0.1 * noise, PER_CYCLE)
    assert over_trials([one]) == one
    alike = over_trials(estimates(np.full(3, 2.0)))
    assert (alike.value, alike.low, alike.reason) == (2.0, None, NO_SCATTER())
    lost = Estimate.without_interval("error", np.nan, "rad", LOST())
    assert over_trials([lost, one]) == one
    with pytest.raises(ValueError, match="no trial"):
        over_trials([])


def test_a_ratio_of_single_trials_says_that_it_is_one() -> None:
    noise = np.random.default_rng(2).standard_normal((2, 4 * PER_CYCLE))
    one, other = (over_cycles(friction_error(4) + 0.2 * each, PER_CYCLE) for each in noise)
    assert quotient("error_reduction", one, other).reason in OF_ONE_TRIAL
    less = decrease("error_decrease", one, other)
    ratio = quotient("ratio", one, other)
    assert (less.value, less.low, less.high) == (1 - ratio.value, 1 - ratio.high, 1 - ratio.low)
    still = over_cycles(friction_error(4), PER_CYCLE)
    for sides in ((one, still), (still, one)):  # of what scatters it is not that nothing does
        told = quotient("error_reduction", *sides)
        assert (told.has_interval, told.reason) == (False, OF_ONE_TRIAL())
    assert quotient("error_reduction", still, still).reason in NO_SCATTER


# How often the truth is held. Errors have the shape that friction gives them: a kick at each
# reversal, integrated away; under them is autocorrelated noise.


def friction_error(cycles: int) -> Array:
    """Kicks of alternating sign that a loop takes away again, standard deviation 1."""
    phase = (np.arange(PER_CYCLE * cycles) % PER_CYCLE) / PER_CYCLE
    late = phase >= 0.5
    since = 2 * np.where(late, phase - 0.5, phase)
    kick = np.exp(-since / 0.08) - np.exp(-since / 0.03)
    shape = np.where(late, -kick, kick)
    return shape / np.std(shape)


def narrow(random: np.random.Generator, count: int, period: float, damping: float) -> Array:
    """Noise through a resonance of unit gain in its sum, as of a rolling ship."""
    omega = 2 * np.pi / period
    a = 2 * np.exp(-damping * omega) * np.cos(omega * np.sqrt(1 - damping**2))
    b = -np.exp(-2 * damping * omega)
    settle = int(10 / (damping * omega))
    return lfilter([1], [1, -a, -b], random.standard_normal(count + settle))[settle:]


def resonance_deviation(period: float, damping: float) -> float:
    """Stationary deviation of `narrow`: that of a second-order autoregression (Box and Jenkins)."""
    omega = 2 * np.pi / period
    a = 2 * np.exp(-damping * omega) * np.cos(omega * np.sqrt(1 - damping**2))
    b = -np.exp(-2 * damping * omega)
    return float(np.sqrt((1 - b) / ((1 + b) * ((1 - b) ** 2 - a**2))))


Draw = Callable[[np.random.Generator], bool]


def coverage(cases: dict[str, Draw], count: int, seed: int) -> dict[str, list[bool]]:
    held = {}
    for number, (case, draw) in enumerate(cases.items()):
        random = np.random.default_rng([seed, number])
        held[case] = [draw(random) for _ in range(count)]
    return held


@draws(250)
def test_half_cycles_hold_the_error_of_the_trial(count: int) -> None:
    """Noise that remembers a fifth of a half cycle costs one or two percent."""

    def case(cycles: int, level: float, memory: float) -> Draw:
        shape = friction_error(cycles)
        truth = float(np.sqrt(1.0 + level**2))

        def draw(random: np.random.Generator) -> bool:
            noise = level * autoregressive(random, len(shape), memory)
            return holds(over_cycles(shape + noise, PER_CYCLE), truth)

        return draw

    cases = {
        f"{cycles} cycles, noise {level}, memory {memory}": case(cycles, level, memory)
        for cycles in (1, 2, 3, 6)
        for level in (0.05, 0.5)
        for memory in (0.0, 0.8)
    }
    assert rejected(coverage(cases, count, 510)) == {}
    long = {f"{cycles} cycles": case(cycles, 0.5, 0.95) for cycles in (2, 3, 6)}
    assert rejected(coverage(long, count, 516), "less", 0.93) == {}


@draws(250)
def test_blocks_hold_the_error_of_an_irregular_motion(count: int) -> None:
    """Of narrow-band noise they hold a little less, 91 %, with only six periods in a block."""

    def case(periods: int, damping: float) -> Draw:
        truth = resonance_deviation(40.0, damping)

        def draw(random: np.random.Generator) -> bool:
            while not (found := over_blocks(narrow(random, 40 * periods, 40.0, damping))).low:
                pass  # refused: its blocks are too short
            return holds(found, truth)

        return draw

    def broad(random: np.random.Generator) -> bool:
        return holds(over_blocks(autoregressive(random, 3000, 0.8)), 1.0)

    assert rejected(coverage({"broad": broad}, count, 511)) == {}
    cases = {f"{p} periods, damping {d}": case(p, d) for p, d in ((37, 0.1), (150, 0.1), (37, 0.3))}
    assert rejected(coverage(cases, count, 512), "less", 0.92) == {}


@draws(250)
def test_trials_hold_what_they_have_in_common_and_so_do_their_ratios(count: int) -> None:
    """Welch's ratios hold a little more than they promise, 96 % with three trials each."""

    def lognormal(
        random: np.random.Generator, size: int, deviation: float, mean: float
    ) -> Estimate:
        return over_trials(estimates(mean * np.exp(deviation * random.standard_normal(size))))

    def mean_of(size: int) -> Draw:
        return lambda random: holds(lognormal(random, size, 0.01, 2e-3), 2e-3)

    def ratio_of(size: int) -> Draw:
        def draw(random: np.random.Generator) -> bool:
            one = lognormal(random, size, 0.01, 2e-3)
            return holds(quotient("r", one, lognormal(random, size, 0.008, 1e-3)), 2.0)

        return draw

    def of_half_cycles(random: np.random.Generator) -> bool:
        shape = friction_error(4)
        with_noise = [
            over_cycles(shape + level * autoregressive(random, len(shape), 0.8), PER_CYCLE)
            for level in (0.3, 0.1)
        ]
        return holds(decrease("d", *with_noise), float(1 - np.sqrt(1.09 / 1.01)))

    means = {f"mean of {n}": mean_of(n) for n in (2, 3, 5)}
    assert rejected(coverage(means, count, 513)) == {}
    ratios = {f"ratio of {n}": ratio_of(n) for n in (3, 5)}
    ratios["decrease, half cycles"] = of_half_cycles
    assert rejected(coverage(ratios, count, 514), "less") == {}
