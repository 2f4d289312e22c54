"""Share of time in which the load sticks, within sensor resolution.

The load sticks where the relative rate is below a threshold: a share of the hull's largest rate.
Rates are smoothed until the sensor resolves that threshold. The share is not determined where so
much smoothing would hide the times stuck.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Systematic
from campaign.estimation.intervals import of_repeats
from campaign.reason import Cause
from campaign.units import rate_text

NAME = "time_stuck"
THRESHOLD = 0.001
"""Threshold over the largest rate of the hull."""
SMOOTHED = 0.01
"""Longest smoothing, as a share of one part of the record (a half cycle)."""
SIGMAS = 2.0
"""Standard deviations of the noise that must be below the threshold."""
UNRESOLVED = Cause(
    "rate not resolved",
    "no sensor resolves 0.1 % of the hull's largest rate within 1 % of a half cycle, by one count "
    "and by twice its noise",
)


@dataclass(frozen=True)
class _Rate:
    """Relative rate smoothed over `span` samples, and its sensor."""

    values: Array
    span: int
    sensor: str


def time_stuck(
    base_rate: Array, relative_angle: Array, gyro_rate: Array, step: float, parts: int
) -> Estimate:
    """Share of the time stuck, t over the parts of the record; arrays of shape (n,).

    By the encoder if its count is small enough, else by the difference of the rates of load and
    hull in space, which requires one clock for both.

    Args:
        base_rate: of the hull (rad/s).
        relative_angle: of the load relative to the hull, by the encoder (rad).
        gyro_rate: of the load in space (rad/s).
        step: between samples (s).
        parts: number of parts of the record: its half cycles.
    """
    threshold = THRESHOLD * float(np.max(np.abs(base_rate), initial=0.0))
    longest = max(SMOOTHED * len(base_rate) / max(parts, 1), 1.0)
    for rate in _rates(base_rate, relative_angle, gyro_rate, step, threshold, longest):
        if not np.all(np.isfinite(rate.values)):
            continue
        stuck = np.abs(rate.values) < threshold
        cut = np.round(np.linspace(0, len(stuck), parts + 1)).astype(int)
        shares = np.add.reduceat(stuck.astype(float), cut[:-1]) / np.diff(cut)
        estimate = of_repeats(NAME, shares, "", "half cycles")
        # Each of the two ends of a time stuck has a rectangular uncertainty by the smoothing.
        blur = rate.span * parts / len(base_rate) / math.sqrt(6.0)
        how = f"relative rate below {rate_text(threshold)} by {rate.sensor}"
        method = f"{how}, smoothed over {rate.span * step:.3g} s; {estimate.method}"
        blurred = (Systematic("smoothing of the rate", blur),)
        return replace(_share(estimate), method=method, systematic=blurred)
    return Estimate.without_interval(NAME, math.nan, "", UNRESOLVED())


def over_recordings(found: Sequence[Estimate]) -> Estimate | None:
    """Mean over several trials, t over them; None without a trial.

    The distance from 0 and 1 determines a share, not its size: 1 % ± 1 % is well determined.
    Therefore `admitted` is not used.
    """
    if len(found) < 2:
        return found[0] if found else None
    shares = [one.value for one in found]
    estimate = of_repeats(NAME, shares, "", "trials", systematic=found[0].systematic)
    return _share(estimate)


def _share(told: Estimate) -> Estimate:
    """Limit the interval by scatter to 0 ... 1; the kind `share` limits the systematic parts."""
    low = None if told.low is None else max(told.low, 0.0)
    high = None if told.high is None else min(told.high, 1.0)
    return replace(told, low=low, high=high, kind="share")


def _rates(
    base_rate: Array, angle: Array, gyro: Array, step: float, threshold: float, longest: float
) -> Iterator[_Rate]:
    """Relative rates, smoothed as their sensor requires, over at most `longest` samples.

    Noise is checked before counts, because counts require a sorted copy.
    """
    if not threshold > 0:
        return
    if np.all(np.isfinite(angle)):
        span = math.ceil(SIGMAS * math.sqrt(2.0) * noise_of(angle) / (threshold * step))
        if span <= longest and (count := count_of(angle)) > 0:
            span = max(1, span, math.ceil(count / (threshold * step)))
            if span <= longest and span < len(angle):
                yield _Rate((angle[span:] - angle[:-span]) / (span * step), span, "the encoder")
    if np.all(np.isfinite(gyro)):
        span = max(1, math.ceil((SIGMAS * noise_of(gyro) / threshold) ** 2))
        if span <= longest and span < len(gyro) and count_of(gyro) <= threshold:
            total = np.concatenate([[0.0], np.cumsum(gyro - base_rate)])
            yield _Rate((total[span:] - total[:-span]) / span, span, "the rates of load and hull")


def count_of(samples: Array) -> float:
    """One count of the sensor: the smallest difference of two values; 0 for a single value."""
    steps = np.diff(np.unique(samples))
    steps = steps[steps > 1e-9 * float(np.max(np.abs(samples), initial=0.0))]
    return float(np.min(steps)) if len(steps) else 0.0


def noise_of(samples: Array) -> float:
    """Standard deviation of white noise on smooth samples, from their third differences.

    The median excludes reversals. A third difference of noise has the variance 20 sigma^2
    (1 + 9 + 9 + 1).
    """
    if len(samples) < 8:
        return 0.0
    return float(np.median(np.abs(np.diff(samples, 3)))) / (0.6745 * math.sqrt(20.0))
