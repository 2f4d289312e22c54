"""Atomic creation of the folder of a new run."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path

from campaign.archive.layout.files import (
    PART,
    keep_umask,
    sync_folder,
    write_atomically,
    write_lines_atomically,
)
from campaign.archive.layout.full_plan import write_full_plan
from campaign.archive.layout.header import FORMAT, PlannedTrial, RunHeader
from campaign.archive.layout.journal import Journal, RunStarted
from campaign.archive.layout.names import HEADER, JOURNAL, PLAN
from campaign.archive.layout.run_folder import header_document
from campaign.archive.writing.remnants import remove_folder
from campaign.trial import Trial, canonical_json


def make_folder(folder: Path, header: RunHeader, trials: Sequence[Trial]) -> Journal:
    """Create a run's folder, under a temporary name until it is complete; return its journal."""
    part = folder.with_name(folder.name + PART)
    if part.is_dir():
        remove_folder(part)
    keep_umask()
    part.mkdir()
    try:
        write_full_plan(part, trials)
        lines = (canonical_json(PlannedTrial.of(t).model_dump(mode="json")) + "\n" for t in trials)
        write_lines_atomically(part / PLAN, lines)
        header = header.model_copy(update={"trials": len(trials)})
        write_atomically(part / HEADER, header_document(header))
        started = RunStarted(at=header.created, run=header.name, format=FORMAT, trials=len(trials))
        write_atomically(part / JOURNAL, canonical_json(started.model_dump(mode="json")) + "\n")
        part.rename(folder)
        sync_folder(folder.parent)
    except BaseException:
        with contextlib.suppress(OSError):
            remove_folder(part)
        raise
    return Journal(folder / JOURNAL)
