"""Published values of a source document, and their file.

`campaign/published/thesis.toml` contains the tables of the thesis; a laboratory may provide its own
file of the same form (`docs/published-values.md`). A cell combines conditions, quantity and unit of
its table, its row and its column.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Annotated, Any, Literal, Self, TypeVar

from pydantic import Field, ValidationError, field_validator, model_validator

from campaign.errors import UsageError
from campaign.options import Options, spelled
from campaign.published.patterns import covers
from campaign.result import Value
from campaign.text import capitalized
from campaign.units import convert, to_si

T = TypeVar("T")
THESIS = "thesis"
"""Name of the packaged document in a protocol or a bench."""
Relation = Literal["equal", "near", "at most", "at least", "rank", "mark"]
NO_SIZE = ("rank", "mark")
"""Relations of printed numbers without a deviation in percent."""
Mark = Literal["inconsistent", "not reproducible"]


class Part(Options):
    """Data of a table, row or column on its cells; the innermost has priority."""

    symbol: str = ""
    """Symbol in the document, e.g. σ2."""
    quantity: str | None = None
    """Its name in a finding, e.g. stabilization_error."""
    unit: str | None = None
    """Unit of the printed number; absent for a number without unit."""
    relation: Relation | None = None
    """Claim of the document: this value (default), near it, at most or at least it. Or: a rank in
    an order, or a mark on a scale."""
    decimals: int | None = Field(default=None, ge=0, le=12)
    """Printed decimal places."""
    conditions: dict[str, str | int | float | bool] = {}
    """Conditions of a matching finding: text, numbers, or text with a unit."""


class Names(Options):
    """Condition that the names of rows or columns are values of."""

    condition: str
    """Name of the condition, e.g. compensation, frequency."""
    unit: str = ""
    """Unit of names that are numbers."""
    names: tuple[str, ...] = ()
    """The columns in printed order (rows are named by their cells)."""


class MarkOptions(Options):
    """A remark on some cells of a table."""

    cells: tuple[str, ...] = Field(min_length=1)
    """`row/column` or `row`; `*` means all of them."""
    status: Mark | None = None
    """`inconsistent`: the document contradicts itself; or `not reproducible`."""
    repeats: tuple[str, ...] = ()
    """Tables, rows or cells with the same condition, or from which these cells follow. If they are
    fitted or seen, so are these cells."""
    reason: str = Field(min_length=1)
    """Reason, or remark."""


class TableOptions(Part):
    """One published table, figure or claim in words."""

    name: Annotated[
        str,
        spelled(r"(figure |text )?[A-Z0-9]+(\.[0-9A-Za-z]+)*", "like 5.8, figure 5.14, text 4.2.3"),
    ]
    """Its number: 5.8, or `figure 5.14`, `text 4.2.3`."""
    title: str
    """Its content."""
    domain: Literal["", "simulation", "hardware"] = ""
    """Its origin in the document; for reader and headline, not matched."""
    rows: Names | None = None
    """Condition of the row names."""
    columns: Names | None = None
    """Condition of the column names."""
    row: dict[str, Part] = {}
    """Rows with more data than their name."""
    column: dict[str, Part] = {}
    """Columns with more data than their name, in printed order."""
    cells: dict[str, tuple[float | None, ...]] = Field(min_length=1)
    """The printed numbers: row name to one number per column; `""` for an empty cell."""
    mark: tuple[MarkOptions, ...] = ()
    """Remarks."""

    @property
    def column_names(self) -> tuple[str, ...]:
        """Columns in printed order."""
        named = self.columns.names if self.columns else ()
        return (*named, *(name for name in self.column if name not in named))

    @field_validator("cells", mode="before")
    @classmethod
    def _empty_cells(cls, cells: Any) -> Any:
        """Convert empty texts to None, because TOML has no null."""
        if not isinstance(cells, dict):
            return cells
        return {
            row: [None if value == "" else value for value in values]
            if isinstance(values, list)
            else values
            for row, values in cells.items()
        }

    @model_validator(mode="after")
    def _agree(self) -> Self:
        columns = self.column_names
        for row, values in self.cells.items():
            if len(values) != len(columns):
                raise ValueError(
                    f"row {row!r} has {len(values)} numbers for {len(columns)} columns"
                    f" ({', '.join(columns)})"
                )
        for row in self.row:
            if row not in self.cells:
                raise ValueError(f"row {row!r} has no cells")
        for pattern in (pattern for mark in self.mark for pattern in mark.cells):
            if not any(covers(pattern, f"{row}/{col}") for row in self.cells for col in columns):
                raise ValueError(f"a mark names {pattern!r}, which is no row/column of it")
        return self

    def marks(self, row: str, column: str) -> Iterable[MarkOptions]:
        """The remarks on one cell, in file order."""
        return (
            mark
            for mark in self.mark
            if any(covers(pattern, f"{row}/{column}") for pattern in mark.cells)
        )


class PublishedOptions(Options):
    """A file of published values."""

    source: str
    """Title of the document."""
    author: str = ""
    """Author."""
    institution: str = ""
    """Institution."""
    year: int | None = None
    """Year."""
    table: tuple[TableOptions, ...] = ()
    """Its tables."""

    @property
    def cited(self) -> str:
        """Citation such as `A. Author: Title, Institution, 2010`, without unknown parts."""
        where = ", ".join(
            filter(None, (self.source, self.institution, str(self.year) if self.year else ""))
        )
        return f"{self.author}: {where}" if self.author else where


@dataclass(frozen=True)
class Cell:
    """One published number.

    Attributes:
        table, row, column: e.g. `5.8`, `lugre`, `stabilization_error`.
        value: as printed, in `unit`.
        conditions: conditions that a matching finding must state; numbers in SI.
        decimals: printed digits after the point, None when unknown.
        status: `inconsistent`, `not reproducible` or None; `reason` is the reason.
        notes: further remarks.
        repeats: tables or cells that were measured at the same condition, or that it follows from.
        symbol: the document's symbol for its row, or for its column.
        domain: origin in the document, "simulation" or "hardware"; "" when not stated.
    """

    table: str
    row: str
    column: str
    quantity: str
    unit: str
    value: float
    conditions: Mapping[str, Value]
    relation: Relation = "equal"
    decimals: int | None = None
    status: Mark | None = None
    reason: str = ""
    notes: tuple[str, ...] = ()
    repeats: tuple[str, ...] = ()
    symbol: str = ""
    domain: str = ""

    @property
    def path(self) -> str:
        """`table/row/column`, as a bench's `fitted` names it."""
        return f"{self.table}/{self.row}/{self.column}"

    @property
    def printed(self) -> str:
        """The number as the document prints it."""
        return f"{self.value:.15g}" if self.decimals is None else f"{self.value:.{self.decimals}f}"

    def in_unit(self, unit: str) -> float | None:
        """The number in another unit; None for a unit of another dimension."""
        try:
            return float(convert(self.value, self.unit, unit))
        except ValueError:
            return None


def heading_of(table: str) -> str:
    """Heading of a published table: `Table 5.8`, `Figure 5.14`, `Text 4.2.3`."""
    return capitalized(table) if " " in table else f"Table {table}"


@dataclass(frozen=True)
class PublishedTable:
    """One published table; cells in printed order."""

    name: str
    title: str
    domain: str
    source: str
    cells: tuple[Cell, ...]

    @property
    def heading(self) -> str:
        """Heading, e.g. `Table 5.8`, `Figure 5.14`, `Text 4.2.3`."""
        return heading_of(self.name)

    @property
    def slug(self) -> str:
        """Name in anchors and files: `table-5.8`, `figure-5.14`, `text-4.2.3`."""
        return self.heading.lower().replace(" ", "-")


Published = Mapping[str, PublishedTable]


@cache
def thesis() -> Published:
    """Tables of the packaged document by name, in printed order."""
    path = files("campaign") / "published" / "thesis.toml"
    return read_published(path.read_text(encoding="utf-8"), "thesis.toml")


def published_values(own: str | None = None, name: str = "published.toml") -> Published:
    """Tables of the thesis; those of a laboratory's `own` file (text) replace the same names."""
    return {**thesis(), **read_published(own, name)} if own else thesis()


def read_published(text: str, name: str) -> Published:
    """Tables of a TOML text by name, in file order; `name` is the file name in messages.

    Raises UsageError that lists every error.
    """
    try:
        options = PublishedOptions.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise UsageError(f"{name}: {error}") from None
    except ValidationError as error:
        raise UsageError("\n".join(_messages(name, error))) from None
    tables: dict[str, PublishedTable] = {}
    for table in options.table:
        if table.name in tables:
            raise UsageError(f"{name}: two tables are called {table.name!r}")
        try:
            tables[table.name] = _table(table, options.cited)
        except ValueError as error:
            raise UsageError(f"{name}: table {table.name}: {error}") from None
    return tables


def _table(table: TableOptions, source: str) -> PublishedTable:
    cells = tuple(
        _cell(table, row, column, value)
        for row, values in table.cells.items()
        for column, value in zip(table.column_names, values, strict=True)
        if value is not None
    )
    return PublishedTable(table.name, table.title, table.domain, source, cells)


def _cell(table: TableOptions, row: str, column: str, value: float) -> Cell:
    parts = (table, table.row.get(row, Part()), table.column.get(column, Part()))
    quantity = _innermost(part.quantity for part in parts)
    if quantity is None:
        raise ValueError(f"cell {row}/{column} has no quantity; give the table, row or column one")
    unit = _innermost(part.unit for part in parts) or ""
    _check_unit(unit)
    conditions: dict[str, Value] = {}
    for part, names, name in zip(
        parts, (None, table.rows, table.columns), ("", row, column), strict=True
    ):
        conditions |= {key: _condition(text) for key, text in part.conditions.items()}
        # The name of a row such as `mean`, with conditions of its own, is no value of a condition.
        if names and not part.conditions:
            conditions[names.condition] = _named_value(name, names.unit)
    marks = tuple(table.marks(row, column))
    verdict = next((mark for mark in marks if mark.status), None)
    return Cell(
        table.name,
        row,
        column,
        quantity,
        unit,
        value,
        conditions,
        relation=_innermost(part.relation for part in parts) or "equal",
        decimals=_innermost(part.decimals for part in parts),
        status=verdict.status if verdict else None,
        reason=verdict.reason if verdict else "",
        notes=tuple(mark.reason for mark in marks if mark.status is None),
        repeats=tuple(name for mark in marks for name in mark.repeats),
        symbol=parts[1].symbol or parts[2].symbol,
        domain=str(conditions.get("domain", table.domain)),
    )


def _innermost(values: Iterable[T | None]) -> T | None:
    given = [value for value in values if value is not None]
    return given[-1] if given else None


def _check_unit(unit: str) -> None:
    if unit != "dB":  # a level has no SI factor; findings state it in dB, too
        to_si(f"1 {unit}")


def _condition(given: str | int | float | bool) -> Value:
    """A number with a unit in SI; any other text, number or boolean unchanged."""
    if not isinstance(given, str):
        return given
    try:
        return to_si(given)
    except ValueError:
        return given


def _named_value(name: str, unit: str) -> Value:
    """Value of a row's or column's name: a number (converted from `unit` to SI) or a word."""
    try:
        float(name)
    except ValueError:
        return name
    return to_si(f"{name} {unit}")


def _messages(name: str, error: ValidationError) -> Iterator[str]:
    for problem in error.errors(include_url=False, include_context=False):
        place = ".".join(str(step) for step in problem["loc"])
        yield f"{name}: {place}: {problem['msg'].removeprefix('Value error, ')}"
