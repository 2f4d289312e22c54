"""Friction models fitted to motions, and compared on unseen rows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from campaign.estimate import Estimate
from campaign.estimation.inverse.motion import FilterSettings, Motion, kept_times
from campaign.estimation.inverse.presliding_share import Presliding
from campaign.estimation.inverse.rows import late_force, moving
from campaign.estimation.inverse.structure_choice import criterion, structure
from campaign.estimation.inverse.terms import DIRECTIONAL, TERMS, Term
from campaign.estimation.inverse.validation import Prediction, improvement, relative_error
from campaign.estimation.unknowns import Unknown
from campaign.estimation.whole_model import ModelFit, fit_model, held_out, refitted
from campaign.experiments.any_motion.inverse_fit import together
from campaign.experiments.any_motion.motions import MotionPiece, never_moved
from campaign.experiments.interface import no_progress, say_at
from campaign.experiments.whole_model.doubts import (
    HALF_BAND,
    OTHER_EXPONENT,
    UNRESOLVED,
    described,
    doubt_of_delay,
    resolved,
    shifted,
    with_bases,
    with_delay,
    with_presliding,
    without_loop,
)
from campaign.experiments.whole_model.residuals import (
    EXPONENT_FREE,
    USUAL,
    Model,
    Residuals,
    models,
    steps_between,
)
from campaign.physics.friction.unknowns import EXPONENT, Sizes

DELAYS = 5.0
"""Largest delay of the force, to either side, in samples."""
BLOCKS, EVERY = 12, 3
"""Blocks of each recording, of which one in `EVERY` is held out."""
STRONG = 10.0
"""Difference of BIC from which two models are distinguished."""
WIDE = 5.0
"""Factor between the inertia of plain inverse dynamics and its bounds."""


@dataclass(frozen=True)
class Fit:
    """Fit of one model.

    Attributes:
        extra: further linear terms: an offset, a spring.
        held_out: relative residual of held-out blocks.
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
        """Whether its additions to a simpler model are faster than rows resolve."""
        estimates = self.fit.estimates
        own = (n for n in self.model.numbers if n.lasts is not None and n.lasts.replaced)
        return any(estimates[each.name].reason in UNRESOLVED for each in own)

    @property
    def values(self) -> dict[str, float]:
        """Values (SI) by name."""
        names = [unknown.name for unknown in self.fit.found.unknowns]
        return dict(zip(names, self.fit.values, strict=True))


@dataclass(frozen=True)
class Whole:
    """All models, and which one has the lowest BIC."""

    fits: tuple[Fit, ...]
    best: int
    filtering: FilterSettings
    pieces: tuple[MotionPiece, ...]

    @property
    def as_good(self) -> tuple[str, ...]:
        """Names of models that the motion does not separate from the best: BIC less than 10 above.

        A difference of 10 is strong evidence (Kass and Raftery 1995).
        """
        above = _above(self.fits)
        others = (i for i in range(len(above)) if i != self.best)
        return tuple(
            self.fits[i].model.name for i in others if above[i] - above[self.best] < STRONG
        )


def _above(fits: Sequence[Fit]) -> list[float]:
    """BIC of each fit less that of the fit with the lowest held-out residual.

    All use the effective number of rows of that fit: an incomplete model leaves correlated
    residuals, and would count few rows. A model with bristles faster than rows resolve gets inf:
    it represents a filtered jump, as a model without bristles does.
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
    pieces: Sequence[MotionPiece],
    unseen: Sequence[MotionPiece],
    filtering: FilterSettings,
    extra: Sequence[Term] = (),
    starts: int = 3,
    say: Callable[[str], None] = no_progress,
    *,
    known: Estimate | None = None,
    bristles: Presliding | None = None,
    names: Sequence[str] = USUAL,
    wanted: str = "",
) -> Whole:
    """Fit every model, and the best one with its exponent free, too.

    known: delay (s) from instruments along the wanted motion; None without any.
    bristles: their fit if the axis hardly slides, else None.
    names: of the friction models. wanted: name of a model to use instead of the best.

    Raises ValueError if the motion does not slide in both directions, for an unknown friction model
    or one that declares no unknowns, and if no model has the wanted name.
    """
    motions = [each.motion for each in pieces]
    sizes, inertia = _sizes(motions, filtering)
    fits: list[Fit] = []
    tried = models(sizes, names)

    def add(model: Model, inertia: float, starts: int) -> None:
        done = partial(say_at, say, f"model {len(fits) + 1} of {len(tried) + 1} ({model.name})")
        alike = "alike" in model.name
        terms = (*extra, TERMS["offset"]) if alike else tuple(extra)
        one = _fitted(model, terms, motions, filtering, inertia, starts, done, known, bristles)
        if unseen:
            one = _validated(one, fits[0] if fits else None, unseen, filtering)
        fits.append(one)

    for model in tried:
        add(model, inertia, starts)
    held = fits[_chosen(fits, wanted.removesuffix(EXPONENT_FREE))]
    if (free := held.model.with_exponent_free(held.values)) is not None:
        add(free, held.values["inertia"], starts=1)  # from the values of that fit
    return Whole(tuple(fits), _chosen(fits, wanted), filtering, tuple(pieces))


def _chosen(fits: Sequence[Fit], wanted: str) -> int:
    """Index of the wanted model, else of that with the lowest BIC."""
    names = [each.model.name for each in fits]
    if not wanted:
        above = _above(fits)
        return min(range(len(fits)), key=above.__getitem__)
    if wanted not in names:
        raise ValueError(f"there is no model {wanted!r}; there are {', '.join(names)}")
    return names.index(wanted)


def _sizes(motions: Sequence[Motion], filtering: FilterSettings) -> tuple[Sizes, float]:
    """Sizes of friction and motion, and inertia (kg m^2), from plain inverse dynamics."""
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
    filtering: FilterSettings,
    inertia: float,
    starts: int,
    say: Callable[[str], None],
    known: Estimate | None,
    bristles: Presliding | None,
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

    def left_in(band: FilterSettings, names: Sequence[str], model: Model) -> Residuals:
        return Residuals(names, model, extra, motions, band, steps_between(filtering))

    residuals = left_in(filtering, names, model)
    fit = fit_model(
        unknowns,
        units,
        residuals,
        starts=starts,
        display=lambda progress: say(progress.phase),
    )
    say("half the band")
    # The answer of a loop to noise, and shapes beyond the model, have other weights there.
    other = refitted(unknowns, left_in(filtering.half_band, names, model), fit.found.shares)
    again = dict(zip(names, other, strict=True))
    doubt = doubt_of_delay(fit.estimates["delay"], again["delay"], 1.0 / rate, known)
    fit = without_loop(shifted(fit, again, "band", HALF_BAND))
    free = model.with_exponent_free(dict(zip(names, fit.values, strict=True)))
    if free is not None:
        say("another exponent")
        more = left_in(filtering, [*names, EXPONENT.name], free)
        exponent = free.unknowns[-1]
        begin = np.append(fit.found.shares, exponent.share(EXPONENT.start))
        other = refitted((*unknowns, exponent), more, begin)
        fit = shifted(fit, dict(zip(names, other, strict=False)), "exponent", OTHER_EXPONENT)
    fit = with_presliding(with_delay(fit, doubt), model, bristles)
    fit = with_bases(described(resolved(fit, model, motions, filtering), model), model)
    say("blocks left out")
    forces = [late_force(motion, filtering)(0.0) * moving(motion, filtering) for motion in motions]
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


def _linear(term: Term, motions: Sequence[Motion], force: float) -> Unknown:
    largest = max(float(np.abs(term.column(motion)).max()) for motion in motions)
    return Unknown(term.name, -force / largest, force / largest, 0.0)


def _left_out(count: int) -> NDArray[np.bool_]:
    """Mask of the rows of every third block."""
    block = np.minimum(np.arange(count) * BLOCKS // max(count, 1), BLOCKS - 1)
    return np.asarray(block % EVERY == 1)


def _validated(
    one: Fit, reference: Fit | None, unseen: Sequence[MotionPiece], filtering: FilterSettings
) -> Fit:
    predictions = predicted(one, [each.motion for each in unseen], filtering)
    whole = together(predictions)
    gain = improvement("gain", together(reference.predictions), whole) if reference else None
    share = relative_error("validation", whole)
    return replace(one, predictions=predictions, validation=share, gain=gain)


def predicted(
    one: Fit, motions: Sequence[Motion], filtering: FilterSettings
) -> tuple[Prediction, ...]:
    """Predictions of a fitted model for other motions."""
    names = [unknown.name for unknown in one.fit.found.unknowns]
    made = Residuals(names, one.model, one.extra, motions, filtering, steps_between(filtering))
    values = one.fit.values
    sides = zip(motions, made.forces(values), made.modelled(values), strict=True)
    return tuple(Prediction(kept_times(each, filtering), *both) for each, *both in sides)
