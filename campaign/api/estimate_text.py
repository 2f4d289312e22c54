"""Estimates as text: number with interval and unit, and what an interval leaves out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from campaign.axis_kind import in_axis_terms
from campaign.estimate import Estimate, Origin
from campaign.text import NARROW, SHORT, interval, number, pretty_unit
from campaign.units import convert

FLAGGED = (Origin.ASSUMED, Origin.AT_BOUND, Origin.CONTRADICTED)
"""Origins that stand behind a number, as a reader would take it for measured."""


def estimate_text(estimate: Estimate, display: str = "") -> str:
    """`25.3 ± 0.1 N·m`, `at least 3 Hz`, `not determined (too few samples)`, in the unit shown."""
    if not estimate.is_determined:
        return "not determined" + (f" ({estimate.reason})" if estimate.reason else "")
    unit = display or estimate.unit
    ends = (estimate.value, *estimate.combined)
    value, low, high = (None if e is None else convert(e, estimate.unit, unit) for e in ends)
    sign = {"at least": "at least ", "at most": "at most "}.get(estimate.kind, "")
    if sign:
        value, low, high = (low if high is None else high), None, None
    text = number(value, SHORT) if _is_narrow(estimate) else interval(value, low, high)
    flag = f" ({estimate.origin})" if estimate.origin in FLAGGED else ""
    return f"{sign}{text} {pretty_unit(unit)}".rstrip() + flag


def remarks(estimates: Iterable[Estimate]) -> Iterator[str]:
    """Sentences on what the texts do not say: no interval, or not all of it. Each reason once."""
    found = [each for each in estimates if _is_measured(each)]
    without = dict.fromkeys(str(e.reason) for e in found if not _is_bounded(e) and e.reason)
    if without:
        yield f"Without an interval: {'; '.join(without)}."
    for reason in dict.fromkeys(str(e.reason) for e in found if e.has_interval and e.reason):
        yield f"{reason[:1].upper()}{reason[1:]}."
    if any(_is_narrow(each) for each in found):
        yield "Numbers without an interval: it is narrower than the last digit."
    yield from of_unknown_size(found)


def of_unknown_size(estimates: Iterable[Estimate]) -> Iterator[str]:
    """The sentence on what no interval of theirs has in it; none where there is nothing."""
    unknown = dict.fromkeys(
        each.source
        for estimate in estimates
        if estimate.has_interval
        for each in estimate.systematic
        if each.standard_uncertainty is None
    )
    if unknown:
        sources = ", ".join(map(in_axis_terms, unknown))
        yield f"Not included in the intervals (size unknown): {sources}."


def shows_interval(estimate: Estimate) -> bool:
    """Whether it is measured, and its text has an interval or a bound."""
    return _is_measured(estimate) and _is_bounded(estimate) and not _is_narrow(estimate)


def _is_measured(estimate: Estimate) -> bool:
    return (
        estimate.is_determined and estimate.origin is not Origin.GIVEN and estimate.kind != "count"
    )


def _is_bounded(estimate: Estimate) -> bool:
    return estimate.has_interval or estimate.kind in ("at least", "at most")


def _is_narrow(estimate: Estimate) -> bool:
    """Whether an interval is so narrow that the number does without it."""
    return estimate.has_interval and estimate.half_width < NARROW * abs(estimate.value)
