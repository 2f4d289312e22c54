"""The scoreboard as text: lines, tables, summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from campaign.estimate import OF_ONE_TRIAL
from campaign.experiments.shared.captions import listed
from campaign.published.headline import LIMITS, Headline, headline, is_compared
from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.published.values import Cell, Published, heading_of
from campaign.published.verdicts import GOOD
from campaign.report.palette import MUTED, STATUS
from campaign.result import Cell as TableCell
from campaign.result import Column, Table
from campaign.text import count, interval, minus, number, percent, pretty_unit

SIGNS = {
    "o": "●",
    "D": "◆",
    "s": "■",
    "P": "✚",
    "*": "★",
    "v": "▼",
    "^": "▲",
    "<": "◀",
    "X": "✖",
    "x": "✕",
}


@dataclass(frozen=True)
class ShownLine:
    """A published cell and its reproduced number, as text."""

    table: str
    name: str
    unit: str
    published: str
    reproduced: str
    deviation: str
    status: str
    css: str
    sign: str
    verdict: str
    good: bool
    notes: tuple[str, ...]
    test: str
    place: str


def shown_line(line: Line) -> ShownLine:
    """Convert a line of the scoreboard to text."""
    cell = line.cell
    look = None if line.status is None else STATUS[line.status]
    notes = (cell.reason, *cell.notes, _not_in_the_interval(line))
    claim = {"near": "≈ ", "at most": "≤ ", "at least": "≥ "}.get(cell.relation, "")
    return ShownLine(
        table=cell.table,
        name=cell_name(line.cell),
        unit=pretty_unit(cell.unit),
        published=claim + minus(cell.printed),
        reproduced=_found(line),
        deviation=percent(line.deviation),
        status="–" if line.status is None else str(line.status),
        css=(look or MUTED).name,
        sign=SIGNS[look.marker] if look else "",
        verdict=str(line.verdict),
        good=line.verdict in GOOD,
        notes=tuple(filter(None, notes)),
        test=line.test,
        place=place_words(line),
    )


def _not_in_the_interval(line: Line) -> str:
    """Text on what the interval does not include, or why there is no interval; else ""."""
    value = line.found
    if value is not None and value.calibration_alone and value.reason:
        return f"the interval is of the calibration alone: {value.reason}"
    if value is None or value.reason not in OF_ONE_TRIAL:
        return ""
    if value.has_interval:
        return "one trial: the interval is of the calibration, without the scatter between trials"
    return "no interval: one trial, and no calibration of its bench"


@dataclass(frozen=True)
class ScoredTable:
    """Summary of a published table: its numbers, and the count of reproduced ones.

    Attributes:
        anchor: anchor of its complete numbers on the page; "" without one.
        compared, good: counts of compared and of reproduced numbers, without those that the
            document makes impossible to reproduce.
    """

    table: str
    title: str
    anchor: str
    lines: tuple[ShownLine, ...]
    compared: int
    good: int


def scored_tables(
    scoreboard: Scoreboard, published: Published, anchors: Mapping[str, str]
) -> tuple[ScoredTable, ...]:
    """The published tables of the scoreboard, in its order."""
    tables = []
    for name in scoreboard.tables():
        lines = scoreboard.of_table(name)
        compared = [line for line in lines if is_compared(line)]
        tables.append(
            ScoredTable(
                table=name,
                title=published[name].title,
                anchor=anchors.get(name, ""),
                lines=tuple(map(shown_line, lines)),
                compared=len(compared),
                good=sum(line.verdict in GOOD for line in compared),
            )
        )
    return tuple(tables)


def cell_name(cell: Cell) -> str:
    """Short name of a cell within its table."""
    row, column = cell.row, cell.column
    if cell.symbol and cell.quantity in (row, column):
        row = cell.symbol if row == cell.quantity else row
        column = cell.symbol if column == cell.quantity else column
    elif cell.symbol:
        row = f"{row} {cell.symbol}"
    # A column that only repeats the quantity of the table adds nothing.
    parts = [row] if column in (cell.quantity, "value") else [row, column]
    return " · ".join(part.replace("_", " ") for part in parts)


def place_words(line: Line) -> str:
    """Place among draws, e.g. `above 26 % (14 to 42 %) of 39 draws`; empty without draws."""
    if line.place is None or line.place.low is None or line.place.high is None:
        return ""
    share, low, high = (
        number(100 * end, 2) for end in (line.place.value, line.place.low, line.place.high)
    )
    return f"above {share} % ({low} to {high} %) of {len(line.draws)} draws"


def _found(line: Line) -> str:
    """Reproduced number with its interval, or as a bound."""
    value, decimals = line.found, line.cell.decimals or 0
    if value is None:
        return "–"
    if value.is_bound:
        sign = {"at least": "≥", "at most": "≤"}[value.kind]
        end = value.low if value.high is None else value.high
        return f"{sign} {number(end, decimals=decimals)}"
    if value.low is None and value.high is None:
        return number(value.value, decimals=decimals)
    return interval(value.value, value.low, value.high)


def statuses(scoreboard: Scoreboard) -> tuple[tuple[str, str, str, int], ...]:
    """Status, CSS name, sign and count of lines, for each status that occurs."""
    counts = {s: sum(line.status is s for line in scoreboard.lines) for s in Status}
    return tuple(
        (str(status), STATUS[status].name, SIGNS[STATUS[status].marker], n)
        for status, n in counts.items()
        if n
    )


def contradictions(scoreboard: Scoreboard) -> tuple[tuple[str, tuple[str, ...], str], ...]:
    """Cells where the document contradicts itself, as (table, cells, reason)."""
    groups: dict[tuple[str, str], list[str]] = {}
    for line in scoreboard.lines:
        if line.status is Status.INCONSISTENT:
            groups.setdefault((line.cell.table, line.cell.reason), []).append(cell_name(line.cell))
    return tuple((table, tuple(cells), reason) for (table, reason), cells in groups.items())


def agreement(scoreboard: Scoreboard) -> str:
    """Summary of the scoreboard in a few sentences; each published value counts once."""
    counts = headline(scoreboard)
    if not counts.compared:
        return "No published number was measured in this run."
    return " ".join(_sentences(counts))


def closeness(scoreboard: Scoreboard) -> Table | None:
    """Table of values within each deviation limit, by status; None without any deviation."""
    counts = headline(scoreboard).counts
    if not any(each.numbers for each in counts):
        return None
    limits = tuple(Column(f"within_{n}", f"≤ {n} %", exact=True) for n in LIMITS)
    columns = (
        Column("status", "Status"),
        Column("compared", "Compared", exact=True),
        Column("reproduced", "Reproduced", exact=True),
        Column("numbers", "With a deviation", exact=True),
        *limits,
    )
    rows: Iterator[dict[str, TableCell]] = (
        {
            "status": str(each.status),
            "compared": each.compared,
            "reproduced": each.good,
            "numbers": each.numbers,
            **{column.name: n for column, n in zip(limits, each.within, strict=True)},
        }
        for each in counts
    )
    title = "Deviation from the published values, by status: values within each limit"
    return Table("closeness", title, columns, tuple(rows))


def _cell_in_words(line: Line) -> str:
    """Name of a cell with its table, e.g. `Figure 5.14 (stribeck velocity · rank)`."""
    return f"{heading_of(line.cell.table)} ({cell_name(line.cell)})"


def _sentences(found: Headline) -> Iterator[str]:
    shares = ", ".join(f"{c.status} {c.good} of {c.compared}" for c in found.counts)
    values = count(found.compared, "published value")
    yield f"{values} compared, each counted once, also if printed several times."
    yield _bridge(found)
    yield f"Reproduced (they agree, are compatible or meet their claim): {shares}."
    missed = ", ".join(dict.fromkeys(map(_cell_in_words, found.missed)))
    if missed:
        yield f"Claims missed: {missed}."
    rest = (
        (len(found.not_reached), "not reached"),
        (len(found.not_found), "not found"),
        (len(found.not_run), "not run"),
    )
    if counts := ", ".join(f"{n} {what}" for n, what in rest if n):
        yield f"Besides: {counts}."


def _bridge(found: Headline) -> str:
    """Sentence that accounts for the printed numbers that are not compared."""
    excluded = sum(n for _, n in found.excluded)
    without = found.printed - found.repeats - excluded - found.compared
    less = (
        *([count(found.repeats, "repeat")] if found.repeats else []),
        *(f"{n} {status}" for status, n in found.excluded),
        *([f"{without} without a number to compare"] if without else []),
    )
    if not less:
        return f"Printed: {found.printed}, all compared."
    return f"Printed: {found.printed}. Excluded: {listed(less)}. Compared: {found.compared}."
