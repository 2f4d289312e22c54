"""What is in doubt of a fitted model: systematic parts, and numbers that are not determined."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import USELESS
from campaign.estimation.intervals import LEVEL, shifted_by
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.whole_model import METHOD, ModelFit, moved_with
from campaign.experiments.whole_model.residuals import Model
from campaign.physics.friction.unknowns import DerivedOption
from campaign.reason import Cause, Reason
from campaign.text import words
from campaign.units import in_words

BAND = 0.4
"""of the rows' rate that their low-pass leaves."""
RESOLVED = 3.0
"""Time constants of the low-pass that something must take to be seen as more than a jump."""
NORMAL_95 = 1.96
"""Half of a two-sided 95 % interval over its standard deviation."""
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
"""of the rows, below which residuals are worth too little for what happens in reversals."""
FACTOR_UNKNOWN = Cause("factor unknown", "{factor}: {reason}")
SHOWN = {"rad/s": "deg/s"}
"""Units in which a sentence has a number, by those of estimates."""
SMALL = 1e-6
"""Relative change of an unknown for the slope of what is derived from it."""


def with_delay(fit: ModelFit, doubt: float) -> ModelFit:
    """With the doubt about the delay (s) as a systematic part; too much of it leaves open."""
    moved = moved_with(fit, "delay", doubt)
    found = dict(fit.estimates)
    for name, one in fit.estimates.items():
        if not one.has_interval or name not in moved:
            continue
        found[name] = shifted_by(one, "delay", abs(moved[name]))
        if found[name].half_width > USELESS * abs(one.value):
            reason = DELAY_UNKNOWN(milliseconds=1e3 * doubt)
            found[name] = _open(one, reason)
    return replace(fit, estimates=found)


def doubt_of_delay(delay: Estimate, again: float, sample: float, known: Estimate | None) -> float:
    """By how much a fitted delay may be wrong (s, 1 sigma).

    What a loop makes of noise looks like a delay, and times the inertia like viscous friction: all
    of it may be that, and none a delay; what is held for a sample is half of it late. Instruments
    along a wanted motion may know better. again: what half the band finds (s).
    """
    scatter = delay.standard_error or 0.0
    spread = math.hypot(scatter, again - delay.value)
    doubt = max(0.5 * sample, spread, abs(delay.value) / NORMAL_95)
    if known is None or not known.has_interval:
        return doubt
    told = math.hypot(scatter, known.half_width / NORMAL_95, known.value - delay.value)
    return min(doubt, told)


def _open(one: Estimate, reason: Reason) -> Estimate:
    return Estimate.without_interval(
        one.name, one.value, one.unit, reason, method=METHOD, origin=Origin.NOT_DETERMINED
    )


def shifted(fit: ModelFit, other: dict[str, float], source: str, cause: Cause) -> ModelFit:
    """With what another fit finds otherwise as a systematic part; too much of it leaves open."""
    found = {}
    for name, one in fit.estimates.items():
        told = shifted_by(one, source, abs(other[name] - one.value)) if one.has_interval else one
        if told.half_width > USELESS * abs(told.value):
            shown = in_words(other[name], one.unit, SHOWN.get(one.unit, "")).rstrip()
            told = _open(one, cause(shown=shown, value=other[name]))
        found[name] = told
    return replace(fit, estimates=found)


def without_loop(fit: ModelFit) -> ModelFit:
    """The delay without interval: what a loop makes of noise is in it."""
    delay = fit.estimates["delay"]
    told = Estimate.without_interval("delay", delay.value, "s", LOOP_IN_DELAY(), method=METHOD)
    return replace(fit, estimates={**fit.estimates, "delay": told})


def with_bases(fit: ModelFit, model: Model) -> ModelFit:
    """Without what means nothing, as nothing is measured that it rests on."""
    found = dict(fit.estimates)
    for each in model.numbers:
        for names in each.rests_on:
            bases = [found[name] for name in names]
            lost = all(base.origin is not Origin.MEASURED for base in bases)
            if lost and found[each.name].origin is Origin.MEASURED:
                reason = BASE_UNKNOWN(base=" or ".join(words(base.name) for base in bases))
                found[each.name] = _open(found[each.name], reason)
    return replace(fit, estimates=found)


def resolved(
    fit: ModelFit, model: Model, motions: Sequence[Motion], filtering: FilterSettings
) -> ModelFit:
    """Without what happens at reversals faster than the rows can show.

    A jump of friction that is filtered looks like bristles, and like a Stribeck curve.
    """
    names = [unknown.name for unknown in fit.found.unknowns]
    values = dict(zip(names, fit.values, strict=True))
    band = BAND * motions[0].sample_rate / filtering.decimation
    shortest = RESOLVED / (2.0 * math.pi * min(band, filtering.low_pass))
    turning = _turning(motions)
    found = dict(fit.estimates)

    options = model.options(values)
    for each in model.numbers:
        if each.lasts is None:
            continue
        takes = each.lasts.time(options, turning)
        if takes < shortest:
            reason = UNRESOLVED(
                what=each.lasts.what, milliseconds=1e3 * takes, resolved=1e3 * shortest
            )
            found[each.name] = _open(found[each.name], reason)
    return replace(fit, estimates=found)


def described(fit: ModelFit, model: Model) -> ModelFit:
    """Without what happens in reversals where the model does not describe them.

    Its residuals are correlated then, of a right model with noise they are not: as where several
    interfaces are fitted as one.
    """
    rows = sum(map(len, fit.residuals))
    if fit.regression is None or fit.regression.effective >= WORTH * rows:
        return fit
    reason = CORRELATED(rows=rows, worth=round(fit.regression.effective))
    found = dict(fit.estimates)
    for each in model.numbers:
        if each.lasts is not None and found[each.name].origin is Origin.MEASURED:
            found[each.name] = _open(found[each.name], reason)
    return replace(fit, estimates=found)


def _turning(motions: Sequence[Motion]) -> float:
    """Acceleration (rad/s^2) of reversals: the median where the rate changes its sign."""
    found = []
    for motion in motions:
        crossing = np.flatnonzero(motion.rate[1:] * motion.rate[:-1] < 0.0)
        found.append(np.abs(motion.acceleration[crossing]))
    whole = np.concatenate(found)
    return max(float(np.median(whole)) if len(whole) else 0.0, 1e-12)


def derived(one: DerivedOption, values: Mapping[str, float], fit: ModelFit) -> Estimate:
    """An option that follows from several unknowns, by the delta method.

    It is not determined where one of these is not. values: of all unknowns (SI), by name.
    """
    value, told = one.value(values), fit.estimates
    slopes = {name: _slope(one, values, name) for name in values}
    slopes = {name: slope for name, slope in slopes.items() if slope != 0.0}
    for name in slopes:
        if told[name].origin is not Origin.MEASURED:
            reason = FACTOR_UNKNOWN(factor=words(name), reason=told[name].reason)
            return _open(Estimate.without_interval(one.name, value, one.unit, reason), reason)
    moved = {name: slope * (told[name].standard_error or 0.0) for name, slope in slopes.items()}
    variance = sum(each**2 for each in moved.values())
    for (first, second), share in fit.correlation.items():
        variance += 2.0 * share * moved.get(first, 0.0) * moved.get(second, 0.0)
    error = math.sqrt(max(variance, 0.0))
    # The widest interval of all says how many deviations an interval has.
    wide = max(
        (each.high - each.value) / each.standard_error
        for each in map(told.__getitem__, slopes)
        if each.high is not None and each.standard_error
    )
    freedom = [each for name in slopes if (each := told[name].freedom) is not None]
    made = Estimate(
        one.name, value, one.unit, value - wide * error, value + wide * error, LEVEL, METHOD,
        standard_error=error, freedom=min(freedom, default=None),
    )  # fmt: skip
    # Of one cause in several nobody knows whether it moves them together: sizes add.
    sizes: dict[str, float] = {}
    for name, slope in slopes.items():
        for part in told[name].systematic:
            size = abs(slope) * (part.standard_uncertainty or 0.0)
            sizes[part.source] = sizes.get(part.source, 0.0) + size
    for source, size in sizes.items():
        made = shifted_by(made, source, size)
    return made


def _slope(one: DerivedOption, values: Mapping[str, float], name: str) -> float:
    """How much it changes with an unknown: a central difference."""
    step = SMALL * abs(values[name]) or SMALL
    low, high = (one.value({**values, name: values[name] + way * step}) for way in (-1.0, 1.0))
    return (high - low) / (2.0 * step)
