"""Presliding stiffness from a slow torque ramp (section 4.3.3).

The slope of a chord through the curve of torque over angle underestimates sigma0. Therefore the
curve itself is fitted, but not to angles: an encoder has few counts in presliding, and an
integrated gyro rate is a random walk, whose residuals result in much too small errors. The fit is
to the mean rate of short bins, with the standstill before the ramp, which determines the bias of
the gyro. The torque at which all interfaces slip is free: the breakaway torque of a ramp is not
the curve's asymptote, and a stiffness based on it has an error of 1 to 7 %.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Kind, Origin
from campaign.estimation.autocorrelated_errors import MISFIT
from campaign.estimation.bristle_fit import BristleFit, fit_bristles, one_interface, two_interfaces
from campaign.estimation.gate import admitted
from campaign.estimation.hidden_interface import Shift, hidden_shift
from campaign.estimation.intervals import exponential, shifted_by, student, with_error
from campaign.estimation.presliding_curve import Interface
from campaign.estimation.torque_ramp import Ramp, ramp_of
from campaign.reason import Cause

WINDOWS = (0.5, 0.65, 0.8, 0.9)
"""Ends of fitted windows as shares of the breakaway torque, to estimate their influence."""
SMALLEST_SHARE = 0.05
"""Share of the breakaway torque at which the fit begins: before it, acceleration of the load and
damping of the bristles dominate. Also the least torque of a second interface."""
BENT = 0.3
"""Least share of its torque that the strongest interface must carry in a window."""
NEAR = 0.16
"""Largest distance to the share of another window that counts in the systematic part."""
SPLIT = 1.0 / 3.0
"""Relative distance of two slip angles from their mean, at which a fit sees a single interface."""
CLEARLY = 10.0
"""Least decrease of the Bayesian information criterion by a second interface."""
APART = 2.0
"""Least ratio of the slip angle of the stronger interface to that of the weaker: with a smaller
ratio the second interface is an error of the model, a part of one curve."""
METHOD = "curve of bristles fitted to the gyro rate, its bias and the asymptote free"
WINDOW = "window"
"""Source of the systematic part of where the fitted window ends."""
HIDDEN = "hidden interface"
"""Source of the systematic part of an interface that the rate's noise hides."""
NOT_RESOLVED = Cause(
    "interface not resolved",
    "the noise of the rate may hide a stiffer interface that slips first",
)
OFF_THE_CURVE = Cause(
    "off the curve of bristles",
    "the rate leaves the curve of bristles by more than its noise explains",
)


@dataclass(frozen=True)
class Presliding:
    """Bristle parameters from one ramp.

    Attributes:
        stiffness: of the interface that carries the largest torque (N m/rad); an upper bound where
            noise may hide a stiffer one that slips first.
        stiffness_at_rest: slope before slip, the sum over all interfaces (N m/rad); a lower bound
            in that case.
        interfaces: of the fitted curve, the one that carries the largest torque first.
        bias: of the gyro (rad/s).
        window: lower and upper torque of the fitted part of the curve (N m).
        chord: slope of a straight line through the same part of the curve (N m/rad).
        by_window: stiffness by the share of the breakaway torque at which the window ends.
        damping_shift: change of the logarithms of stiffness and of stiffness at rest by 1 N m s/rad
            of bristle damping, which the curve omits.
    """

    stiffness: Estimate
    stiffness_at_rest: Estimate
    interfaces: tuple[Interface, ...]
    bias: float
    window: tuple[float, float]
    chord: float
    by_window: Mapping[float, Estimate]
    damping_shift: tuple[float, float]

    def with_damping(self, damping: float) -> Presliding:
        """Add the shift by an assumed bristle damping (N m s/rad) as a systematic part."""
        shifts = [damping * shift for shift in self.damping_shift]
        return replace(
            self,
            stiffness=_shifted(self.stiffness, "bristle damping", shifts[0]),
            stiffness_at_rest=_shifted(self.stiffness_at_rest, "bristle damping", shifts[1]),
        )


def fit_presliding(
    time: Array,
    rate: Array,
    torque: Array,
    start: float,
    breakaway: float,
    share: float = 0.8,
) -> Presliding:
    """Fit the curve of bristles to a ramp that begins at `start` (s), up to a share of breakaway.

    time (s), gyro rate (rad/s) and drive torque (N m) have shape (n,), are evenly sampled, and
    positive; breakaway in N m. The fit has one interface, unless two are clearly better (Bayesian
    information criterion). Intervals are Student's t in the logarithm, with autocorrelated
    residuals. Raises ValueError for too few samples in the window or a torque that is no ramp.
    """
    ramp = ramp_of(time, rate, torque, start, max(share, *WINDOWS) * breakaway)
    whole = ramp.until(share * breakaway)
    smallest = SMALLEST_SHARE * breakaway
    one = fit_bristles(whole, smallest, one_interface(whole, breakaway))
    two = fit_bristles(whole, smallest, two_interfaces(whole, breakaway, smallest))
    if one is None:
        raise ValueError("too little of the curve of bristles shows in the rate of this ramp")
    best = two if two is not None and _believed(two, one) else one
    fits = {share: best, **_by_window(ramp, smallest, breakaway, best, share)}
    by_window = {end: _stiffness(fit) for end, fit in fits.items()}
    sums = {end: _at_rest(fit) for end, fit in fits.items()}
    hidden = hidden_shift(one) if best is one else Shift(0.0, 0.0)
    shifted = _shifted(by_window[share], WINDOW, _window_shift(share, by_window))
    at_rest = _shifted(sums[share], WINDOW, _window_shift(share, sums))
    at_rest = _shifted(at_rest, "more interfaces than two", _split_shift(best))
    return Presliding(
        stiffness=_beside(shifted, hidden.stiffness, "at most"),
        stiffness_at_rest=_beside(at_rest, hidden.at_rest, "at least"),
        interfaces=best.interfaces,
        bias=best.bias,
        window=(smallest, float(whole.torque[-1])),
        chord=_chord(whole, best.bias, smallest),
        by_window=dict(sorted(by_window.items())),
        damping_shift=_damping_shift(best),
    )


def _believed(two: BristleFit, one: BristleFit) -> bool:
    """Whether two interfaces fit clearly better and are not two parts of one curve."""
    strong, weak = two.interfaces
    apart = strong.torque / strong.stiffness > APART * weak.torque / weak.stiffness
    return apart and two.criterion < one.criterion - CLEARLY


def _stiffness(fit: BristleFit) -> Estimate:
    row = np.zeros(fit.jacobian.shape[1])
    row[fit.of_stiffness[0]] = 1.0
    return _of_logarithm(fit, "bristle_stiffness", fit.interfaces[0].stiffness, row)


def _at_rest(fit: BristleFit) -> Estimate:
    total = sum(each.stiffness for each in fit.interfaces)
    return _of_logarithm(fit, "stiffness_at_rest", total, _row_of_sum(fit))


def _row_of_sum(fit: BristleFit) -> Array:
    """Derivatives of the logarithm of the summed stiffness by the parameters."""
    row = np.zeros(fit.jacobian.shape[1])
    total = sum(each.stiffness for each in fit.interfaces)
    for index, each in zip(fit.of_stiffness, fit.interfaces, strict=True):
        row[index] = each.stiffness / total
    return row


def _of_logarithm(fit: BristleFit, name: str, value: float, row: Array) -> Estimate:
    error = float(np.sqrt(row @ fit.errors.covariance @ row))
    inner = with_error(name, float(np.log(value)), "", error, fit.errors.freedom, METHOD)
    estimate = exponential(inner, "N m/rad")
    if fit.errors.misfit <= MISFIT:
        return admitted(estimate)
    return replace(estimate, low=None, high=None, level=None, reason=OFF_THE_CURVE())


def _by_window(
    ramp: Ramp, smallest: float, breakaway: float, best: BristleFit, share: float
) -> dict[float, BristleFit]:
    """Fits to the other windows, with the same number of interfaces, by share.

    A window that ends before the strongest interface bends does not determine it.
    """
    fits = {}
    strongest, *weaker = best.interfaces
    least = sum(each.torque for each in weaker) + BENT * strongest.torque
    for other in WINDOWS:
        part = ramp.until(other * breakaway)
        if part.torque[-1] < least:
            continue
        fit = fit_bristles(part, smallest, best.again(part, breakaway, smallest))
        if fit is not None and other != share:
            fits[other] = fit
    return fits


def _window_shift(share: float, by_window: Mapping[float, Estimate]) -> float:
    """Largest significant change of the logarithm between window ends.

    The windows are nested: the variance of a difference is the difference of the variances
    (Hausman, Econometrica 46, 1978).
    """
    own, shifts = by_window[share], [0.0]
    for other, there in by_window.items():
        if abs(other - share) > NEAR or not (own.has_interval and there.has_interval):
            continue
        change = abs(float(np.log(there.value / own.value)))
        errors = [(each.standard_error or 0.0) / each.value for each in (own, there)]
        scatter = float(np.sqrt(abs(errors[0] ** 2 - errors[1] ** 2)))
        if change > student(min(own.freedom or np.inf, there.freedom or np.inf)) * scatter:
            shifts.append(change)
    return max(shifts)


def _damping_shift(fit: BristleFit) -> tuple[float, float]:
    """`Presliding.damping_shift`: one linear step of the fit to a curve with damped bristles."""
    change = fit.change_by_damping()
    step = np.linalg.lstsq(fit.jacobian, change, rcond=None)[0]
    return float(step[fit.of_stiffness[0]]), float(_row_of_sum(fit) @ step)


def _split_shift(fit: BristleFit) -> float:
    """Error of the logarithm of the stiffness at rest if the weaker interface is in truth two."""
    if len(fit.interfaces) < 2:
        return 0.0
    strong, weak = fit.interfaces
    parts = [
        Interface(0.5 * weak.stiffness / apart, 0.5 * weak.torque)
        for apart in (1.0 - SPLIT, 1.0 + SPLIT)
    ]
    step = np.linalg.lstsq(fit.jacobian, fit.change_by((strong, *parts)), rcond=None)[0]
    seen = strong.stiffness + weak.stiffness
    true = strong.stiffness + sum(part.stiffness for part in parts)
    return float(_row_of_sum(fit) @ step - np.log(true / seen))


def _beside(estimate: Estimate, hidden: float, kind: Kind) -> Estimate:
    """Add the relative shift by a hidden interface; a bound where that shift is too large."""
    if not hidden:
        return estimate
    shifted = _shifted(estimate, HIDDEN, hidden)
    end = estimate.low if kind == "at least" else estimate.high
    if end is None or admitted(shifted).origin is Origin.MEASURED:
        return shifted
    return replace(
        estimate,
        value=end,
        low=None,
        high=None,
        level=None,
        kind=kind,
        origin=Origin.MEASURED,
        reason=NOT_RESOLVED(),
    )


def _chord(ramp: Ramp, bias: float, smallest: float) -> float:
    """Slope of a straight line through torque over the integrated rate (N m/rad)."""
    angle = np.concatenate([[0.0], np.cumsum((ramp.rate - bias) * np.diff(ramp.edges))])
    inside = ramp.torque >= smallest
    return float(np.polyfit(angle[inside], ramp.torque[inside], 1)[0])


def _shifted(estimate: Estimate, source: str, relative: float) -> Estimate:
    """Add a rectangular part with a relative half-width (GUM 4.3.7)."""
    return shifted_by(estimate, source, abs(relative) * estimate.value / math.sqrt(3.0))


def damping_by_ratio(stiffness: float, inertia: float, viscous: float, ratio: float) -> float:
    """sigma1 (N m s/rad) from an *assumed* damping ratio (Equation 4.12): not a measurement."""
    return 2.0 * ratio * float(np.sqrt(stiffness * inertia)) - viscous
