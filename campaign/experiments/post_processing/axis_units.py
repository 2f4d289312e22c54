"""Results in the units and terms of the bench's axis.

Analyses are written for a rotary axis; of a linear one the numbers (SI) are the same, and here they
get their units. Names stay: those of tables, columns, findings and conditions. What cannot be told
from the outside, a number of degrees within a sentence, analyses write with `units.in_words`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from campaign.axis_kind import axis_unit, in_axis_terms, is_linear
from campaign.estimate import Estimate
from campaign.parameter import IdentifiedRig
from campaign.reason import Reason
from campaign.result import (
    Axis,
    Cell,
    Column,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
)


def in_axis_units(result: Result) -> Result:
    """The same result, told of the axis that is meant (`axis_kind.axis_terms`)."""
    if not is_linear():
        return result
    return replace(
        result,
        tables=tuple(map(_table, result.tables)),
        figures=tuple(map(_figure, result.figures)),
        findings=tuple(map(_finding, result.findings)),
        notes=tuple(map(in_axis_terms, result.notes)),
        identified=_identified(result.identified),
    )


def _identified(found: IdentifiedRig) -> IdentifiedRig:
    parameters = tuple(
        replace(
            each,
            estimate=estimate_in_axis_terms(each.estimate),
            meaning=in_axis_terms(each.meaning),
            display=axis_unit(each.display),
            advice=in_axis_terms(each.advice),
        )
        for each in found.parameters
    )
    unseen = found.unseen and replace(found.unseen, what=in_axis_terms(found.unseen.what))
    return replace(found, parameters=parameters, unseen=unseen)


def estimate_in_axis_terms(estimate: Estimate) -> Estimate:
    """An estimate with the unit and in the words of the axis that is meant."""
    if not is_linear():
        return estimate
    return replace(
        estimate,
        unit=estimate.unit if _is_phase(estimate.name) else axis_unit(estimate.unit),
        method=in_axis_terms(estimate.method),
        reason=_reason(estimate.reason),
    )


def _reason(reason: Reason) -> Reason:
    return replace(reason, text=in_axis_terms(reason.text))


def _is_phase(*names: str) -> bool:
    """Whether a number is an angle of no axis: a phase, a phase margin."""
    return any("phase" in name.lower() for name in names)


def _finding(finding: Finding) -> Finding:
    phase = _is_phase(finding.quantity)
    return replace(
        finding,
        unit=finding.unit if phase else axis_unit(finding.unit),
        estimate=finding.estimate and estimate_in_axis_terms(finding.estimate),
    )


def _table(table: Table) -> Table:
    phases = {each.name for each in table.columns if _is_phase(each.name, each.label)}
    return replace(
        table,
        title=in_axis_terms(table.title),
        columns=tuple(_column(each, each.name in phases) for each in table.columns),
        rows=tuple(
            {name: _cell(name, cell, row, name in phases) for name, cell in row.items()}
            for row in table.rows
        ),
        note=in_axis_terms(table.note),
    )


def _column(column: Column, phase: bool) -> Column:
    return replace(
        column,
        label=in_axis_terms(column.label),
        unit=column.unit if phase else axis_unit(column.unit),
        display=column.display if phase else axis_unit(column.display),
        reason=_reason(column.reason),
    )


def _cell(name: str, cell: Cell, row: Mapping[str, Cell], phase: bool) -> Cell:
    if isinstance(cell, Estimate):
        return cell if phase else estimate_in_axis_terms(cell)
    if not isinstance(cell, str):
        return cell
    if name == "unit":  # of the row's number
        return cell if _is_phase(str(row.get("parameter", ""))) else axis_unit(cell)
    return in_axis_terms(cell)


def _figure(figure: Figure) -> Figure:
    return replace(
        figure,
        title=in_axis_terms(figure.title),
        caption=in_axis_terms(figure.caption),
        alt=in_axis_terms(figure.alt),
        panels=tuple(map(_panel, figure.panels)),
    )


def _panel(panel: Panel) -> Panel:
    return Panel(
        _axis(panel.x),
        _axis(panel.y),
        tuple(
            replace(
                curve,
                label=in_axis_terms(curve.label),
                parameters={name: axis_unit(unit) for name, unit in curve.parameters.items()},
            )
            for curve in panel.curves
        ),
        in_axis_terms(panel.title),
        tuple(map(_mark, panel.marks)),
    )


def _axis(axis: Axis) -> Axis:
    phase = _is_phase(axis.label)
    return replace(
        axis,
        label=in_axis_terms(axis.label),
        unit=axis.unit if phase else axis_unit(axis.unit),
        display=axis.display if phase else axis_unit(axis.display),
        places=tuple((at, in_axis_terms(name)) for at, name in axis.places),
    )


def _mark(mark: Mark) -> Mark:
    return replace(mark, label=in_axis_terms(mark.label))
