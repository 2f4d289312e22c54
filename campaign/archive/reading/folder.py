"""Reading the folder of a run in progress, or of a killed run."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from campaign.archive.layout.files import read_errors
from campaign.archive.layout.followup_trials import planned_in, stages_in
from campaign.archive.layout.full_plan import FullPlan
from campaign.archive.layout.header import PlannedTrial
from campaign.archive.layout.journal import RunStarted, TrialFinished
from campaign.archive.layout.journal_summary import Lines, read_lines
from campaign.archive.layout.names import (
    ENTRY,
    JOURNAL,
    PARTIAL,
    PLAN,
    PLAN_TREES,
    PLAN_TRIALS,
    entry_name,
    entry_names,
)
from campaign.archive.layout.run_folder import parse_plan, read_header, read_text
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import measured_in, with_metrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from campaign.recording import SafeState


def open_folder(folder: Path) -> RunReader:
    """The run of a folder, from its journal. Raises ArchiveError if it is not a run's folder."""
    if folder.suffix != PARTIAL:
        raise ArchiveError(f"{folder}: is a folder, but not that of a run in progress")
    header = read_header(folder)
    damaged = DamageList(folder)
    story = _story(folder, damaged)
    measured = measured_in(story.entries)
    trials: list[ArchivedTrial] = []
    earlier: dict[int, list[ArchivedTrial]] = {}
    for entry, finished in entry_names(story.attempts).items():
        with damaged.noting():
            archived = read_trial_file(folder / finished.file, finished, entry)
            archived = with_metrics(archived, measured.get(finished.record))
            if ENTRY.fullmatch(entry)[2]:  # type: ignore[index]
                earlier.setdefault(finished.trial, []).append(archived)
            else:
                trials.append(archived)
    ended = story.ended
    planned: tuple[PlannedTrial, ...] = damaged.read(
        lambda: parse_plan(folder / PLAN, read_text(folder / PLAN)), ()
    )
    stages = stages_in(story.entries)
    return RunReader(
        path=folder,
        header=header,
        status=ended.status if ended else RunStatus.INCOMPLETE,
        reason=ended.reason if ended else "the run is in progress or was killed",
        safe_state=ended.safe_state if ended else SafeState.NOT_CONFIRMED,
        ended=ended.at if ended else "",
        plan=planned + planned_in(stages),
        trials=tuple(trials),
        story=story,
        full_plan=FullPlan(folder, partial(_plan_texts, folder), stages),
        damaged=tuple(damaged.found),
        earlier_attempts={number: tuple(tries) for number, tries in earlier.items()},
        stages=stages,
    )


def read_trial_file(path: Path, finished: TrialFinished, sealed_as: str = "") -> ArchivedTrial:
    """The trial in its own file; its record must match the journal. Raises ArchiveError.

    `sealed_as` is its group after the run is sealed.
    """
    from campaign.archive.reading.archived_samples import PackedSamples, archived_trial
    from campaign.archive.reading.packed_trial_reader import packed_record, read_packed

    entry = entry_name(finished.trial)
    packed = read_packed(path, entry)
    record, trees = packed_record(path, entry, packed, finished.record)
    return archived_trial(PackedSamples(path, entry, record, packed.not_kept, sealed_as), trees)


def _plan_texts(folder: Path) -> tuple[str, str]:
    return read_text(folder / PLAN_TRIALS), read_text(folder / PLAN_TREES)


def _story(folder: Path, damaged: DamageList) -> Lines:
    content, path = b"", folder / JOURNAL
    with damaged.noting(), read_errors(path):
        content = path.read_bytes()
    story = read_lines(content)
    for number in story.damaged:
        damaged.add(f"{JOURNAL}:{number}", "is not a line of a journal")
    if not story.all(RunStarted) and not damaged.found:
        damaged.add(JOURNAL, "has no line of the start of the run")
    return story
