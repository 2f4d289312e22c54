"""Tables of every identification: parameters and changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from campaign.axis_kind import in_axis_terms
from campaign.estimate import Estimate, Origin
from campaign.estimation.family import RATE
from campaign.identify.identification import Section
from campaign.references.verdict import JudgedNumber
from campaign.result import Cell, Column, Table
from campaign.text import interval, number, pretty_unit, words
from campaign.units import convert

BOUNDS = {"at least": "≥", "at most": "≤"}


def parameters_table(sections: Sequence[Section]) -> Table:
    """Every parameter of every method, each in its own unit."""
    rows: list[Mapping[str, Cell]] = [
        {
            "parameter": words(parameter.estimate.name),
            "value": parameter_text(parameter.estimate, parameter.display),
            "unit": pretty_unit(parameter.display or parameter.estimate.unit),
            "origin": parameter.estimate.origin.value,
            "systematic": systematic(parameter.estimate, parameter.display),
            "meaning": parameter.meaning,
            "bench": parameter.bench,
            "method": section.model.name,
            "reason": str(parameter.estimate.reason),
        }
        for section in sections
        for parameter in section.identified.parameters
    ]
    columns = (
        Column("parameter", "Parameter"),
        Column("value", "Value, 95 % interval"),
        Column("unit", "Unit"),
        Column("origin", "Origin"),
        Column("systematic", "Systematic part, 1 sigma"),
        Column("meaning", "What it is"),
        Column("bench", "Key of the bench"),
        Column("method", "Method"),
        Column("reason", "Condition, or why it is not determined"),
    )
    note = (
        "Intervals hold what scatters, with autocorrelation, and the systematic parts; a choice of "
        "terms that was made on the same data is in none of them."
    )
    return Table("parameters", "Parameters", columns, tuple(rows), note=note)


def changes_table(before: str, after: str, section: Section) -> Table:
    """A method's parameters of both runs, which have these names."""
    rows = tuple(_change_row(each) for each in section.changes)
    columns = (
        Column("parameter", "Parameter"),
        Column("unit", "Unit"),
        Column("before", before),
        Column("after", after),
        Column("change", "Change"),
        Column("p", "p, adjusted"),
        Column("verdict", "Verdict"),
    )
    note = (
        "The same terms fitted to both. p values are adjusted over all parameters of this page "
        f"(Benjamini and Hochberg): of what is declared different {RATE:.0%} may be false."
    )
    return Table(
        f"changes-{section.model.name.replace('_', '-')}", "What has changed", columns, rows,
        note=note,
    )  # fmt: skip


def _change_row(change: JudgedNumber) -> Mapping[str, Cell]:
    p = change.adjusted
    return {
        "parameter": words(change.quantity),
        "unit": pretty_unit(change.reference.unit),
        "before": parameter_text(change.reference),
        "after": parameter_text(change.other),
        "change": parameter_text(change.found.difference),
        "p": "" if p is None else f"{p:.2g}",
        "verdict": change.outcome,
    }


def parameter_text(estimate: Estimate, display: str = "") -> str:
    """`20.14 ± 0.41`; a bound, or that it is not determined."""
    if estimate.origin is Origin.NOT_DETERMINED:
        return "not determined"
    low, high = estimate.combined

    def shown(size: float | None) -> Any:
        if size is None or not display:
            return size
        return float(convert(size, estimate.unit, display))

    if estimate.kind in BOUNDS:
        return f"{BOUNDS[estimate.kind]} {number(shown(high if low is None else low), 3)}"
    text = interval(shown(estimate.value), shown(low), shown(high))
    if low is None and high is None:
        return f"{text} (no interval: {estimate.reason})" if estimate.reason else text
    return text


def systematic(estimate: Estimate, display: str = "") -> str:
    """`low-pass 0.03, delay 0.2`, in the unit that the estimate is shown in."""

    def shown(size: float | None) -> str:
        if size is None:
            return "unknown"
        return f"{float(convert(size, estimate.unit, display)) if display else size:.2g}"

    return ", ".join(
        f"{in_axis_terms(part.source)} {shown(part.standard_uncertainty)}"
        for part in estimate.systematic
    )
