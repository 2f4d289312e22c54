"""`campaign report`: the page, its tables and its figures, from an archive alone."""

from __future__ import annotations

import webbrowser
from pathlib import Path

from campaign.archive import find_run, open_run
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_note
from campaign.errors import ExitCode
from campaign.experiments import experiments
from campaign.interrupts import unwinding
from campaign.report.build import build_report
from campaign.resources import templates_folder


@unwinding()
def report_run(
    name: str | None,
    results: Path,
    output: Path | None,
    templates: Path | None,
    *,
    open_it: bool,
    measure_anew: bool = False,
) -> tuple[Path, ExitCode]:
    """Build the report of the run that `name` means; its page, and whether all could be read."""
    path = find_run(results, name)
    run = open_run(path)
    report = build_report(
        run,
        output or path.with_name(f"{path.stem}-report"),
        experiments=experiments(),
        packaged_templates=templates_folder(),
        templates=templates,
        measure_anew=measure_anew,
    )
    code = say_damaged(path, report.damaged)
    for problem in report.problems:
        print_note(problem, style="yellow")
    if open_it and not webbrowser.open(report.path.resolve().as_uri()):
        print_note("no browser was found; open the file by hand", style="yellow")
    return report.path, code
