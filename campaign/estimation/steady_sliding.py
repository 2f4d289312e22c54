"""Friction torque of steady sliding from one window of a recording.

At constant rate the drive torque is equal to friction (Equation 4.1 without acceleration). The mean
drive torque, less J times the residual acceleration, is one point of a velocity map. Where J is
unknown, the point includes the inertial torque.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import BATCHES, of_series, with_error
from campaign.estimation.ripple import LEAST_PERIODS, harmonics_of
from campaign.estimation.steadiness import drifting, seen_rate, torque_drift, unsteady
from campaign.reason import NONE, Reason

METHOD = "mean drive torque over the way less J times residual acceleration, errors of 10 batches"
WITHOUT_INERTIA = "mean drive torque with what the residual acceleration takes, from 10 batches"


@dataclass(frozen=True)
class SteadySliding:
    """Steady sliding in one window; SI, signed.

    Attributes:
        rate: mean rate (rad/s).
        torque: friction torque (N m); its standard error is that of the window alone, with the
            drive torque's autocorrelation and the error of the residual acceleration.
        spread: of the drive torque's samples (N m, 1 sigma).
        acceleration: residual acceleration (rad/s²), the slope of the rate over the window.
        effective: effective number of independent samples.
        first, last: angles at both ends of the window (rad); NaN without `angle`.
        unsteady: why it is no steady sliding.
        drift: significant change of the torque across the window, or `NONE`.
    """

    rate: Estimate
    torque: Estimate
    spread: float
    acceleration: float
    effective: float
    first: float
    last: float
    unsteady: Reason
    drift: Reason


def steady_sliding(
    time: Array,
    rate: Array,
    torque: Array,
    angle: Array | None,
    inertia: float | None,
    periods: float | None = None,
    *,
    own_sensor: bool = True,
    commanded: float | None = None,
) -> SteadySliding:
    """Rate and friction torque of a settled window.

    The deviation excludes a ripple over position, where the window spans most of a period: it is no
    noise, and would increase the errors of fast points, which average it. The load is slow where
    friction is large, so that the mean over time is too large (by 0.2 to 0.7 % on two rigs with
    rates that varied by 9 to 35 %). Therefore the torque is the mean over the path.

    Args:
        time, rate, torque: s, rad/s, N m; shape (n,).
        angle: of the load (rad), shape (n,); None: not recorded.
        inertia: J (kg m²); None: unknown.
        periods: of the ripple per revolution; None: unknown.
        own_sensor: whether the rate has its own sensor and is not derived from the angle.
        commanded: commanded rate (rad/s); None: unknown.

    Raises ValueError for fewer than 3 samples.
    """
    if len(time) < 3:
        raise ValueError(f"a window of {len(time)} samples says nothing about a mean and a slope")
    clock = time - time.mean()
    interval = float(np.ptp(time)) / (len(time) - 1)
    slope = float(clock @ rate / (clock @ clock))
    first = last = math.nan
    noise, columns = torque, None
    if angle is not None:
        line = np.polynomial.Polynomial.fit(clock, angle, 1)
        ends = clock[0] - 0.5 * interval, clock[-1] + 0.5 * interval
        first, last = float(line(ends[0])), float(line(ends[1]))
        if periods is not None and periods * abs(last - first) >= 2.0 * math.pi * LEAST_PERIODS:
            columns = harmonics_of(line(clock), periods)
            columns -= columns.mean(axis=0)
            noise = torque - columns @ np.linalg.lstsq(columns, torque, rcond=None)[0]
    of_rate = of_series("rate", rate, "rad/s")
    trouble = drifting(
        slope * float(np.ptp(time)), of_rate.half_width, float(rate.mean()), commanded
    )
    trouble = unsteady(time, rate, angle, own_sensor=own_sensor) or trouble
    # In a window shorter than a known ripple, a change is due to position.
    short = periods is not None and columns is None
    reasons = trouble, NONE if short else torque_drift(torque, columns)
    of_torque = of_series("friction_torque", noise, "N m")
    mean = _over_the_way(time, rate, torque, angle, own_sensor) - (inertia or 0.0) * slope
    spread = float(np.std(torque))
    about = rate - rate.mean() - slope * clock
    of_slope = float(np.sqrt(about @ about / max(len(time) - 2, 1) / (clock @ clock)))
    error = of_torque.standard_error
    if error is None:
        friction = Estimate.without_interval("friction_torque", mean, "N m", of_torque.reason)
        return SteadySliding(of_rate, friction, spread, slope, 1.0, first, last, *reasons)
    both = math.hypot(error, (inertia or 0.0) * of_slope)
    method = METHOD if inertia is not None else WITHOUT_INERTIA
    friction = with_error("friction_torque", mean, "N m", both, BATCHES - 1, method)
    effective = (float(np.std(noise)) / both) ** 2 if both > 0 else float(len(time))
    return SteadySliding(of_rate, friction, spread, slope, effective, first, last, *reasons)


def _over_the_way(
    time: Array, rate: Array, torque: Array, angle: Array | None, own_sensor: bool
) -> float:
    """Mean torque weighted by the smoothed rate; the mean over time for a mean rate of zero."""
    if not abs(float(rate.mean())) > np.finfo(float).tiny:
        return float(torque.mean())
    seen = seen_rate(time, rate, angle, own_sensor=own_sensor).values
    weight = np.where(np.isfinite(seen), seen, rate.mean())
    return float(weight @ torque / weight.sum())
