"""Names, conditions and units of findings, for display."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, get_args

from pydantic.fields import FieldInfo

from campaign.api.analysis import AnalysedTest
from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate
from campaign.experiments.shared.common import OF_NO_OPTION
from campaign.physics.bench_knowledge import number_at
from campaign.result import Finding, Table, Value
from campaign.text import number, pretty_unit, quantity_words
from campaign.units import DISPLAY, Quantity, convert

BENCH = "bench."
"""Prefix of a swept value of the bench."""


def display_unit(test: AnalysedTest, finding: Finding) -> str:
    """Unit in which the test's tables show this number, else its quantity."""
    return unit_in_tables(test.result.tables, finding.quantity, finding.value, finding.unit)


def unit_in_tables(tables: Sequence[Table], quantity: str, value: float, unit: str) -> str:
    """Unit in which tables show a number (SI, `unit`), else its quantity, else the default unit."""
    columns = [
        (table, column)
        for table in tables
        for column in table.columns
        if column.display and column.unit == unit
    ]
    for table, column in columns:
        if any(_is(row.get(column.name), value) for row in table.rows):
            return column.display
    own = (column.display for _, column in columns if column.name == quantity)
    return next(own, DISPLAY.get(unit, unit))


def condition_words(test: AnalysedTest, conditions: Mapping[str, Value]) -> str:
    """`direction positive, frequency 0.24 Hz`; a number of unknown unit is in SI."""
    words = (
        f"{name.removeprefix(BENCH).replace('_', ' ')} {_value(test, name, value)}"
        for name, value in conditions.items()
        if value is not None
    )
    return ", ".join(words)


def axis_quantity_name(test: AnalysedTest, quantity: str) -> str:
    """Name of a quantity in terms of the test's axis: `breakaway force`."""
    with axis_terms(test.sides):
        return quantity_words(quantity)


def option_quantity(test: AnalysedTest, name: str) -> Quantity | None:
    """Quantity of an option of the test's experiment; that of `speeds` for `speed`."""
    fields = test.experiment.options.model_fields if test.experiment else {}
    for path in (name, f"{name}s", f"{name.removesuffix('y')}ies"):
        if path in fields:
            quantity = field_quantity(fields[path])
            return quantity and quantity.of(test.sides)
    return None


def field_quantity(field: FieldInfo) -> Quantity | None:
    """Quantity of an option; for a list, that of its values."""
    return next(_quantities((*field.metadata, field.annotation)), None)


def plain(value: Any, quantity: Quantity | None = None) -> str:
    """Text of an option's or bench's value (SI), in the display unit."""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {plain(each)}" for key, each in value.items()) or "none"
    if isinstance(value, list | tuple):
        return ", ".join(plain(each, quantity) for each in value) or "none"
    if isinstance(value, int | float):
        shown = convert(value, quantity.si, quantity.display) if quantity else value
        text = str(value) if isinstance(shown, int) else number(float(shown), 6)
        return f"{text} {pretty_unit(quantity.display)}".rstrip() if quantity else text
    return str(value)


def _value(test: AnalysedTest, name: str, value: Value) -> str:
    if isinstance(value, float):
        quantity = option_quantity(test, name)
        if quantity is None and name in OF_NO_OPTION:
            quantity = OF_NO_OPTION[name].of(test.sides)
        if quantity is None and name.startswith(BENCH) and test.bench is not None:
            field = number_at(test.bench, name.removeprefix(BENCH))
            quantity = None if field is None else field[1]
        return plain(value, quantity) if quantity else f"{plain(value)} (SI)"
    return str(value)


def _quantities(hints: Any) -> Iterator[Quantity]:
    """Quantities in a field's metadata, or in a list or optional type of it."""
    for hint in hints:
        if isinstance(hint, Quantity):
            yield hint
        else:
            yield from _quantities((*getattr(hint, "__metadata__", ()), *get_args(hint)))


def _is(cell: object, value: float) -> bool:
    number = cell.value if isinstance(cell, Estimate) else cell
    return isinstance(number, float) and math.isclose(number, value, rel_tol=1e-12)
