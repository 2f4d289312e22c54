"""`campaign export`: recordings in the formats of other programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from campaign.api import RunView
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_note
from campaign.errors import ExitCode, UsageError
from campaign.export import exports
from campaign.export.run_export import export_run
from campaign.interrupts import unwinding


@unwinding()
def export_archive(
    name: str | None,
    results: Path,
    to: str,
    output: Path | None,
    tests: Sequence[str],
    trials: Sequence[int],
) -> tuple[Path, ExitCode]:
    """Export the run that `name` matches; return the folder and the exit code for damage."""
    kinds = exports()
    if to not in kinds:
        raise UsageError(f"there is no format {to!r}; there are {', '.join(kinds)}")
    run = RunView(open_run(find_run(results, name)))
    folder = output or run.path.with_name(f"{run.path.stem}-{to}")
    exported = export_run(run, kinds[to], folder, tests, trials)
    code = say_damaged(run.path, exported.damaged)
    print_note(f"recordings written: {exported.files}")
    return exported.folder, code
