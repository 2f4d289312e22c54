"""How often intervals hold the truth, and whether that is what they promise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from scipy.stats import binomtest

from campaign.estimate import Estimate

LEVEL = 0.95
FALSE_ALARM = 0.01
"""Chance that intervals which hold are rejected somewhere, over all cases of one test (Holm)."""


def holds(estimate: Estimate, truth: float) -> bool:
    """Whether the interval, systematic parts included, holds the truth; open ends hold all."""
    low, high = estimate.combined
    assert estimate.has_interval or estimate.kind in ("at least", "at most"), estimate
    return (low is None or low <= truth) and (high is None or truth <= high)


def rejected(
    held: Mapping[str, Sequence[bool]], alternative: str = "two-sided", level: float = LEVEL
) -> dict[str, float]:
    """Cases whose coverage is not `level` by a binomial test (Holm), with what it was.

    `alternative="less"` rejects only what holds too seldom: for intervals that are wide on purpose.
    """
    chances = {
        case: binomtest(sum(each), len(each), level, alternative).pvalue
        for case, each in held.items()
    }
    wrong: dict[str, float] = {}
    for left, case in enumerate(sorted(chances, key=lambda case: chances[case])):
        if chances[case] > FALSE_ALARM / (len(chances) - left):
            break
        wrong[case] = sum(held[case]) / len(held[case])
    return wrong
