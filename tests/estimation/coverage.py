"""How often intervals hold the truth, and whether that is what they promise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import binomtest

from campaign.estimate import Estimate

LEVEL = 0.95
FALSE_ALARM = 0.01
"""Chance that intervals which hold are rejected somewhere, over all cases of one test (Holm)."""


def draws(sample: int, every: int = 4000, *, name: str = "count") -> pytest.MarkDecorator:
    """So many draws in every run, and as many as `every` in `make statistics`."""
    all_of_them = pytest.param(every, id="all", marks=pytest.mark.statistics)
    return pytest.mark.parametrize(name, [pytest.param(sample, id="sample"), all_of_them])


def autoregressive(random: np.random.Generator, count: int, memory: float) -> np.ndarray:
    """First-order autoregressive noise of unit variance."""
    drive = random.standard_normal(count + 200) * np.sqrt(1 - memory**2)
    return np.asarray(lfilter([1], [1, -memory], drive)[200:])


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
