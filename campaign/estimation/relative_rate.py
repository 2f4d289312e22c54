"""Rate of the load relative to the hull, from quantized sensors.

A difference of encoder counts is a series of spikes of one count per sample. A straight line
through a window of counts has the slope of the motion. It is symmetric in time: it has no delay,
and is exact for a constant acceleration. The length of the window follows from one count and the
smallest rate to resolve (`window_for`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.time_stuck import SIGMAS, count_of, noise_of

WORST_COUNT = 1.5
"""Largest slope that one count at any place of a window adds, in counts per window."""
SHORTEST = 3
"""Fewest samples of a line; fewer have no middle."""
STOP_FACTOR = 4.0
"""Rate that ends a torque ramp, over the threshold of sliding: enough to show the sliding."""
STOP_COUNTS = 2.0
"""Fewest counts of the rate that end a torque ramp: a creeping load shows one at a time."""
LONGEST = 0.2
"""Longest smoothing of a rate of counts on a ramp (s): a load accelerates within such a time."""


@dataclass(frozen=True)
class RelativeRate:
    """Relative rate and its origin.

    Attributes:
        values: rad/s, shape (n,); NaN within half a window of the ends and of lost samples.
        window: length of the filter (s); 0 for the recorded rate.
        finest: smallest rate (rad/s) that the sensor resolves; 0 where it is negligible.
        blind: angle (rad) within which the sensor sees no motion: one count of an encoder, else 0.
        sensor: `encoder`, or `gyro` for the difference of the rates of load and hull in space.
    """

    values: Array
    window: float
    finest: float
    blind: float
    sensor: str


def slope(angle: Array, step: float, span: int) -> Array:
    """Rate (rad/s) of an angle (rad): slope of a line through `span` samples around each sample.

    Args:
        angle: shape (n,).
        step: between samples (s).
        span: odd, at least 3.

    Returns: shape (n,); NaN where the window exceeds the ends or includes a lost sample.

    The weights are odd about the middle (Savitzky and Golay, Analytical Chemistry 36 (1964) 1627,
    first and second order): zero phase shift, and the exact rate of a parabola.
    """
    half = span // 2
    places = np.arange(-half, half + 1)
    return _centred(angle, -places / (step * float(np.sum(places**2))))


def mean(rate: Array, span: int) -> Array:
    """Mean of `span` (odd) samples around each sample, shape (n,); NaN as in `slope`."""
    return _centred(rate, np.full(span, 1.0 / span))


def _centred(samples: Array, weights: Array) -> Array:
    """Convolution with an odd number of weights; NaN where a sample is missing."""
    values = np.full(len(samples), np.nan)
    half = len(weights) // 2
    if len(samples) >= len(weights):
        values[half : len(samples) - half] = np.convolve(samples, weights, mode="valid")
    return values


def window_for(count: float, noise: float, step: float, finest: float) -> int:
    """Samples (odd) of a line whose slope error is below `finest` (rad/s); 1: no line needed.

    A staircase deviates from its motion by at most half a count: `WORST_COUNT` counts per window
    in the slope. White noise of n samples adds sqrt(12 / n^3) standard deviations per step.

    Args:
        count: one count of the angle (rad).
        noise: standard deviation of the angle (rad).
    """
    if not count > finest * step and not SIGMAS * noise > finest * step:
        return 1
    staircase = WORST_COUNT * count / (finest * step)
    noisy = (math.sqrt(12.0) * SIGMAS * noise / (finest * step)) ** (2.0 / 3.0)
    return _odd(max(staircase, noisy, SHORTEST))


def relative_rate(
    recorded: Array,
    angle: Array | None,
    gyro: Array | None,
    base: Array,
    step: float,
    finest: float,
    longest: float,
) -> RelativeRate:
    """Relative rate by the sensor that resolves `finest` (rad/s) in a window of `longest` (s).

    The order is: encoder; difference of the rates in space; if neither resolves `finest`, encoder
    over the longest window with a coarser resolution.

    Args:
        recorded: relative rate from the rig (rad/s); all arrays have shape (n,).
        angle: of the encoder (rad); None if not recorded.
        gyro: rate of the load in space (rad/s); None if not recorded.
        base: rate of the hull in space (rad/s).
        step: between samples (s).
    """
    most = max(SHORTEST, 2 * int(0.5 * longest / step) - 1)
    counted = recorded if angle is None else angle
    count, noise = _resolution(counted)
    if angle is None:
        needed = _mean_of(count, noise, finest)
    else:
        needed = window_for(count, noise, step, finest)
    if needed == 1:
        return RelativeRate(recorded, 0.0, 0.0, 0.0, "encoder")
    if needed > most and gyro is not None:
        span = _mean_of(*_resolution(gyro), finest)
        if span <= most:
            window = span * step if span > 1 else 0.0
            return RelativeRate(mean(gyro - base, span), window, finest, 0.0, "gyro")
    span = min(needed, most)
    if angle is None:
        reached = max(count, SIGMAS * noise) / math.sqrt(span)
        return RelativeRate(mean(recorded, span), span * step, max(finest, reached), 0.0, "encoder")
    noisy = math.sqrt(12.0) * SIGMAS * noise / (step * span**1.5)
    reached = max(finest, WORST_COUNT * count / (span * step), noisy)
    return RelativeRate(slope(angle, step, span), span * step, reached, count, "encoder")


def resolved_rate(
    rate: Array,
    angle: Array | None,
    step: float,
    finest: float,
    longest: float,
    *,
    own_sensor: bool,
) -> RelativeRate:
    """Rate of an axis with a hull at rest, by the sensor that resolves `finest` in the shortest
    window, else by the sensor with the best resolution.

    Args:
        rate, angle: rad/s, rad; shape (n,); `angle` is None if not recorded.
        own_sensor: whether the rate has its own sensor, and is not made of the angle's counts.
        step, finest, longest: as for `relative_rate`.
    """
    still = np.zeros_like(rate)
    by_rate = relative_rate(rate, None, None, still, step, finest, longest)
    if angle is None:
        return by_rate
    by_angle = relative_rate(rate, angle, None, still, step, finest, longest)
    if not own_sensor:
        return by_angle
    return min(by_rate, by_angle, key=lambda each: (max(each.finest, finest), each.window))


def stop_rate(sliding: float, count: float) -> float:
    """Rate (rad/s) that ends a torque ramp, from the threshold of sliding and one count."""
    return max(STOP_FACTOR * sliding, STOP_COUNTS * count)


def slides_from(rate: Array, threshold: float) -> tuple[int, int] | None:
    """First sample and stop of the samples that show sliding; None where the load never slides.

    Sliding begins where the magnitude of the rate, shape (n,), stays at `threshold` (rad/s) or
    above until it exceeds `STOP_FACTOR` times that or the recording ends. Creep and noise fall
    below it again. NaN has no influence.
    """
    size = np.abs(rate)
    fast = np.flatnonzero(size > STOP_FACTOR * threshold)
    stop = int(fast[0]) + 1 if len(fast) else len(size)
    slow = np.append(-1, np.flatnonzero(size[:stop] < threshold))
    sliding = np.flatnonzero(size[slow[-1] + 1 : stop] >= threshold)
    return (int(slow[-1] + 1 + sliding[0]), stop) if len(sliding) else None


def made_of_counts(rate: Array, angle: Array, step: float) -> bool:
    """Whether one count of a rate (rad/s) exceeds half a count of the angle (rad) per sample."""
    return 2.0 * count_of(rate) * step > count_of(angle) > 0.0


def _resolution(samples: Array) -> tuple[float, float]:
    """One count and the noise of a recorded channel, without lost samples."""
    known = samples[np.isfinite(samples)]
    return count_of(known), noise_of(known)


def _mean_of(count: float, noise: float, finest: float) -> int:
    """Samples (odd) whose mean resolves `finest`, for independent errors."""
    return _odd((max(count, SIGMAS * noise) / finest) ** 2)


def _odd(samples: float) -> int:
    """The next odd number of samples."""
    return 2 * math.ceil(0.5 * (max(samples, 1.0) - 1.0)) + 1
