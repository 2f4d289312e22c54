"""All results of one run: to inspect, and to keep beside the run.

A results file replaces the analysis if it is undamaged, of this run, and from the same code.
Otherwise the program analyzes the run and reports why.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from html import escape
from typing import TYPE_CHECKING

from campaign import __version__
from campaign.api.analysis import (
    AnalysedTest,
    analyse_run,
    damage_of,
    published_of,
    source_of,
    title_of,
)
from campaign.api.damage_warnings import report_damage, warn
from campaign.api.estimates import findings_table
from campaign.api.plots import plot
from campaign.api.tables import result_table
from campaign.archive.layout.names import results_path
from campaign.archive.layout.results import ResultsOfTest, RunResults
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import in_words
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from campaign.experiments import experiments
from campaign.published.scoreboard import Line, Scoreboard, score
from campaign.reason import Cause
from campaign.result import Cell, Column, Figure, Finding, Table
from campaign.source_hash import digest, sources_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as Drawing

NOT_IN_A_NOTEBOOK = (
    "standard_error", "freedom", "origin", "kind", "method", "scatter_low", "scatter_high",
    "systematic", "reason_code", "reason_values",
)  # fmt: skip
"""Columns of numbers that a notebook's table leaves out."""
NO_FILE = "there is no file of results"


@dataclass(frozen=True)
class Results:
    """Results of the analysis of a run.

    Attributes:
        found: all results, as objects.
        origin: text on their source: the file, or the version of the program that analyzed the run
            and why it did not read a file.
        archive: the run.
    """

    found: RunResults = field(repr=False)
    origin: str
    archive: RunReader = field(repr=False)

    @property
    def key_numbers(self) -> pd.DataFrame:
        """Key numbers of each test, the most important first; columns as of `findings`."""
        return self._numbers([(t.name, t.result.key_numbers) for t in self.found.tests])

    @property
    def findings(self) -> pd.DataFrame:
        """One row per number of any test (SI): `test`, then the columns of a test's `findings`."""
        return self._numbers([(t.name, t.result.findings) for t in self.found.tests])

    def _numbers(self, by_test: Sequence[tuple[str, Sequence[Finding]]]) -> pd.DataFrame:
        pairs = [(name, each) for name, findings in by_test for each in findings]
        frame = findings_table(_beside_test([finding for _, finding in pairs]))
        frame.insert(0, "test", [name for name, _ in pairs])
        frame.attrs["damaged"] = list(self.found.damaged)
        return frame

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables of all tests by `test/key`, unrounded, SI; units in `attrs`."""
        tests = self.found.tests
        frames = {
            f"{each.name}/{table.key}": result_table(table)
            for each in tests
            for table in each.result.tables
        }
        for frame in frames.values():
            frame.attrs["damaged"] = list(self.found.damaged)
        return frames

    @property
    def figures(self) -> dict[str, Figure]:
        """The figures of all tests by `test/key`: panels, and curves as arrays (SI)."""
        tests = self.found.tests
        return {f"{each.name}/{f.key}": f for each in tests for f in each.result.figures}

    def plot(self, figure: str = "") -> Drawing:
        """A figure of the report as a matplotlib figure; a notebook shows it.

        figure: `test/key` as in `figures`; a test's name for its most informative figure; a key
            that only one figure has; absent: the figure at the top of the report.

        Raises UsageError when no figure, or more than one, matches.
        """
        return plot(self.archive, self.found, figure)

    @property
    def published(self) -> pd.DataFrame:
        """Published values and reproduced values, in the printed units; empty without any."""
        table = self.found.published
        frame = result_table(scoreboard_table(Scoreboard()) if table is None else table)
        return frame.astype(dict.fromkeys(NUMBERS, "float64"))

    @property
    def problems(self) -> dict[str, str]:
        """Reason by test for no result; empty when all tests have one."""
        return {test.name: test.problem for test in self.found.tests if test.problem}

    def __repr__(self) -> str:
        tests = ", ".join(test.name for test in self.found.tests) or "no tests"
        return f"<results of {self.found.run}: {tests}; {self.origin}>"

    def _repr_html_(self) -> str:
        """HTML for a notebook: the key numbers, and the tests without a result."""
        parts = [f"<p><code>{escape(repr(self))}</code></p>"]
        numbers = self.key_numbers
        if len(numbers):
            parts.append(numbers.drop(columns=list(NOT_IN_A_NOTEBOOK)).to_html(index=False))
        for name, problem in self.problems.items():
            parts.append(f"<p>{escape(name)}: no result: {escape(problem)}.</p>")
        return "".join(parts)


def results_of(
    run: RunReader,
    tests: Sequence[AnalysedTest],
    scoreboard: Scoreboard,
    *,
    telling: tuple[str, str] | None = None,
    measured_anew: bool = False,
) -> RunResults:
    """Results of a run's analysis, with the identity of the run and of the code.

    `telling`: test and key of the leading figure.
    """
    header = run.header
    return RunResults(
        run=run.name,
        file=run.path.name,
        root=run.identity,
        date=run.ended or header.created,
        version=__version__,
        sources=code_of(tests),
        tests=tuple(map(_of_test, tests)),
        title=title_of(header.title or header.protocol_name, source_of(run)),
        measured_anew=measured_anew,
        damaged=tuple(in_words(damage) for damage in damage_of(run, tests)),
        published=scoreboard_table(scoreboard) if scoreboard.lines else None,
        telling=telling,
    )


def results_view(run: RunReader, *, strict: bool = False, measure_anew: bool = False) -> Results:
    """Results of a run: from a usable file beside it, else from an analysis.

    An ArchiveWarning reports why an existing file is not used, and the trials left out. If
    `strict`, raises ArchiveError for trials left out, and for a file that is damaged or of
    another run.
    """
    path = results_path(run.path)
    why = NO_FILE
    if path.exists():
        kept, why = _kept(run, strict=strict, measure_anew=measure_anew)
        if kept is not None:
            return Results(kept, f"read from {path}", run)
        warn(f"{why}; the run is analysed")
    results = _analysed(run, strict=strict, measure_anew=measure_anew)
    return Results(results, f"analysed by campaign {__version__}: {why}", run)


def _kept(run: RunReader, *, strict: bool, measure_anew: bool) -> tuple[RunResults | None, str]:
    """Results from the file beside a run, or the reason not to use it."""
    from campaign.archive.reading.results_file import OtherLayoutError, read_results

    path = results_path(run.path)
    try:
        results = read_results(path, run.identity)
    except ArchiveError as error:
        if strict and not isinstance(error, OtherLayoutError):
            raise
        return None, str(error)
    why = ""
    if (results.version, results.sources) != (__version__, code_of(results.tests)):
        why = f"was made by other code: campaign {results.version}, sources {results.sources[:12]}…"
    elif results.measured_anew != measure_anew:
        measured = "anew" if results.measured_anew else "when they were executed"
        why = f"is of recordings that were measured {measured}"
    elif results.damaged and not run.damaged:
        why = f"was made when the run was damaged: {results.damaged[0]}"
    return (None, f"{path}: {why}") if why else (results, "")


def _analysed(run: RunReader, *, strict: bool, measure_anew: bool) -> RunResults:
    tests = analyse_run(run, experiments(), measure_anew=measure_anew)
    left_out = dict.fromkeys(d for test in tests for d in test.damaged if _is_new(d, run))
    report_damage(run.path, tuple(left_out), strict=strict)
    scoreboard = score(published_of(run), [test.evidence() for test in tests])
    return results_of(run, tests, scoreboard, measured_anew=measure_anew)


def _is_new(damage: Damage, run: RunReader) -> bool:
    """Whether damage affects a trial and was not reported at opening of the run."""
    return bool(damage.trial) and damage not in run.damaged


def code_of(tests: Iterable[AnalysedTest | ResultsOfTest]) -> str:
    """Hash of the sources of this program and of the installed packages that analyze the tests."""
    known = experiments()
    plug_ins = (known.plug_in(test.kind) for test in tests)
    packages = [name for each in plug_ins if each is not None for name in each.packages]
    return digest(sources_of(dict.fromkeys(["campaign", *sorted(packages)])))


def _of_test(test: AnalysedTest) -> ResultsOfTest:
    plug_in = experiments().plug_in(test.kind)
    return ResultsOfTest(
        test.name,
        test.kind,
        test.title,
        test.result,
        test.problem,
        "campaign" if plug_in is None else plug_in.distribution,
        __version__ if plug_in is None else plug_in.version,
    )


NUMBERS = ("published", "reproduced", "low", "high", "deviation")
_PRINTED = Cause("printed", "a number of a document")
_ENDS = Cause("interval ends", "the interval of the number before it")
_BESIDE = Cause("interval beside", "low and high are its interval")
_FROM_PRINTED = Cause("from printed", "from what is printed")


def scoreboard_table(scoreboard: Scoreboard) -> Table:
    """The scoreboard as a table: one row per published number, in its printed unit."""
    columns = (
        Column("table", "Table"),
        Column("row", "Row"),
        Column("column", "Column"),
        Column("unit", "Unit"),
        Column("published", "Published", reason=_PRINTED()),
        Column("reproduced", "Reproduced", reason=_BESIDE()),
        Column("low", "Low", reason=_ENDS()),
        Column("high", "High", reason=_ENDS()),
        Column("deviation", "Deviation", "percent", reason=_FROM_PRINTED()),
        Column("verdict", "Verdict"),
        Column("status", "Status"),
        Column("test", "Test"),
        Column("source", "Source"),
        Column("reason", "Reason"),
        Column("draws", "Draws", exact=True),
    )
    cells = map(_line, scoreboard.lines)
    lines = tuple({column.name: each[column.name] for column in columns} for each in cells)
    return Table("published", "Published values and results", columns, lines)


def _line(line: Line) -> dict[str, Cell]:
    """Cells of a line by column of `scoreboard_table`."""
    own: dict[str, Cell] = {
        "deviation": line.deviation,
        "reason": line.why or line.cell.reason,
        "draws": len(line.draws),
    }
    return {**line.cells, **own}


def _beside_test(findings: Sequence[Finding]) -> Sequence[Finding]:
    """Rename the condition `test` of findings: the column `test` holds the name of the test."""

    def renamed(finding: Finding) -> Finding:
        new = {("condition.test" if n == "test" else n): v for n, v in finding.conditions.items()}
        return replace(finding, conditions=new)

    return [renamed(each) if "test" in each.conditions else each for each in findings]
