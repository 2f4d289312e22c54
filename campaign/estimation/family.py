"""Decisions of one page as one family, with a limited false discovery rate.

At most the share `RATE` of the declared differences is expected to be false (Benjamini and
Hochberg, Journal of the Royal Statistical Society B 57, 1995), for tests that are independent or
positively dependent (Benjamini and Yekutieli, Annals of Statistics 29, 2001).
"""

from __future__ import annotations

from collections.abc import Sequence

RATE = 0.05
"""Largest expected share of false decisions among the declared ones."""


def adjusted(p: Sequence[float]) -> list[float]:
    """Adjusted p values (Benjamini and Hochberg), in the same order."""
    if not p:
        return []  # without the import, which takes a third of a second
    from scipy.stats import false_discovery_control

    return [float(each) for each in false_discovery_control(list(p), method="bh")]


def level_of(p: Sequence[float]) -> float:
    """The p value below which one more test of the family would be declared."""
    if not p:
        return RATE
    declared = sum(each <= RATE for each in adjusted(p))
    return RATE * min(declared + 1, len(p)) / len(p)
