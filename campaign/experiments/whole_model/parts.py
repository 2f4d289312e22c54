"""Parts of long motions with most information on friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.estimation.inverse.rows import rows
from campaign.estimation.inverse.terms import DIRECTIONAL, TERMS, Term
from campaign.experiments.any_motion.motions import MotionPiece
from campaign.experiments.whole_model.residuals import steps_between

MOST_STEPS = 60_000
"""Most simulated steps of all parts together: fits simulate them some thousand times."""
PART = 5.0
"""Length of a part (s): long against the correlation of residuals, and the omitted ends."""
SLOW = (0.01, 0.1)
"""Shares of the fastest rate over which friction may change at the onset of sliding."""


def telling_parts(
    pieces: Sequence[MotionPiece], filtering: FilterSettings
) -> Sequence[MotionPiece]:
    """All pieces if a fit can simulate them, else their most informative parts, in order.

    Each step adds the part that raises the determinant of the normal equations most (Wynn, Ann.
    Math. Stat. 41, 1970). Only the motion decides, not the residuals, which prevents a bias.
    """
    every = steps_between(filtering)
    if sum(len(each.motion.time) for each in pieces) <= MOST_STEPS * every:
        return pieces
    parts = [part for each in pieces for part in _cut(each, filtering.skip)]
    filtering = replace(filtering, skip=0)
    terms = _terms(max(float(np.abs(each.motion.rate).max()) for each in pieces))
    columns = [rows(part.motion, terms, filtering).columns for part in parts]
    squares = np.array([each.T @ each for each in columns])
    length = np.sqrt(np.maximum(np.diagonal(squares.sum(0)), np.finfo(float).tiny))
    squares /= np.outer(length, length)
    chosen: list[int] = []
    known, steps = 1e-9 * np.eye(len(terms)), 0
    for _ in parts:
        left = [i for i in range(len(parts)) if i not in chosen]
        best = left[int(np.argmax(np.linalg.slogdet(known + squares[left])[1]))]
        steps += len(parts[best].motion.time) // every
        if chosen and steps > MOST_STEPS:
            break
        chosen.append(best)
        known = known + squares[best]
    return [parts[i] for i in sorted(chosen)]


def _cut(piece: MotionPiece, skip: int) -> list[MotionPiece]:
    left = len(piece.motion.time) - skip
    count = max(1, round(left / (PART * piece.motion.sample_rate)))
    edges = skip + np.linspace(0, left, count + 1).astype(int)
    return [piece.part(slice(int(a), int(b))) for a, b in pairwise(edges)]


def _terms(fastest: float) -> list[Term]:
    """Linearised terms of a friction model, with terms of their own for slow sliding."""
    names = ("spring", *DIRECTIONAL)
    return [TERMS[name] for name in names] + [
        _slow(share * fastest, sign) for share in SLOW for sign in (1.0, -1.0)
    ]


def _slow(rate: float, sign: float) -> Term:
    def column(motion: Motion) -> Array:
        return np.asarray((sign * motion.rate > 0) * np.exp(-np.abs(motion.rate) / rate))

    return Term("slow", "", "", "", column)
