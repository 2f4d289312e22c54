"""The scoreboard: every published cell a run speaks to, against what the run found."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from campaign.physics.bench import Bench
from campaign.published.values import Cell, Published
from campaign.result import Finding, Value
from campaign.units import convert

COLUMNS = (
    "table",
    "row",
    "column",
    "unit",
    "published",
    "reproduced",
    "deviation_percent",
    "status",
)
TOLERANCE = 1e-3
"""How far a finding's condition may be from a published one, as a share of it."""


class Status(StrEnum):
    """What a reproduced number is worth. The first that applies."""

    INCONSISTENT = "inconsistent"  # the document contradicts itself there
    NOT_REPRODUCIBLE = "not reproducible"  # nobody could reproduce it; the reason is given
    CALIBRATED = "calibrated"  # the bench was fitted to it
    RECOVERED = "recovered"  # the bench was given this value and the experiment found it again
    RECOMPUTED = "recomputed"  # derived from other published cells
    PREDICTED = "predicted"  # the bench was fitted, but not to this
    SIMULATED = "simulated"  # nothing was fitted


@dataclass(frozen=True)
class Evidence:
    """What one test brings to the scoreboard.

    Attributes:
        reproduces: the published tables the test stands for, by name.
        given, fitted: of its bench: cells (or rows, or tables) it was given, and was fitted to.
        known: conditions that hold for every finding which does not state them itself.
        failed: whether trials of the test failed, or its analysis found no number somewhere.
    """

    test: str
    reproduces: Sequence[str]
    findings: Sequence[Finding]
    given: Sequence[str] = ()
    fitted: Sequence[str] = ()
    known: Mapping[str, Value] = field(default_factory=dict)
    failed: bool = False


def evidence_of(
    test: str, reproduces: Sequence[str], findings: Sequence[Finding], bench: Bench | None
) -> Evidence:
    """What a test on `bench` brings; None when nobody knows the bench.

    A table may ask whether a number is from a simulation or from hardware: here that is whether
    the bench's controller is continuous, or sampled as a real one is.
    """
    if bench is None:
        return Evidence(test, reproduces, findings)
    domain = "simulation" if bench.controller.sample_rate is None else "hardware"
    return Evidence(test, reproduces, findings, bench.given, bench.fitted, {"domain": domain})


@dataclass(frozen=True)
class Line:
    """One published cell with what the run found for it.

    Attributes:
        reproduced: in the printed unit; None when no trial measured it.
        deviation: of reproduced from published, in percent; None without either, and for a
            published zero.
        test: which test found it; empty when none did.
    """

    cell: Cell
    status: Status
    reproduced: float | None = None
    deviation: float | None = None
    test: str = ""

    @property
    def agrees(self) -> bool | None:
        """Whether the reproduced value rounds to the printed digits, or meets the claim.

        None when that cannot be said.
        """
        if self.reproduced is None:
            return None
        if self.cell.relation == "at most":
            return self.reproduced <= self.cell.value
        if self.cell.relation == "at least":
            return self.reproduced >= self.cell.value
        if self.cell.relation == "near" or self.cell.decimals is None:
            return None
        half = 0.5 * 10.0**-self.cell.decimals
        return abs(self.reproduced - self.cell.value) <= half * (1 + 1e-9)


@dataclass(frozen=True)
class Scoreboard:
    """All lines in the order of the published tables.

    Attributes:
        missing: cells of the tables spoken to for which this run has no finding.
        problems: sentences on what could not be compared.
    """

    lines: tuple[Line, ...] = ()
    missing: tuple[Cell, ...] = ()
    problems: tuple[str, ...] = ()

    def of_table(self, table: str) -> tuple[Line, ...]:
        return tuple(line for line in self.lines if line.cell.table == table)

    def tables(self) -> tuple[str, ...]:
        """Names of the tables with at least one line, in printed order."""
        return tuple(dict.fromkeys(line.cell.table for line in self.lines))


def score(published: Published, evidence: Sequence[Evidence]) -> Scoreboard:
    """Compare every published cell of the tables that tests stand for with their findings.

    A cell with no finding is a line, without a reproduced value, when the document marks it, or
    when a test tried and failed: a failed trial must not improve the scoreboard. Otherwise this run
    did not try it, and it is `missing`. When several tests found a cell, the first one in the order
    of the protocol counts.
    """
    lines, missing, problems = [], [], list(_unknown_tables(published, evidence))
    for table in published.values():
        tests = [test for test in evidence if table.name in test.reproduces]
        for cell in table.cells if tests else ():
            found = next(_matches(cell, tests, problems), None)
            if found:
                lines.append(found)
            elif cell.status or any(test.failed for test in tests):
                lines.append(Line(cell, Status(cell.status or Status.NOT_REPRODUCIBLE)))
            else:
                missing.append(cell)
    return Scoreboard(tuple(lines), tuple(missing), tuple(dict.fromkeys(problems)))


def to_csv(lines: Iterable[Line]) -> str:
    """`scoreboard.csv`: unrounded values in the printed unit."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for line in lines:
        cell = line.cell
        numbers = (cell.value, line.reproduced, line.deviation)
        shown = ("" if number is None else repr(float(number)) for number in numbers)
        writer.writerow((cell.table, cell.row, cell.column, cell.unit, *shown, str(line.status)))
    return text.getvalue()


def _unknown_tables(published: Published, evidence: Sequence[Evidence]) -> Iterator[str]:
    for test in evidence:
        for name in test.reproduces:
            # Figures are named for the reader; few of them have printed numbers.
            if name not in published and not name.startswith("figure "):
                yield f"{test.test} reproduces {name!r}, which is no published table"


def _matches(cell: Cell, tests: Sequence[Evidence], problems: list[str]) -> Iterator[Line]:
    for test in tests:
        for finding in test.findings:
            if not speaks_to(finding, cell, test.known) or not math.isfinite(finding.value):
                continue
            try:
                value = float(convert(finding.value, finding.unit, cell.unit))
            except ValueError:  # a plug-in's odd unit
                problems.append(
                    f"{test.test}: {finding.quantity} in {finding.unit!r} cannot be compared with"
                    f" {cell.path} in {cell.unit!r}"
                )
                continue
            deviation = 100 * (value - cell.value) / cell.value if cell.value else None
            yield Line(cell, _status(cell, finding, test), value, deviation, test.test)


def speaks_to(finding: Finding, cell: Cell, known: Mapping[str, Value]) -> bool:
    """Whether a finding is of the cell's quantity and states each of the cell's conditions."""
    stated = {**known, **finding.conditions}
    if finding.lower_bound and cell.relation != "at least":
        return False
    return finding.quantity == cell.quantity and all(
        name in stated and _same(stated[name], value) for name, value in cell.conditions.items()
    )


def _same(found: Value, published: Value) -> bool:
    if isinstance(found, bool) or isinstance(published, bool):
        return found is published
    if isinstance(found, int | float) and isinstance(published, int | float):
        return math.isclose(found, published, rel_tol=TOLERANCE)
    return str(found) == str(published)


def _covers(name: str, path: str) -> bool:
    """Whether `table`, `table/row` or `table/row/column` covers a cell; * is any row or column."""
    return all(
        want in ("*", part) for want, part in zip(name.split("/"), path.split("/"), strict=False)
    )


def _was_fitted(cell: Cell, fitted: Sequence[str]) -> bool:
    """Whether the bench was fitted to the cell, or to a table whose condition it repeats."""
    itself = any(f"{cell.path}/".startswith(f"{name}/") for name in fitted)
    again = any(f"{name}/".startswith(f"{table}/") for name in fitted for table in cell.repeats)
    return itself or again


def _status(cell: Cell, finding: Finding, test: Evidence) -> Status:
    if cell.status:
        return Status(cell.status)
    if _was_fitted(cell, test.fitted):
        return Status.CALIBRATED
    if any(_covers(given, cell.path) for given in test.given):
        return Status.RECOVERED
    if finding.recomputed:
        return Status.RECOMPUTED
    return Status.PREDICTED if test.fitted else Status.SIMULATED
