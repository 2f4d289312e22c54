"""Reading the summary of a run."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.layout.followup_trials import planned_in, stages_in
from campaign.archive.layout.journal import RunStarted
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.names import JOURNAL, PARTIAL, SEALED
from campaign.archive.layout.run_folder import read_header
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.run_reader import Glance
from campaign.archive.reading.summary import RunSummary
from campaign.errors import ArchiveError


def summarise(path: Path) -> RunSummary:
    """Summarize a run without its trials; errors become its `problem`."""
    size = 0
    try:
        if path.is_dir():
            size = sum(file.stat().st_size for file in path.iterdir())
            run = _glance_at_folder(path)
        else:
            from campaign.archive.reading import sealed_run

            size = path.stat().st_size
            run = sealed_run.read_glance(path)
    except (ArchiveError, OSError) as error:
        sealed = path.with_suffix(SEALED)
        if path.suffix == PARTIAL and sealed.is_file():
            return summarise(sealed)  # sealed during the reading
        if isinstance(error, ArchiveError):
            return RunSummary(path.stem, path, size, problem=str(error))
        return RunSummary(
            path.stem, path, size, problem=f"{error.filename or path}: {error.strerror}"
        )
    header = run.header
    benches = (test.get("bench") for test in header.tests)
    return RunSummary(
        name=path.stem,
        path=path,
        bytes=size,
        created=header.created,
        ended=run.ended,
        status=run.status,
        title=header.title,
        protocol=header.protocol_name,
        backend=header.backend,
        operator=header.operator,
        tests=tuple(str(test.get("name", "")) for test in header.tests),
        benches=tuple(dict.fromkeys(bench for bench in benches if isinstance(bench, str))),
        tags=header.tags,
        planned=run.planned,
        trials=run.finished,
        failed=run.failed,
        interrupted=run.interrupted,
        untold=run.untold,
    )


def _glance_at_folder(folder: Path) -> Glance:
    header = read_header(folder)
    story = read_lines((folder / JOURNAL).read_bytes())
    if not story.all(RunStarted):
        raise ArchiveError(f"{folder / JOURNAL}: has no line of the start of the run")
    finished, ended = story.finished.values(), story.ended
    planned = header.trials + len(planned_in(stages_in(story.entries)))
    return Glance(
        header=header,
        planned=planned,
        status=ended.status if ended else RunStatus.INCOMPLETE,
        ended=ended.at if ended else "",
        finished=len(finished),
        failed=sum(each.outcome.failed for each in finished),
        interrupted=story.interrupted,
        untold=max(0, planned - len(finished)) if story.damaged else 0,
    )
