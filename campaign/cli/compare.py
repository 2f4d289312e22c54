"""`campaign compare`: differing numbers of runs, with their significance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_line, print_table, print_warning
from campaign.comparison.finding_pairs import Pair
from campaign.comparison.page import write_comparison
from campaign.comparison.run_comparison import Against, Comparison, compare_runs
from campaign.comparison.tables import (
    bare_differing,
    bench_lines,
    change_of,
    name_of,
    not_judged,
    number_of,
    sentences,
)
from campaign.errors import ExitCode, worst_exit_code
from campaign.experiments import experiments
from campaign.interrupts import unwinding
from campaign.references.verdict import Verdict
from campaign.report.formats import chosen_formats
from campaign.resources import templates_folder
from campaign.text import pretty_unit, shortened

STEM = 90
"""Most characters of a run's name in the name of a folder."""
BENCH_LINES = 8
"""Most differing values of benches that the terminal lists."""
REASONS = 6
"""Most reasons for not judging that the terminal lists."""
SHOWN = 16
"""Most pairs of one run that the terminal lists; the page has all."""


@unwinding()
def compare_archives(
    names: Sequence[str],
    results: Path,
    output: Path | None,
    exchanged: Sequence[str],
    templates: Path | None = None,
    formats: Sequence[str] = (),
) -> tuple[Path, ExitCode]:
    """Compare the runs that `names` match with the first; return page and exit code for damage."""
    also = chosen_formats(formats)
    paths = [find_run(results, name) for name in names]
    runs = [open_run(path) for path in paths]
    comparison = compare_runs(runs, experiments(), exchanged)
    folder = output or _beside(paths)
    page = write_comparison(comparison, folder, templates_folder(), templates, also)
    for against in comparison.against:
        _tell(against, comparison)
    for side in comparison.sides:
        for problem in side.problems:
            print_warning(problem)
    codes = [say_damaged(side.run.path, side.damaged) for side in comparison.sides]
    return page, worst_exit_code(codes)


def _beside(paths: Sequence[Path]) -> Path:
    """Folder `A-against-B-comparison` beside the reference; B is the first of the other runs."""
    first, other, *more = paths
    rest = f"-and-{len(more)}-more" if more else ""
    return first.with_name(f"{first.stem[:STEM]}-against-{other.stem[:STEM]}{rest}-comparison")


def _tell(against: Against, comparison: Comparison) -> None:
    """Print summary lines and a table, the declared differences first."""
    reference, other = against.reference, against.other
    print_line(f"{reference.letter}  {reference.run.name}  {reference.title}")
    print_line(f"{other.letter}  {other.run.name}  {other.title}")
    print_line(" ".join(sentences(against, comparison.tested)))
    benches = list(bench_lines(against))
    for line in shortened(benches, BENCH_LINES, "more of the bench, on the page"):
        print_line(line, 2)
    if against.equal:
        return
    for why in islice(not_judged(against.pairs), REASONS):
        print_line(f"not judged, {why}", 2)
    shown = list(_order(against))
    if shown:
        heads = ("finding", reference.letter, other.letter, "change", "")
        print_table(heads, [_row(pair) for pair in shown[:SHOWN]])
    if len(shown) > SHOWN:
        print_line(f"and {len(shown) - SHOWN} more, on the page")


def _order(against: Against) -> Iterator[Pair]:
    yield from against.of(Verdict.DIFFERENT)
    yield from against.of(Verdict.BEYOND_BOUND)
    yield from bare_differing(against)
    yield from against.of(Verdict.NOT_SHOWN)


def _row(pair: Pair) -> tuple[str, ...]:
    unit = pretty_unit(pair.display)
    mark = {Verdict.DIFFERENT: "differs", Verdict.BEYOND_BOUND: "bound"}.get(pair.verdict, "")
    if pair.simulated_bare:
        mark = "no interval"
    numbers = (number_of(each, pair.display) for each in (pair.reference, pair.other))
    named = f"{name_of(pair)} ({unit})" if unit else name_of(pair)
    return (named, *numbers, change_of(pair), mark)
