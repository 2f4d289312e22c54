"""A run into a folder of files: one per recording, and the table of trials beside them."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.access import RunView, TrialView
from campaign.access.tables import trials_table
from campaign.errors import ArchiveError, UsageError
from campaign.export.interface import ExportKind

TABLE = "trials.csv"
"""The table of what was exported; its column `file` says which file a trial's recording is in."""


@dataclass(frozen=True)
class Exported:
    """What came of an export.

    Attributes:
        files: how many recordings were written.
        problems: the trials that could not be read, each in one line; everything else is there.
    """

    folder: Path
    files: int
    problems: tuple[str, ...]


def export_run(
    run: RunView,
    kind: ExportKind,
    folder: Path,
    tests: Sequence[str] = (),
    numbers: Sequence[int] = (),
) -> Exported:
    """Write the trials of a run into a new folder; all of them when none are chosen.

    The folder appears when everything is in it; after an error there is none.

    Args:
        run: an open archive.
        kind: the format.
        folder: where to write; it must not be there yet, or be empty.
        tests, numbers: what to choose; a trial needs to be among one of them.

    Raises UsageError when there is something in the folder, or a test or trial is not in the run.
    """
    trials = _chosen(run, tests, numbers)
    if folder.is_file() or (folder.is_dir() and any(folder.iterdir())):
        raise UsageError(f"{folder} is there already; nothing was written: name another --output")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        part = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", suffix=".part", dir=folder.parent))
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from None
    try:
        exported = _write(trials, kind, part, folder)
        _publish(part, folder)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return exported


def _chosen(run: RunView, tests: Sequence[str], numbers: Sequence[int]) -> list[TrialView]:
    if not tests and not numbers:
        return list(run)
    chosen = {view.number: view for name in tests for view in run.test(name)}
    chosen |= {number: run.trial(number) for number in numbers}
    return [chosen[number] for number in sorted(chosen)]


def _write(trials: Sequence[TrialView], kind: ExportKind, part: Path, folder: Path) -> Exported:
    files: dict[int, str] = {}
    problems = []
    for view in trials:
        try:
            recording = view.recording()
        except ArchiveError as error:
            problems.append(str(error))
            continue
        if recording.channels:  # a trial that failed before its first sample has none
            files[view.number] = f"{view.name}{kind.suffix}"
            kind.write(view, recording, part / files[view.number])
    table = trials_table(view.archived for view in trials)
    table["file"] = [files.get(view.number, "") for view in trials]
    table.to_csv(part / TABLE, lineterminator="\n", encoding="utf-8")
    return Exported(folder, len(files), tuple(problems))


def _publish(part: Path, folder: Path) -> None:
    part.chmod(0o777 & ~_umask())  # a temporary folder is its owner's alone
    if folder.is_dir():
        folder.rmdir()  # empty; Windows does not rename over it
    part.rename(folder)


def _umask() -> int:
    """The process' file mode mask, which can only be read by setting it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
