"""Brackets around numbers read off samples hold the curve's own, whatever the samples hit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.intervals import with_error
from campaign.estimation.sampled_curve import (
    ALIKE,
    PEAK_AT_END,
    SAMPLES,
    UNRESOLVED_PEAK,
    at_sample,
    bracketed,
    drop_interval_if_deterministic,
    largest,
    peak,
    shifted,
    together,
    upward_crossings,
)
from campaign.reason import Cause
from tests.estimation.coverage import holds, rejected

DRAWS = 4000

CONCAVE: dict[str, Callable[[Array], Array]] = {
    "parabola": lambda t: 3.0 - t**2,
    "tent": lambda t: 3.0 - np.abs(t),
    "lopsided tent": lambda t: 3.0 - np.where(t < 0, -0.1 * t, 4.0 * t),
    "breaking loose": lambda t: 3.0 - 1e-3 * np.expm1(8.0 * t) + np.minimum(t, 0.0),
}
"""Largest at t = 0, where it is 3."""


@pytest.mark.parametrize("name", CONCAVE)
def test_the_bracket_holds_the_peak_wherever_the_samples_fall(name: str) -> None:
    draw = np.random.default_rng(811)
    for _ in range(DRAWS):
        step = 10.0 ** draw.uniform(-3, -1)
        time = step * (np.arange(-20, 21) + draw.uniform(-0.5, 0.5))
        found = peak("top", CONCAVE[name](time), "N m")
        high = math.nan if found.high is None else found.high
        assert found.low == found.value <= 3.0 <= high + 1e-12, (name, step)
        assert high - found.value <= 4.0 * step + 1e-12  # a step of the steepest side


def test_a_bracket_is_narrow_where_the_curve_is_smooth() -> None:
    """Of a parabola the samples miss h²/4 at most, and the bracket has twice that at most."""
    for phase in np.linspace(-0.5, 0.5, 21):
        time = 0.01 * (np.arange(-9, 10) + phase)
        found = peak("top", 1.0 - time**2, "")
        assert 1.0 - 1e-15 <= found.high <= found.value + 2.0 * 0.01**2


@pytest.mark.parametrize(
    ("samples", "why"),
    [
        ([0.0, 1.0, 2.0, 3.0], PEAK_AT_END),
        ([3.0, 2.0, 1.0, 0.0], PEAK_AT_END),
        ([0.0, 0.0, 0.0, 9.0, 0.0, 0.0, 0.0], UNRESOLVED_PEAK),
        ([0.0, 1.0, 1.1, 3.0, 2.9, 2.0, 0.0], UNRESOLVED_PEAK),
    ],
)
def test_a_peak_that_the_samples_do_not_resolve_has_a_reason(
    samples: list[float], why: Cause
) -> None:
    found = peak("top", np.array(samples), "")
    assert found.value == max(samples)
    assert not found.has_interval
    assert found.reason in why


def test_crossings_lie_between_their_samples() -> None:
    """A sine of 1 rad/s passes 0.3 upwards at asin 0.3 and a turn later."""
    time = np.arange(0.0, 20.0, 0.01)
    found, before = upward_crossings(time, np.sin(time), 0.3)
    expected = math.asin(0.3) + 2 * math.pi * np.arange(len(found))
    assert len(found) == 4
    assert np.all((before <= expected) & (expected <= before + 0.01))
    assert found == pytest.approx(expected, abs=1e-5)  # a straight line errs by f'' h² / 8 f'


def test_a_curve_at_a_moment_known_to_one_sample() -> None:
    samples = np.array([5.0, 1.0, 2.0, 4.0, 9.0])
    middle, first = at_sample("x", samples, 2, ""), at_sample("x", samples, 0, "")
    assert (middle.low, middle.value, middle.high) == (1.0, 2.0, 4.0)
    assert (first.low, first.value, first.high) == (1.0, 5.0, 5.0)


def test_one_recording_keeps_its_bracket_and_several_have_their_scatter_besides() -> None:
    """Of 1, 2, 6: mean 3, deviation √7; t with 2 is 4.302653; a bracket of ± 0.3 is 0.3/√3."""
    each = [bracketed("x", v, "s", (v - 0.3, v + 0.3), "") for v in (1.0, 2.0, 6.0)]
    assert together(each[:1]) is each[0]
    found = together(each)
    assert found.value == pytest.approx(3.0)
    assert found.low == pytest.approx(3.0 - 4.302653 * math.sqrt(7 / 3), rel=1e-6)
    (part,) = found.systematic
    assert part.source == SAMPLES
    assert part.standard_uncertainty == pytest.approx(0.3 / math.sqrt(3))
    low, _ = found.combined
    wide = math.hypot(4.302653 * math.sqrt(7 / 3), 1.959964 * 0.3 / math.sqrt(3))
    assert low == pytest.approx(3.0 - wide, rel=1e-6)


def test_what_has_a_deviation_of_its_own_adds_none_between_repeats() -> None:
    each = [with_error("x", v, "", 0.5, 9.0, "") for v in (1.0, 2.0, 6.0)]
    assert together(each).systematic == ()


def test_repeats_that_are_all_the_same_show_no_scatter() -> None:
    each = [with_error("x", 7.0, "", 0.0, 9.0, "")] * 3
    found = together(each)
    assert not found.has_interval
    assert found.reason == ALIKE(digits=9)
    assert drop_interval_if_deterministic(each[0], 0.0).reason
    told = with_error("x", 7.0, "", 1e-3, 9.0, "")
    assert drop_interval_if_deterministic(told, 7.0) is told


def largest_of_three(draw: np.random.Generator) -> Estimate:
    """Three sizes of 1, 1 and 0.9, each measured five times with a deviation of 0.2."""
    each = []
    for truth in (1.0, 1.0, 0.9):
        values = truth + 0.2 * draw.normal(size=5)
        error = float(np.std(values, ddof=1)) / math.sqrt(5)
        each.append(with_error("x", float(np.mean(values)), "", error, 4.0, ""))
    return largest("most", each, "")


@pytest.mark.parametrize(
    ("draws", "seed"), [(500, 812), pytest.param(4000, 813, marks=pytest.mark.statistics)]
)
def test_the_largest_of_several_is_held(draws: int, seed: int) -> None:
    """Bonferroni may hold more often than it says, and must not less often."""
    draw = np.random.default_rng(seed)
    found = [largest_of_three(draw) for _ in range(draws)]
    assert not rejected({"largest": [holds(each, 1.0) for each in found]}, "less")


def test_the_largest_of_some_without_a_deviation_has_their_reason() -> None:
    why = Cause("one trial", "one trial")()
    each = [with_error("x", 1.0, "", 0.1, 4.0, ""), Estimate("x", 2.0, "", reason=why)]
    found = largest("most", each, "")
    assert (found.value, found.reason, found.has_interval) == (2.0, why, False)


def test_an_offset_that_is_known_moves_the_interval_along() -> None:
    found = shifted("y", bracketed("x", 2.0, "rad", (1.0, 4.0), ""), -3.0)
    assert (found.name, found.low, found.value, found.high) == ("y", -2.0, -1.0, 1.0)
