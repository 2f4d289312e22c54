"""Coefficients by instruments: a simulated motion replaces the measured regressors.

If the commanded motion is recorded, the loop between command and force is estimated, and the fitted
model is simulated within that loop: its motion has no noise and no disturbance. If not, the model
follows the recorded force, in which a loop may have put noise. Such instruments are reported beside
least squares and decide nothing. A second simulation uses the coefficients of the first, as refined
instrumental variables do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import shifted_by
from campaign.estimation.inverse.coefficients import coefficient, farthest
from campaign.estimation.inverse.delay import LONGEST
from campaign.estimation.inverse.instruments import WEAK, InstrumentFit, by_instruments
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.regression import Piece
from campaign.estimation.inverse.rows import all_rows, moving
from campaign.estimation.inverse.simulation import Loop, driven_motion, find_loop, followed_motion
from campaign.estimation.inverse.terms import Term
from campaign.experiments.any_motion.motions import MotionPiece

ROUNDS = 2
"""Number of simulations; each uses the coefficients that instruments gave before."""
ALONG_WANTED = "simulated along the wanted motion"
ALONG_FORCE = "simulated along the recorded force"
NORMAL_95 = 1.96
"""Half of a two-sided 95 % interval over its standard deviation."""
UNSTABLE = 100.0
"""Times the fastest measured rate, above which a simulated motion is unstable."""


@dataclass(frozen=True)
class Instruments:
    """Estimates by instruments.

    Attributes:
        along: the signal along which the motion was simulated.
        of_wanted: whether that signal is the commanded motion, which has no noise.
        found: the regression; with `delay` its last coefficient is that of the delay.
        estimates: of the terms, by name, with systematic parts of band, rate limit and delay.
        delay: of the force; None if it was not fitted, or is at the end of its range.
    """

    along: str
    of_wanted: bool
    found: InstrumentFit
    estimates: dict[str, Estimate]
    delay: Estimate | None


def instruments(
    pieces: Sequence[MotionPiece],
    terms: Sequence[Term],
    values: Array,
    filtering: FilterSettings,
    delay: float,
    *,
    stated: bool = False,
) -> tuple[Instruments | None, str]:
    """Instruments by the commanded motion, or else along the force; and why not the better ones.

    Args:
        values: of the terms, by least squares.
        delay: of the force (s); fitted again with the commanded motion, unless it is `stated`.
    """
    fit = partial(_iterated, pieces, terms, values, filtering, delay, stated=stated)
    wanted = [(each.motion, each.wanted) for each in pieces if each.wanted is not None]
    try:
        if len(wanted) < len(pieces):
            raise ValueError("the commanded motion was not recorded")
        loops = [find_loop(*each, filtering.low_pass) for each in wanted]
        found = fit(loops, fitted=not stated)
        if not stated and not np.all(found.found.strength >= WEAK):  # that of the delay is the last
            found = fit(loops, fitted=False)
        return _checked(found, terms), ""
    except ValueError as error:
        why = str(error)
    try:
        return _checked(fit(None, fitted=False), terms), why
    except ValueError as error:
        return None, f"{why}; along the recorded force: {error}"


def held_against(
    squares: Mapping[str, Estimate], found: Instruments | None
) -> tuple[dict[str, Estimate], bool]:
    """Reported coefficients by name, and whether they are those of instruments.

    Least squares, with their difference to instruments as a systematic part. A difference larger
    than scatter shows that noise of the motion biases least squares. Then all coefficients are
    those of instruments, if these are of the commanded motion.
    """
    if found is None:
        return dict(squares), False
    if found.of_wanted and differs(squares, found):
        return found.estimates, True
    return {n: _shifted(one, found.estimates[n]) for n, one in squares.items()}, False


def differs(squares: Mapping[str, Estimate], found: Instruments) -> bool:
    """Whether a coefficient of the two differs by more than its scatter."""
    return any(_differ(one, found.estimates[name]) for name, one in squares.items())


def judged_delay(late: Estimate, found: Instruments | None) -> Estimate:
    """The reported delay: checked against instruments, as coefficients are.

    Without a delay by instruments, the whole delay may be a loop's reaction to noise and
    disturbances: its systematic part then includes zero.
    """
    if late.origin is Origin.GIVEN:
        return late
    if found is None or found.delay is None or not found.delay.has_interval:
        if math.isnan(late.value):
            return late
        return shifted_by(late, "loop", abs(late.value) / NORMAL_95)
    if math.isnan(late.value) or _differ(late, found.delay):
        return found.delay
    return _shifted(late, found.delay)


def _differ(one: Estimate, other: Estimate) -> bool:
    """Whether two differ by more than the scatter of `one` and the interval of `other`.

    False without these. Systematic parts of `one` are left out: they include the tested noise.
    """
    if one.low is None or one.high is None:
        return False
    scatter = 0.5 * (one.high - one.low)
    return abs(one.value - other.value) > math.hypot(scatter, other.half_width)


def _shifted(one: Estimate, other: Estimate) -> Estimate:
    if not one.has_interval:
        return one
    return shifted_by(one, "instruments", abs(one.value - other.value))


def _checked(found: Instruments, terms: Sequence[Term]) -> Instruments:
    """The instruments. Raises ValueError if they are weak for a term."""
    strength = found.found.strength[: len(terms)]
    index = int(np.argmin(strength))
    if not strength[index] >= WEAK:
        raise ValueError(
            f"the simulated motion hardly determines {terms[index].name} (F {strength[index]:.2g})"
        )
    return found


def _iterated(
    pieces: Sequence[MotionPiece],
    terms: Sequence[Term],
    values: Array,
    filtering: FilterSettings,
    delay: float,
    loops: Sequence[Loop] | None,
    *,
    fitted: bool,
    stated: bool,
) -> Instruments:
    """Instruments after `ROUNDS` simulations. Raises ValueError if there is no regression.

    fitted: whether the delay is fitted too; stated: whether it is known.
    """
    reach = max(LONGEST, 5.0 / pieces[0].motion.sample_rate)
    for _ in range(ROUNDS):
        made = _simulated(pieces, terms, values, delay, loops)
        fit = _regressed(pieces, made, terms, values, filtering, delay, fitted=fitted)
        at, before = values, delay
        values = fit.fit.values[: len(terms)]
        if fitted:
            delay = min(max(delay + float(fit.fit.values[-1]), -reach), reach)
    along = ALONG_FORCE if loops is None else ALONG_WANTED
    others = {
        "band": [(filtering.half_band, before)],
        "slow": [(each, before) for each in filtering.faster],
    }
    if not fitted and not stated:
        uncertainty = max(1.0 / pieces[0].motion.sample_rate, abs(before) / NORMAL_95)
        others["delay"] = [(filtering, before - uncertainty)]

    def other(rows: FilterSettings, late: float) -> Array:
        return _regressed(pieces, made, terms, at, rows, late, fitted=fitted).fit.values

    parts = {
        source: farthest(fit.fit.values, [partial(other, *each) for each in every])
        for source, every in others.items()
    }
    method = f"instruments {along}"
    estimates = {
        term.name: coefficient(
            fit.fit, index, term.name, term.unit, float(values[index]), method, parts
        )
        for index, term in enumerate(terms)
    }
    delay_estimate = None
    if fitted and abs(delay) < reach:
        delay_estimate = coefficient(fit.fit, len(terms), "delay", "s", delay, method, parts)
    return Instruments(along, loops is not None, fit, estimates, delay_estimate)


def _simulated(
    pieces: Sequence[MotionPiece],
    terms: Sequence[Term],
    values: Array,
    delay: float,
    loops: Sequence[Loop] | None,
) -> list[Motion]:
    made = []
    for number, each in enumerate(pieces):
        if loops is None or each.wanted is None:
            one = driven_motion(each.motion, terms, values, delay)
        else:
            one = followed_motion(each.motion, each.wanted, loops[number], terms, values)
        fastest = float(np.abs(one.rate).max())
        if not fastest < UNSTABLE * float(np.abs(each.motion.rate).max()):
            raise ValueError("the model runs away")
        made.append(one)
    return made


def _regressed(
    pieces: Sequence[MotionPiece],
    made: Sequence[Motion],
    terms: Sequence[Term],
    values: Array,
    filtering: FilterSettings,
    delay: float,
    *,
    fitted: bool,
) -> InstrumentFit:
    """Regression on rows where both move; for the delay a column: the model force's time slope."""
    own: list[Piece] = []
    other: list[Piece] = []
    for piece, one in zip(pieces, made, strict=True):
        motion = piece.motion.part(slice(len(one.time)))
        both = moving(motion, filtering) * moving(one, filtering)
        rows = [all_rows(motion, terms, filtering, delay), all_rows(one, terms, filtering)]
        for each, into in zip(rows, (own, other), strict=True):
            columns = each.columns
            if fitted:
                # Its coefficient is the further delay of the force.
                change = np.gradient(columns @ values, each.time)
                columns = np.column_stack([columns, change])
            into.append(Piece(columns * both[:, None], each.force * both, each.time))
    try:
        return by_instruments(own, other)
    except np.linalg.LinAlgError as error:
        raise ValueError("the simulated motion does not separate the model's terms") from error
