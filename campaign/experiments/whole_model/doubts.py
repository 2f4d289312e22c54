"""Uncertainty of a fitted model: systematic parts, and numbers that are not determined."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import USELESS
from campaign.estimation.intervals import LEVEL, shifted_by
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.presliding_share import Presliding
from campaign.estimation.whole_model import METHOD, ModelFit, moved_with
from campaign.experiments.any_motion.instrument_estimates import NORMAL_95
from campaign.experiments.any_motion.inverse_fit import in_presliding, undetermined
from campaign.experiments.whole_model.residuals import Model
from campaign.physics.friction.unknowns import DerivedOption
from campaign.reason import Cause
from campaign.text import words
from campaign.units import in_words

BAND = 0.4
"""Share of the rows' rate that their low-pass passes."""
RESOLVED = 3.0
"""Shortest duration of an effect that differs from a jump, in time constants of the low-pass."""
DELAY_UNKNOWN = Cause(
    "delay unknown", "a delay of {milliseconds:.2g} ms more or less leaves it open"
)
HALF_BAND = Cause("half band differs", "half the band finds {shown}")
OTHER_EXPONENT = Cause("exponent left open", "with another exponent it is {shown}")
LOOP_IN_DELAY = Cause("loop in the delay", "it takes what a loop makes of noise as well")
BASE_UNKNOWN = Cause("base unknown", "without a known {base} it means nothing")
UNRESOLVED = Cause(
    "faster than rows", "{what} takes {milliseconds:.2g} ms, and rows show {resolved:.2g} ms"
)
CORRELATED = Cause(
    "residuals correlated",
    "the model is incomplete: its residuals are correlated (effective size {worth} of {rows} rows)",
)
WORTH = 0.5
"""Share of effective rows below which numbers of reversals are not determined."""
FACTOR_UNKNOWN = Cause("factor unknown", "{factor}: {reason}")
SHOWN = {"rad/s": "deg/s"}
"""Units of numbers in sentences, by units of estimates."""
SMALL = 1e-6
"""Relative step of an unknown for the slope of a derived option."""


def with_delay(fit: ModelFit, doubt: float) -> ModelFit:
    """Add the uncertainty of the delay (s) as a systematic part; above `USELESS` not determined."""
    moved = moved_with(fit, "delay", doubt)
    estimates = dict(fit.estimates)
    for name, one in fit.estimates.items():
        if not one.has_interval or name not in moved:
            continue
        estimates[name] = shifted_by(one, "delay", abs(moved[name]))
        if estimates[name].half_width > USELESS * abs(one.value):
            reason = DELAY_UNKNOWN(milliseconds=1e3 * doubt)
            estimates[name] = undetermined(one, reason)
    return replace(fit, estimates=estimates)


def doubt_of_delay(delay: Estimate, again: float, sample: float, known: Estimate | None) -> float:
    """Uncertainty of a fitted delay (s, 1 sigma).

    The answer of a loop to noise resembles a delay, and times the inertia viscous friction: the
    whole delay may be this effect. A value held for a sample is half a sample late. Instruments
    along a wanted motion may have a lower uncertainty. again: delay from half the band (s).
    """
    scatter = delay.standard_error or 0.0
    spread = math.hypot(scatter, again - delay.value)
    doubt = max(0.5 * sample, spread, abs(delay.value) / NORMAL_95)
    if known is None or not known.has_interval:
        return doubt
    instrumental = math.hypot(scatter, known.half_width / NORMAL_95, known.value - delay.value)
    return min(doubt, instrumental)


def shifted(fit: ModelFit, other: dict[str, float], source: str, cause: Cause) -> ModelFit:
    """Add the difference of another fit as a systematic part; above `USELESS` not determined."""
    estimates = {}
    for name, one in fit.estimates.items():
        estimate = (
            shifted_by(one, source, abs(other[name] - one.value)) if one.has_interval else one
        )
        if estimate.half_width > USELESS * abs(estimate.value):
            shown = in_words(other[name], one.unit, SHOWN.get(one.unit, "")).rstrip()
            estimate = undetermined(one, cause(shown=shown, value=other[name]))
        estimates[name] = estimate
    return replace(fit, estimates=estimates)


def without_loop(fit: ModelFit) -> ModelFit:
    """Remove the interval of the delay, which includes the answer of a loop to noise."""
    delay = fit.estimates["delay"]
    opened = Estimate.without_interval("delay", delay.value, "s", LOOP_IN_DELAY(), method=METHOD)
    return replace(fit, estimates={**fit.estimates, "delay": opened})


def with_presliding(fit: ModelFit, model: Model, found: Presliding | None) -> ModelFit:
    """Mark friction of an axis that hardly slides as not determined.

    Numbers of reversals remain: they act in presliding, or rest on friction of sliding.
    """
    if found is None:
        return fit
    kept = {"delay", *(each.name for each in model.numbers if each.lasts is not None)}
    estimates = {
        name: one if name in kept else in_presliding(one, found)
        for name, one in fit.estimates.items()
    }
    return replace(fit, estimates=estimates)


def with_bases(fit: ModelFit, model: Model) -> ModelFit:
    """Mark numbers without a measured base in a group of `rests_on` as not determined."""
    estimates = dict(fit.estimates)
    for each in model.numbers:
        for names in each.rests_on:
            bases = [estimates[name] for name in names]
            lost = all(base.origin is not Origin.MEASURED for base in bases)
            if lost and estimates[each.name].origin is Origin.MEASURED:
                reason = BASE_UNKNOWN(base=" or ".join(words(base.name) for base in bases))
                estimates[each.name] = undetermined(estimates[each.name], reason)
    return replace(fit, estimates=estimates)


def resolved(
    fit: ModelFit, model: Model, motions: Sequence[Motion], filtering: FilterSettings
) -> ModelFit:
    """Mark numbers of effects at reversals that are faster than rows resolve as not determined.

    A filtered jump of friction resembles bristles, and a Stribeck curve.
    """
    names = [unknown.name for unknown in fit.found.unknowns]
    values = dict(zip(names, fit.values, strict=True))
    band = BAND * motions[0].sample_rate / filtering.decimation
    shortest = RESOLVED / (2.0 * math.pi * min(band, filtering.low_pass))
    turning = _turning(motions)
    estimates = dict(fit.estimates)

    options = model.options(values)
    for each in model.numbers:
        if each.lasts is None:
            continue
        takes = each.lasts.time(options, turning)
        if takes < shortest:
            reason = UNRESOLVED(
                what=each.lasts.what, milliseconds=1e3 * takes, resolved=1e3 * shortest
            )
            estimates[each.name] = undetermined(estimates[each.name], reason)
    return replace(fit, estimates=estimates)


def described(fit: ModelFit, model: Model) -> ModelFit:
    """Mark numbers of reversals as not determined if the residuals are correlated.

    Residuals of a correct model with noise are not; those of several interfaces fitted as one are.
    """
    rows = sum(map(len, fit.residuals))
    if fit.regression is None or fit.regression.effective >= WORTH * rows:
        return fit
    reason = CORRELATED(rows=rows, worth=round(fit.regression.effective))
    estimates = dict(fit.estimates)
    for each in model.numbers:
        if each.lasts is not None and estimates[each.name].origin is Origin.MEASURED:
            estimates[each.name] = undetermined(estimates[each.name], reason)
    return replace(fit, estimates=estimates)


def _turning(motions: Sequence[Motion]) -> float:
    """Acceleration (rad/s^2) of reversals: the median where the rate changes its sign."""
    accelerations = []
    for motion in motions:
        crossing = np.flatnonzero(motion.rate[1:] * motion.rate[:-1] < 0.0)
        accelerations.append(np.abs(motion.acceleration[crossing]))
    whole = np.concatenate(accelerations)
    return max(float(np.median(whole)) if len(whole) else 0.0, 1e-12)


def derived(one: DerivedOption, values: Mapping[str, float], fit: ModelFit) -> Estimate:
    """Option that is derived from several unknowns, by the delta method.

    It is not determined if one of these is not. values: of all unknowns (SI), by name.
    """
    value, estimates = one.value(values), fit.estimates
    slopes = {name: _slope(one, values, name) for name in values}
    slopes = {name: slope for name, slope in slopes.items() if slope != 0.0}
    for name in slopes:
        if estimates[name].origin is not Origin.MEASURED:
            reason = FACTOR_UNKNOWN(factor=words(name), reason=estimates[name].reason)
            return Estimate.without_interval(
                one.name, value, one.unit, reason, method=METHOD, origin=Origin.NOT_DETERMINED
            )
    moved = {
        name: slope * (estimates[name].standard_error or 0.0) for name, slope in slopes.items()
    }
    variance = sum(each**2 for each in moved.values())
    for (first, second), share in fit.correlation.items():
        variance += 2.0 * share * moved.get(first, 0.0) * moved.get(second, 0.0)
    error = math.sqrt(max(variance, 0.0))
    # The interval has as many standard deviations as the widest one of the unknowns.
    wide = max(
        (each.high - each.value) / each.standard_error
        for each in map(estimates.__getitem__, slopes)
        if each.high is not None and each.standard_error
    )
    freedom = [each for name in slopes if (each := estimates[name].freedom) is not None]
    made = Estimate(
        one.name, value, one.unit, value - wide * error, value + wide * error, LEVEL, METHOD,
        standard_error=error, freedom=min(freedom, default=None),
    )  # fmt: skip
    # One cause may shift several unknowns together, with unknown correlation: sizes add.
    sizes: dict[str, float] = {}
    for name, slope in slopes.items():
        for part in estimates[name].systematic:
            size = abs(slope) * (part.standard_uncertainty or 0.0)
            sizes[part.source] = sizes.get(part.source, 0.0) + size
    for source, size in sizes.items():
        made = shifted_by(made, source, size)
    return made


def _slope(one: DerivedOption, values: Mapping[str, float], name: str) -> float:
    """Derivative of an option by an unknown: a central difference."""
    step = SMALL * abs(values[name]) or SMALL
    low, high = (one.value({**values, name: values[name] + sign * step}) for sign in (-1.0, 1.0))
    return (high - low) / (2.0 * step)
