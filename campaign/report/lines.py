"""Lines of the scoreboard as text: what was printed, what was found, and what that comes to."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.published.verdicts import GOOD
from campaign.report.overview import cell_name
from campaign.report.palette import MUTED, STATUS
from campaign.report.strips import place_words
from campaign.report.text import interval, minus, number, percent, pretty_unit

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
    """A published cell beside what the run found, as text."""

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
    """A line of the scoreboard as text."""
    cell = line.cell
    look = None if line.status is None else STATUS[line.status]
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
        notes=tuple(note for note in (cell.reason, *cell.notes) if note),
        test=line.test,
        place=place_words(line),
    )


def _found(line: Line) -> str:
    """What was found, with its interval, or as the bound that it is."""
    found, decimals = line.found, line.cell.decimals or 0
    if found is None:
        return "–"
    if found.is_bound:
        sign = {"at least": "≥", "at most": "≤"}[found.kind]
        end = found.low if found.high is None else found.high
        return f"{sign} {number(end, decimals=decimals)}"
    if found.low is None and found.high is None:
        return number(found.value, decimals=decimals)
    return interval(found.value, found.low, found.high)


def statuses(scoreboard: Scoreboard) -> tuple[tuple[str, str, str, int], ...]:
    """Status, its CSS name, its sign and how many lines have it; those that occur."""
    counts = {s: sum(line.status is s for line in scoreboard.lines) for s in Status}
    return tuple(
        (str(status), STATUS[status].name, SIGNS[STATUS[status].marker], count)
        for status, count in counts.items()
        if count
    )


def contradictions(scoreboard: Scoreboard) -> tuple[tuple[str, tuple[str, ...], str], ...]:
    """Per table and reason: the cells where the document contradicts itself."""
    found: dict[tuple[str, str], list[str]] = {}
    for line in scoreboard.lines:
        if line.status is Status.INCONSISTENT:
            found.setdefault((line.cell.table, line.cell.reason), []).append(cell_name(line.cell))
    return tuple((table, tuple(cells), reason) for (table, reason), cells in found.items())
