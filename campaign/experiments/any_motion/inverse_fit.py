"""Inverse dynamics of motions: delay, then terms, then uncertainty."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import moved_by, shifted_by
from campaign.estimation.inverse.coefficients import estimates, shifts
from campaign.estimation.inverse.delay import find_delay
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.position_period import find_period
from campaign.estimation.inverse.presliding_share import HARDLY_SLIDES, Presliding, presliding
from campaign.estimation.inverse.regression import Regression
from campaign.estimation.inverse.rows import all_rows, rows
from campaign.estimation.inverse.simulation import relative_rate_error
from campaign.estimation.inverse.structure_choice import Structure, choose, structure
from campaign.estimation.inverse.terms import DIRECTIONAL, SYMMETRIC, TERMS, Term, periodic
from campaign.estimation.inverse.validation import Prediction, improvement, relative_error
from campaign.experiments.any_motion.instrument_estimates import (
    NORMAL_95,
    Instruments,
    held_against,
    instruments,
    judged_delay,
)
from campaign.experiments.any_motion.motions import PLACE_AND_RATE, MotionPiece, never_moved
from campaign.experiments.interface import no_progress
from campaign.reason import Cause, Reason

SQUARED = "_squared"
"""Suffix of the quadratic counterpart of a term over temperature."""
ROUNDS = 4
"""Largest number of rounds: terms are chosen at a delay, then the delay is estimated again."""
BENDS = Cause(
    "friction bends",
    "friction is nonlinear over these rates: it is one share of a sum, without own meaning",
)
STATED = Cause("stated", "stated")
PRESLIDING = "presliding"
"""Systematic part of bristles that an axis hardly leaves."""


@dataclass(frozen=True)
class CandidateFit:
    """A structure at a delay, with its predictions of the validation.

    Attributes:
        delay: s.
        predictions: of each piece of the validation; empty without validation.
        validation: relative residual of the validation; None without validation.
        gain: reduction of that residual against the plain directional model; None if there is none.
        simulated: relative error of the rate simulated from the force; NaN if it was not simulated
            or cannot be.
    """

    structure: Structure
    delay: float
    predictions: tuple[Prediction, ...] = ()
    validation: Estimate | None = None
    gain: Estimate | None = None
    simulated: float = math.nan


@dataclass(frozen=True)
class InverseDynamics:
    """Result of inverse dynamics.

    Attributes:
        delay: of the force, checked against instruments; or as stated.
        tried: fits of all structures; first the plain ones without delay (symmetric and
            directional, or one direction).
        chosen: index in `tried`.
        squares: least-squares estimates of the chosen terms, by name, with systematic parts.
        estimates: reported estimates of the same terms, checked against instruments and bristles.
        instruments: of the chosen structure, or None.
        no_instruments: why there are none, or none along the commanded motion.
        biased: whether least squares differ from instruments by more than their scatter; then
            `estimates` are those of instruments.
        period: period over position that was tried; None without one.
        bristles: their fit if the axis hardly slides, else None.
    """

    pieces: tuple[MotionPiece, ...]
    filtering: FilterSettings
    delay: Estimate
    tried: tuple[CandidateFit, ...]
    chosen: int
    squares: dict[str, Estimate]
    estimates: dict[str, Estimate]
    instruments: Instruments | None
    no_instruments: str
    biased: bool
    period: float | None
    bristles: Presliding | None

    @property
    def best(self) -> CandidateFit:
        """The chosen fit."""
        return self.tried[self.chosen]

    @property
    def fit(self) -> Regression:
        """Regression of the chosen structure."""
        return self.best.structure.fit

    @property
    def matters(self) -> dict[str, float]:
        """Size of each coefficient, by name, below which its force is negligible in this motion."""
        return dict(zip(self.best.structure.names, map(float, self.fit.matters), strict=True))


def find(
    pieces: Sequence[MotionPiece],
    unseen: Sequence[MotionPiece],
    filtering: FilterSettings,
    *,
    delay: float | None = None,
    terms: Sequence[Term] | None = None,
    linear: bool = False,
    say: Callable[[str], None] = no_progress,
) -> InverseDynamics:
    """Identify from `pieces`; then predict `unseen`.

    Args:
        delay: of the force (s); None: estimated, and removed if its interval excludes zero.
        terms: the structure; None: it is chosen.
        linear: whether the axis is linear: then there is no gravity over an angle.
        say: receives the text of steps 2 to 4; step 1 has read the motion.

    Raises ValueError if the motions do not determine even the plain model.
    """
    motions = [each.motion for each in pieces]
    say("step 2 of 4, delay and terms")
    plain = _plain(motions, filtering)
    start = tuple(terms) if terms is not None else plain[-1].terms
    late = _delay(motions, start, filtering, delay)
    shift = _taken_out(late, delay)
    period = None
    more, picked = [structure(motions, start, filtering, shift)], 0
    for _ in range(ROUNDS if terms is None else 0):
        period = _period(motions, more[picked].terms, filtering, shift)
        candidates = _candidates(motions, period, linear=linear)
        more, picked = choose(motions, start, candidates, filtering, shift)
        # A missing term may have resembled a delay, and a delay a missing term.
        late = _delay(motions, more[picked].terms, filtering, delay)
        before, shift = shift, _taken_out(late, delay)
        if abs(shift - before) <= (late.standard_error or 0.0):
            shift = before
            # Gravity may hide a ripple: search again in the residuals of the new terms.
            again = _period(motions, more[picked].terms, filtering, shift)
            if again == period or repeats(more[picked]):
                break
    else:
        more = [structure(motions, each.terms, filtering, shift) for each in more]
    offset = len(plain)
    structures = [(each, 0.0) for each in plain] + [(each, shift) for each in more]
    picked += offset
    unseen_motions = [each.motion for each in unseen]
    simulated = {*range(len(plain)), picked}
    say("step 3 of 4, predictions")
    tried = _validated(structures, motions, unseen_motions, filtering, simulated)
    best = tried[picked]
    say("step 4 of 4, instruments")
    squares = _estimates(best, motions, filtering, late)
    held, why = instruments(
        pieces,
        best.structure.terms,
        best.structure.fit.values,
        filtering,
        best.delay,
        stated=delay is not None,
    )
    estimates, biased = held_against(squares, held)
    if terms is None:
        estimates = _without_shares(estimates, best.structure.terms)
    late = judged_delay(late, held)
    found = presliding(motions, best.structure, filtering, best.delay, stated=delay is not None)
    if found is not None:
        # Noise that biases least squares biases the fit of bristles, too, but not instruments.
        estimates = {
            name: in_presliding(one, found, corrected=not biased) for name, one in estimates.items()
        }
        if delay is None:
            late = shifted_by(late, PRESLIDING, abs(best.delay))
    return InverseDynamics(
        tuple(pieces),
        filtering,
        late,
        tuple(tried),
        picked,
        squares,
        estimates,
        held,
        why,
        biased,
        None if found is not None else period,
        found,
    )


def in_presliding(one: Estimate, found: Presliding, *, corrected: bool = False) -> Estimate:
    """Estimate of an axis that hardly slides.

    Friction, and what bristles have in place of it, is not determined. Other numbers have their
    difference to those beside bristles as a systematic part.

    corrected: whether they are corrected by that difference (GUM 3.2.4). A regression on the sign
        of the rate subtracts a part of the bristles' spring from the inertia: of 343 inertias of
        simulated benches under torques it made 337 smaller. The part stays as large as the
        correction, because friction is not one bristle either.
    """
    if one.name in found.values and not one.name.startswith("viscous"):
        if not one.has_interval:
            return one
        change = found.values[one.name] - one.value
        return shifted_by(moved_by(one, change) if corrected else one, PRESLIDING, abs(change))
    return undetermined(one, HARDLY_SLIDES(percent=100.0 * found.share, reach=found.reach))


def undetermined(one: Estimate, reason: Reason) -> Estimate:
    """The estimate as not determined: its value without an interval."""
    return Estimate.without_interval(
        one.name, one.value, one.unit, reason, method=one.method, origin=Origin.NOT_DETERMINED
    )


def _plain(motions: Sequence[Motion], filtering: FilterSettings) -> list[Structure]:
    """The usual models without delay; for a motion in one direction, its friction only."""
    everything = replace(filtering, slowest=0.0)
    missing = tuple(f"_{direction}" for direction in never_moved(motions, filtering.slowest))
    if not missing:
        sets = (SYMMETRIC, DIRECTIONAL)
        return [structure(motions, [TERMS[n] for n in names], everything) for names in sets]
    # Here dry friction and a constant force are one column; standstill determines neither.
    names = [name for name in DIRECTIONAL if not name.endswith(missing)]
    moving_only = filtering if filtering.slowest > 0 else everything
    return [structure(motions, [TERMS[name] for name in names], moving_only)]


def _delay(
    motions: Sequence[Motion],
    terms: Sequence[Term],
    filtering: FilterSettings,
    stated: float | None,
) -> Estimate:
    if stated is not None:
        return Estimate.without_interval("delay", stated, "s", STATED(), origin=Origin.GIVEN)
    return find_delay(motions, terms, filtering)


def _taken_out(late: Estimate, stated: float | None) -> float:
    """The delay (s) to remove: the stated one, or an estimate whose interval excludes zero; or 0.

    It improves predictions, whether it is a true delay or a loop's reaction to noise. The
    systematic part of every coefficient includes the difference between the two.
    """
    low, high = late.low, late.high
    sure = low is not None and high is not None and (low > 0 or high < 0)
    return late.value if sure or stated is not None else 0.0


def _candidates(
    motions: Sequence[Motion], period: float | None, *, linear: bool
) -> list[Sequence[Term]]:
    names: list[tuple[str, ...]] = [("spring",), ("square_root",), ("quadratic",)]
    if not linear:
        names.append(("gravity_sine", "gravity_cosine"))
    if all(motion.temperature is not None for motion in motions):
        names += [("coulomb_over_temperature",), ("viscous_over_temperature",)]
    candidates: list[Sequence[Term]] = [[TERMS[name] for name in group] for group in names]
    if period is not None:
        waves = periodic(period)
        candidates += [waves[:2], waves[2:]]
    return candidates


def _period(
    motions: Sequence[Motion], start: Sequence[Term], filtering: FilterSettings, delay: float
) -> float | None:
    fit = structure(motions, start, filtering, delay).fit
    place = [rows(motion, PLACE_AND_RATE, filtering).columns for motion in motions]
    whole = np.concatenate(place)
    interval = filtering.decimation / motions[0].sample_rate
    return find_period(whole[:, 0], whole[:, 1], np.concatenate(fit.residuals), interval)


def repeats(which: Structure) -> bool:
    """Whether a structure has a term that is periodic over position."""
    return any(name.startswith(("cogging", "ripple")) for name in which.names)


def _validated(
    found: Sequence[tuple[Structure, float]],
    motions: Sequence[Motion],
    unseen: Sequence[Motion],
    filtering: FilterSettings,
    moved: Collection[int],
) -> list[CandidateFit]:
    """Fits with their predictions of `unseen`; those at indices `moved` with a simulated rate."""
    fits: list[CandidateFit] = []
    reference: tuple[Prediction, ...] = ()
    for index, (which, delay) in enumerate(found):
        predictions = tuple(predicted(motion, which, filtering, delay) for motion in unseen)
        one = CandidateFit(which, delay, predictions)
        if index in moved:
            one = replace(one, simulated=_simulated(unseen or motions, which, delay))
        if predictions:
            if set(which.names) == set(DIRECTIONAL) and delay == 0.0 and not reference:
                reference = predictions
            whole = together(predictions)
            gain = improvement("gain", together(reference), whole) if reference else None
            one = replace(one, validation=relative_error("validation", whole), gain=gain)
        fits.append(one)
    return fits


def _simulated(motions: Sequence[Motion], which: Structure, delay: float) -> float:
    try:
        return relative_rate_error(motions, which.terms, which.fit.values, delay)
    except ValueError:
        return math.nan


def predicted(
    motion: Motion, which: Structure, filtering: FilterSettings, delay: float
) -> Prediction:
    """Force of another motion, predicted by a structure."""
    piece = all_rows(motion, which.terms, filtering, delay)
    return Prediction(piece.time, piece.force, piece.columns @ which.fit.values)


def together(predictions: Sequence[Prediction]) -> Prediction:
    """Predictions of several motions, concatenated."""
    return Prediction(
        np.concatenate([each.time for each in predictions]),
        np.concatenate([each.force for each in predictions]),
        np.concatenate([each.predicted for each in predictions]),
    )


def _estimates(
    best: CandidateFit, motions: Sequence[Motion], filtering: FilterSettings, late: Estimate
) -> dict[str, Estimate]:
    """Estimates of the chosen terms; systematic: band, slow rows, delay, temperature."""
    fit, terms = best.structure.fit, best.structure.terms
    parts = {
        "band": shifts(fit, motions, terms, [filtering.half_band], best.delay),
        "slow": shifts(fit, motions, terms, filtering.faster, best.delay),
    }
    if late.origin is not Origin.GIVEN:
        parts["delay"] = shifts(
            fit, motions, terms, [filtering], best.delay + _doubt(best, late, motions[0])
        )
    bends = [TERMS[f"{term.name}{SQUARED}"] for term in terms if f"{term.name}{SQUARED}" in TERMS]
    if bends:
        parts["curve over temperature"] = _moved_by(bends, best, motions, filtering)
    return estimates(fit, terms, parts)


def _moved_by(
    bends: Sequence[Term], best: CandidateFit, motions: Sequence[Motion], filtering: FilterSettings
) -> Array | None:
    """Changes of coefficients by further terms, shape (k,); None if those are not determined."""
    own = best.structure
    try:
        other = structure(motions, (*own.terms, *bends), filtering, best.delay)
    except ValueError:
        return None
    return np.asarray(np.abs(other.fit.values[: len(own.terms)] - own.fit.values))


def _without_shares(
    estimates: Mapping[str, Estimate], terms: Sequence[Term]
) -> dict[str, Estimate]:
    """Estimates without intervals of friction if the terms include one that is nonlinear in rate.

    That term approximates any curvature of friction, most often a Stribeck curve. Coulomb and
    viscous friction then compensate its error at other rates.
    """
    shares = {term.name for term in terms if term.family == "bend"}
    if not shares:
        return dict(estimates)
    return {
        name: undetermined(one, BENDS())
        if name in shares or name.startswith(("coulomb", "viscous"))
        else one
        for name, one in estimates.items()
    }


def _doubt(best: CandidateFit, late: Estimate, motion: Motion) -> float:
    """Uncertainty of the delay (s, 1 sigma); a sample interval if no delay was removed."""
    if best.delay == 0.0 or math.isnan(late.half_width):
        return 1.0 / motion.sample_rate
    return late.half_width / NORMAL_95
