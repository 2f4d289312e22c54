"""Summary of a run without its trials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from campaign.archive.layout.header import PARTIAL, SEALED, RunHeader, RunStatus
from campaign.archive.layout.journal import JOURNAL, RunStarted
from campaign.archive.layout.journal_summary import read_lines
from campaign.archive.layout.run_folder import read_header
from campaign.errors import ArchiveError


@dataclass(frozen=True)
class RunSummary:
    """One line of `campaign list`.

    Attributes:
        created, ended: ISO 8601; `ended` is empty while the run is in progress.
        title, operator: from the header.
        tests: names, in the protocol's order.
        benches: names, each once, in the order of the tests.
        trials: number of finished trials, incomplete ones included.
        planned: number of trials of the plan and of later stages.
        failed, interrupted: number of trials that failed, and number that an operator stopped.
        untold: number of planned trials missing in a damaged journal; they may have been executed.
        problem: reason why the run is unreadable; all but name, path and bytes are then empty.
    """

    name: str
    path: Path
    bytes: int
    created: str = ""
    ended: str = ""
    status: RunStatus | None = None
    title: str = ""
    protocol: str = ""
    backend: str = ""
    operator: str = ""
    tests: tuple[str, ...] = ()
    benches: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    planned: int = 0
    trials: int = 0
    failed: int = 0
    interrupted: int = 0
    untold: int = 0
    problem: str = ""

    @classmethod
    def of_header(cls, path: Path, header: RunHeader) -> Self:
        """Summary of the facts that the header of a run states."""
        benches = (test.get("bench") for test in header.tests)
        return cls(
            name=path.stem,
            path=path,
            bytes=0,
            created=header.created,
            title=header.title,
            protocol=header.protocol_name,
            backend=header.backend,
            operator=header.operator,
            tests=tuple(str(test.get("name", "")) for test in header.tests),
            benches=tuple(dict.fromkeys(bench for bench in benches if isinstance(bench, str))),
            tags=header.tags,
        )


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
