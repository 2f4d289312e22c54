"""`campaign report`: page, tables and figures from an archive.

The functions import the code for pages, while other processes analyze.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath
from shlex import quote
from typing import TYPE_CHECKING, cast

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.cli.output import print_note, print_table, print_warning
from campaign.errors import DEBUG, ArchiveError, ExitCode, UsageError, worst_exit_code
from campaign.interrupts import unwinding
from campaign.report.processes import begin_early, choose_processes, workers

if TYPE_CHECKING:
    from campaign.archive.writing.results_file import PreparedResults
    from campaign.report.build import Report
    from campaign.report.content.document import Document
    from campaign.report.content.first_screen import FirstScreen
    from campaign.report.drawing.figures import Column

LISTED = 4
"""Most files of a folder that are listed by name."""


@unwinding()
def report_run(
    name: str | None,
    results: Path,
    output: Path | None,
    templates: Path | None,
    *,
    measure_anew: bool = False,
    formats: Sequence[str] = (),
    trials: str = "",
    zoom: bool = False,
    references: Sequence[Path] = (),
) -> tuple[Path, ExitCode]:
    """Build the report of the run that `name` matches; return its page and the exit code."""
    from campaign.references.values import read_values

    path = find_run(results, name)
    files = {each: read_values(each) for each in references}
    begin_early(path)
    run = open_run(path)
    written: list[PreparedResults] = []
    try:
        with workers(run, choose_processes(run), measure_anew=measure_anew) as at_work:
            # Import while the workers begin to analyze.
            from campaign.cli.keep_results import written_results
            from campaign.experiments import experiments
            from campaign.report.build import build_report
            from campaign.report.formats import chosen_formats
            from campaign.resources import templates_folder

            def write_results(document: Document) -> None:
                made = written_results(run, document, measured_anew=measure_anew)
                written.extend([made] if made else [])

            report = build_report(
                run,
                output or path.with_name(f"{path.stem}-report"),
                experiments=experiments(),
                packaged_templates=templates_folder(),
                templates=templates,
                measure_anew=measure_anew,
                at_work=at_work,
                formats=chosen_formats(formats),
                trials=_wanted_trials(run, trials),
                zoom=zoom,
                command=_command(path, measure_anew=measure_anew),
                when_found=write_results,
                references=files,
            )
            kept = [_published(each) for each in written]
    finally:
        for each in written:
            each.discard()
    code = _say(report, path, kept, measure_anew=measure_anew)
    return report.path, code


def _say(report: Report, path: Path, kept: Sequence[str], *, measure_anew: bool) -> ExitCode:
    """Print key numbers, missing results, damage and files; return the exit code."""
    from campaign.cli.damage import say_damaged
    from campaign.execution.run_reference import reference

    _print_key_numbers(report.layout.document.opening)
    lacking = [test for test in report.layout.document.tests if test.lacks_result]
    codes = [say_damaged(path, report.damaged), *([ExitCode.NO_RESULT] if lacking else [])]
    for problem in (*report.problems, *report.left_out):
        print_warning(problem)
    if any(test.problem and test.experiment for test in lacking):
        anew = " --measure-anew" if measure_anew else ""
        command = f"{DEBUG}=1 campaign report {reference(path)}{anew}"
        print_note(f"to locate the failure of an analysis:\n  {command}")
    print_note(f"written: {'; '.join([*_told(report.files), *filter(None, kept)])}")
    return worst_exit_code(codes)


def _print_key_numbers(opening: FirstScreen) -> None:
    from campaign.report.formats.outline import key_numbers

    for answer in opening.shown:
        if answer.numbers:
            where = f" ({answer.where})" if answer.where else ""
            print_note(f"{answer.title}{where}", style="bold")
            grid = key_numbers([replace(answer, where="")])
            print_table(grid.headers, grid.rows, beside=True)
    held = opening.held and f"{opening.held} of the simulated bench."
    more = opening.left_out and f"Key numbers: {opening.left_out}"
    for line in filter(None, (*opening.remarks, opening.intervals, opening.compared, held, more)):
        print_note(line)


def _published(results: PreparedResults) -> str:
    """Publish a results file; return its path, or "" after a warning."""
    try:
        return str(results.publish())
    except ArchiveError as error:
        print_warning(f"no results file: {error}")
        return ""


def _command(path: Path, *, measure_anew: bool) -> str:
    """Command that repeats the report from the current folder.

    An absolute path is reduced to its name and `--results FOLDER`, as pages do not show private
    folders.
    """
    from campaign.execution.run_reference import reference

    run = f"{quote(path.stem)} --results FOLDER" if path.is_absolute() else reference(path)
    return f"campaign report {run}{' --measure-anew' if measure_anew else ''}"


def _wanted_trials(run: RunReader, wanted: str) -> tuple[int, ...]:
    """Numbers of the trials that `--trials` selects; prints a note if there is none."""
    from campaign.report.content.trial_choice import chosen_trials

    chosen = chosen_trials(run, wanted)
    if wanted and not chosen:
        print_note(f"--trials {wanted}: no such trial, so no page is made for it")
    return chosen


def _told(files: Iterable[str]) -> Iterator[str]:
    """Texts on the files of a report by folder; for many files, counts by kind."""
    folders: dict[str, list[PurePosixPath]] = {}
    for file in map(PurePosixPath, files):
        folders.setdefault(str(file.parent), []).append(file)
    for folder, own in sorted(folders.items()):
        if folder == "." or len(own) <= LISTED:
            yield ", ".join(map(str, own))
        else:
            counts = Counter(file.suffix.removeprefix(".") for file in own)
            kinds = ", ".join(f"{count} {kind}" for kind, count in counts.items())
            yield f"{folder}/ ({kinds})"


@unwinding()
def draw_figures(
    name: str | None,
    results: Path,
    output: Path | None,
    wanted: str,
    *,
    measure_anew: bool = False,
    column: str = "",
) -> tuple[tuple[Path, ...], ExitCode]:
    """Write a figure of a run's report, TEST/KEY, or all; return paths and exit code for damage."""
    from campaign.cli.damage import say_damaged
    from campaign.experiments import experiments
    from campaign.report.one_figure import write_figures

    if column not in ("", "single", "double"):
        raise UsageError(f"--column {column}: is neither 'single' nor 'double'")
    path = find_run(results, name)
    drawings, damaged = write_figures(
        open_run(path),
        wanted,
        output or path.with_name(f"{path.stem}-figures"),
        experiments=experiments(),
        measure_anew=measure_anew,
        column=cast("Column", column) if column else None,
    )
    return drawings, say_damaged(path, damaged)
