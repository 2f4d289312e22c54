"""Choice of terms: cross-validation by blocks and an information criterion.

A term that improves the criterion on the rows of a fit can increase the error on other rows.
Therefore both must decrease, and the error on held-out blocks must decrease clearly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.regression import Piece, Regression, regress
from campaign.estimation.inverse.rows import in_blocks, part, rows
from campaign.estimation.inverse.terms import Term

BLOCKS = 10
"""Blocks of consecutive rows, each held out once."""
ALIKE = 300.0
"""Condition number of columns of unit length above which two columns are almost equal."""
CLEARLY = 2.0
"""Paired standard errors over blocks by which a further term must lower the error."""


@dataclass(frozen=True)
class Structure:
    """A set of terms with its fit and its errors.

    Attributes:
        fit: on all rows.
        held_out: norm of the error on held-out blocks over norm of the force.
        by_block: mean square error on each held-out block, shape (blocks,).
        criterion: Bayesian information criterion with the effective number of rows.
    """

    terms: tuple[Term, ...]
    fit: Regression
    held_out: float
    by_block: Array
    criterion: float

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(term.name for term in self.terms)


def structure(
    motions: Sequence[Motion],
    terms: Sequence[Term],
    filtering: FilterSettings,
    delay: float = 0.0,
    effective: float | None = None,
) -> Structure:
    """Fit these terms to all motions, and to all but each block.

    effective: number of rows in the criterion; default: that of the fit. Compared criteria must
        have the same number.

    Raises ValueError if columns are dependent, in all rows or without one block.
    """
    pieces = [rows(motion, terms, filtering, delay) for motion in motions]
    fit = regress(pieces)
    by_block, norm = held_out(pieces)
    count = fit.effective if effective is None else effective
    error = math.sqrt(float(np.sum(by_block[:, 0])) / norm)
    mean = by_block[:, 0] / by_block[:, 1]
    return Structure(tuple(terms), fit, error, mean, criterion(fit, count))


def criterion(fit: Regression, count: float) -> float:
    """Bayesian information criterion of a fit with the effective sample size `count`."""
    square = max(fit.relative**2, float(np.finfo(float).tiny))
    return count * math.log(square) + len(fit.values) * math.log(max(count, 2.0))


def held_out(pieces: Sequence[Piece]) -> tuple[Array, float]:
    """Squared error and rows of each held-out block, shape (blocks, 2); squared force.

    The block is subtracted from the normal equations of all rows, without a new regression.
    """
    whole = sum(p.columns.T @ p.columns for p in pieces)
    right = sum(p.columns.T @ p.force for p in pieces)
    errors, norm = [], 0.0
    for piece, blocks in zip(pieces, in_blocks(pieces, BLOCKS), strict=True):
        for block in blocks:
            own = part(piece, block)
            left = whole - own.columns.T @ own.columns
            if np.linalg.cond(left) > 1.0 / np.finfo(float).eps:
                raise ValueError("some terms rest on one part of the motion alone")
            values = np.linalg.solve(left, right - own.columns.T @ own.force)
            error = own.force - own.columns @ values
            errors.append((float(error @ error), len(error)))
            norm += float(own.force @ own.force)
    return np.array(errors), norm


def choose(
    motions: Sequence[Motion],
    start: Sequence[Term],
    candidates: Sequence[Sequence[Term]],
    filtering: FilterSettings,
    delay: float = 0.0,
) -> tuple[list[Structure], int]:
    """Add groups of terms one by one to `start` while they lower held-out error and criterion.

    At most one group of a family is added. Returns all tried structures, the start first, and the
    index of the chosen one.
    """
    tried = [structure(motions, start, filtering, delay)]
    effective = tried[0].fit.effective
    chosen, open_groups = 0, list(candidates)
    while open_groups:
        larger = []
        for group in open_groups:
            terms = (*tried[chosen].terms, *group)
            try:
                larger.append((group, structure(motions, terms, filtering, delay, effective)))
            except ValueError:  # these motions do not determine the terms
                continue
            if larger[-1][1].fit.likeness > ALIKE:
                larger.pop()
        if not larger:
            break
        tried += [each for _, each in larger]
        group, best = min(larger, key=lambda pair: pair[1].held_out)
        before = tried[chosen]
        if not (clearly_better(best, before) and best.criterion < criterion(before.fit, effective)):
            break
        chosen = next(i for i, each in enumerate(tried) if each is best)
        families = {term.family for term in group} - {""}
        open_groups = [
            each
            for each in open_groups
            if each is not group and not families & {term.family for term in each}
        ]
    return tried, chosen


def clearly_better(new: Structure, old: Structure) -> bool:
    """Whether mean square error on held-out blocks decreases by over `CLEARLY` standard errors."""
    gain = old.by_block - new.by_block
    error = float(np.std(gain, ddof=1)) / math.sqrt(len(gain)) if len(gain) > 1 else math.inf
    return float(np.mean(gain)) > CLEARLY * error
