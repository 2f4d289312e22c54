"""The largest friction torque of a torque ramp: the breakaway torque at that ramp rate.

Friction is the drive torque less the inertial torque (Eq. 4.1). Around the maximum of friction the
load creeps at an increasing rate until it slides, so that both torques change smoothly. The drive
torque is fitted by a line and the rate by a polynomial. Friction is the difference of line and
inertia times slope, without a filter that would distort it.

The pace is the time in which the rate doubles. With a slower ramp, the maximum of friction lies
more paces before the end of the ramp, and the end of the rate contains less of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import polynomial

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.autocorrelated_errors import FitErrors, errors_of
from campaign.estimation.intervals import shifted_by, student, with_error
from campaign.estimation.relative_rate import mean, slides_from, slope
from campaign.reason import Cause
from campaign.units import rate_text

NAME = "breakaway_torque"
DEGREE = 5
"""Degree of the polynomial of the rate around the maximum."""
BINS = 60
"""Number of bins in which the rate is averaged around the maximum."""
REACH = 1.75
"""Half-width of the fit, in paces. On an axis of 70 kg m^2 a pace is 0.2 to 0.4 s: with 1.5 to 2
paces the polynomial follows friction (coverage 94 to 98 %), with 2.5 it does not (68 to 99 %)."""
WIDER = 1.4
"""Factor of the half-width: multiplied while noise hides the peak, divided while the residuals are
the polynomial's own error."""
NARROWEST, WIDEST = 0.5, 7.0
"""Limits of the half-width (paces)."""
WIDEN, UNSURE = 2.0, 0.4
"""Standard error over the gain of torque in a pace, which is the inertial torque at the peak. Above
the first a fit is widened; above the second it does not determine the time of the peak."""
INNER = 0.6
"""Share of the half-width within which the maximum lies: near the ends the slope is noise."""
POLYNOMIAL = "polynomial of the rate"
SMOOTH = 0.95
"""AR(1) coefficient of the residuals above which they are the polynomial's own error: gyro noise is
not correlated over that many bins."""
METHOD = "line through the torque less inertia times the slope of a quintic through the rate"
STILL_RISING = Cause("friction still rising", "friction was still rising when the recording ended")
NO_FALL = Cause(
    "no significant fall", "the recording ends before the fall of friction is significant"
)
TOO_LITTLE_NOISE = Cause(
    "error of the polynomial", "noise is so small that the polynomial's own error is larger"
)


@dataclass(frozen=True)
class Breakaway:
    """Breakaway torque of a torque ramp.

    Attributes:
        torque: the largest friction (N m); a bound of "at least" when friction did not fall
            significantly before the recording ended.
        acceleration: of the load at the largest friction (rad/s^2); the negative derivative of the
            torque by the inertia (N m per kg m^2).
    """

    torque: Estimate
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
    load begins to slide, where the rate exceeds `threshold` (rad/s); inertia in kg m^2. A ramp in
    the negative direction also results in a positive torque. The interval is by the delta method,
    with Student's t and autocorrelated residuals.
    `seen` is the rate smoothed until its sensor resolves `threshold`, shape (n,), NaN where it is
    unknown; default: the rate itself. It determines the start of sliding and the pace.
    Raises ValueError when the rate never exceeds `threshold`, the torque falls, or samples are few.
    """
    seen = rate if seen is None else seen
    sliding = slides_from(seen, threshold)
    if sliding is None:
        raise ValueError(
            f"the rate never reached {rate_text(threshold, '.4g')}: the ramp ended below breakaway"
        )
    first, last = sliding
    sign = float(np.sign(np.nanmean(seen[first:last])))
    interval = float(np.ptp(time)) / max(len(time) - 1, 1)
    forwards = sign * np.nan_to_num(seen[:last])
    span = 2 * (max(int(np.sum(forwards > 0.5 * np.max(forwards))), 2) // 2) + 1
    pace, stop = span * interval, float(time[-1]) + interval

    def fit(middle: float, half: float) -> _Fit:
        part = slice(*np.searchsorted(time, (middle - half, middle + half)))
        return _fit(time[part], sign * rate[part], sign * torque[part], inertia)

    def friction(half: int) -> Array:
        return mean(sign * torque, half) - inertia * slope(sign * rate, interval, half)

    about, reach = float(time[np.nanargmax(friction(2 * span - 1))]), REACH * pace
    later = slice(last // 2, last)  # without the rest before the ramp
    gain = pace * float(
        np.polynomial.Polynomial.fit(time[later], sign * torque[later], 1).deriv()(0)
    )
    if not gain > 0:
        raise ValueError("the torque does not rise before the load slides: that is no ramp")
    peak = fit(about, reach)
    while peak.friction(about)[1] > WIDEN * gain and reach < WIDEST * pace:
        reach *= WIDER
        peak = fit(about, reach)
    noisy = peak.friction(about)[1] > UNSURE * gain
    middle = fit(about, max(reach, 1.6 * REACH * pace)).peak_time if noisy else about
    slid = min(float(time[last - 1]), stop - 0.5 * pace)
    peak, end = fit(middle, reach), fit(min(slid, stop - reach), reach)
    while peak.errors.correlation >= SMOOTH and reach > NARROWEST * pace:
        try:
            peak = fit(middle, reach / WIDER)
        except ValueError:  # too few samples
            break
        reach /= WIDER
    peak_time = middle if noisy else peak.peak_time
    wider = fit(peak_time, WIDER * reach).friction(peak_time)
    most = _told(peak, peak_time, end.friction(slid), end.friction(slid - pace), peak_time < slid)
    return Breakaway(_with_shift(most, wider), peak.acceleration(peak_time))


def _told(
    found: _Fit,
    peak_time: float,
    late: tuple[float, float],
    before: tuple[float, float],
    passed: bool,
) -> Estimate:
    """Estimate from friction and its error (N m) at the start of sliding and a pace before it.

    `passed`: the maximum lies before sliding; a later one is at the end of the recording, such as
    of friction that rises with speed. Errors are added: two fits with common samples are dependent.
    """
    (value, error), freedom = found.friction(peak_time), found.errors.freedom
    more = {"standard_error": error, "freedom": freedom, "method": METHOD}
    times = student(freedom)
    if not passed or value - late[0] <= times * (error + late[1]):
        rises = late[0] - before[0] > times * (late[1] + before[1])
        reason, low = STILL_RISING() if rises else NO_FALL(), value - times * error
        return Estimate.without_interval(NAME, low, "N m", reason, kind="at least", **more)
    if found.errors.correlation >= SMOOTH:
        return Estimate.without_interval(NAME, value, "N m", TOO_LITTLE_NOISE(), **more)
    return with_error(NAME, value, "N m", error, freedom, METHOD)


def _with_shift(told: Estimate, wider: tuple[float, float]) -> Estimate:
    """Add the polynomial's own error: the change by a wider fit beyond scatter (Hausman 1978)."""
    change = abs(wider[0] - told.value)
    scatter = abs((told.standard_error or 0.0) ** 2 - wider[1] ** 2) ** 0.5
    if not told.has_interval or change <= 2.0 * scatter:
        return told
    return shifted_by(told, POLYNOMIAL, change)


@dataclass(frozen=True)
class _Fit:
    """Polynomial through the rate and line through the torque, over a time of 2 `half` (s)."""

    centre: float
    half: float
    of_rate: Array
    of_torque: Array
    errors: FitErrors
    levels: FitErrors
    inertia: float

    def acceleration(self, time: float) -> float:
        """Acceleration of the load (rad/s^2)."""
        return float(self._slope(time) @ self.of_rate)

    def friction(self, time: float) -> tuple[float, float]:
        """Value and standard error (N m)."""
        slope, line = self._slope(time), np.array([1.0, (time - self.centre) / self.half])
        variance = self.inertia**2 * slope @ self.errors.covariance @ slope
        variance += line @ self.levels.covariance @ line
        return float(line @ self.of_torque - self.inertia * slope @ self.of_rate), float(
            variance**0.5
        )

    @property
    def peak_time(self) -> float:
        """Time of the largest friction (s)."""
        places = np.linspace(-INNER, INNER, 1001)
        slopes = polynomial.polyval(places, polynomial.polyder(self.of_rate)) / self.half
        friction = self.of_torque[1] * places - self.inertia * slopes
        return self.centre + self.half * float(places[np.argmax(friction)])

    def _slope(self, time: float) -> Array:
        """Slope of each power of the polynomial (1/s)."""
        place, powers = (time - self.centre) / self.half, np.arange(1, DEGREE + 1)
        return np.append(0.0, powers * place ** (powers - 1)) / self.half


def _fit(time: Array, rate: Array, torque: Array, inertia: float) -> _Fit:
    """Fit with positive torque and rate; samples that fill no bin are omitted at the start."""
    each = max(1, len(time) // BINS)
    count = len(time) // each
    if count < 2 * (DEGREE + 1):
        raise ValueError(f"only {len(time)} samples around breakaway: too few for its torque")
    time, rate, torque = (values[len(values) - count * each :] for values in (time, rate, torque))
    centre, half = float(np.mean(time)), 0.5 * float(np.ptp(time))
    at = (time - centre) / half
    rates = rate.reshape(count, each).mean(axis=1)
    powers = np.vander(at.reshape(count, each).mean(axis=1), DEGREE + 1, increasing=True)
    of_rate = np.linalg.lstsq(powers, rates, rcond=None)[0]
    line = np.stack([np.ones_like(at), at], axis=1)
    of_torque = np.asarray(np.linalg.lstsq(line, torque, rcond=None)[0], np.float64)
    errors = errors_of(powers, rates - powers @ of_rate)
    levels = errors_of(line, torque - line @ of_torque)
    return _Fit(centre, half, of_rate, of_torque, errors, levels, inertia)
