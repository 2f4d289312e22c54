"""Declared changes among many quantities of one report."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from campaign.estimation.family import RATE, adjusted
from campaign.estimation.trends.scatter import Mixture

POWER = 0.8
"""How often a change of the detectable size would be declared."""


def level_of(p: Sequence[float]) -> float:
    """The p value at which one more of the family would be declared, given the others."""
    if not p:
        return RATE
    declared = sum(each <= RATE for each in adjusted(p))
    return RATE * min(declared + 1, len(p)) / len(p)


def detectable(known: Mixture, level: float) -> float:
    """Smallest size that would be declared at `level` with a probability of `POWER`.

    known: what the points leave open of the number; its centre does not matter. The scatter that
        was found is taken as what it would have been with such a change, too.
    """
    from scipy.special import ndtri

    needed = 0.5 * float(np.diff(known.interval(1.0 - level))[0])
    one_sigma = 0.5 * float(np.diff(known.interval(0.682689492137))[0])
    return needed + float(ndtri(POWER)) * one_sigma
