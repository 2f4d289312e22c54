"""Reference values of another program: a CSV file with a row for each number.

Columns `quantity`, `value` and `unit` are required. `low` and `high` are the ends of a 95 %
interval. `test` names the test of a row. Any other column is a condition, such as `direction` or
`frequency [Hz]`: a finding must state the same value; an empty cell is no condition.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.errors import UsageError
from campaign.estimate import Estimate, Origin
from campaign.estimation.intervals import LEVEL
from campaign.reason import Cause
from campaign.result import Finding, Value, meets
from campaign.units import same_dimension, to_si

NEEDED = ("quantity", "value", "unit")
OWN = (*NEEDED, "low", "high", "test")
CONDITION = re.compile(r"(?P<name>[^\[\]]+?)\s*(\[(?P<unit>[^\[\]]*)\])?")
"""Heading of a condition's column: a name, and the unit of its numbers in brackets."""
SMALLEST, LARGEST = 1e-100, 1e100
"""Limits of the absolute value of a number, in any unit."""
NO_INTERVAL = Cause("reference without interval", "the file states no interval (low, high)")


@dataclass(frozen=True)
class ReferenceValue:
    """A row of the file.

    Attributes:
        conditions: conditions that a matching finding must state, in SI.
        units: units of conditions that have one in the file, by name.
        test: name of its test; "" for any.
        place: location of the row, e.g. `line 3`.
    """

    estimate: Estimate
    conditions: Mapping[str, Value]
    units: Mapping[str, str]
    test: str
    place: str

    def speaks_of(self, test: str, finding: Finding) -> bool:
        """Whether a test's finding has this quantity and these conditions."""
        return (
            self.test in ("", test)
            and self.estimate.name == finding.quantity
            and same_dimension(self.estimate.unit, finding.unit)
            and meets(finding.conditions, self.conditions)
        )


def read_values(path: Path) -> tuple[ReferenceValue, ...]:
    """Read the values of a file. Raises UsageError that names file, line and column."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file, strict=True))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{path}: is no CSV file in UTF-8: {error}") from None
    heads = [_Head.of(head.strip()) for head in (rows[0] if rows else [])]
    names = [head.name for head in heads if head.name]
    lacking = [name for name in NEEDED if name not in names]
    twice = next((name for name in names if names.count(name) > 1), "")
    if lacking or twice:
        what = f"there is no column {', '.join(lacking)}" if lacking else f"{twice!r} stands twice"
        raise UsageError(
            f"{path}, line 1: {what}; the first line names columns, separated by commas: "
            f"{', '.join(OWN)}, and conditions such as direction or frequency [Hz]"
        )
    values: dict[str, ReferenceValue] = {}
    for line, row in enumerate(rows[1:], start=2):
        if not any(map(str.strip, row)):
            continue
        try:
            value = _value(heads, row, f"line {line}")
            about = repr((value.estimate.name, dict(sorted(value.conditions.items())), value.test))
            if about in values:
                raise ValueError(
                    f"it repeats {values[about].place}: quantity, conditions and test are the same"
                )
        except ValueError as error:
            raise UsageError(f"{path}, line {line}: {error}") from None
        values[about] = value
    if not values:
        raise UsageError(f"{path}: it has no row below the names of the columns")
    return tuple(values.values())


@dataclass(frozen=True)
class _Head:
    """Heading of a column: its name, and the unit in brackets or None."""

    name: str
    unit: str | None = None

    @classmethod
    def of(cls, text: str) -> _Head:
        match = CONDITION.fullmatch(text)
        return cls(text) if match is None else cls(match["name"], match["unit"])

    def condition(self, cell: str) -> Value:
        """Value of a cell: a word, a boolean or a number (SI). Raises ValueError."""
        if self.unit is not None:
            return to_si(f"{_number(self.name, cell)} {self.unit}")
        try:
            return _number(self.name, cell)
        except ValueError:
            return {"true": True, "false": False}.get(cell.lower(), cell)


def _value(heads: Sequence[_Head], row: Sequence[str], place: str) -> ReferenceValue:
    if len(row) != len(heads):
        raise ValueError(f"{len(row)} cells; the first line has {len(heads)}")
    cells = {head: cell.strip() for head, cell in zip(heads, row, strict=True) if cell.strip()}
    if unnamed := [cell for head, cell in cells.items() if not head.name]:
        raise ValueError(f"{unnamed[0]!r} stands in a column without a name")
    own = {head.name: cell for head, cell in cells.items() if head.name in OWN}
    conditions = {head: cell for head, cell in cells.items() if head.name not in OWN}
    return ReferenceValue(
        _estimate(own),
        {head.name: head.condition(cell) for head, cell in conditions.items()},
        {head.name: head.unit for head in conditions if head.unit is not None},
        own.get("test", ""),
        place,
    )


def _estimate(told: Mapping[str, str]) -> Estimate:
    """Estimate from the cells of a row. Raises ValueError."""
    if "quantity" not in told:
        raise ValueError("quantity is empty")
    unit = told.get("unit", "")
    to_si(f"1 {unit}")  # checks the unit
    value = _number("value", told.get("value", ""))
    ends = [_number(name, told[name]) for name in ("low", "high") if name in told]
    what = (told["quantity"], value, unit)
    if not ends:
        return Estimate.without_interval(*what, NO_INTERVAL(), origin=Origin.GIVEN)
    if len(ends) == 1:
        raise ValueError("low and high belong together: write both or none")
    low, high = ends
    if not low <= value <= high or low == high:
        raise ValueError(f"value lies between low and high, but {low:g}, {value:g}, {high:g} stand")
    return Estimate(*what, low, high, LEVEL, origin=Origin.GIVEN)


def _number(name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is a number, but {cell!r} stands there")
    if value and not SMALLEST <= abs(value) <= LARGEST:
        raise ValueError(f"{name} is {cell}; sizes from {SMALLEST:g} to {LARGEST:g} are read")
    return value
