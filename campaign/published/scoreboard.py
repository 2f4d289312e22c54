"""The scoreboard: every published cell a run speaks to, against what the run found."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from campaign.physics.bench import Bench
from campaign.published.patterns import covers, overlap
from campaign.published.provenance import NOTHING_ALTERED, Provenance
from campaign.published.values import Cell, Published
from campaign.published.verdicts import Reproduced, Verdict, deviation, judge, reproduced
from campaign.result import Finding, Value

COLUMNS = (
    "table",
    "row",
    "column",
    "unit",
    "published",
    "reproduced",
    "deviation_percent",
    "status",
    "low",
    "high",
    "verdict",
    "source",
)
TOLERANCE = 1e-3
"""How far a finding's condition may be from a published one, as a share of it."""


class Status(StrEnum):
    """Where a reproduced number comes from. The first that applies."""

    INCONSISTENT = "inconsistent"  # the document contradicts itself there
    NOT_REPRODUCIBLE = "not reproducible"  # nobody could reproduce it; the reason is given
    ALTERED = "altered"  # the bench is not the one that was calibrated or described
    CALIBRATED = "calibrated"  # the bench was fitted to it
    RECOVERED = "recovered"  # the bench was given this value and the experiment found it again
    RECOMPUTED = "recomputed"  # derived from other published cells
    SELECTED = "selected"  # it was looked at while the bench's structure was chosen
    PREDICTED = "predicted"  # the bench was fitted, but not to this
    SIMULATED = "simulated"  # nothing was fitted


@dataclass(frozen=True)
class Evidence:
    """What one test brings to the scoreboard.

    Attributes:
        reproduces: the published tables the test stands for, by name.
        given, fitted, seen: of its bench: cells (or rows, or tables) it was given, was fitted to,
            and that were looked at while it was made.
        known: conditions that hold for every finding which does not state them itself, such as
            the `domain`.
        failed: whether trials of the test failed, or its analysis found no number somewhere.
        source: where its samples come from: `simulation`, `hardware`, `recording`; "" unknown.
        provenance: whether its trials ran on the bench that was described.
    """

    test: str
    reproduces: Sequence[str]
    findings: Sequence[Finding]
    given: Sequence[str] = ()
    fitted: Sequence[str] = ()
    seen: Sequence[str] = ()
    known: Mapping[str, Value] = field(default_factory=dict)
    failed: bool = False
    source: str = ""
    provenance: Provenance = NOTHING_ALTERED


def evidence_of(
    test: str,
    reproduces: Sequence[str],
    findings: Sequence[Finding],
    bench: Bench | None,
    *,
    source: str = "",
    provenance: Provenance = NOTHING_ALTERED,
) -> Evidence:
    """What a test on `bench` brings; None when nobody knows the bench.

    A table may ask whether a number is from a simulation or from hardware: here that is whether
    the bench's controller is continuous, or sampled as a real one is. Where the samples themselves
    come from is the `source`.
    """
    if bench is None:
        return Evidence(test, reproduces, findings, source=source, provenance=provenance)
    domain = "simulation" if bench.controller.sample_rate is None else "hardware"
    known = bench.known
    return Evidence(
        test,
        reproduces,
        findings,
        known.given,
        known.fitted,
        known.seen,
        {"domain": domain},
        source=source,
        provenance=provenance,
    )


@dataclass(frozen=True)
class Line:
    """One published cell with what the run found for it.

    Attributes:
        status: None for a cell without a number that the document does not mark either.
        found: in the printed unit; None when no trial measured it.
        test: which test found it; empty when none did.
        source: where that test's samples come from.
        why: a sentence on the status, where there is one to say.
    """

    cell: Cell
    verdict: Verdict
    status: Status | None = None
    found: Reproduced | None = None
    test: str = ""
    source: str = ""
    why: str = ""

    @property
    def reproduced(self) -> float | None:
        """The reproduced value in the printed unit; None without one, and for a mere bound."""
        return None if self.found is None or self.found.is_bound else self.found.value

    @property
    def deviation(self) -> float | None:
        """Of reproduced from published in percent; None where that has no meaning."""
        return None if self.found is None else deviation(self.cell, self.found, self.verdict)


@dataclass(frozen=True)
class Scoreboard:
    """All cells of the tables that tests stand for, in the order of the published tables.

    Attributes:
        lines: one per cell, found or not.
        further: cells that another test found again, which do not count.
        problems: sentences on what could not be compared.
    """

    lines: tuple[Line, ...] = ()
    further: tuple[Line, ...] = ()
    problems: tuple[str, ...] = ()

    def of_table(self, table: str) -> tuple[Line, ...]:
        return tuple(line for line in self.lines if line.cell.table == table)

    def tables(self) -> tuple[str, ...]:
        """Names of the tables with at least one line, in printed order."""
        return tuple(dict.fromkeys(line.cell.table for line in self.lines))

    @property
    def altered(self) -> tuple[str, ...]:
        """Why lines are `altered`, each reason once, with the test."""
        found = (line for line in self.lines if line.status is Status.ALTERED)
        return tuple(dict.fromkeys(f"{line.test}: {line.why}" for line in found))


def score(published: Published, evidence: Sequence[Evidence]) -> Scoreboard:
    """Compare every published cell of the tables that tests stand for with their findings.

    Every cell is a line: a cell that was not run, or that a failed trial should have found, must
    not leave the board. When several tests found a cell, the first one in the order of the
    protocol counts; one that found a number goes before one that found a bound.
    """
    lines: list[Line] = []
    further: list[Line] = []
    problems = list(_unknown_tables(published, evidence))
    for table in published.values():
        tests = [test for test in evidence if table.name in test.reproduces]
        for cell in table.cells if tests else ():
            found = list(_found(cell, tests, problems))
            found.sort(key=_is_bound)  # stable
            lines.append(found[0] if found else _without(cell, tests))
            further += found[1:]
    return Scoreboard(tuple(lines), tuple(further), tuple(dict.fromkeys(problems)))


def to_csv(lines: Iterable[Line], *, tests: bool = False) -> str:
    """`scoreboard.csv`: unrounded values in the printed unit; `tests` adds who found them."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*COLUMNS, "test") if tests else COLUMNS)
    for line in lines:
        writer.writerow((*_row(line), line.test) if tests else _row(line))
    return text.getvalue()


def _row(line: Line) -> tuple[str, ...]:
    cell, found = line.cell, line.found
    ends = (None, None) if found is None else (found.low, found.high)
    value, again, off, low, high = (
        "" if number is None else repr(float(number))
        for number in (cell.value, line.reproduced, line.deviation, *ends)
    )
    status = "" if line.status is None else str(line.status)
    place = (cell.table, cell.row, cell.column, cell.unit)
    return (*place, value, again, off, status, low, high, str(line.verdict), line.source)


def _unknown_tables(published: Published, evidence: Sequence[Evidence]) -> Iterator[str]:
    for test in evidence:
        for name in test.reproduces:
            # Figures are named for the reader; few of them have printed numbers.
            if name not in published and not name.startswith("figure "):
                yield f"{test.test} reproduces {name!r}, which is no published table"


def _without(cell: Cell, tests: Sequence[Evidence]) -> Line:
    """The line of a cell for which no test found anything."""
    tried = any(test.failed for test in tests)
    status = None if cell.status is None else Status(cell.status)
    return Line(cell, Verdict.NOT_FOUND if tried else Verdict.NOT_RUN, status)


def _found(cell: Cell, tests: Sequence[Evidence], problems: list[str]) -> Iterator[Line]:
    """The first match of each test, and its first bound where nothing else matches."""
    for test in tests:
        found = list(_matches(cell, test, problems))
        numbers = (line for line in found if not _is_bound(line))
        first = next(numbers, found[0] if found else None)
        if first is not None:
            yield first


def _is_bound(line: Line) -> bool:
    return line.found is not None and line.found.is_bound


def _matches(cell: Cell, test: Evidence, problems: list[str]) -> Iterator[Line]:
    for finding in test.findings:
        if not speaks_to(finding, cell, test.known) or not math.isfinite(finding.value):
            continue
        try:
            value = reproduced(finding, cell.unit)
        except ValueError:  # a plug-in's odd unit
            problems.append(
                f"{test.test}: {finding.quantity} in {finding.unit!r} cannot be compared with"
                f" {cell.path} in {cell.unit!r}"
            )
            continue
        status, why = _status(cell, finding, test)
        yield Line(cell, judge(cell, value), status, value, test.test, test.source, why)


def speaks_to(finding: Finding, cell: Cell, known: Mapping[str, Value]) -> bool:
    """Whether a finding is of the cell's quantity and states each of the cell's conditions."""
    stated = {**known, **finding.conditions}
    return finding.quantity == cell.quantity and all(
        name in stated and _same(stated[name], value) for name, value in cell.conditions.items()
    )


def _same(found: Value, published: Value) -> bool:
    if isinstance(found, bool) or isinstance(published, bool):
        return found is published
    if isinstance(found, int | float) and isinstance(published, int | float):
        return math.isclose(found, published, rel_tol=TOLERANCE)
    return str(found) == str(published)


def _is_among(cell: Cell, patterns: Sequence[str]) -> bool:
    """Whether the patterns cover the cell, or anything whose condition it repeats."""
    return any(
        covers(pattern, cell.path) or any(overlap(pattern, again) for again in cell.repeats)
        for pattern in patterns
    )


def _status(cell: Cell, finding: Finding, test: Evidence) -> tuple[Status, str]:
    """The status of a number that was found, and what there is to say of it."""
    if cell.status:
        return Status(cell.status), cell.reason
    altered = test.provenance.why_altered({**test.known, **finding.conditions})
    if altered:
        return Status.ALTERED, altered
    if _is_among(cell, test.fitted):
        return Status.CALIBRATED, ""
    if any(covers(given, cell.path) for given in test.given):
        return Status.RECOVERED, ""
    if finding.recomputed:
        return Status.RECOMPUTED, ""
    if _is_among(cell, test.seen):
        return Status.SELECTED, ""
    return (Status.PREDICTED if test.fitted else Status.SIMULATED), ""
