"""Rise time of one noisy step, with its interval.

A parabola is fitted to the response around each time near a level. The interval of a crossing
contains the times at which the parabola differs from the level by no more than chance (test
inversion: a flat approach results in an asymmetric interval). Newcombe's square-and-add combines
both crossings. Coverage of 95 % intervals: 94 to 99 % (200 seeds each, loops of first and second
order, white noise of 0.3 to 5 % of the step).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import LEVEL, shifted_by, student
from campaign.estimation.least_squares import straight_line
from campaign.estimation.step_response import HIGH, LOW, SCATTERS, StepCharacteristics
from campaign.reason import Cause

METHOD = "parabolas around 10 and 90 %, and where they may cross these for the recording's noise"
QUIET = 1e-4
"""Noise over step height below which the recording counts as noise-free."""
FEWEST = 30
"""Fewest samples of a standstill for an estimate of the noise and its correlation."""
DEGREE = 2
"""Degree of the polynomials of the local fit."""
WIDTH = 0.25
"""Largest half-width of a parabola over the rise time."""
NOISY = 0.01
"""Noise over step height from which on parabolas have the full width. With less noise they are
narrower: then the curvature of the response dominates their error."""
BENDS = "bends of the response"
"""Source of the systematic part: the change by parabolas of half the width (friction)."""
FINE = 100
"""Number of parabolas in a rise time."""
SHORT_STANDSTILL = Cause(
    "standstill too short",
    "the standstill before it has fewer than {samples} samples to estimate its noise",
)
HIDDEN_LEVEL = Cause(
    "level hidden by noise",
    SCATTERS + ", which hides when it reaches {level_percent:.0f} %",
)


@dataclass(frozen=True)
class _Crossing:
    """Time of a crossing (s), and the distances (s) to the ends of its interval."""

    at: float
    before: float
    after: float


def rise_interval(
    time: Array, response: Array, start: float, step: float, found: StepCharacteristics
) -> tuple[Estimate, float] | None:
    """Rise time (s) from 10 to 90 % of a step, and the start of the rise (s); None without noise.

    Not determined, with the reason, where noise hides the crossing of a level. Without an interval
    where the standstill is too short to estimate small noise.

    Args:
        time, response: shape (n,), starting before the step at `start` (s); `step` is its height.
        found: characteristics of this step, with a rise time.
    """
    known = np.isfinite(response)
    time, response = time[known], response[known]
    rest = response[time < start]
    if found.noise < QUIET:
        return None
    if len(rest) < FEWEST:
        few = SHORT_STANDSTILL(samples=FEWEST)
        plain = found.rise_time if found.noise <= NOISY else math.nan
        return Estimate.without_interval("rise_time", plain, "s", few), found.rise_from
    share = (response - float(np.mean(rest))) / step
    scatter, lasting = _noise(rest / step)
    error = max(scatter, found.noise) * lasting
    zero = error / math.sqrt(len(rest))
    quantile = student(len(rest) - 2)
    spacing = float(np.median(np.diff(time)))
    narrow = min(1.0, math.sqrt(found.noise / NOISY))
    half = max(WIDTH * narrow * found.rise_time, 2.5 * spacing)

    def crossed(level: float, about: float, half: float) -> _Crossing | None:
        at = np.arange(
            max(start, about - found.rise_time), about + found.rise_time, found.rise_time / FINE
        )
        value, weight = _parabolas(time[time >= start], share[time >= start], at, half)
        bound = quantile * np.hypot(error * weight, zero)
        return _crossing(at, value - level, bound, about)

    places = ((LOW, found.rise_from), (HIGH, found.rise_from + found.rise_time))
    first, last = (crossed(level, about, half) for level, about in places)
    if first is None or last is None:
        hidden = LOW if first is None else HIGH
        reason = HIDDEN_LEVEL(noise_percent=100 * found.noise, level_percent=100 * hidden)
        return Estimate.without_interval("rise_time", math.nan, "s", reason), math.nan
    rise = _between(first, last)
    early, late = (crossed(level, about, 0.5 * half) for level, about in places)
    if early is not None and late is not None:
        narrower = _between(early, late)
        # The variance of the difference between an efficient mean and another one is the
        # difference of their variances (Hausman, Econometrica 46 (1978) 1251).
        chance = (narrower.half_width**2 - rise.half_width**2) / quantile**2
        square = (narrower.value - rise.value) ** 2 - max(chance, 0.0)
        rise = shifted_by(rise, BENDS, math.sqrt(max(square, 0.0)))
    return rise, first.at


def _between(first: _Crossing, last: _Crossing) -> Estimate:
    """Time between two crossings (s)."""
    rise = last.at - first.at
    low = rise - math.hypot(last.before, first.after)
    high = rise + math.hypot(last.after, first.before)
    return Estimate("rise_time", rise, "s", low, high, LEVEL, METHOD)


def _noise(rest: Array) -> tuple[float, float]:
    """Standard deviation about a line, and deviation of a mean over that with white noise."""
    left = rest - straight_line(rest)
    square = float(left @ left)
    if square == 0.0:
        return 0.0, 1.0
    correlation = float(left[1:] @ left[:-1]) / square
    # Residuals are less correlated than noise.
    correlation += (1.0 + 4.0 * max(correlation, 0.0)) / len(rest)
    correlation = min(max(correlation, 0.0), 0.95)
    return math.sqrt(square / (len(rest) - 2)), math.sqrt((1.0 + correlation) / (1.0 - correlation))


def _parabolas(time: Array, share: Array, at: Array, half: float) -> tuple[Array, Array]:
    """Values at the times `at` of parabolas through the samples within `half` (s) of each.

    The second array has their standard errors over that of a sample; both (m,), NaN for too few.
    """
    value, weight = np.full(len(at), np.nan), np.full(len(at), np.nan)
    first = np.searchsorted(time, at - half)
    stop = np.searchsorted(time, at + half, side="right")
    for k, (low, high) in enumerate(zip(first.tolist(), stop.tolist(), strict=True)):
        if high - low < DEGREE + 2:
            continue
        powers = np.vander((time[low:high] - at[k]) / half, DEGREE + 1, increasing=True)
        row = np.linalg.pinv(powers)[0]
        value[k], weight[k] = row @ share[low:high], np.linalg.norm(row)
    return value, weight


def _crossing(at: Array, off: Array, bound: Array, about: float) -> _Crossing | None:
    """Rise of `off` through zero nearest to `about`, with the range where it is within `bound`.

    None where it does not rise through zero, or the range extends to the last value.
    """
    rising = np.flatnonzero((off[:-1] < 0) & (off[1:] >= 0))
    if not len(rising):
        return None
    k = int(rising[np.argmin(np.abs(at[rising] - about))])
    when = _zero(at, off, k)
    low, high = off + bound, off - bound
    below = np.flatnonzero(low[: k + 1] <= 0)
    above = np.flatnonzero(high[k + 1 :] >= 0)
    if not len(above):
        return None
    # The response does not rise before the step.
    begin = _zero(at, low, int(below[-1])) if len(below) else float(at[0])
    return _Crossing(when, when - begin, _zero(at, high, k + int(above[0])) - when)


def _zero(at: Array, values: Array, k: int) -> float:
    """Zero of the line from value k to the next."""
    return float(at[k] - values[k] * (at[k + 1] - at[k]) / (values[k + 1] - values[k]))
