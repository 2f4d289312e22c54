"""Option and sweep values in the protocol's units.

Internal values are in SI, and most quantities have one display unit. But an author of `"3 urad"`
does not recognize 0.000171887 degrees. The archive contains the protocol's text: the page uses the
unit that the protocol or `--set` wrote, and the quantity's own unit for defaults.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.archive.layout.header import RunHeader
from campaign.experiments.shared.common import OF_NO_OPTION
from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import number_at
from campaign.protocol.shapes import Shape, shape_at
from campaign.report.content.protocol_units import written_units
from campaign.result import Table, is_number
from campaign.text import capitalized, number, path_words, pretty_unit
from campaign.trial import leaves
from campaign.units import Quantity, convert

LISTED = 12
"""Maximum number of shown values of a list."""
DIGITS = 6
"""Maximum number of digits of a written value."""
KINDS = ("kind", "model", "method")
"""Entries with the kind of a table; they come first and need no name."""


@dataclass(frozen=True)
class DisplayUnit:
    """Display unit of numbers in the SI unit `si`: one `unit` is `factor` SI units."""

    si: str
    unit: str
    factor: float

    def number(self, value: float) -> float:
        return value / self.factor


@dataclass(frozen=True)
class TestUnits:
    """Display units of one test's options, bench and sweep.

    Attributes:
        written: written unit by dotted path.
    """

    __test__ = False

    test: AnalysedTest
    written: Mapping[str, str] = field(default_factory=dict)

    def of(self, path: str) -> DisplayUnit | None:
        """Display unit at a path of an option or of a sweep; None without one."""
        if path not in self._known:
            self._known[path] = self._find(path)
        return self._known[path]

    def listed_by(self, path: str) -> str:
        """Option that lists the values of an experiment's own sweep: `speeds`; or ""."""
        fields = self.test.experiment.options.model_fields if self.test.experiment else {}
        several = [f"{path}s", f"{path[:-1]}ies" if path.endswith("y") else f"{path}es"]
        return next((name for name in several if path not in fields and name in fields), "")

    def words(self, path: str, values: Sequence[Any]) -> str:
        """Values at a path as text with the unit once: `0.1, 0.2, 0.4 Hz`."""
        unit = self.of(path)
        if any(isinstance(value, Mapping) for value in values):
            return "; ".join(self._tables(path, values))
        numbers = [value for value in values if is_number(value)]
        ends = [min(numbers), max(numbers)] if len(numbers) == len(values) > LISTED else values
        shown = [_plain(value, unit) for value in ends]
        text = ", ".join(shown)
        if len(values) > LISTED:
            text = f"{len(values)} values from {shown[0]} to {shown[-1]}"
        return f"{text} {pretty_unit(unit.unit)}".rstrip() if unit and numbers else text

    def value(self, path: str, value: Any) -> str:
        """Text of one value, which may be a list or a table of further options."""
        if isinstance(value, list | tuple):
            return self.words(path, value)
        return self.words(path, [value])

    def table(self, table: Table) -> Table:
        """The same table, with words for paths and the protocol's units for settings."""
        columns = []
        for column in table.columns:
            set_ = column.exact or column.name in self._swept
            unit = self.of(column.name) if set_ else None
            if column.label == column.name:
                column = replace(column, label=capitalized(path_words(column.name)))
            if unit is not None and column.unit in ("", unit.si):
                column = replace(column, unit=unit.si, display=unit.unit)
            columns.append(column)
        return replace(table, columns=tuple(columns))

    def in_si(self, table: Table) -> Table:
        """The same table, with SI units of swept columns, for its file."""
        columns = (
            replace(column, unit=unit.si)
            if column.name in self._swept and not column.unit and (unit := self.of(column.name))
            else column
            for column in table.columns
        )
        return replace(table, columns=tuple(columns))

    @cached_property
    def _known(self) -> dict[str, DisplayUnit | None]:
        return {}

    @cached_property
    def _swept(self) -> frozenset[str]:
        return frozenset(path for each in self.test.trials for path in each.trial.point)

    def _find(self, path: str) -> DisplayUnit | None:
        for name in filter(None, (path, self.listed_by(path))):
            quantity = self._quantity(name)
            if quantity is not None:
                return _shown(quantity, self.written.get(path) or self.written.get(name))
        return self._of_column(path)

    def _quantity(self, path: str) -> Quantity | None:
        root: Any = None if self.test.experiment is None else self.test.experiment.options
        tree: Any = self.test.options
        keys = path.split(".")
        if keys[0] == "bench":
            root, keys = Bench, keys[1:]
            tree = self.test.bench.model_dump(mode="json") if self.test.bench else {}
            found = self.test.bench and number_at(self.test.bench, ".".join(keys))
            if found:
                return found[1]
        if root is None or not keys:
            return None
        quantity = _within(shape_at(root, tree, tuple(keys))) or OF_NO_OPTION.get(path)
        bench = self.test.bench
        return quantity.of(bench.sides) if quantity and bench else quantity

    def _of_column(self, path: str) -> DisplayUnit | None:
        """Display unit of the analysis' column of this name, for points of the experiment's own."""
        for table in self.test.result.tables:
            for column in table.columns:
                if column.name == path and column.unit:
                    unit = column.shown_unit
                    return DisplayUnit(column.unit, unit, convert(1.0, unit, column.unit))
        return None

    def _tables(self, path: str, values: Sequence[Any]) -> Iterator[str]:
        """Texts of tables: their kind, and the entries that are not equal in all of a kind."""
        tables = [dict(leaves(v)) if isinstance(v, Mapping) else {"": v} for v in values]
        for own in tables:
            alike = [other for other in tables if _kind(other) == _kind(own)]
            entries = [
                f"{path_words(name)} {self.value(f'{path}.{name}', value)}".strip()
                for name, value in own.items()
                if name not in KINDS
                and value not in (None, [], ())
                and (len(values) == 1 or any(other.get(name) != value for other in alike))
            ]
            yield ", ".join(filter(None, (_kind(own), *entries))) or "as given"


def units_of(tests: Iterable[AnalysedTest], header: RunHeader) -> dict[str, TestUnits]:
    """Display units by test."""
    written = written_units(header)
    return {test.name: TestUnits(test, written.get(test.name, {})) for test in tests}


def short_number(value: float) -> str:
    """A written number as text, with its own digits, at most `DIGITS`."""
    rounded = float(f"{value:.{DIGITS}g}")
    if not rounded or 1e-5 <= abs(rounded) < 10.0 ** (DIGITS + 3):
        return number(rounded, DIGITS)
    fewest = next((n for n in range(1, DIGITS) if float(f"{value:.{n}g}") == rounded), DIGITS)
    return number(rounded, fewest)


def _shown(quantity: Quantity, unit: str | None) -> DisplayUnit:
    """Display unit of a quantity: the written unit if it is valid, else the quantity's own."""
    for each in filter(None, (unit, quantity.display)):
        try:
            return DisplayUnit(quantity.si, each, quantity.parse_own(f"1 {each}"))
        except ValueError:
            continue
    return DisplayUnit(quantity.si, quantity.si, 1.0)


def _within(shape: Shape | None) -> Quantity | None:
    """Quantity of a value, or of the values of a list."""
    depth = 0
    while shape is not None and shape.quantity is None and depth < 3:
        shape, depth = shape.child(0), depth + 1
    return shape.quantity if shape is not None else None


def _plain(value: Any, unit: DisplayUnit | None) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        text = ", ".join(_plain(item, unit) for item in value[:LISTED])
        return f"{text} … ({len(value)})" if len(value) > LISTED else text
    if isinstance(value, int | float):
        return short_number(unit.number(value) if unit else value)
    return "none" if value is None or value == "" else str(value)


def _kind(leaves: Mapping[str, Any]) -> str:
    return next((str(leaves[name]) for name in KINDS if name in leaves), "")
