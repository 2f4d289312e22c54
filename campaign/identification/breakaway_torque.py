"""The largest friction torque of a torque ramp: the breakaway torque at that ramp rate.

Friction is the drive torque less what accelerates the load (Eq. 4.1). Around its maximum the load
creeps faster and faster until it slides, so that both parts change smoothly: the drive torque is a
line, the rate a polynomial, and friction is their difference, without a filter that would bend it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.estimate import Estimate
from campaign.identification.autocorrelated import Array, errors_of
from campaign.identification.intervals import student, with_error
from campaign.reason import Cause

DEGREE = 5
"""of the polynomial that the rate is around the maximum."""
BINS = 60
"""into which the rate is averaged around the maximum."""
REACH = 1.75
"""Half-width of what is fitted, in times that the rate takes from half of its last value to all of
it. The instability sets its own pace, 0.2 to 0.4 s on an axis of 70 kg m^2: with 1.5 to 2 of it the
polynomial bends as friction does (coverage 94 to 98 %), with 2.5 no longer (68 to 99 %)."""
FIRST_REACH = 6.0
"""The same, before the end of the ramp, where the maximum is looked for."""
SMOOTH = 0.95
"""AR(1) coefficient of the residuals from which on they are the polynomial's own error: no noise of
a gyro lasts that long against a bin."""
METHOD = "line through the torque less inertia times the slope of a quintic through the rate"
STILL_RISING = Cause("friction still rising", "friction was still rising when the recording ended")
TOO_LITTLE_NOISE = Cause(
    "error of the polynomial", "noise is so small that the polynomial's own error is larger"
)


@dataclass(frozen=True)
class Breakaway:
    """What the end of a torque ramp says.

    Attributes:
        torque: the largest friction (N m); a bound of "at least" when friction still rose as the
            recording ended.
        sliding: the sample at which the rate passed the threshold.
        peak_time: when friction was largest (s).
        acceleration: of the load at that time (rad/s^2), as fast as the torque falls when the
            inertia is said to be larger (N m per kg m^2).
    """

    torque: Estimate
    sliding: int
    peak_time: float
    acceleration: float


def breakaway_torque(
    time: Array,
    rate: Array,
    torque: Array,
    inertia: float,
    threshold: float,
    seen: Array | None = None,
) -> Breakaway:
    """Largest friction torque of a torque ramp from rest, with its interval.

    time (s), rate (rad/s) and torque (N m) are evenly sampled, shape (n,), and end soon after the
    load began to slide, which is where the rate passes `threshold` (rad/s); inertia in kg m^2. A
    ramp to the negative side gives a positive torque, too. The interval is by the delta method,
    with Student's t and residuals that may be autocorrelated.
    `seen` is the rate smoothed until its sensor resolves `threshold`, shape (n,), NaN where it is
    not known; absent: the rate itself. It decides when the load slides, and its pace.
    Raises ValueError when the load never moved that fast, or for too few samples.
    """
    seen = rate if seen is None else np.nan_to_num(seen)
    moving = np.abs(seen) >= threshold
    if not moving.any():
        raise ValueError(
            f"the rate never reached {threshold:.4g} rad/s: the ramp ended below breakaway"
        )
    sliding = int(np.argmax(moving))
    sign = float(np.sign(np.mean(seen[sliding:])))
    interval = float(np.ptp(time)) / max(len(time) - 1, 1)
    pace = interval * float(np.sum(sign * seen > 0.5 * np.max(sign * seen)))
    stop = float(time[-1]) + interval
    first = _fit(time, sign * rate, sign * torque, inertia, (stop - FIRST_REACH * pace, stop))
    near = (first.peak_time - REACH * pace, first.peak_time + REACH * pace)
    found = _fit(time, sign * rate, sign * torque, inertia, near)
    return Breakaway(found.estimate(), sliding, found.peak_time, found.acceleration)


@dataclass(frozen=True)
class _Peak:
    """A maximum of friction: value and standard error (N m), how far it falls to the end."""

    value: float
    error: float
    freedom: int
    correlation: float
    fall: float
    fall_error: float
    peak_time: float
    acceleration: float

    def estimate(self) -> Estimate:
        more = {"standard_error": self.error, "freedom": self.freedom, "method": METHOD}
        if self.fall <= student(self.freedom) * self.fall_error:
            low = self.value - student(self.freedom) * self.error
            return Estimate.without_interval(
                "breakaway_torque", low, "N m", STILL_RISING(), kind="at least", **more
            )
        if self.correlation >= SMOOTH:
            reason = TOO_LITTLE_NOISE()
            return Estimate.without_interval("breakaway_torque", self.value, "N m", reason, **more)
        return with_error("breakaway_torque", self.value, "N m", self.error, self.freedom, METHOD)


def _fit(
    time: Array, rate: Array, torque: Array, inertia: float, window: tuple[float, float]
) -> _Peak:
    """The largest friction within a window of time, where torque and rate are positive."""
    first, last = np.searchsorted(time, window)
    each = max(1, int(last - first) // BINS)
    count = int(last - first) // each
    if count < 2 * (DEGREE + 1):
        raise ValueError(f"only {last - first} samples around breakaway: too few for its torque")
    first = last - count * each
    centre, half = float(np.mean(time[first:last])), 0.5 * float(np.ptp(time[first:last]))
    at = (time[first:last] - centre) / half

    rates = rate[first:last].reshape(count, each).mean(axis=1)
    powers = np.vander(at.reshape(count, each).mean(axis=1), DEGREE + 1, increasing=True)
    of_rate = np.linalg.lstsq(powers, rates, rcond=None)[0]
    line = np.stack([np.ones_like(at), at], axis=1)
    of_torque = np.linalg.lstsq(line, torque[first:last], rcond=None)[0]

    fine = np.linspace(powers[0, 1], powers[-1, 1], 2001)
    slopes = np.arange(1, DEGREE + 1) * np.vander(fine, DEGREE, increasing=True) / half
    accelerations = slopes @ of_rate[1:]
    friction = of_torque[0] + of_torque[1] * fine - inertia * accelerations
    peak = int(np.argmax(friction))

    errors = errors_of(powers, rates - powers @ of_rate)
    levels = errors_of(line, torque[first:last] - line @ of_torque)

    def error(of_slope: Array, of_line: Array) -> float:
        row = np.concatenate([[0.0], of_slope])
        variance = inertia**2 * row @ errors.covariance @ row
        return float(np.sqrt(variance + of_line @ levels.covariance @ of_line))

    return _Peak(
        float(friction[peak]),
        error(slopes[peak], np.array([1.0, fine[peak]])),
        errors.freedom,
        errors.correlation,
        float(friction[peak] - friction[-1]),
        error(slopes[peak] - slopes[-1], np.array([0.0, fine[peak] - fine[-1]])),
        centre + half * float(fine[peak]),
        float(accelerations[peak]),
    )
