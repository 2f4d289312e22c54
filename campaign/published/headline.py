"""Counts of a scoreboard: each published value once, by status."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import dataclass

from campaign.published.scoreboard import Line, Scoreboard
from campaign.published.status import Status
from campaign.published.values import Cell
from campaign.published.verdicts import GOOD, Verdict

MOST_FITTED_FIRST = (
    Status.CALIBRATED,
    Status.ALTERED,  # the changes to that bench are unknown
    Status.UNDESCRIBED,  # the origin of that bench is unknown
    Status.SELECTED,
    Status.RECOVERED,
    Status.RECOMPUTED,
    Status.PREDICTED,
    Status.SIMULATED,
    Status.INCONSISTENT,
    Status.NOT_REPRODUCIBLE,
)
NOBODY_FITTED = (Status.PREDICTED, Status.SIMULATED)
"""Statuses of values that the bench was not fitted to."""
LIMITS = (2, 5, 10, 20)
"""Limits of a deviation, in percent of the published value."""
ROUNDING = 1e-9
"""Relative tolerance of a deviation at a limit, for rounding."""
OF_THE_DOCUMENT = (Status.INCONSISTENT, Status.NOT_REPRODUCIBLE)
"""Statuses of values that the document makes impossible to reproduce: shown, not counted."""


@dataclass(frozen=True)
class Count:
    """Number of published values of one status that were compared, and that were reproduced (good).

    Attributes:
        numbers: count of values with a deviation in percent.
        within: count of these with a deviation within each of `LIMITS`.
    """

    status: Status
    compared: int
    good: int
    numbers: int
    within: tuple[int, ...]


@dataclass(frozen=True)
class Headline:
    """Counts of a scoreboard, each published value once.

    Attributes:
        counts: by status, the most fitted first; only those that occur.
        missed: claims that were missed.
        not_reached: values with a bound only.
        not_found, not_run: values without a number, with trials and without.
        printed: count of printed numbers; `repeats` of these repeat another.
        excluded: count, by status, of values that the document makes impossible to reproduce.
    """

    counts: tuple[Count, ...]
    missed: tuple[Line, ...]
    not_reached: tuple[Line, ...]
    not_found: tuple[Line, ...]
    not_run: tuple[Line, ...]
    printed: int = 0
    repeats: int = 0
    excluded: tuple[tuple[Status, int], ...] = ()

    @property
    def compared(self) -> int:
        return sum(count.compared for count in self.counts)


def headline(scoreboard: Scoreboard) -> Headline:
    """Count every published value once, by its representative line (`once`)."""
    values = once(scoreboard.lines)
    lines = [line for line in values if line.status not in OF_THE_DOCUMENT]
    compared = [line for line in lines if is_compared(line)]
    by_status = ((s, [line for line in compared if line.status is s]) for s in MOST_FITTED_FIRST)

    def with_verdict(verdict: Verdict) -> tuple[Line, ...]:
        return tuple(line for line in lines if line.verdict is verdict)

    return Headline(
        tuple(_count(status, own) for status, own in by_status if own),
        with_verdict(Verdict.MISSED),
        with_verdict(Verdict.NOT_REACHED),
        with_verdict(Verdict.NOT_FOUND),
        with_verdict(Verdict.NOT_RUN),
        len(scoreboard.lines),
        len(scoreboard.lines) - len(values),
        tuple(
            (status, count)
            for status in OF_THE_DOCUMENT
            if (count := sum(line.status is status for line in values))
        ),
    )


def _count(status: Status, lines: Sequence[Line]) -> Count:
    sizes = [abs(line.deviation) for line in lines if line.deviation is not None]
    within = tuple(sum(size <= limit * (1 + ROUNDING) for size in sizes) for limit in LIMITS)
    good = sum(line.verdict in GOOD for line in lines)
    return Count(status, len(lines), good, len(sizes), within)


def is_compared(line: Line) -> bool:
    """Whether a value has a reproduced number, and the document allows its reproduction."""
    return line.reproduced is not None and line.status not in OF_THE_DOCUMENT


def once(lines: Iterable[Line]) -> tuple[Line, ...]:
    """One line per published value: the same quantity, conditions, domain and printed number.

    A number that a document prints in three tables was measured once. The most fitted of its lines
    counts: a value that was fitted in one table is not predicted in another. A line without a
    result counts only if all are without one.
    """
    chosen: dict[Hashable, Line] = {}
    for line in lines:
        value = _value(line.cell)
        if value not in chosen or _rank(line) < _rank(chosen[value]):
            chosen[value] = line
    return tuple(chosen.values())


def _value(cell: Cell) -> Hashable:
    conditions = frozenset((k, v) for k, v in cell.conditions.items() if k != "domain")
    claim = "equal" if cell.relation == "near" else cell.relation
    return cell.quantity, conditions, cell.domain, cell.value, cell.unit, claim


def _rank(line: Line) -> tuple[int, int]:
    without = (Verdict.NOT_REACHED, Verdict.NOT_FOUND, Verdict.NOT_RUN)
    lack = without.index(line.verdict) + 1 if line.verdict in without else 0
    place = len(MOST_FITTED_FIRST)
    if line.status is not None:
        place = MOST_FITTED_FIRST.index(line.status)
    return lack, place
