"""Results in the units and terms of the bench's axis.

Analyses are written for a rotary axis; of a linear one the numbers (SI) are the same, and here they
get their units. Names stay: those of tables, columns, findings and conditions. What cannot be told
from the outside, a number of degrees within a sentence, analyses write with `units.in_words`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from campaign.axis_kind import axis_unit, in_axis_terms, is_linear
from campaign.estimate import Estimate
from campaign.result import Cell, Result, Table

UNITS = frozenset({"unit", "display"})
"""Fields that are units, of whatever part of a result has them ..."""
TEXTS = frozenset(
    {"title", "label", "note", "caption", "alt", "method", "meaning", "advice", "text", "what"}
)
"""... fields that a reader reads ..."""
PARTS = frozenset(
    {
        "tables", "columns", "figures", "panels", "x", "y", "curves", "marks", "findings",
        "estimate", "reason", "identified", "parameters", "unseen", "notes",
    }
)  # fmt: skip
"""... and fields that have parts of their own."""
Part = TypeVar("Part", Result, Estimate)
NAMES = ("name", "quantity", "label")
"""Fields that tell a phase from an angle of the axis."""


def in_axis_units(part: Part) -> Part:
    """The same result, or estimate, told of the axis that is meant (`axis_kind.axis_terms`)."""
    told: Part = _told(part) if is_linear() else part
    return told


def _told(part: Any) -> Any:
    """A part of a result: its units, unless it is of a phase, its texts, and the parts it has."""
    if isinstance(part, str):
        return in_axis_terms(part)
    if isinstance(part, list | tuple):
        return tuple(map(_told, part))
    if isinstance(part, Mapping):  # units of parameters, by name
        return {name: axis_unit(unit) for name, unit in part.items()}
    if not hasattr(part, "__dataclass_fields__"):
        return part
    phase = _is_phase(*(str(getattr(part, name, "")) for name in NAMES))
    told: dict[str, Any] = {}
    for name in (each.name for each in fields(part)):
        value = getattr(part, name)
        if name in UNITS:
            told[name] = value if phase else axis_unit(value)
        elif name in TEXTS:
            told[name] = in_axis_terms(value)
        elif name in PARTS:
            told[name] = _told(value)
        elif name == "places":  # of an axis
            told[name] = tuple((at, in_axis_terms(word)) for at, word in value)
        elif name == "rows":
            told[name] = tuple(_row(part, row) for row in value)
    return replace(part, **told)


def _is_phase(*names: str) -> bool:
    """Whether a number is an angle of no axis: a phase, a phase margin."""
    return any("phase" in name.lower() for name in names)


def _row(table: Table, row: Mapping[str, Cell]) -> dict[str, Cell]:
    phases = {each.name for each in table.columns if _is_phase(each.name, each.label)}
    return {name: _cell(name, cell, row, name in phases) for name, cell in row.items()}


def _cell(name: str, cell: Cell, row: Mapping[str, Cell], phase: bool) -> Cell:
    if isinstance(cell, Estimate):
        return cell if phase else in_axis_units(cell)
    if not isinstance(cell, str):
        return cell
    if name == "unit":  # of the row's number
        return cell if _is_phase(str(row.get("parameter", ""))) else axis_unit(cell)
    return in_axis_terms(cell)
