"""Static friction parameters from a friction-velocity map.

A point is the mean of a window with a known deviation. Points deviate from each other by more:
friction changes from trial to trial, and the rest of its ripple over position is no noise of the
window. So the weight of a point is 1 / (window² + (between × torque)²). The relative deviation
between points makes chi-square equal to its degrees of freedom (Paule and Mandel, "Consensus values
and weighting factors", J. Res. NBS 87 (1982)). The torque in the weight is all of the friction, or
friction without its viscous part, whichever is more likely: grease and contact may scatter
differently. Intervals are Student's t with n - p, from (JᵀWJ)⁻¹. A parameter at a bound is not
exactly known: p and J include it, so that intervals of the others are rather too wide than too
narrow.

Every map is fitted with delta free, with delta = 2 (LuGre model), and without a Stribeck effect.
All three have the weights of the first, the most general: the misfit of a model must not count as
noise. The interval of a model with a misfit is that of the curve of its kind closest to the truth.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin
from campaign.estimation.curve_misfit import CurveMisfit, curve_misfit
from campaign.estimation.gate import USELESS, admitted, mattering, refused
from campaign.estimation.intervals import shifted_by, student, with_error
from campaign.estimation.least_squares import gradients, profile_limit, propagated, refuse_too_few
from campaign.estimation.point_weights import (
    Scatter,
    fit_with_scatter,
    lack_of_fit,
    smoothed_deviation,
)
from campaign.estimation.stribeck import (
    PARAMETERS,
    UNITS,
    StribeckFit,
    fit_line,
    fit_stribeck,
    held_at,
    stribeck,
    with_misfit,
)
from campaign.reason import NONE, Cause, Reason

Model = Literal["free", "2", "none"]
MODELS: tuple[Model, ...] = ("free", "2", "none")
"""Models of the Stribeck effect: delta free, delta = 2, none."""
HELD = {"free": None, "2": 2.0}
DOUBTED = 0.2
"""p-value below which the points contradict a model with a held parameter."""
EFFECT = 1e-3
"""p-value of a line below which a Stribeck effect shows. A line has neither vs nor delta: the F
distribution does not apply (Davies, Biometrika 74 (1987) 33), and a barely significant effect is
overestimated. Of 600 lines two were below 0.01 and none below 0.001."""
FORM = "form of the curve"
BENT = ("static_torque", "coulomb_torque", "stribeck_velocity", "stribeck_exponent")
STRAIGHT = 0.2
"""Largest relative half-width of vs for intervals from the derivatives of the curve."""
TINY = 1e-300
"""Smallest positive number, in place of zero."""
LACKING = 0.05
"""p-value below which a model does not describe repeated points."""
FEWEST_BELOW = 3
"""Fewest speeds below vs for a Ts that is not extrapolated."""
FAR = 3.0
"""Multiple of vs at which a twentieth of the fall from Ts remains (delta = 1). Without a speed
beyond it, Tc is extrapolated."""
BRANCH = 3.0
"""Least range of speeds above vs, in lengths of a misfit, for Tc and viscous friction: one more
than these two, as in `curve_misfit`. In a shorter range, the rest of the fall resembles them."""
EXTRAPOLATED = Cause("extrapolated", "{symbol} is extrapolated: {why}")
FEW_BELOW = Cause("too few speeds below vs", "{counted} below vs")
NONE_ABOVE = Cause("no speed far above vs", "no speed is above {times:g} times vs")
HELD_EXPONENT = Cause("held", "held at {value:g}")
LEFT_OPEN = Cause("left open by points", "these points leave it open")
NO_EFFECT = Cause("no Stribeck effect", "the points do not show a Stribeck effect")
SEARCH_ENDED = Cause("at search limit", "the search ended at {value:.3g}, its {side} limit")
EXPONENT_ENDED = Cause(
    "exponent at search limit", "the exponent ended at {value:.3g}, its {side} limit, and moves it"
)
MISFIT_ABOVE = Cause(
    "misfit above vs", "the curve does not fit, and no speed is above {times:.2g} times vs"
)
NEGATIVE = Cause("negative by the data", "the data would have it negative")
LIKE_VISCOUS = Cause(
    "like viscous friction", "these points do not separate it from viscous friction"
)
CONTRADICTED: Mapping[Model, Cause] = {
    "2": Cause("exponent contradicted", "the points contradict the exponent of 2 (p = {p:.2g})"),
    "none": Cause("Stribeck effect shows", "the points show a Stribeck effect (p = {p:.2g})"),
}
"""Reasons for parameters of a model that the data contradict."""


@dataclass(frozen=True)
class DirectionFit:
    """Fits of one direction of a map; arrays of shape (n,), one entry per speed.

    Attributes:
        place: the `repeat_of` of each speed, such as the commanded speed; else `speed`.
        speed, torque: positive (rad/s, N m).
        window: deviation of each torque by its window (N m, 1 sigma).
        scatters: deviation of points beyond that; two where neither is clearly more likely.
        fits: by model.
        lack_of_fit: p-value of `free` against repeated points; None without repeats.
        curve_misfit: of `free`; None if the residuals show none.
    """

    place: Array
    speed: Array
    torque: Array
    window: Array
    scatters: tuple[Scatter, ...]
    fits: Mapping[Model, StribeckFit]
    lack_of_fit: float | None = None
    curve_misfit: CurveMisfit | None = None

    @property
    def freedom(self) -> int:
        """Degrees of freedom of every interval: points less `free` parameters, even at bounds."""
        return len(self.speed) - len(self.fits["free"].free)

    @property
    def deviation(self) -> Array:
        """Deviation of each torque, by window and between points (N m, 1 sigma)."""
        return self.fits["free"].deviation

    @property
    def shows_stribeck_effect(self) -> bool:
        """Whether the points significantly contradict a line."""
        return self._p_value("none") < EFFECT

    @property
    def preferred(self) -> Model:
        """Model with the lowest Bayesian information criterion."""
        return min(MODELS, key=lambda model: self.fits[model].bic)

    @property
    def accepted(self) -> Model:
        """Preferred model, or `free` where the points contradict it.

        The criterion prefers delta = 2 down to a p-value of about 0.1, below `DOUBTED`. Without
        this rule, one of twelve maps of a rig with delta = 2 had no parameter.
        """
        return "free" if self.contradiction(self.preferred) else self.preferred

    def contradiction(self, model: Model) -> Reason:
        """Reason why the points contradict what a model holds; `NONE` where they do not."""
        p = self._p_value(model)
        return CONTRADICTED[model](p=p) if p < DOUBTED else NONE

    def _p_value(self, model: Model) -> float:
        """p-value of an F test of a model against the free fit with the same weights."""
        held, free = self.fits[model], self.fits["free"]
        more = len(free.free) - len(held.free)
        if more <= 0:
            return 1.0
        excess = (held.chi_square - free.chi_square) / more
        ratio = excess / max(free.chi_square / self.freedom, TINY)
        from scipy.special import fdtrc

        return float(fdtrc(more, self.freedom, max(ratio, 0.0)))

    @property
    def misfit(self) -> float:
        """Weighted deviation of the residuals with delta = 2 over that with delta free."""
        return math.sqrt(self.fits["2"].chi_square / max(self.fits["free"].chi_square, 1e-300))

    def beyond(self, name: str) -> Reason:
        """Reason why a parameter is extrapolated; none if it is not, or without Stribeck effect."""
        if not self.shows_stribeck_effect:
            return NONE
        velocity = self.fits["free"].values["stribeck_velocity"]
        below = int(np.sum(self.speed < velocity))
        if name == "static_torque" and below < FEWEST_BELOW:
            return EXTRAPOLATED(symbol="Ts", why=FEW_BELOW(counted=_speeds(below), speeds=below))
        if name == "coulomb_torque" and not np.any(self.speed > FAR * velocity):
            return EXTRAPOLATED(symbol="Tc", why=NONE_ABOVE(times=FAR))
        return NONE

    def form_part(self, model: Model, name: str) -> float:
        """Uncertainty of a parameter by the form of the curve (1 sigma, in its unit).

        Where no Stribeck effect shows, a line also describes the points: the true value is between
        those of curve and line (rectangular distribution; GUM, 4.3.7).
        """
        line, moved = self.fits["none"], self.misfit_part(model, name)
        if model == "none" or self.shows_stribeck_effect or name not in line.free:
            return moved
        between = abs(self.fits[model].values[name] - line.values[name]) / math.sqrt(3.0)
        return math.hypot(between, moved)

    def misfit_part(self, model: Model, name: str) -> float:
        """Possible shift of a parameter by a misfit (1 sigma, in its unit)."""
        curve, misfit = self.fits[model], self.curve_misfit
        if misfit is None or name not in curve.free:
            return 0.0
        return misfit.moves(curve.influence[curve.free.index(name)] * curve.deviation)

    def misfit_above(self, model: Model, name: str) -> Reason:
        """Reason why a misfit leaves Tc or viscous friction open; none for sufficient speeds."""
        misfit = self.curve_misfit
        if misfit is None or model == "none" or not self.shows_stribeck_effect:
            return NONE
        needed = math.exp(BRANCH * misfit.length) * self.fits[model].values["stribeck_velocity"]
        near = name in ("coulomb_torque", "viscous_friction") and self.speed.max() < needed
        return MISFIT_ABOVE(times=math.exp(BRANCH * misfit.length)) if near else NONE


def _speeds(count: int) -> str:
    return "1 speed is" if count == 1 else f"{count or 'no'} speeds are"


def fit_direction(
    speed: Array, torque: Array, window: Array, repeat_of: Array | None = None
) -> DirectionFit:
    """Fit all models to one direction.

    Args:
        speed, torque: of each point, positive (rad/s, N m), shape (m,).
        window: deviation of each torque by its window (N m); 0 or NaN where unknown.
        repeat_of: equal for points that repeat each other, such as the commanded speed; it must
            increase with `speed`. Default: no repeats.

    Repeats are averaged first: otherwise their common error (ripple at one place) would count
    several times. They determine the lack of fit. Intervals follow from the residuals of the means,
    which include the errors that repeats do not show.

    Raises ValueError for fewer than 6 speeds.
    """
    order = np.argsort(speed)
    speed, torque, window = speed[order], torque[order], np.nan_to_num(window[order])
    place = np.arange(len(speed)) if repeat_of is None else np.asarray(repeat_of)[order]
    shared, first, member, count = np.unique(
        place, return_index=True, return_inverse=True, return_counts=True
    )
    refuse_too_few(len(first), len(PARAMETERS))

    def mean(values: Array) -> Array:
        return np.asarray(np.bincount(member, values) / count)

    means, level = mean(speed), mean(torque)
    scatter = smoothed_deviation(np.sqrt(mean(window**2) / count), np.log(means))
    scatters, free = fit_with_scatter(means, level, scatter)
    held = with_misfit(
        fit_stribeck(means, level, free.deviation, HELD["2"], near=free.values), means, level
    )
    fits: dict[Model, StribeckFit] = {
        "free": free,
        "2": held,
        "none": fit_line(means, level, free.deviation),
    }
    part = scatters[0].part(means, level)
    lacking = lack_of_fit(torque, level, part, member, free.residuals, len(level) - len(free.free))
    named = means if repeat_of is None else np.asarray(shared, dtype=float)
    misfit = curve_misfit(means, free.residuals / free.deviation, free.influence * free.deviation)
    return DirectionFit(named, means, level, scatter, scatters, fits, lacking, misfit)


def direction_estimates(
    fit: DirectionFit, model: Model, shared: Callable[[Estimate], Estimate] = lambda one: one
) -> dict[str, Estimate]:
    """Parameters of one direction for the report, with their intervals, by name.

    shared: adds the systematic parts that all points share.
    """
    estimates = fitted_estimates(fit, model)
    return {name: passed(shared(one), model, fit) for name, one in estimates.items()}


def fitted_estimates(fit: DirectionFit, model: Model) -> dict[str, Estimate]:
    """Fitted parameters of one direction, by name, before `passed`."""
    names = PARAMETERS if model != "none" else ("viscous_friction", "coulomb_torque")
    return {name: _estimate(fit, model, fit.fits[model], name) for name in names}


def passed(told: Estimate, model: Model, *fits: DirectionFit) -> Estimate:
    """Parameter of one direction, or of the mean of both, for the report."""
    shape = told.name in ("stribeck_velocity", "stribeck_exponent")
    of_effect = shape or told.name == "static_torque"  # which may lie below the slowest speed
    effect = all(fit.shows_stribeck_effect for fit in fits)
    if of_effect and not effect and told.origin is Origin.MEASURED:
        return refused(told, NO_EFFECT())
    force = max(float(fit.torque.max()) for fit in fits)
    rate = max(float(fit.speed.max()) for fit in fits)
    one = admitted(told, 0.0 if shape else mattering(told.name, force, rate))
    against = next(filter(None, (fit.contradiction(model) for fit in fits)), NONE)
    if against and one.origin in (Origin.MEASURED, Origin.AT_BOUND):
        return replace(one, origin=Origin.CONTRADICTED, reason=against)
    return one


def _estimate(fit: DirectionFit, model: Model, found: StribeckFit, name: str) -> Estimate:
    value, unit = found.values[name], UNITS[name]
    method = f"least squares, points weighted by window and scatter, t({fit.freedom})"
    if name == "stribeck_exponent" and model == "2":
        return Estimate(
            name, value, unit, reason=HELD_EXPONENT(value=HELD[model]), origin=Origin.GIVEN
        )
    ended = found.bounds.get("stribeck_exponent")
    plain = Estimate(name, value, unit, method=method)
    if ended and name in _moved_by_exponent(fit):
        reason = EXPONENT_ENDED(value=found.values["stribeck_exponent"], side=ended)
        return refused(plain, reason)
    if reason := fit.misfit_above(model, name):
        return refused(plain, reason)
    if name in found.bounds:
        return _at_bound(fit, model, plain)
    if name in found.open:
        return refused(plain, LEFT_OPEN())
    error = math.sqrt(max(found.variance({name: 1.0}), 0.0))
    estimate = with_error(name, value, unit, error, fit.freedom, method, reason=fit.beyond(name))
    if is_bent(fit, model, name):
        estimate = _by_profile(fit, model, estimate)
    form = fit.form_part(model, name)
    return shifted_by(estimate, FORM, form) if form else estimate


def _moved_by_exponent(fit: DirectionFit) -> tuple[str, ...]:
    """Parameters that depend on an exponent at its limit. Without fast speeds, the bend of the
    curve also replaces Tc and viscous friction.
    """
    slow = ("static_torque", "stribeck_velocity")
    return (*slow, "coulomb_torque", "viscous_friction") if fit.beyond("coulomb_torque") else slow


def is_bent(fit: DirectionFit, model: Model, name: str) -> bool:
    """Whether the interval of a parameter needs profile likelihood: the curve is nonlinear within
    its error, because it is extrapolated, or the uncertainty of vs is large.
    """
    if model == "none" or not fit.shows_stribeck_effect:
        return False
    curve = fit.fits[model]
    error = student(fit.freedom) * math.sqrt(max(curve.variance({"stribeck_velocity": 1.0}), 0.0))
    badly = error > STRAIGHT * curve.values["stribeck_velocity"]
    return bool(fit.beyond(name)) or (name in BENT and badly)


def _by_profile(fit: DirectionFit, model: Model, told: Estimate) -> Estimate:
    """Interval by profile likelihood; refused where the points have no limit on a side."""
    curve, rise = fit.fits[model], student(fit.freedom) ** 2
    step = 0.5 * (told.standard_error or 0.0)

    def cost(tried: float) -> float:
        return held_at(curve, fit.speed, fit.torque, told.name, max(tried, TINY), HELD[model])

    try:
        low, high = (
            float(profile_limit(cost, told.value, sign * step, rise)) for sign in (-1.0, 1.0)
        )
    except ValueError:
        return refused(told, LEFT_OPEN())
    method = f"profile likelihood, t({fit.freedom})"
    return replace(told, low=low, high=high, method=method)


def _at_bound(fit: DirectionFit, model: Model, plain: Estimate) -> Estimate:
    """Estimate at a bound: one-sided by profile for friction of a curve, otherwise refused."""
    curve, name, value = fit.fits[model], plain.name, plain.value
    physical = name in ("viscous_friction", "coulomb_torque", "static_torque")
    if not physical or model == "none":
        ended = SEARCH_ENDED(value=value, side=curve.bounds[name])
        return refused(plain, NEGATIVE() if physical else ended)

    def cost(tried: float) -> float:
        return held_at(curve, fit.speed, fit.torque, name, tried, HELD[model])

    # At the end of the interval, chi-square has risen by the square of Student's t: the two-sided
    # quantile, because the data decide whether the interval has one side or two.
    rise = student(fit.freedom) ** 2
    step = float(np.median(fit.deviation)) / (
        float(fit.speed.max()) if name == "viscous_friction" else 1.0
    )
    try:
        high = profile_limit(cost, value, step, rise)
    except ValueError:
        return refused(plain, LEFT_OPEN())
    if name != "viscous_friction" and high > USELESS * float(fit.torque.max()):
        # Tc = 0 and a huge viscous friction describe a map that ends below vs as well as the true
        # values. Where noise prefers them, a limit belongs to the wrong minimum: it included Tc in
        # 22 % of such maps.
        return refused(plain, LIKE_VISCOUS())
    estimate = replace(
        plain,
        high=high,
        level=0.95,
        method=f"at its bound; one-sided by profile likelihood, t({fit.freedom})",
        origin=Origin.AT_BOUND,
    )
    moved = fit.misfit_part(model, name)
    return shifted_by(estimate, FORM, moved) if moved else estimate


def shifts(found: StribeckFit, torque_shift: Array) -> dict[str, float]:
    """Change of each parameter by shifts of the torques (N m), shape (n,); by name."""
    moved = found.influence @ torque_shift
    return dict(zip(found.free, moved.tolist(), strict=True))


def band(fit: DirectionFit, model: Model, speed: Array) -> Array:
    """Half-width of the 95 % band of the fitted curve (N m) at `speed` (rad/s), shape (m,)."""
    curve = fit.fits[model]
    point = np.array([curve.values[name] for name in curve.free])

    def torque(values: Array) -> Array:
        return stribeck(speed, {**curve.values, **dict(zip(curve.free, values, strict=True))})

    by = gradients(torque, point, 1e-5 * np.where(point != 0.0, np.abs(point), 1.0))
    return np.asarray(student(fit.freedom) * propagated(by, curve.covariance))


def doubts(fit: DirectionFit) -> Iterator[str]:
    """Limits of a fit with delta free, as sentences without a full stop."""
    curve = fit.fits["free"]
    for name, side in curve.bounds.items():
        yield f"{name} ended at its {side} bound {curve.values[name]:.4g}"
    if not fit.shows_stribeck_effect:
        yield ("no Stribeck effect shows: static_torque and stribeck_velocity are not determined")
    for name, which in (("static_torque", "slower"), ("coulomb_torque", "faster")):
        if why := fit.beyond(name):
            yield f"{why}; add {which} ones"
    if fit.lack_of_fit is not None and fit.lack_of_fit < LACKING:
        yield (
            f"repeated points scatter less than they deviate from the curve (p = "
            f"{fit.lack_of_fit:.2g}): Equation 4.6 is not all there is"
        )
    if fit.curve_misfit is not None:
        yield (
            f"residuals of neighboring speeds are alike (p = {fit.curve_misfit.p:.2g}): the "
            "points do not follow Equation 4.6; intervals of parameters include that, the curve's "
            "band does not"
        )
