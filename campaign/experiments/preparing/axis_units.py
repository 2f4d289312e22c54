"""What an analysis found, in the units and words of its bench's axis.

Analyses are written for a rotary axis; of a linear one the numbers (SI) are the same, and here they
get their units. Names stay: those of tables, columns, findings and conditions. What cannot be told
from the outside, a number of degrees within a sentence, analyses write with `units.in_words`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from campaign.axis_kind import is_linear, unit_here, words_here
from campaign.estimate import Estimate
from campaign.parameter import Identified
from campaign.reason import Reason
from campaign.result import (
    Amount,
    Axis,
    Cell,
    Column,
    Conclusion,
    Factor,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
)


def of_its_axis(result: Result) -> Result:
    """The same result, told of the axis that is meant (`axis_kind.speaking_of`)."""
    if not is_linear():
        return result
    return replace(
        result,
        tables=tuple(map(_table, result.tables)),
        figures=tuple(map(_figure, result.figures)),
        findings=tuple(map(_finding, result.findings)),
        notes=tuple(map(words_here, result.notes)),
        conclusions=tuple(map(_conclusion, result.conclusions)),
        identified=_identified(result.identified),
    )


def _identified(found: Identified) -> Identified:
    parameters = tuple(
        replace(
            each,
            estimate=estimate_here(each.estimate),
            meaning=words_here(each.meaning),
            display=unit_here(each.display),
            advice=words_here(each.advice),
        )
        for each in found.parameters
    )
    unseen = found.unseen and replace(found.unseen, what=words_here(found.unseen.what))
    return replace(found, parameters=parameters, unseen=unseen)


def estimate_here(estimate: Estimate) -> Estimate:
    """An estimate with the unit and in the words of the axis that is meant."""
    if not is_linear():
        return estimate
    return replace(
        estimate,
        unit=estimate.unit if _is_phase(estimate.name) else unit_here(estimate.unit),
        method=words_here(estimate.method),
        reason=_reason(estimate.reason),
    )


def _reason(reason: Reason) -> Reason:
    return replace(reason, text=words_here(reason.text))


def _is_phase(*names: str) -> bool:
    """Whether a number is an angle of no axis: a phase, a phase margin."""
    return any("phase" in name.lower() for name in names)


def _conclusion(conclusion: Conclusion) -> Conclusion:
    return Conclusion(tuple(map(_part, conclusion.parts)))


def _part(part: str | Amount | Factor) -> str | Amount | Factor:
    if isinstance(part, str):
        return words_here(part)
    estimate = estimate_here(part.estimate)
    if isinstance(part, Factor):
        return Factor(estimate, words_here(part.above), words_here(part.below))
    phase = _is_phase(part.estimate.name)
    return Amount(estimate, part.display if phase else unit_here(part.display))


def _finding(finding: Finding) -> Finding:
    phase = _is_phase(finding.quantity)
    return replace(
        finding,
        unit=finding.unit if phase else unit_here(finding.unit),
        estimate=finding.estimate and estimate_here(finding.estimate),
    )


def _table(table: Table) -> Table:
    phases = {each.name for each in table.columns if _is_phase(each.name, each.label)}
    return replace(
        table,
        title=words_here(table.title),
        columns=tuple(_column(each, each.name in phases) for each in table.columns),
        rows=tuple(
            {name: _cell(name, cell, row, name in phases) for name, cell in row.items()}
            for row in table.rows
        ),
        note=words_here(table.note),
    )


def _column(column: Column, phase: bool) -> Column:
    return replace(
        column,
        label=words_here(column.label),
        unit=column.unit if phase else unit_here(column.unit),
        display=column.display if phase else unit_here(column.display),
        reason=_reason(column.reason),
    )


def _cell(name: str, cell: Cell, row: Mapping[str, Cell], phase: bool) -> Cell:
    if isinstance(cell, Estimate):
        return cell if phase else estimate_here(cell)
    if not isinstance(cell, str):
        return cell
    if name == "unit":  # of the row's number
        return cell if _is_phase(str(row.get("parameter", ""))) else unit_here(cell)
    return words_here(cell)


def _figure(figure: Figure) -> Figure:
    return replace(
        figure,
        title=words_here(figure.title),
        caption=words_here(figure.caption),
        alt=words_here(figure.alt),
        panels=tuple(map(_panel, figure.panels)),
    )


def _panel(panel: Panel) -> Panel:
    return Panel(
        _axis(panel.x),
        _axis(panel.y),
        tuple(
            replace(
                curve,
                label=words_here(curve.label),
                parameters={name: unit_here(unit) for name, unit in curve.parameters.items()},
            )
            for curve in panel.curves
        ),
        words_here(panel.title),
        tuple(map(_mark, panel.marks)),
    )


def _axis(axis: Axis) -> Axis:
    phase = _is_phase(axis.label)
    return replace(
        axis,
        label=words_here(axis.label),
        unit=axis.unit if phase else unit_here(axis.unit),
        display=axis.display if phase else unit_here(axis.display),
        places=tuple((at, words_here(name)) for at, name in axis.places),
    )


def _mark(mark: Mark) -> Mark:
    return replace(mark, label=words_here(mark.label))
