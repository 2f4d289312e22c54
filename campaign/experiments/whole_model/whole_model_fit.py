"""Friction models fitted to motions, and compared on what none of them was fitted to."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import USELESS
from campaign.estimation.intervals import LEVEL, shifted_by
from campaign.estimation.inverse.choosing import criterion, structure
from campaign.estimation.inverse.motion import Filtering, Motion, kept_times
from campaign.estimation.inverse.rows import late_force, moving
from campaign.estimation.inverse.terms import DIRECTIONAL, TERMS, Term
from campaign.estimation.inverse.validation import Prediction, improvement, relative_error
from campaign.estimation.unknowns import Unknown
from campaign.estimation.whole_model import (
    METHOD,
    ModelFit,
    fit_model,
    held_out,
    moved_with,
    refitted,
)
from campaign.experiments.any_motion.inverse_fit import together
from campaign.experiments.any_motion.motions import Moved, never_moved
from campaign.experiments.interface import say_at
from campaign.experiments.whole_model.models import USUAL, Model, models
from campaign.experiments.whole_model.residuals import Residuals, steps_between
from campaign.physics.friction.sought import Sizes
from campaign.reason import Cause, Reason

DELAYS = 5.0
"""Samples to either side between which the force's delay is looked for."""
BLOCKS, EVERY = 12, 3
"""Blocks of each recording, and which of them are left out once: every third."""
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
LOOP_IN_DELAY = Cause("loop in the delay", "it takes what a loop makes of noise as well")
COULOMB_AT_BOUND = Cause(
    "Coulomb friction at bound", "it says how a Coulomb friction changes that went to its bound"
)
NO_STIFFNESS = Cause("no stiffness", "without a stiffness it means nothing")
UNRESOLVED = Cause(
    "faster than rows", "{what} takes {milliseconds:.2g} ms, and rows show {resolved:.2g} ms"
)
FACTOR_UNKNOWN = Cause("factor unknown", "{factor}: {reason}")
STRONG = 10.0
"""Difference of BIC from which on one model is told from another."""
WIDE = 5.0
"""How many times more or less than plain inverse dynamics the inertia may be."""


@dataclass(frozen=True)
class Fit:
    """One model, fitted.

    Attributes:
        extra: further terms that are linear: an offset, a spring.
        held_out: relative residual of blocks that a fit did not see.
        predictions: of the validation; empty without any.
        validation: relative residual there, and `gain`: by how much it is lower than the first
            model's; None without any.
    """

    model: Model
    extra: tuple[Term, ...]
    fit: ModelFit
    relative: float
    held_out: float
    criterion: float
    predictions: tuple[Prediction, ...] = ()
    validation: Estimate | None = None
    gain: Estimate | None = None

    @property
    def faster_than_rows(self) -> bool:
        """Whether its bristles bend faster than rows show."""
        below = (self.fit.estimates[n.name] for n in self.model.numbers if n.presliding)
        return any(each.reason in UNRESOLVED for each in below)

    @property
    def values(self) -> dict[str, float]:
        """SI, by name."""
        names = [unknown.name for unknown in self.fit.found.unknowns]
        return dict(zip(names, self.fit.values, strict=True))


@dataclass(frozen=True)
class Whole:
    """All models, and which one has the lowest BIC."""

    fits: tuple[Fit, ...]
    best: int
    filtering: Filtering
    pieces: tuple[Moved, ...]

    @property
    def as_good(self) -> tuple[str, ...]:
        """Names of others that the motion does not tell from the best: BIC less than 10 above.

        A difference of 10 is strong evidence (Kass and Raftery 1995).
        """
        above = _above(self.fits)
        others = (i for i in range(len(above)) if i != self.best)
        return tuple(
            self.fits[i].model.name for i in others if above[i] - above[self.best] < STRONG
        )


def _above(fits: Sequence[Fit]) -> list[float]:
    """BIC of each less that of the one that does best on blocks it was not fitted to.

    All on the rows that that one's are worth: a model that lacks something leaves correlated
    residuals, and would count few. A model whose bristles bend faster than rows show takes no part:
    it stands for a jump that is filtered, which a model without them has as well.
    """
    shown = [each for each in fits if not each.faster_than_rows]
    first = min(shown or fits, key=lambda each: each.held_out)
    rows = first.fit.regression.effective if first.fit.regression is not None else math.nan
    if not rows > 1.0:
        return [0.0 if each is first else math.inf for each in fits]
    return [
        2.0 * rows * math.log(each.relative / first.relative)
        + (len(each.fit.values) - len(first.fit.values)) * math.log(rows)
        if each in shown or not shown
        else math.inf
        for each in fits
    ]


def find(
    pieces: Sequence[Moved],
    unseen: Sequence[Moved],
    filtering: Filtering,
    extra: Sequence[Term] = (),
    starts: int = 3,
    say: Callable[[str], None] = lambda text: None,
    *,
    known: Estimate | None = None,
    names: Sequence[str] = USUAL,
) -> Whole:
    """Fit every model. Raises ValueError where the motion does not slide in both directions.

    known: the delay as instruments along the wanted motion have it (s); None without any.
    names: of the friction models; ValueError for one that does not say what is fitted of it.
    """
    motions = [each.motion for each in pieces]
    sizes, inertia = _sizes(motions, filtering)
    fits: list[Fit] = []
    tried = models(sizes, names)
    for number, model in enumerate(tried, 1):
        done = partial(say_at, say, f"model {number} of {len(tried)} ({model.name})")
        alike = "alike" in model.name
        terms = (*extra, TERMS["offset"]) if alike else tuple(extra)
        one = _fitted(model, terms, motions, filtering, inertia, starts, done, known)
        if unseen:
            one = _validated(one, fits[0] if fits else None, unseen, filtering)
        fits.append(one)
    above = _above(fits)
    best = min(range(len(fits)), key=above.__getitem__)
    return Whole(tuple(fits), best, filtering, tuple(pieces))


def _sizes(motions: Sequence[Motion], filtering: Filtering) -> tuple[Sizes, float]:
    """From plain inverse dynamics."""
    if missing := never_moved(motions, filtering.slowest):
        raise ValueError(f"the axis does not slide in the {missing[0]} direction")
    plain = structure(motions, [TERMS[name] for name in DIRECTIONAL], filtering)
    inertia, up, down, dry, back = plain.fit.values
    coulomb = (max(float(dry), 1e-9), max(float(back), 1e-9))
    if not inertia > 0 or not float(dry) + float(back) > 0:
        raise ValueError("plain inverse dynamics finds no inertia, or no friction, to begin with")
    rate = max(float(np.abs(motion.rate).max()) for motion in motions)
    travel = max(float(np.ptp(motion.position)) for motion in motions)
    return Sizes(coulomb, (float(up), float(down)), rate, travel), float(inertia)


def _fitted(
    model: Model,
    extra: tuple[Term, ...],
    motions: Sequence[Motion],
    filtering: Filtering,
    inertia: float,
    starts: int,
    say: Callable[[str], None],
    known: Estimate | None,
) -> Fit:
    rate = motions[0].sample_rate
    force = max(float(np.abs(motion.force).max()) for motion in motions)
    unknowns = (
        Unknown("inertia", inertia / WIDE, inertia * WIDE, inertia, logarithmic=True),
        *model.unknowns,
        Unknown("delay", -DELAYS / rate, DELAYS / rate, 0.0),
        *(_linear(term, motions, force) for term in extra),
    )
    units = {each.name: each.unit for each in model.numbers}
    units |= {"inertia": "kg m^2", "delay": "s"} | {term.name: term.unit for term in extra}
    names = [unknown.name for unknown in unknowns]

    def left_in(band: Filtering) -> Residuals:
        return Residuals(names, model, extra, motions, band, steps_between(filtering))

    residuals = left_in(filtering)
    fit = fit_model(
        unknowns,
        units,
        residuals,
        starts=starts,
        display=lambda progress: say(progress.phase),
    )
    say("half the band")
    # A loop that answers noise, and shapes that the model has not, weigh otherwise there.
    other = refitted(unknowns, left_in(filtering.half_band), fit.found.shares)
    again = dict(zip(names, other, strict=True))
    doubt = _doubt(fit.estimates["delay"], again["delay"], 1.0 / rate, known)
    fit = _with_delay(_with_band(fit, again), doubt)
    fit = resolved(fit, model, motions, filtering)
    say("blocks left out")
    forces = [
        late_force(motion, filtering).at(0.0) * moving(motion, filtering) for motion in motions
    ]
    norm = float(np.sqrt(sum(float(each @ each) for each in forces)))
    masks = [_left_out(len(each)) for each in forces]
    unseen = held_out(unknowns, residuals, fit.found.shares, masks)
    seen = np.concatenate([f[m] for f, m in zip(forces, masks, strict=True)])
    left = np.concatenate(fit.residuals)
    relative = float(np.linalg.norm(left)) / norm
    judged = math.nan
    if fit.regression is not None:
        own = replace(fit.regression, relative=relative, values=np.array(fit.values))
        judged = criterion(own, fit.regression.effective)
    return Fit(
        model,
        extra,
        fit,
        relative,
        float(np.linalg.norm(np.concatenate(unseen)) / np.linalg.norm(seen)),
        judged,
    )


def _with_delay(fit: ModelFit, doubt: float) -> ModelFit:
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


def _doubt(delay: Estimate, again: float, sample: float, known: Estimate | None) -> float:
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


def _with_band(fit: ModelFit, other: dict[str, float]) -> ModelFit:
    """With what half the band says otherwise as a systematic part; too much of it leaves open."""
    found = {}
    for name, one in fit.estimates.items():
        told = shifted_by(one, "band", abs(other[name] - one.value)) if one.has_interval else one
        if told.half_width > USELESS * abs(told.value):
            shown = f"{other[name]:.3g} {one.unit}".rstrip()
            reason = HALF_BAND(shown=shown, value=other[name])
            told = _open(one, reason)
        found[name] = told
    delay = found["delay"]
    found["delay"] = Estimate.without_interval(
        "delay", delay.value, "s", LOOP_IN_DELAY(), method=METHOD
    )
    dry = [name for name in found if name.startswith("coulomb")]
    lost = [name for name in dry if found[name].origin is Origin.AT_BOUND]
    of_it = [name.replace("coulomb", "static_over_coulomb") for name in lost]
    for name in (*of_it, *(["stribeck_velocity"] if lost == dry else [])):
        if name in found:
            found[name] = _open(found[name], COULOMB_AT_BOUND())
    stiffness = found.get("bristle_stiffness")
    if stiffness is not None and stiffness.origin is not Origin.MEASURED:
        for name in found.keys() & {"bristle_damping"}:
            found[name] = _open(found[name], NO_STIFFNESS())
    return replace(fit, estimates=found)


def resolved(
    fit: ModelFit, model: Model, motions: Sequence[Motion], filtering: Filtering
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

    def refuse(names: Sequence[str], takes: float, what: str) -> None:
        if takes >= shortest:
            return
        reason = UNRESOLVED(what=what, milliseconds=1e3 * takes, resolved=1e3 * shortest)
        for name in names:
            if name in found:
                found[name] = _open(found[name], reason)

    if "stribeck_velocity" in values:
        ratios = [each.name for each in model.numbers if each.over]
        slow = values["stribeck_velocity"]
        refuse(("stribeck_velocity", *ratios), slow / turning, "passing it in a reversal")
    if "bristle_stiffness" in values:
        bent = float(model.options(values)["coulomb_torque"]) / values["bristle_stiffness"]
        takes = math.sqrt(2.0 * bent / turning)
        below = [each.name for each in model.numbers if each.presliding]
        refuse(below, takes, "bending the bristles")
    return replace(fit, estimates=found)


def _turning(motions: Sequence[Motion]) -> float:
    """Acceleration (rad/s^2) of reversals: the median where the rate changes its sign."""
    found = []
    for motion in motions:
        crossing = np.flatnonzero(motion.rate[1:] * motion.rate[:-1] < 0.0)
        found.append(np.abs(motion.acceleration[crossing]))
    whole = np.concatenate(found)
    return max(float(np.median(whole)) if len(whole) else 0.0, 1e-12)


def _linear(term: Term, motions: Sequence[Motion], force: float) -> Unknown:
    largest = max(float(np.abs(term.column(motion)).max()) for motion in motions)
    return Unknown(term.name, -force / largest, force / largest, 0.0)


def _left_out(count: int) -> NDArray[np.bool_]:
    """Every third block."""
    block = np.minimum(np.arange(count) * BLOCKS // max(count, 1), BLOCKS - 1)
    return np.asarray(block % EVERY == 1)


def _validated(
    one: Fit, reference: Fit | None, unseen: Sequence[Moved], filtering: Filtering
) -> Fit:
    predictions = predicted(one, [each.motion for each in unseen], filtering)
    whole = together(predictions)
    gain = improvement("gain", together(reference.predictions), whole) if reference else None
    share = relative_error("validation", whole)
    return replace(one, predictions=predictions, validation=share, gain=gain)


def predicted(one: Fit, motions: Sequence[Motion], filtering: Filtering) -> tuple[Prediction, ...]:
    """What a fitted model says of other motions."""
    names = [unknown.name for unknown in one.fit.found.unknowns]
    made = Residuals(names, one.model, one.extra, motions, filtering, steps_between(filtering))
    values = one.fit.values
    sides = zip(motions, made.forces(values), made.modelled(values), strict=True)
    return tuple(Prediction(kept_times(each, filtering), *both) for each, *both in sides)


def product(name: str, ratio: Estimate, base: Estimate, correlation: float) -> Estimate:
    """A ratio times what it is a ratio to, by the delta method; not determined where one is not."""
    value = ratio.value * base.value
    if ratio.origin is not Origin.MEASURED or base.origin is not Origin.MEASURED:
        which = ratio if ratio.origin is not Origin.MEASURED else base
        reason = FACTOR_UNKNOWN(factor=which.name.replace("_", " "), reason=which.reason)
        return Estimate.without_interval(
            name, value, base.unit, reason, method=METHOD, origin=Origin.NOT_DETERMINED
        )
    one = (ratio.standard_error or 0.0) / abs(ratio.value)
    two = (base.standard_error or 0.0) / abs(base.value)
    error = abs(value) * math.sqrt(max(one**2 + two**2 + 2.0 * correlation * one * two, 0.0))
    # The wider of both intervals says how many deviations an interval has.
    wide = max(
        (each.high - each.value) / each.standard_error
        for each in (ratio, base)
        if each.high is not None and each.standard_error
    )
    half = wide * error
    made = Estimate(
        name, value, base.unit, value - half, value + half, LEVEL, METHOD,
        standard_error=error, freedom=base.freedom,
    )  # fmt: skip
    # Of one cause in both nobody knows whether it moves them together: sizes add.
    sizes: dict[str, float] = {}
    for each, other in ((ratio, base), (base, ratio)):
        for part in each.systematic:
            moved = abs(other.value) * (part.standard_uncertainty or 0.0)
            sizes[part.source] = sizes.get(part.source, 0.0) + moved
    for source, size in sizes.items():
        made = shifted_by(made, source, size)
    return made
