"""Where a curve passes a threshold: made-up curves, bounds, and how often intervals hold."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.estimation.intervals import of_positive_repeats
from campaign.estimation.threshold import BEYOND_WITHOUT_CHANGE, Threshold, crossing, passing
from campaign.reason import Cause
from tests.estimation.coverage import draws, holds, rejected

CHANGES = np.array([-0.8, -0.4, -0.2, 0.0, 0.2, 0.4, 0.8])
LIMIT = Threshold(0.2)
NORMAL = 1.959964  # quantiles of the normal distribution: any table
ONE_SIDED = 1.644854


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        # 0.1 + 0.5 |x| passes 0.2 at 0.2 exactly where a straight line says so
        (0.1 + 0.5 * np.abs(CHANGES), 0.2),
        # steeper below: 0.1 + |x| at -0.1 (interpolated), 0.1 + x/4 above at 0.4
        (np.where(CHANGES < 0, 0.1 - CHANGES, 0.1 + 0.25 * CHANGES), 0.1),
        # passed on one side only, between 0.4 (0.15) and 0.8 (0.35): 0.4 + 0.4 * 0.05 / 0.2
        (np.array([0.1, 0.1, 0.1, 0.1, 0.1, 0.15, 0.35]), 0.5),
        # a return below the threshold does not undo the first passing
        (np.array([0.1, 0.1, 0.3, 0.1, 0.1, 0.1, 0.1]), 0.1),
        (np.full(7, 0.2), None),  # reached, never passed
        (np.full(7, 0.21), 0.0),
    ],
)
def test_where_a_curve_passes_the_threshold(error: np.ndarray, expected: float | None) -> None:
    found = crossing(CHANGES, error, 0.2)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-12))


def errors(values: np.ndarray, deviation: float) -> list[Estimate]:
    """Normal errors of one standard deviation, which is known."""
    return [
        Estimate("error", float(v), "", v - 1.96 * deviation, v + 1.96 * deviation, 0.95,
                 standard_error=deviation)
        for v in values
    ]  # fmt: skip


def test_the_interval_on_a_straight_line() -> None:
    """0.1 + 0.4 x at x = 0.25, 1/4 of the way from 0.2 to 0.4; se there s sqrt(w^2 + (1-w)^2).

    It ends where 0.1 + 0.4 x -+ z s sqrt(...) is 0.2 (Fieller), within the chords of that band.
    """
    deviation = 0.004
    line = np.where(CHANGES < 0, 0.1, 0.1 + 0.4 * CHANGES)
    found = passing("threshold", CHANGES, errors(line, deviation), LIMIT)
    assert found.value == pytest.approx(0.25)
    for end, sign in ((found.low, 1.0), (found.high, -1.0)):
        weight = (end - 0.2) / 0.2
        half = NORMAL * deviation * np.hypot(weight, 1 - weight)
        assert 0.1 + 0.4 * end + sign * half == pytest.approx(0.2, abs=1e-5)
    assert found.kind == "number"


def test_the_error_without_change_scatters_in_a_relative_threshold_too() -> None:
    """e(0) = 0.1 times 2: the gap at x is e(x) - 2 e(0), of variance s^2 (w^2 + (1-w)^2 + 4)."""
    deviation = 0.004
    line = np.where(CHANGES < 0, 0.1, 0.1 + 0.4 * CHANGES)
    found = passing("threshold", CHANGES, errors(line, deviation), Threshold(0.2, ratio=2.0))
    weight = (found.low - 0.2) / 0.2
    half = NORMAL * deviation * np.sqrt(weight**2 + (1 - weight) ** 2 + 4.0)
    assert 0.1 + 0.4 * found.low + half == pytest.approx(0.2, abs=1e-5)


def test_an_interval_that_nothing_closes_is_open() -> None:
    """At 0.8 the error is 0.21 with a deviation of 0.01: it may or may not have passed."""
    line = np.where(CHANGES < 0, 0.1, 0.1 + 0.11 * CHANGES / 0.8)
    found = passing("threshold", CHANGES, errors(line, 0.01), LIMIT)
    assert found.low is not None
    assert found.high is None


def test_a_threshold_that_is_not_passed_is_a_bound() -> None:
    flat = np.full(7, 0.1)
    found = passing("threshold", CHANGES, errors(flat, 0.01), LIMIT)
    assert (found.kind, found.value) == ("at least", 0.8)
    # 0.19 at the end: 0.1 + 0.09 x / 0.8 + 1.645 s sqrt(w^2 + (1-w)^2) passes before it
    near = np.where(CHANGES < 0, 0.1, 0.1 + 0.09 * CHANGES / 0.8)
    found = passing("threshold", CHANGES, errors(near, 0.008), LIMIT)
    weight = (found.value - 0.4) / 0.4
    half = ONE_SIDED * 0.008 * np.hypot(weight, 1 - weight)
    assert 0.1 + 0.09 * found.value / 0.8 + half == pytest.approx(0.2, abs=5e-5)
    assert found.kind == "at least"
    found = passing("threshold", CHANGES, errors(np.full(7, 0.199), 0.01), LIMIT)
    assert (found.origin, np.isnan(found.value)) == ("not determined", True)


def test_what_does_not_scatter_has_no_interval_and_says_why() -> None:
    alone = Cause("alone", "alone")()
    single = [Estimate.without_interval("e", v, "", alone) for v in 0.1 + 0.5 * np.abs(CHANGES)]
    found = passing("threshold", CHANGES, single, LIMIT)
    assert (found.value, found.low, found.reason) == (pytest.approx(0.2), None, alone)
    beyond = passing("threshold", CHANGES, errors(np.full(7, 0.3), 0.01), LIMIT)
    assert (beyond.value, beyond.low) == (0.0, None)
    assert beyond.reason in BEYOND_WITHOUT_CHANGE


TRIED = np.array([-0.8, -0.65, -0.5, -0.4, -0.3, -0.2, -0.1, 0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.65, 0.8])


def straight(change: np.ndarray) -> np.ndarray:
    return 0.14 * (1 + np.where(change < 0, -1.2 * change, 0.4 * change))


def both_sides(change: np.ndarray) -> np.ndarray:
    return 0.14 * (1 + 1.2 * np.abs(change))


def bent(change: np.ndarray) -> np.ndarray:
    return np.hypot(0.14, 0.35 * change)


def drawn(curve, random, repeats, deviation, ratio) -> Estimate:
    """What some repeats at each change say of a curve; 0: one, of a known standard deviation."""
    if repeats:
        scatter = np.exp(deviation * random.standard_normal((len(TRIED), repeats)))
        found = [of_positive_repeats("e", row, "rad") for row in curve(TRIED)[:, None] * scatter]
    else:
        found = errors(curve(TRIED) + deviation * random.standard_normal(len(TRIED)), deviation)
    limit = 0.2 if ratio is None else ratio * found[7].value
    return passing("threshold", TRIED, found, Threshold(limit, ratio))


@pytest.mark.slow
@draws(80)
def test_the_interval_holds_where_the_true_curve_passes(count: int) -> None:
    """Straight between the changes, of known scatter: as promised. With few repeats a little more
    (Welch), and so where both sides pass alike, of which the nearer counts. What a bend does to a
    straight line is no scatter but a systematic part, as large as it can be guessed: 93 to 95 %.
    """
    fine = np.linspace(-0.8, 0.8, 160_001)
    strict, wide, curved = {}, {}, {}
    for number, (curve, repeats, deviation, ratio) in enumerate(
        (
            (straight, 0, 0.002, None),
            (straight, 0, 0.002, 1.4),
            (straight, 3, 0.01, None),
            (straight, 5, 0.003, None),
            (straight, 3, 0.01, 1.4),
            (both_sides, 3, 0.01, None),
            (bent, 3, 0.01, None),
            (bent, 3, 0.001, None),
        )
    ):
        random = np.random.default_rng([514, number])
        truth = crossing(fine, curve(fine), 0.2 if ratio is None else ratio * 0.14)
        found = (drawn(curve, random, repeats, deviation, ratio) for _ in range(count))
        kind = strict if not repeats else curved if curve is bent else wide
        name = f"{curve.__name__}, {repeats} repeats, {deviation}, {ratio}"
        kind[name] = [holds(one, truth) for one in found]
    assert rejected(strict) == {}
    assert rejected(wide, "less") == {}
    assert rejected(curved, "less", 0.92) == {}
