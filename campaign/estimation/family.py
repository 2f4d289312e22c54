"""Decisions of one page as one family (Benjamini and Hochberg).

Benjamini and Hochberg (Journal of the Royal Statistical Society B 57, 1995): of what is declared,
at most a share of `RATE` is expected to be false, for tests that are independent or positively
dependent (Benjamini and Yekutieli, Annals of Statistics 29, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence

RATE = 0.05
"""Share of false ones that is expected among what is declared."""


def adjusted(p: Sequence[float]) -> list[float]:
    """The p values as Benjamini and Hochberg adjust them, in the same order; none for none."""
    if not p:
        return []  # before what takes a third of a second to import
    from scipy.stats import false_discovery_control

    return [float(each) for each in false_discovery_control(list(p), method="bh")]


def level_of(p: Sequence[float]) -> float:
    """The p value at which one more of the family would be declared, given the others."""
    if not p:
        return RATE
    declared = sum(each <= RATE for each in adjusted(p))
    return RATE * min(declared + 1, len(p)) / len(p)
