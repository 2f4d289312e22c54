"""Common parts of models with a state: one-directional parts of a step, closed form."""

from __future__ import annotations

from typing import Any, NamedTuple

from campaign.physics.compilation import pasted
from campaign.physics.elementary import expm1, where
from campaign.physics.step_function import Motion


class Parts(NamedTuple):
    """Parts of a step before and after a reversal; without one, the first part is the whole step.

    Attributes:
        first, last: displacements (rad) of both parts, each in one direction; their sum is that of
            the step. The rate is a straight line up to the reversal.
        share: share of the first part in the step, 1 without a reversal.
        turns: whether there is a reversal.
    """

    first: float
    last: float
    share: float
    turns: Any


@pasted
def parts_of(motion: Motion) -> Parts:
    """Parts of a step."""
    v0, v1, step = motion.rate_start, motion.rate_end, motion.step
    turns = v0 * v1 < 0.0
    share = where(turns, v0 / where(turns, v0 - v1, 1.0), 1.0)
    whole = motion.rate_mean * step
    first = where(turns, 0.5 * v0 * share * step, whole)
    return Parts(first, where(turns, whole - first, 0.0), share, turns)


@pasted
def sign_of(x: float) -> float:
    """1, -1, or 0 at 0."""
    sign: float = where(x > 0.0, 1.0, where(x < 0.0, -1.0, 0.0))
    return sign


@pasted
def decayed(x: float) -> float:
    """(1 - exp(-x)) / x for x >= 0: the mean of a decay over its duration."""
    share: float = where(x > 0.0, -expm1(-x) / where(x > 0.0, x, 1.0), 1.0)
    return share
