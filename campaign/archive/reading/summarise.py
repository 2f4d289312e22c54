"""Reading the summary of a run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from campaign.archive.layout.journal import RunStarted
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.names import JOURNAL, PARTIAL, SEALED
from campaign.archive.layout.run_folder import read_header
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.summary import RunSummary
from campaign.errors import ArchiveError


def summarise(path: Path) -> RunSummary:
    """Summarize a run without its trials; errors become its `problem`."""
    size = 0
    try:
        if path.is_dir():
            size = sum(file.stat().st_size for file in path.iterdir())
            run = _summary_of_folder(path)
        else:
            from campaign.archive.reading import sealed_run

            size = path.stat().st_size
            run = sealed_run.read_summary(path)
    except (ArchiveError, OSError) as error:
        sealed = path.with_suffix(SEALED)
        if path.suffix == PARTIAL and sealed.is_file():
            return summarise(sealed)  # sealed during the reading
        if isinstance(error, ArchiveError):
            return RunSummary(path.stem, path, size, problem=str(error))
        return RunSummary(
            path.stem, path, size, problem=f"{error.filename or path}: {error.strerror}"
        )
    return replace(run, bytes=size)


def _summary_of_folder(folder: Path) -> RunSummary:
    header = read_header(folder)
    story = read_lines((folder / JOURNAL).read_bytes())
    if not story.all(RunStarted):
        raise ArchiveError(f"{folder / JOURNAL}: has no line of the start of the run")
    finished, ended = story.finished.values(), story.ended
    planned = header.trials + len(story.followed)
    return replace(
        RunSummary.of_header(folder, header),
        planned=planned,
        status=ended.status if ended else RunStatus.INCOMPLETE,
        ended=ended.at if ended else "",
        trials=len(finished),
        failed=sum(each.outcome.failed for each in finished),
        interrupted=story.interrupted,
        untold=max(0, planned - len(finished)) if story.damaged else 0,
    )
