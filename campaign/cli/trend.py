"""`campaign trend`: drift, jumps and correlations of a rig's numbers over its runs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_line, print_table, print_warning
from campaign.errors import ExitCode, UsageError, worst_exit_code
from campaign.experiments import experiments
from campaign.identify import experiments_by_model
from campaign.interrupts import unwinding
from campaign.report.formats import chosen_formats
from campaign.resources import templates_folder
from campaign.trends.page import write_trends
from campaign.trends.rig_trends import JUMP, TREND, Trends, Verdict, follow
from campaign.trends.tables import detectable_words, headline, not_judged, sentences

STEM = 90
"""Most characters of a run's name in the name of a folder."""
REASONS = 6
"""Most reasons for not judging that the terminal lists."""
SHOWN = 12
"""Most numbers without a trend that the terminal lists; the page has all."""
NAMED = 3
"""Most runs that the command on the page names."""


@unwinding()
def trend_of_archives(
    names: Sequence[str],
    results: Path,
    output: Path | None,
    over: str,
    models: Sequence[str],
    exchanged: Sequence[str] = (),
    templates: Path | None = None,
    formats: Sequence[str] = (),
) -> tuple[Path, ExitCode]:
    """Estimate the trends of the runs that `names` match; return page and exit code for damage.

    exchanged: `SOURCE@RUN`, a systematic part and the first run with another piece.
    """
    also = chosen_formats(formats)
    pieces = [_exchange(results, each) for each in exchanged]
    paths = [find_run(results, name) for name in names]
    runs = [open_run(path) for path in paths]
    trends = follow(runs, experiments(), over, experiments_by_model(), models, pieces)
    last = trends.members[-1].run.path
    folder = output or last.with_name(f"{last.stem[:STEM]}-trend-over-{_slug(over)}")
    page = write_trends(
        trends,
        folder,
        templates_folder(),
        _command(names, over, models, exchanged),
        templates,
        also,
    )
    _tell(trends)
    for member in trends.members:
        for problem in member.problems:
            print_warning(problem)
    for fitted in trends.fitted:
        for problem in fitted.problems:
            print_warning(problem)
    codes = [say_damaged(member.run.path, member.damaged) for member in trends.members]
    return page, worst_exit_code(codes)


def _exchange(results: Path, told: str) -> tuple[str, Path]:
    source, at, run = told.rpartition("@")
    if not (at and source.strip() and run.strip()):
        raise UsageError(f'--exchanged {told!r}: write "torque constant@RUN"')
    return source.strip(), find_run(results, run.strip())


def _without_folder(told: str) -> str:
    source, at, run = told.rpartition("@")
    return f"{source}{at}{Path(run).name}"


def _command(
    names: Sequence[str], over: str, models: Sequence[str], exchanged: Sequence[str]
) -> str:
    """Command that repeats the analysis; with names of runs, without private folders."""
    shown = [Path(name).name for name in names]
    if len(shown) > NAMED:
        shown = [*shown[: NAMED - 1], "...", shown[-1]]
    return " ".join(
        [
            "campaign trend",
            *shown,
            f"--over '{over}'",
            *(f"--model {name}" for name in models),
            *(f"--exchanged '{_without_folder(each)}'" for each in exchanged),
        ]
    )


def _slug(over: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in over.lower())[:40] or "something"


def _tell(trends: Trends) -> None:
    print_line(" ".join(sentences(trends)))
    for each in trends.declared:
        print_line("; ".join((headline(each, trends), *each.notes)), 2)
    for why in islice(not_judged(trends), REASONS):
        print_line(f"not judged, {why}", 2)
    rest = trends.of(Verdict.NOT_SHOWN)
    if rest:
        heads = ["no significant trend", f"detectable, per {trends.covariate.per}"]
        heads += ["detectable jump"] if trends.covariate.ordered else []
        rows = [
            [
                f"{each.series.test}: {each.series.name}",
                detectable_words(each, TREND, trends.covariate, per=False),
                *(
                    [detectable_words(each, JUMP, trends.covariate)]
                    if trends.covariate.ordered
                    else []
                ),
            ]
            for each in rest[:SHOWN]
        ]
        print_table(heads, rows)
    if len(rest) > SHOWN:
        print_line(f"and {len(rest) - SHOWN} more, on the page")
