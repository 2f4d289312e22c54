"""Tables of every identification: parameters and changes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from campaign.api.quantity_words import unit_in_tables
from campaign.axis_kind import in_axis_terms
from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import in_unit
from campaign.estimation.family import RATE
from campaign.identify.identification import Section
from campaign.parameter import Parameter
from campaign.references.verdict import JudgedNumber
from campaign.result import Cell, Column, Table
from campaign.text import QUANTITIES, interval, number, pretty_unit, quantity_words, words

BOUNDS = {"at least": "≥", "at most": "≤"}


def parameter_words(name: str) -> str:
    """Report's words for a name: `Coulomb friction Tc (negative)` for `coulomb_torque_negative`."""
    whole = next((key for key in QUANTITIES if name.startswith(f"{key}_")), name)
    rest = words(name.removeprefix(whole).removeprefix("_"))
    return f"{quantity_words(whole)} ({rest})" if rest else quantity_words(name)


def parameter_unit(section: Section, estimate: Estimate) -> str:
    """The unit in which a report shows a parameter of a section."""
    name, unit = estimate.name, estimate.unit
    own = (each.display for each in section.identified.parameters if each.estimate.name == name)
    tables = section.result.tables if section.result is not None else ()
    return next(own, "") or unit_in_tables(tables, name, estimate.value, unit)


def parameters_table(sections: Sequence[Section]) -> Table:
    """Table of the parameters of all methods, each in its own unit."""
    rows = [
        _parameter_row(section, parameter)
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


def _parameter_row(section: Section, parameter: Parameter) -> Mapping[str, Cell]:
    estimate, unit = parameter.estimate, parameter_unit(section, parameter.estimate)
    return {
        "parameter": parameter_words(estimate.name),
        "value": parameter_text(estimate, unit),
        "unit": pretty_unit(unit),
        "origin": estimate.origin.value,
        "systematic": systematic(estimate, unit),
        "meaning": parameter.meaning,
        "bench": parameter.bench,
        "method": section.model.name,
        "reason": str(estimate.reason),
    }


def changes_table(before: str, after: str, section: Section) -> Table:
    """Table of a method's parameters from the runs named `before` and `after`."""
    rows = tuple(
        _change_row(each, parameter_unit(section, each.reference)) for each in section.changes
    )
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


def _change_row(change: JudgedNumber, unit: str) -> Mapping[str, Cell]:
    p = change.adjusted
    return {
        "parameter": parameter_words(change.quantity),
        "unit": pretty_unit(unit),
        "before": parameter_text(change.reference, unit),
        "after": parameter_text(change.other, unit),
        "change": parameter_text(change.found.difference, unit),
        "p": "" if p is None else f"{p:.2g}",
        "verdict": change.outcome,
    }


def parameter_text(estimate: Estimate, unit: str) -> str:
    """Text of a value in a unit: `20.14 ± 0.41`, a bound, or `not determined`."""
    if estimate.origin is Origin.NOT_DETERMINED:
        return "not determined"
    shown = in_unit(estimate, unit)
    low, high = shown.combined
    if estimate.kind in BOUNDS:
        end = next(end for end in (low, high) if end is not None)
        return f"{BOUNDS[estimate.kind]} {number(end, 3)}"
    text = interval(shown.value, low, high)
    if low is None and high is None:
        return f"{text} (no interval: {estimate.reason})" if estimate.reason else text
    return text


def systematic(estimate: Estimate, unit: str) -> str:
    """Text of the systematic parts in a unit: `low-pass 0.03, delay 0.2`."""
    return ", ".join(
        f"{in_axis_terms(part.source)} "
        + ("unknown" if (size := part.standard_uncertainty) is None else f"{size:.2g}")
        for part in in_unit(estimate, unit).systematic
    )
