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
    Status.ALTERED,  # nobody knows what was done to that bench
    Status.UNDESCRIBED,  # nor what was done to make that one
    Status.SELECTED,
    Status.RECOVERED,
    Status.RECOMPUTED,
    Status.PREDICTED,
    Status.SIMULATED,
    Status.INCONSISTENT,
    Status.NOT_REPRODUCIBLE,
)
NOBODY_FITTED = (Status.PREDICTED, Status.SIMULATED)
"""What a bench says of itself, whatever the document says."""
LIMITS = (2, 5, 10, 20)
"""Percent of the published value."""
ROUNDING = 1e-9
"""Share by which a deviation of just a limit may exceed it."""
OF_THE_DOCUMENT = (Status.INCONSISTENT, Status.NOT_REPRODUCIBLE)
"""What the document itself lets nobody reproduce: shown, and not counted."""


@dataclass(frozen=True)
class Count:
    """How many published values of one status were compared, and how many of them hold.

    Attributes:
        numbers: those of which a deviation in percent means something.
        within: how many of these deviate by no more than each of `LIMITS`.
    """

    status: Status
    compared: int
    good: int
    numbers: int
    within: tuple[int, ...]


@dataclass(frozen=True)
class Headline:
    """Each published value once.

    Attributes:
        printed: how often a number is printed, and `repeats` how many of these repeat another.
        excluded: how many values, by status, the document itself lets nobody reproduce.
        counts: by status, the most fitted first; those that occur.
        missed: claims that were missed.
        not_reached: values of which only a bound was found.
        not_found: values that were tried in vain, and `not_run` those that were not tried.
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
    """Count every published value once, with the line that counts for it."""
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
    """Whether a number was found for a value that the document lets somebody reproduce."""
    return line.reproduced is not None and line.status not in OF_THE_DOCUMENT


def once(lines: Iterable[Line]) -> tuple[Line, ...]:
    """One line per published value: the same quantity, conditions, domain and printed number.

    A document that prints a number in three tables has measured it once. Of its lines the most
    fitted one counts: a value that was fitted in one table is not predicted in another. One for
    which nothing was found counts only when all are so.
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
    found = without.index(line.verdict) + 1 if line.verdict in without else 0
    place = len(MOST_FITTED_FIRST)
    if line.status is not None:
        place = MOST_FITTED_FIRST.index(line.status)
    return found, place
