"""Whether a window of sliding is steady within its sensors' resolution.

The criterion is the rate. Friction is a curve over the rate: with a relative variation s (1 sigma)
of the rate, the error of its mean is at most s^2 of Ts - Tc (half of the curve's largest second
derivative). The rate is smoothed until its sensor resolves a twentieth of its mean; the remaining
variation is real. A torque that varies at a constant rate does not shift a point, and the interval
from batch means includes it. Only its trend is reported.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimation.intervals import BATCHES, student
from campaign.estimation.relative_rate import RelativeRate, resolved_rate
from campaign.estimation.time_stuck import SIGMAS, count_of
from campaign.reason import NONE, Cause, Reason

VARIES = 0.1
"""Largest relative variation of the rate in a window (1 sigma): an error of at most 1 % of Ts - Tc.
"""
RESOLVED = 0.5 * VARIES
"""Share of the mean rate to be resolved by smoothing over at most a tenth of the window."""
CHANCE = 4.0
"""Largest variance of a smoothed rate by its sensor, as a multiple: chi-square of the ten means of
a window is below 3.3 times their number in 99.9 % of cases."""
STICKS = 0.25
"""Share of the mean rate below which the load almost sticks."""
DRIFTS = 0.25
"""Largest relative change of a rate across a window, uncertainty, or deviation from its command."""
FEWEST_COUNTS = 10.0
"""Fewest counts of the sensor in a window."""
TORQUE_DRIFT = 0.01
"""Relative change of the torque across a window above which it is reported, if significant."""
SURE = 0.99
"""Confidence of a significant change."""

TOO_FEW_COUNTS = Cause(
    "too few counts", "the window spans {counts:.2g} counts of the sensor, and needs {needs:.2g}"
)
STICK_SLIP = Cause(
    "stick-slip",
    "the rate varies by {spread_percent:.2g} % of its mean (1σ), down to {least_percent:.2g} %",
)
RATE_VARIES = Cause(
    "rate not constant",
    "the rate varies by {spread_percent:.2g} % of its mean (1σ), down to {least_percent:.2g} %",
)
RATE_DRIFTS = Cause("rate drifts", "the rate changes by {percent:.2g} % across the window")
NOT_REACHED = Cause("speed not reached", "the mean rate is {percent:.2g} % of what was commanded")
RATE_UNCERTAIN = Cause("rate uncertain", "the mean rate is uncertain by {percent:.2g} %")
TORQUE_DRIFTS = Cause("torque drifts", "the torque changes by {percent:.2g} % across the window")


def unsteady(
    time: Array,
    rate: Array,
    angle: Array | None,
    *,
    own_sensor: bool = True,
) -> Reason:
    """Reason why a window is not steady sliding, from its samples; `NONE` without one.

    Args:
        time, rate: s, rad/s; shape (n,), n at least 3, without missing samples.
        angle: by an encoder (rad), shape (n,); None: not recorded.
        own_sensor: whether the rate has its own sensor and is not derived from the angle.
    """
    mean = abs(float(np.mean(rate)))
    if mean < np.finfo(float).tiny:
        return RATE_UNCERTAIN(percent=math.inf)
    step = float(np.median(np.diff(time)))
    duration = step + float(np.ptp(time))
    counts = _counts(rate, None if own_sensor else angle, mean * duration, step)
    if counts < FEWEST_COUNTS:
        return TOO_FEW_COUNTS(counts=counts, needs=FEWEST_COUNTS)
    seen = seen_rate(time, rate, angle, own_sensor=own_sensor)
    values = seen.values
    known = np.isfinite(values)
    columns = np.column_stack([np.ones_like(time), time - time.mean()])[known]
    if known.sum() <= columns.shape[1]:
        return NONE
    values = values[known]
    left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    square, explained = float(np.mean(left**2)), (seen.finest / SIGMAS) ** 2
    if square <= (VARIES * mean) ** 2 + CHANCE * explained:
        return NONE
    least = float(np.min(values * np.sign(np.mean(rate)))) / mean
    cause = STICK_SLIP if least < STICKS else RATE_VARIES
    return cause(
        spread_percent=100.0 * math.sqrt(square - explained) / mean, least_percent=100.0 * least
    )


def seen_rate(
    time: Array, rate: Array, angle: Array | None, *, own_sensor: bool = True
) -> RelativeRate:
    """Rate, smoothed until its sensor resolves a twentieth of its mean; arguments of `unsteady`.

    Its values are at the samples, shape (n,), NaN where smoothing has no value.
    """
    step = float(np.median(np.diff(time)))
    # Evenly spaced, NaN for missing samples: smoothing depends on the number of samples.
    place = np.round((time - time[0]) / step).astype(int)
    seen = resolved_rate(
        _spread_out(rate, place),
        None if angle is None else _spread_out(angle, place),
        step,
        RESOLVED * abs(float(np.mean(rate))),
        0.1 * (step + float(np.ptp(time))),
        own_sensor=own_sensor,
    )
    return replace(seen, values=seen.values[place])


def drifting(
    change: float, half_width: float, mean: float, commanded: float | None = None
) -> Reason:
    """Reason why a mean rate is not that of steady sliding: its change, interval or command.

    All in one unit; `half_width` is NaN without an interval. A stuck load creeps at a rate that
    differs from the `commanded` one (None: unknown).
    """
    if commanded is not None and abs(mean - commanded) > DRIFTS * abs(commanded):
        return NOT_REACHED(percent=100.0 * mean / commanded if commanded else math.inf)
    if abs(change) > DRIFTS * abs(mean):
        return RATE_DRIFTS(percent=100.0 * abs(change / mean) if mean else math.inf)
    if half_width > DRIFTS * abs(mean):
        return RATE_UNCERTAIN(percent=100.0 * half_width / abs(mean) if mean else math.inf)
    return NONE


def torque_drift(torque: Array, modelled: Array | None = None) -> Reason:
    """Significant change of a torque, shape (n,), across its window, by batch means; or `NONE`.

    Causes: running-in, warming, a ripple longer than the window. `modelled`: columns of a known
    variation over position, shape (n, m), fitted together with the change.
    """
    size = len(torque) // BATCHES
    if size == 0:
        return NONE
    line = np.linspace(-0.5, 0.5, len(torque))
    parts = [np.ones_like(torque), line]
    columns = np.column_stack(parts if modelled is None else [*parts, modelled])
    means, rows = (
        each[: size * BATCHES].reshape(BATCHES, size, -1).mean(axis=1) for each in (torque, columns)
    )
    fit = np.linalg.lstsq(rows, means[:, 0], rcond=None)[0]
    left, freedom = means[:, 0] - rows @ fit, BATCHES - rows.shape[1]
    variance = float(left @ left) / freedom * float(np.linalg.pinv(rows.T @ rows)[1, 1])
    change, mean = float(fit[1]), float(np.mean(torque))
    if abs(change) <= max(TORQUE_DRIFT * abs(mean), student(freedom, SURE) * math.sqrt(variance)):
        return NONE
    return TORQUE_DRIFTS(percent=100.0 * change / mean if mean else math.inf)


def _counts(rate: Array, angle: Array | None, travel: float, step: float) -> float:
    """Number of counts in a window: of an encoder, or of a quantized rate."""
    count = count_of(rate) * step if angle is None else count_of(angle)
    return travel / count if count > 0 else math.inf


def _spread_out(values: Array, place: NDArray[np.int64]) -> Array:
    """Each value at its place, NaN elsewhere."""
    spread = np.full(int(place[-1]) + 1, np.nan)
    spread[place] = values
    return spread
