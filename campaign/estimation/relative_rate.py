"""Rate of the load relative to the hull, from quantized sensors.

A difference of encoder counts is a row of spikes, each one count per sample high. A straight line
through a window of counts has the slope of the motion: it is the same backwards in time, so that
it delays nothing, and it leaves what moves at a constant acceleration as it is. How long the window
has to be follows from one count and from how small a rate is to be seen (`window_for`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.time_stuck import SIGMAS, count_of, noise_of

WORST_COUNT = 1.5
"""Slope that one count, wherever in a window, adds at most: times a count per window."""
SHORTEST = 3
"""Samples of a line; fewer have no middle."""
STOP_FACTOR = 4.0
"""Rate that ends a torque ramp, over the rate that counts as sliding: enough to see it slide."""
STOP_COUNTS = 2.0
"""Counts of the rate that end a torque ramp, at least: a load that creeps shows one at a time."""
LONGEST = 0.2
"""s over which a rate of counts is smoothed on a ramp, at most: a load gathers speed as fast."""


@dataclass(frozen=True)
class RelativeRate:
    """A relative rate, and how it was come by.

    Attributes:
        values: rad/s, shape (n,); NaN within half a window of the ends and of lost samples.
        window: of the filter (s); 0 for the rate as it was recorded.
        finest: rate (rad/s) below which the sensor tells nothing apart; 0 where it is negligible.
        blind: angle (rad) within which the sensor sees no motion: one count of an encoder, else 0.
        sensor: `encoder`, or `gyro` for the difference of the load's and the hull's rate in space.
    """

    values: Array
    window: float
    finest: float
    blind: float
    sensor: str


def slope(angle: Array, step: float, span: int) -> Array:
    """Rate (rad/s) of an angle (rad): the slope of a line through `span` samples around each.

    Args:
        angle: shape (n,).
        step: between samples (s).
        span: odd, at least 3.

    Returns: shape (n,); NaN where the window reaches beyond the ends or over a lost sample.

    Its weights are odd about the middle (Savitzky and Golay, Analytical Chemistry 36 (1964) 1627,
    of first and second order): no phase, and the exact rate of a parabola.
    """
    half = span // 2
    places = np.arange(-half, half + 1)
    return _centred(angle, -places / (step * float(np.sum(places**2))))


def mean(rate: Array, span: int) -> Array:
    """Mean of `span` samples around each (odd), shape (n,); NaN as in `slope`."""
    return _centred(rate, np.full(span, 1.0 / span))


def _centred(samples: Array, weights: Array) -> Array:
    """Convolution with odd many weights; NaN where not all of them meet a sample."""
    values = np.full(len(samples), np.nan)
    half = len(weights) // 2
    if len(samples) >= len(weights):
        values[half : len(samples) - half] = np.convolve(samples, weights, mode="valid")
    return values


def window_for(count: float, noise: float, step: float, finest: float) -> int:
    """Samples (odd) of a line whose slope is wrong by less than `finest` (rad/s), or 1 for none.

    A staircase is off its motion by half a count at most, which turns the line by `WORST_COUNT`
    counts per window; white noise of n samples turns it by sqrt(12 / n^3) standard deviations.

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
    """The relative rate by the sensor that shows `finest` (rad/s) within a window of `longest` (s).

    The encoder if it does; else the difference of the rates in space, if that does; else the
    encoder over the longest window, as fine as it then is.

    Args:
        recorded: the relative rate as the rig tells it (rad/s), all of shape (n,).
        angle: of the encoder (rad); None where it was not recorded.
        gyro: rate of the load in space (rad/s); None where it was not recorded.
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
    """The rate of an axis whose hull rests, by the sensor that shows `finest` within the shortest
    time; else by the one that comes nearest to it.

    Args:
        rate, angle: rad/s, rad; shape (n,); `angle` None where nobody recorded it.
        own_sensor: whether the rate has a sensor of its own, and is not made of the angle's counts.
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
    """Rate (rad/s) that ends a torque ramp, by what counts as sliding and one count of the rate."""
    return max(STOP_FACTOR * sliding, STOP_COUNTS * count)


def slides_from(rate: Array, threshold: float) -> tuple[int, int] | None:
    """First sample of sliding and the stop of what shows it; None where the load never slides.

    It slides once its rate, shape (n,), either way, stays at `threshold` (rad/s) or above until it
    is `STOP_FACTOR` times as fast or the recording ends. What creeps, or scatters, comes back. NaN
    is neither.
    """
    size = np.abs(rate)
    fast = np.flatnonzero(size > STOP_FACTOR * threshold)
    stop = int(fast[0]) + 1 if len(fast) else len(size)
    slow = np.append(-1, np.flatnonzero(size[:stop] < threshold))
    sliding = np.flatnonzero(size[slow[-1] + 1 : stop] >= threshold)
    return (int(slow[-1] + 1 + sliding[0]), stop) if len(sliding) else None


def made_of_counts(rate: Array, angle: Array, step: float) -> bool:
    """Whether one count of a rate (rad/s) is as large as a count of the angle (rad) per sample."""
    return 2.0 * count_of(rate) * step > count_of(angle) > 0.0


def _resolution(samples: Array) -> tuple[float, float]:
    """One count and the noise of what was recorded, without lost samples."""
    known = samples[np.isfinite(samples)]
    return count_of(known), noise_of(known)


def _mean_of(count: float, noise: float, finest: float) -> int:
    """Samples (odd) whose mean tells `finest` apart, where their errors are independent."""
    return _odd((max(count, SIGMAS * noise) / finest) ** 2)


def _odd(samples: float) -> int:
    """The next odd number of samples."""
    return 2 * math.ceil(0.5 * (max(samples, 1.0) - 1.0)) + 1
