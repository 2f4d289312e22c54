"""Reference values of another program: a CSV file with a row for each number.

Columns `quantity`, `value` and `unit` are needed. `low` and `high` are the ends of a 95 % interval.
`test` names the test that a row is for. Any other column is a condition, such as `direction` or
`frequency [Hz]`: a finding must state the same; an empty cell asks for nothing.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.errors import UsageError
from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import in_unit
from campaign.estimation.intervals import LEVEL
from campaign.reason import Cause
from campaign.result import Finding, Value, same_value
from campaign.units import same_dimension, to_si

NEEDED = ("quantity", "value", "unit")
OWN = (*NEEDED, "low", "high", "test")
CONDITION = re.compile(r"(?P<name>[^\[\]]+?)\s*(\[(?P<unit>[^\[\]]*)\])?")
"""Head of a condition's column: a name, and the unit of its numbers in brackets."""
NO_INTERVAL = Cause("reference without interval", "the file states no interval (low, high)")


@dataclass(frozen=True)
class ReferenceValue:
    """A row of the file.

    Attributes:
        conditions: SI; a finding states each of them alike.
        test: the test that it is for; "" for any.
        place: of the row, in words.
    """

    estimate: Estimate
    conditions: Mapping[str, Value]
    test: str
    place: str

    def speaks_of(self, test: str, finding: Finding) -> bool:
        """Whether a finding of a test is of the same quantity under these conditions."""
        return (
            self.test in ("", test)
            and self.estimate.name == finding.quantity
            and same_dimension(self.estimate.unit, finding.unit)
            and all(
                name in finding.conditions and same_value(finding.conditions[name], value)
                for name, value in self.conditions.items()
            )
        )

    def in_unit_of(self, finding: Finding) -> Estimate:
        """Its number in the unit of a finding that it speaks of."""
        return in_unit(self.estimate, finding.unit)


def read_values(path: Path) -> tuple[ReferenceValue, ...]:
    """The values of a file. Raises UsageError that names file, line and column."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            rows = list(csv.reader(file, strict=True))
    except OSError as error:
        raise UsageError(f"{path}: cannot be read: {error.strerror}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise UsageError(f"{path}: is no CSV file in UTF-8: {error}") from None
    heads = [head.strip() for head in rows[0]] if rows else []
    lacking = [name for name in NEEDED if name not in heads]
    if lacking or len(set(heads)) < len(heads):
        what = f"there is no column {', '.join(lacking)}" if lacking else "two columns are alike"
        raise UsageError(
            f"{path}, line 1: {what}; the first line names columns, separated by commas: "
            f"{', '.join(OWN)}, and conditions such as direction or frequency [Hz]"
        )
    found = tuple(_values(path, heads, rows[1:]))
    if not found:
        raise UsageError(f"{path}: it has no row below the names of the columns")
    return found


def _values(
    path: Path, heads: Sequence[str], rows: Sequence[Sequence[str]]
) -> Iterator[ReferenceValue]:
    for line, row in enumerate(rows, start=2):
        cells = [cell.strip() for cell in row]
        if not any(cells):
            continue
        try:
            if len(cells) != len(heads):
                raise ValueError(f"{len(cells)} cells; the first line has {len(heads)}")
            told = dict(zip(heads, cells, strict=True))
            conditions = {
                name: value
                for head, cell in told.items()
                if head not in OWN and cell
                for name, value in [_condition(head, cell)]
            }
            yield ReferenceValue(_estimate(told), conditions, told.get("test", ""), f"line {line}")
        except ValueError as error:
            raise UsageError(f"{path}, line {line}: {error}") from None


def _estimate(told: Mapping[str, str]) -> Estimate:
    """Raises ValueError, as `_condition` does."""
    if not told["quantity"]:
        raise ValueError("quantity is empty")
    to_si(f"1 {told['unit']}")  # it is a unit
    value = _number("value", told["value"])
    ends = [_number(name, cell) for name in ("low", "high") if (cell := told.get(name, ""))]
    what = (told["quantity"], value, told["unit"])
    if not ends:
        return Estimate.without_interval(*what, NO_INTERVAL(), origin=Origin.GIVEN)
    if len(ends) == 1:
        raise ValueError("low and high go together: write both or none")
    low, high = ends
    if not low <= value <= high or low == high:
        raise ValueError(f"value lies between low and high, but {low:g}, {value:g}, {high:g} stand")
    return Estimate(*what, low, high, LEVEL, origin=Origin.GIVEN)


def _condition(head: str, cell: str) -> tuple[str, Value]:
    """Name and value (SI) of a condition: a number, or a word."""
    match = CONDITION.fullmatch(head)
    if match is None:
        raise ValueError(f"the column {head!r} is no name with a unit in brackets")
    name, unit = match["name"], match["unit"]
    if unit is None:
        try:
            return name, float(cell)
        except ValueError:
            return name, cell
    return name, to_si(f"{_number(head, cell)} {unit}")


def _number(name: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{name} is a number, but {cell!r} stands there")
    return value
