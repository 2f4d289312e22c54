"""Share of a motion in which the axis slides, from a model of bristles in place of dry friction.

Below breakaway, friction is a spring with damping. A regression on the sign of the rate takes this
damping for viscous friction, and a part of the spring for inertia. In Dahl's model, bristles build
up dry friction over a distance. Regressions at several distances estimate this distance.
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
"""Tried distances over which dry friction builds up, over the travel. The shortest have hardly an
effect on the motion; for the longest, friction is a spring over the whole travel."""
SETTLED = 1.0 - MATTERS
"""Share of dry friction above which an axis slides; the rest is negligible."""
MOST = 0.5
"""Share of the moving rows. If an axis slides in fewer, bristles outweigh sliding in a regression,
because it weights all rows equally."""
HARDLY_SLIDES = Cause(
    "hardly slides",
    "the axis slides in {percent:.0f} % of the motion; below breakaway, friction is a spring with "
    "damping (excite until it slides)",
)


@dataclass(frozen=True)
class Presliding:
    """A model with bristles, fitted to motions.

    Attributes:
        reach: distance over which friction builds up to 1 - 1/e of dry friction (rad, or m).
        share: of the moving rows in which the axis slides.
        values: coefficients by name; without delay unless one is stated, as damping resembles one.
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
    """Fit bristles to motions in which the axis hardly slides; None if it slides or shows none.

    Conditions: the force of the bristles matters; they describe the force clearly better than no
    dry friction; dry friction with all further terms (`chosen`) is not clearly better than they.

    Args:
        delay: of the force in `chosen` (s). stated: whether the user states it.
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
    significant = matter and clearly_better(best, without)
    if share >= MOST or not significant or clearly_better(chosen, best):
        return None
    if not stated:
        best = structure(motions, best.terms, filtering)
    return Presliding(reach, share, dict(zip(best.names, map(float, best.fit.values), strict=True)))


def bristles(reach: float) -> tuple[Term, Term]:
    """Friction and damping of bristles that build up over a `reach` (rad, or m), as terms."""

    def damping(motion: Motion) -> Array:
        return np.asarray(np.gradient(deflection(motion.position, reach)) * motion.sample_rate)

    return (
        Term("bristles", "z", "N m", "", lambda m: deflection(m.position, reach)),
        Term("bristle_damping", "dz/dt", "N m s", "", damping),
    )


def deflection(position: Array, reach: float) -> Array:
    """Deflection of bristles over its largest value, shape (n,); it starts at 0.

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
