"""Results in the units and terms of the bench's axis.

Analyses are written for a rotary axis. For a linear one the numbers (SI) are the same; this module
sets their units. Names of tables, columns, findings and conditions stay. Analyses write numbers of
degrees within a sentence, which this module cannot recognize, with `units.in_words`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, TypeVar

from campaign.axis_kind import axis_unit, in_axis_terms, is_linear
from campaign.estimate import Estimate
from campaign.result import Cell, Result, Table

UNITS = frozenset({"unit", "display"})
"""Fields that are units, in any part of a result ..."""
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
"""Fields that distinguish a phase from an angle of the axis."""


def in_axis_units(part: Part) -> Part:
    """Result or estimate in terms of the current axis (`axis_kind.axis_terms`)."""
    converted: Part = _told(part) if is_linear() else part
    return converted


def _told(part: Any) -> Any:
    """Convert a part of a result: its units, except those of a phase, its texts, and its parts."""
    if isinstance(part, str):
        return in_axis_terms(part)
    if isinstance(part, list | tuple):
        return tuple(map(_told, part))
    if isinstance(part, Mapping):  # units of parameters, by name
        return {name: axis_unit(unit) for name, unit in part.items()}
    if not hasattr(part, "__dataclass_fields__"):
        return part
    phase = _is_phase(*(str(getattr(part, name, "")) for name in NAMES))
    changes: dict[str, Any] = {}
    for name in (each.name for each in fields(part)):
        value = getattr(part, name)
        if name in UNITS:
            changes[name] = value if phase else axis_unit(value)
        elif name in TEXTS:
            changes[name] = in_axis_terms(value)
        elif name in PARTS:
            changes[name] = _told(value)
        elif name == "places":  # of an axis
            changes[name] = tuple((at, in_axis_terms(word)) for at, word in value)
        elif name == "rows":
            changes[name] = tuple(_row(part, row) for row in value)
    return replace(part, **changes)


def _is_phase(*names: str) -> bool:
    """Whether a number is an angle, but not of an axis: a phase, a phase margin."""
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
