"""What a whole scoreboard comes to: each published value once, by status."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass
from statistics import median

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
OF_THE_DOCUMENT = (Status.INCONSISTENT, Status.NOT_REPRODUCIBLE)
"""What the document itself lets nobody reproduce: shown, and not counted."""


@dataclass(frozen=True)
class Count:
    """How many published values of one status were compared, and how many of them hold."""

    status: Status
    compared: int
    good: int


@dataclass(frozen=True)
class Headline:
    """Each published value once.

    Attributes:
        printed: how often a number is printed, and `repeats` how many of these repeat another.
        excluded: how many values, by status, the document itself lets nobody reproduce.
        counts: by status, the most fitted first; those that occur.
        deviations: sizes in percent, increasing, of those that nobody fitted.
        missed: claims that were missed.
        not_reached: values of which only a bound was found.
        not_found: values that were tried in vain, and `not_run` those that were not tried.
    """

    counts: tuple[Count, ...]
    deviations: tuple[float, ...]
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

    @property
    def median_deviation(self) -> float | None:
        """Percent; None when nothing was compared that nobody fitted."""
        return median(self.deviations) if self.deviations else None

    @property
    def worst_deviation(self) -> float | None:
        return self.deviations[-1] if self.deviations else None


def headline(scoreboard: Scoreboard) -> Headline:
    """Count every published value once, with the line that counts for it."""
    values = once(scoreboard.lines)
    lines = [line for line in values if line.status not in OF_THE_DOCUMENT]
    compared = [line for line in lines if is_compared(line)]
    counts = []
    for status in MOST_FITTED_FIRST:
        of_status = [line for line in compared if line.status is status]
        good = sum(line.verdict in GOOD for line in of_status)
        if of_status:
            counts.append(Count(status, len(of_status), good))
    free = (line for line in compared if line.status in NOBODY_FITTED)
    deviations = sorted(abs(line.deviation) for line in free if line.deviation is not None)

    def with_verdict(verdict: Verdict) -> tuple[Line, ...]:
        return tuple(line for line in lines if line.verdict is verdict)

    return Headline(
        tuple(counts),
        tuple(deviations),
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
