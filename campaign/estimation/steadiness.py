"""Whether a window of sliding is steady within its sensors' resolution.

The rate decides. Friction bends over the rate, so that its mean over a rate that varies by a share
s (1 sigma) is off by up to s^2 of Ts - Tc (half of the curve's second derivative, at its largest).
The rate is smoothed until its sensor tells a twentieth of its mean; what then varies, varies. A
torque that varies at a constant rate moves no point: batch means have it in the interval. Only its
trend is reported.
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
"""Share of its mean by which the rate may vary in a window (1 sigma): 1 % of Ts - Tc at most."""
RESOLVED = 0.5 * VARIES
"""Share of the mean rate that a sensor has to tell, smoothed over a tenth of the window at most."""
CHANCE = 4.0
"""times the variance of its sensor that a smoothed rate may have: chi-square of the ten means of a
window is below 3.3 times their number in 99.9 % of cases."""
STICKS = 0.25
"""Share of the mean rate below which the load all but sticks."""
DRIFTS = 0.25
"""Share of its mean by which a rate may change across a window, be uncertain, or miss its
command."""
FEWEST_COUNTS = 10.0
"""of the sensor that a window spans."""
TORQUE_DRIFT = 0.01
"""Share of its mean by which the torque may change across a window without a word ..."""
SURE = 0.99
"""... and how sure that has to be."""

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
    """Why a window is no steady sliding, as far as its samples show; `NONE` where they do not.

    Args:
        time, rate: s, rad/s; shape (n,), n at least 3, lost samples left out.
        angle: by an encoder (rad), shape (n,); None where nobody recorded it.
        own_sensor: whether the rate has a sensor of its own, and is not made of the angle.
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
    there = np.isfinite(values)
    columns = np.column_stack([np.ones_like(time), time - time.mean()])[there]
    if there.sum() <= columns.shape[1]:
        return NONE
    values = values[there]
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
    """The rate, smoothed until its sensor tells a twentieth of its mean; arguments as above.

    Its values are at the samples, shape (n,), NaN where smoothing has none.
    """
    step = float(np.median(np.diff(time)))
    # Evenly, and NaN where samples were lost: smoothing goes by their number.
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
    """Why a mean rate is none of steady sliding: its change across the window, or its interval.

    All in one unit; `half_width` is NaN where there is no interval. A load that is stuck creeps at
    a rate of its own, which is not the `commanded` one, where that is known.
    """
    if commanded is not None and abs(mean - commanded) > DRIFTS * abs(commanded):
        return NOT_REACHED(percent=100.0 * mean / commanded if commanded else math.inf)
    if abs(change) > DRIFTS * abs(mean):
        return RATE_DRIFTS(percent=100.0 * abs(change / mean) if mean else math.inf)
    if half_width > DRIFTS * abs(mean):
        return RATE_UNCERTAIN(percent=100.0 * half_width / abs(mean) if mean else math.inf)
    return NONE


def torque_drift(torque: Array, modelled: Array | None = None) -> Reason:
    """Whether a torque, shape (n,), changes across its window by more than it scatters; by batches.

    Running-in does that, warming, and a ripple that is longer than the window. `modelled`, shape
    (n, m), is fitted beside the change: what is known to vary over position.
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
    found = np.linalg.lstsq(rows, means[:, 0], rcond=None)[0]
    left, freedom = means[:, 0] - rows @ found, BATCHES - rows.shape[1]
    variance = float(left @ left) / freedom * float(np.linalg.pinv(rows.T @ rows)[1, 1])
    change, mean = float(found[1]), float(np.mean(torque))
    if abs(change) <= max(TORQUE_DRIFT * abs(mean), student(freedom, SURE) * math.sqrt(variance)):
        return NONE
    return TORQUE_DRIFTS(percent=100.0 * change / mean if mean else math.inf)


def _counts(rate: Array, angle: Array | None, travel: float, step: float) -> float:
    """Counts within a window: of an encoder, or of a rate as if it were made of counts."""
    count = count_of(rate) * step if angle is None else count_of(angle)
    return travel / count if count > 0 else math.inf


def _spread_out(values: Array, place: NDArray[np.int64]) -> Array:
    """Each value at its place, NaN elsewhere."""
    found = np.full(int(place[-1]) + 1, np.nan)
    found[place] = values
    return found
