"""Share of a motion in which the axis slides, from a model of bristles in place of dry friction.

Below breakaway, friction is a spring with damping: a regression on the sign of the rate takes its
damping for viscous friction, and a part of its spring for inertia. Bristles of Dahl's model build
dry friction up over a distance; a regression at several distances estimates it.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.gate import MATTERS
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.rows import rows
from campaign.estimation.inverse.structure_choice import Structure, clearly_better, structure
from campaign.estimation.inverse.terms import TERMS, Term
from campaign.reason import Cause

REACHES = np.geomspace(1e-3, 10.0, 13)
"""Tried distances over which dry friction builds up, as shares of the travel: from those that a
motion over all of it hardly shows, to those over which friction is a spring throughout."""
SETTLED = 1.0 - MATTERS
"""Share of dry friction from which on an axis slides: what it lacks does not matter."""
MOST = 0.5
"""Share of the moving rows: where an axis slides in fewer, bristles outweigh sliding in a
regression: it weighs all rows alike."""
HARDLY_SLIDES = Cause(
    "hardly slides",
    "the axis slides in {percent:.0f} % of the motion; below breakaway, friction is a spring with "
    "damping (excite until it slides)",
)


@dataclass(frozen=True)
class Presliding:
    """Fit of bristles.

    Attributes:
        reach: distance over which friction builds up to 1 - 1/e of dry friction (rad, or m).
        share: of the moving rows in which the axis slides.
        values: coefficients by name, without delay unless one is stated: damping resembles a delay.
    """

    reach: float
    share: float
    values: dict[str, float]


def presliding(
    motions: Sequence[Motion],
    chosen: Structure,
    filtering: FilterSettings,
    delay: float,
    *,
    stated: bool = False,
) -> Presliding | None:
    """Bristles in motions in which the axis hardly slides; None if it slides, or none are seen.

    They are seen if their force matters, and if they describe the force clearly better than no dry
    friction does, and dry friction with all further terms (`chosen`) not clearly better than they.

    Args:
        delay: of the force in `chosen` (s), as `stated` by the user or estimated.
    """
    shared = ("inertia", "viscous", "viscous_positive", "viscous_negative")
    terms = (*(term for term in chosen.terms if term.name in shared), TERMS["offset"])
    travel = max(float(np.ptp(motion.position)) for motion in motions)
    tried: list[tuple[Structure, float]] = []
    for reach in travel * REACHES:
        with suppress(ValueError):
            tried.append((structure(motions, (*terms, *bristles(reach)), filtering, delay), reach))
    if not tried:
        return None
    best, reach = min(tried, key=lambda each: each[0].held_out)
    without = structure(motions, terms, filtering, delay)
    state = np.concatenate([rows(m, best.terms, filtering).columns[:, -2] for m in motions])
    share = float(np.mean(np.abs(state[state != 0.0]) > SETTLED))
    matter = np.any(np.abs(best.fit.values[-2:]) > best.fit.matters[-2:])
    seen = matter and clearly_better(best, without)
    if share >= MOST or not seen or clearly_better(chosen, best):
        return None
    if not stated:
        best = structure(motions, best.terms, filtering)
    return Presliding(reach, share, dict(zip(best.names, map(float, best.fit.values), strict=True)))


def bristles(reach: float) -> tuple[Term, Term]:
    """Terms of bristles that build up over a `reach` (rad, or m): their friction, their damping."""

    def damping(motion: Motion) -> Array:
        return np.asarray(np.gradient(deflection(motion.position, reach)) * motion.sample_rate)

    return (
        Term("bristles", "z", "N m", "", lambda m: deflection(m.position, reach)),
        Term("bristle_damping", "dz/dt", "N m s", "", damping),
    )


def deflection(position: Array, reach: float) -> Array:
    """Deflection of bristles over its largest value, shape (n,), at first 0.

    dz/dq = (sign dq - z) / reach (Dahl 1968), in closed form between reversals.
    """
    change = np.sign(np.diff(position))
    moves = np.flatnonzero(change)
    ends = moves[np.flatnonzero(np.diff(change[moves]))]  # the last step before each reversal
    ends = np.append(ends + 1, len(position) - 1)
    starts = np.insert(ends[:-1], 0, 0)
    direction = np.sign(position[ends] - position[starts])
    left = np.exp(-np.abs(position[ends] - position[starts]) / reach)
    first, state = [], 0.0
    for sign, kept in zip(direction.tolist(), left.tolist(), strict=True):
        first.append(state)
        state = sign + (state - sign) * kept
    stroke = np.searchsorted(ends, np.arange(len(position)))
    sign = direction[stroke]
    kept = np.exp(-np.abs(position - position[starts[stroke]]) / reach)
    return np.asarray(sign + (np.array(first)[stroke] - sign) * kept)
