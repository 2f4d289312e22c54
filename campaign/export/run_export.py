"""A run as a folder of files: one per recording, and a table of trials."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from campaign.api import RunView, TrialView
from campaign.api.tables import trials_table
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import FILE, damaged_csv, lost_trials
from campaign.archive.reading.sound_samples import sound_part
from campaign.errors import UsageError
from campaign.export.interface import ExportKind
from campaign.plain_text import on_a_page

TABLE = "trials.csv"
"""Table of the exported trials; its column `file` is the name of the recording's file."""


@dataclass(frozen=True)
class ExportResult:
    """Result of an export.

    Attributes:
        files: number of exported recordings.
        damaged: damage of the run that this export detected; `damaged.csv` lists it, and all other
            data is exported.
    """

    folder: Path
    files: int
    damaged: tuple[Damage, ...]


def export_run(
    run: RunView,
    kind: ExportKind,
    folder: Path,
    tests: Sequence[str] = (),
    numbers: Sequence[int] = (),
) -> ExportResult:
    """Write the selected trials of a run, or all of them, into a new folder.

    The folder appears when it is complete; after an error it does not exist.

    Args:
        run: an open archive.
        kind: the format.
        folder: output folder; it must be new or empty.
        tests, numbers: selected tests and trial numbers; a trial in either is exported.

    Damaged channels and trials are omitted; `damaged.csv` lists them, and so does each file of a
    format with metadata.

    Raises UsageError when the folder is not empty, or a test or trial is not in the run.
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
        files, damaged = _write(run, trials, kind, part)
        _publish(part, folder)
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror or error}") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return ExportResult(folder, files, damaged)


def _chosen(run: RunView, tests: Sequence[str], numbers: Sequence[int]) -> list[TrialView]:
    if not tests and not numbers:
        return list(run)
    chosen = {view.number: view for name in tests for view in run.test(name)}
    lost = lost_trials(run.archive)
    chosen |= {number: run.trial(number) for number in numbers if number not in lost}
    return [chosen[number] for number in sorted(chosen)]


def _write(
    run: RunView, trials: Sequence[TrialView], kind: ExportKind, part: Path
) -> tuple[int, tuple[Damage, ...]]:
    """Write recordings and tables; return the number of recordings and the damage.

    Each file names all damage. If the samples show further damage, all files are written again.
    """
    files, damaged = _write_recordings(run, trials, kind, part, run.damaged)
    if damaged != run.damaged:
        files, damaged = _write_recordings(run, trials, kind, part, damaged)
    table = trials_table(view.archived for view in trials)
    table["file"] = [files.get(view.number, "") for view in trials]
    text = on_a_page(table.to_csv(lineterminator="\n"))
    (part / TABLE).write_text(text, encoding="utf-8", newline="\n")
    if damaged:
        (part / FILE).write_text(on_a_page(damaged_csv(damaged)), encoding="utf-8", newline="\n")
    return len(files), damaged


def _write_recordings(
    run: RunView,
    trials: Sequence[TrialView],
    kind: ExportKind,
    part: Path,
    known: tuple[Damage, ...],
) -> tuple[dict[int, str], tuple[Damage, ...]]:
    """Write recordings; return file names by trial number, and the damage of run and samples."""
    files: dict[int, str] = {}
    damaged = list(run.damaged)
    for view in trials:
        recording, damage = sound_part(run.path, view.archived)
        damaged += damage
        if recording is None or not recording.channels:
            continue  # damaged, or failed before its first sample
        files[view.number] = f"{view.name}{kind.suffix}"
        kind.write(replace(view, damaged=known), recording, part / files[view.number])
    return files, tuple(dict.fromkeys(damaged))


def _publish(part: Path, folder: Path) -> None:
    part.chmod(0o777 & ~_umask())  # only its owner can access a temporary folder
    if folder.is_dir():
        folder.rmdir()  # empty; Windows does not rename over it
    part.rename(folder)


def _umask() -> int:
    """File mode mask of the process; reading it requires setting it."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask
