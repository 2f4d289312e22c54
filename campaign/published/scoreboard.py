"""The scoreboard: published cells against findings of a run."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from campaign.estimate import Estimate, Origin
from campaign.published.attempts import in_vain
from campaign.published.draws import SEED, place_in, together, without_seed
from campaign.published.evidence import Evidence, concerns, with_cells
from campaign.published.provenance import OF_A_TRUTH
from campaign.published.status import Status, status_of
from campaign.published.values import Cell, Published
from campaign.published.verdicts import (
    ReproducedNumber,
    Verdict,
    deviation,
    half_digit,
    judge,
    reproduced,
)
from campaign.result import Finding, same_value
from campaign.text import csv_text
from campaign.trial import canonical_json

COLUMNS = (
    *("table", "row", "column", "unit", "published", "reproduced", "deviation_percent", "status"),
    *("low", "high", "verdict", "source", "place", "place_low", "place_high", "draws"),
)
"""Columns of `scoreboard.csv`: keys of `Line.cells`."""


@dataclass(frozen=True)
class Line:
    """One published cell with the reproduced number of the run.

    Attributes:
        status: None for a cell without a reproduced number and without a mark of the document.
        found: reproduced number in the printed unit; None when no trial measured it.
        test: name of the test that measured it; empty without one.
        source: origin of that test's samples.
        why: reason for the status as a sentence, or "".
        draws: number of each draw of a random bench, in the printed unit, with several draws;
            `found` is then their median and the prediction interval of one more draw.
        place: share of these draws below the published value; None without draws.
    """

    cell: Cell
    verdict: Verdict
    status: Status | None = None
    found: ReproducedNumber | None = None
    test: str = ""
    source: str = ""
    why: str = ""
    draws: tuple[float, ...] = ()
    place: Estimate | None = None

    @property
    def reproduced(self) -> float | None:
        """The reproduced value in the printed unit; None without one, and for a mere bound."""
        return None if self.found is None or self.found.is_bound else self.found.value

    @property
    def deviation(self) -> float | None:
        """Deviation of the reproduced from the published value in percent; None if undefined."""
        return None if self.found is None else deviation(self.cell, self.found, self.verdict)

    @property
    def cells(self) -> dict[str, str | float | None]:
        """Cells of this line in a table, by column name; numbers in the printed unit."""
        cell, found, place = self.cell, self.found, self.place
        return {
            "table": cell.table,
            "row": cell.row,
            "column": cell.column,
            "unit": cell.unit,
            "published": float(cell.value),
            "reproduced": self.reproduced,
            "deviation_percent": self.deviation,
            "status": "" if self.status is None else str(self.status),
            "low": None if found is None else found.low,
            "high": None if found is None else found.high,
            "verdict": str(self.verdict),
            "source": self.source,
            "place": None if place is None else place.value,
            "place_low": None if place is None else place.low,
            "place_high": None if place is None else place.high,
            "draws": None if place is None else len(self.draws),
            "reason": cell.reason,
            "test": self.test,
        }


@dataclass(frozen=True)
class Scoreboard:
    """All cells of the tables that the tests reproduce, in the order of the published tables.

    Attributes:
        lines: one per cell, with or without a reproduced number.
        further: repeated results of a cell, from another test or sweep point; they do not count.
        problems: sentences on numbers that cannot be compared.
    """

    lines: tuple[Line, ...] = ()
    further: tuple[Line, ...] = ()
    problems: tuple[str, ...] = ()

    def of_table(self, table: str) -> tuple[Line, ...]:
        return tuple(line for line in self.lines if line.cell.table == table)

    def tables(self) -> tuple[str, ...]:
        """Names of the tables with lines, in printed order."""
        return tuple(dict.fromkeys(line.cell.table for line in self.lines))

    @property
    def altered(self) -> tuple[str, ...]:
        """Reasons why lines are `altered`, each once, with its tests."""
        tests: dict[str, dict[str, None]] = {}
        for line in self.lines:
            if line.status is Status.ALTERED:
                tests.setdefault(line.why, {})[line.test] = None
        return tuple(f"{', '.join(of)}: {why}" for why, of in tests.items())

    @property
    def misdescribed(self) -> bool:
        """Whether a new description in a bench file would change the status of a line."""
        altered = (line.why for line in self.lines if line.status is Status.ALTERED)
        return any(why != OF_A_TRUTH for why in altered)


def score(published: Published, evidence: Sequence[Evidence]) -> Scoreboard:
    """Compare every published cell of the tables that the tests reproduce with their findings.

    Every cell is a line: a cell without a run, or with a failed trial, must stay on the board. If
    several tests, or several sweep points of a test, have a result for a cell, the first in
    protocol order counts. A number takes precedence over a bound.
    """
    lines: list[Line] = []
    further: list[Line] = []
    problems = list(_unknown_tables(published, evidence))
    evidence = [with_cells(test, published) for test in evidence]
    for table in published.values():
        tests = [test for test in evidence if table.name in test.reproduces]
        for cell in table.cells if tests else ():
            found = list(_found(cell, tests, problems))
            found.sort(key=_is_bound)  # stable
            lines.append(found[0] if found else _without(cell, tests))
            further += found[1:]
    return Scoreboard(tuple(lines), tuple(further), tuple(dict.fromkeys(problems)))


def to_csv(lines: Iterable[Line], columns: Sequence[str] = COLUMNS) -> str:
    """CSV text of the lines with these `columns` of `Line.cells`, unrounded."""
    rows = ([cells[name] for name in columns] for cells in (line.cells for line in lines))
    return csv_text(columns, rows)


def _unknown_tables(published: Published, evidence: Sequence[Evidence]) -> Iterator[str]:
    for test in evidence:
        for name in test.reproduces:
            # A figure name informs the reader; few figures have printed numbers.
            if name not in published and not name.startswith("figure "):
                yield f"{test.test} reproduces {name!r}, which is no published table"


def _without(cell: Cell, tests: Sequence[Evidence]) -> Line:
    """Line of a cell without a result."""
    why = next(filter(None, (_why_not(cell, test) for test in tests)), "")
    status = None if cell.status is None else Status(cell.status)
    return Line(cell, Verdict.NOT_FOUND if why else Verdict.NOT_RUN, status, why=why)


def _why_not(cell: Cell, test: Evidence) -> str:
    """Reason why a test has no result for a cell that it tried; "" if it did not try."""
    ours = {name: test.known[name] for name in test.known.keys() & cell.conditions.keys()}
    if not all(same_value(value, cell.conditions[name]) for name, value in ours.items()):
        return ""  # e.g. a bench with a sampled controller and a column of simulations
    if any(concerns(finding, cell, test.known) for finding in test.findings):
        return f"{test.test}: the analysis found no number"
    if test.failed:
        return f"{test.test}: its analysis failed or trials are damaged, and any cell may need them"
    if in_vain(test.provenance.places, cell.conditions):
        return f"{test.test}: trials that it may need did not complete"
    return ""


def _found(cell: Cell, tests: Sequence[Evidence], problems: list[str]) -> Iterator[Line]:
    """Line of each test and sweep point: the first number, or else the first bound.

    Several draws of a random bench are one sweep point with one combined result.
    """
    for test in tests:
        places: dict[str, list[Finding]] = {}
        for finding in test.findings:
            if concerns(finding, cell, test.known):
                place = canonical_json(without_seed(finding.conditions))
                places.setdefault(place, []).append(finding)
        for findings in places.values():
            lines = [_line(cell, test, [finding], problems) for finding in findings]
            own = sorted((line for line in lines if line is not None), key=_is_bound)  # stable
            if own and len({finding.conditions.get(SEED) for finding in findings}) > 1:
                yield _line(cell, test, _one_of_each(findings), problems) or own[0]
            elif own:
                yield own[0]


def _one_of_each(findings: Iterable[Finding]) -> list[Finding]:
    """First number of every draw, or else its first bound: one draw must not count twice."""
    by_seed: dict[object, Finding] = {}
    for finding in sorted(findings, key=lambda each: each.lower_bound):  # stable
        by_seed.setdefault(finding.conditions.get(SEED), finding)
    return list(by_seed.values())


def _is_bound(line: Line) -> bool:
    return line.found is not None and line.found.is_bound


def _line(
    cell: Cell, test: Evidence, findings: Sequence[Finding], problems: list[str]
) -> Line | None:
    """Line of a cell from one finding, or from those of several draws; None without a number."""
    try:
        # A single remaining draw of several is a selection, too.
        several = len(findings) > 1 or (
            len(test.provenance.seeds) > 1 and SEED in findings[0].conditions
        )
        finding = together(findings, test.provenance.seeds) if several else findings[0]
        if not math.isfinite(finding.value):
            return None
        part, lost = None, False
        if test.is_described(finding):
            part = test.calibration.half_width(cell.path)
            lost = cell.path in test.calibration.lost
        value = reproduced(finding, cell.unit, part, lost=lost)
        draws = tuple(reproduced(each, cell.unit).value for each in findings) if several else ()
    except ValueError:  # unsuitable unit of a plug-in
        finding = findings[0]
        problems.append(
            f"{test.test}: {finding.quantity} in {finding.unit!r} cannot be compared with"
            f" {cell.path} in {cell.unit!r}"
        )
        return None
    draws = tuple(draw for draw in draws if math.isfinite(draw))
    # A share of the remaining draws, or of bounds, is not the share of all draws.
    whole = finding.known.origin is not Origin.NOT_DETERMINED
    place = place_in(draws, cell.value, half_digit(cell)) if draws and whole else None
    verdict, (status, why) = judge(cell, value), status_of(cell, finding, test)
    return Line(cell, verdict, status, value, test.test, test.source, why, draws, place)
