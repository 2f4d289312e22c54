"""Reading a run: the sealed file, or the folder of one that is in progress or was killed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.archive.archived_trial import ArchivedTrial
from campaign.archive.damage import Damage, DamageList
from campaign.archive.files import PART, sha256_of, why
from campaign.archive.full_plan import FullPlan, read_full_plan
from campaign.archive.header import PARTIAL, PlannedTrial, RunHeader, RunStatus
from campaign.archive.journal import JOURNAL, RunStarted
from campaign.archive.run_folder import PLAN, parse_plan, read_header, read_plan_text
from campaign.archive.story import Lines, read_lines
from campaign.errors import ArchiveError
from campaign.trial import SafeState, Tree, Trial

if TYPE_CHECKING:
    import h5py


@dataclass(frozen=True)
class RunReader:
    """An archived run. Samples are read only when a trial's `recording()` is asked for.

    Attributes:
        path: the sealed file, or the folder of a run in progress.
        header: what was known before the first trial.
        status, reason, safe_state: how the run ended. An `incomplete` run has no word of its end,
            and its bench is not known to be safe.
        ended: ISO 8601; empty when incomplete.
        plan: every planned trial, executed or not.
        trials: the executed ones, in plan order, failed ones included.
        journal: verbatim.
        damaged: what cannot be read. It is missing from the rest: a trial from `trials`, a line
            from `plan`, a field of the header is as if it had not been given. Samples are looked
            at only by `problems`.
    """

    path: Path
    header: RunHeader
    status: RunStatus
    reason: str
    safe_state: SafeState
    ended: str
    plan: tuple[PlannedTrial, ...]
    trials: tuple[ArchivedTrial, ...]
    journal: str = field(repr=False)
    damaged: tuple[Damage, ...] = ()

    @property
    def name(self) -> str:
        return self.header.name

    @property
    def tests(self) -> tuple[Tree, ...]:
        """The protocol's tests: name, kind, title, normalised options ..."""
        return self.header.tests

    def trials_of(self, test: str) -> tuple[ArchivedTrial, ...]:
        """The executed trials of one test, in plan order."""
        return tuple(trial for trial in self.trials if trial.trial.test == test)

    @property
    def sealed(self) -> bool:
        return self.path.is_file()

    @cached_property
    def sha256(self) -> str:
        """Hash of the sealed file as `sha256sum` prints it; of the journal while in progress."""
        return sha256_of(self.path if self.sealed else self.path / JOURNAL)

    @cached_property
    def earlier_attempts(self) -> Mapping[int, tuple[ArchivedTrial, ...]]:
        """By trial number, the attempts that a later one replaced; no analysis sees them."""
        from campaign.archive.attempts import read_earlier

        return read_earlier(self.path, DamageList(self.path))

    @cached_property
    def full_plan(self) -> FullPlan:
        """Every planned trial, whole; empty in an archive of format 1."""
        return read_full_plan(self.path)

    def planned(self, number: int) -> Trial:
        """The trial `number` of the plan, executed or not, ready to be executed.

        Raises ArchiveError when there is none, or when the archive is of format 1, which kept the
        executed ones only.
        """
        if len(self.full_plan):
            return self.full_plan.trial(number)
        executed = {archived.trial.number: archived.trial for archived in self.trials}
        if number not in executed:
            raise ArchiveError(
                f"{self.path}: has no trial {number}; an archive of format 1 holds only those that "
                "were executed"
            )
        return executed[number]

    def unchanged(self) -> bool:
        """Whether every byte of the sealed file is as it was written (reads it all)."""
        from campaign.archive import guarded

        if not self.sealed:
            return False
        with guarded.open_file(self.path) as file:
            digest, place = guarded.digest_at(file, "run/outcome/file_sha256")
        return digest == sha256_of(self.path, place)

    def problems(self) -> list[str]:
        """What is damaged, samples included (reads them all, in flat memory)."""
        from campaign.archive.sample_reading import check_recordings

        known = [f"{self.path}: {damage}" for damage in self.damaged]
        entries: dict[Path, list[str]] = {}
        for trial in self.trials:
            entries.setdefault(trial.path, []).append(trial.entry)
        return known + [
            problem for path, names in entries.items() for problem in check_recordings(path, names)
        ]


def open_run(path: Path) -> RunReader:
    """Open a sealed run, or the folder of a run in progress.

    What is damaged is left out and listed in `damaged`. Raises ArchiveError, naming file and place,
    when it is no run, or when what it was or how it ended cannot be read.
    """
    if path.is_dir():
        return _open_folder(path)
    if path.suffix == PART:
        raise ArchiveError(f"{path}: was never finished; what was is in the run's folder")
    return read_sealed(path)


def read_sealed(path: Path) -> RunReader:
    """Read a sealed file, whatever its name; its hash is not looked at (`RunReader.unchanged`)."""
    from campaign.archive import guarded
    from campaign.archive.provenance import read_provenance
    from campaign.archive.trial_reading import read_trials

    damaged = DamageList(path)
    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        header = read_provenance(run, damaged)
        outcome = guarded.group_at(run, "outcome", "NXcollection")
        story = read_lines(damaged.read(lambda: _note(path, run, "journal"), "").encode())
        trials = tuple(read_trials(path, file, damaged))
        _note_lines(story, "/run/journal", damaged)
        if story.torn or not story.all(RunStarted):
            damaged.add("/run/journal", "is not a whole journal")
        _note_missing(story, trials, damaged)
        return RunReader(
            path=path,
            header=header,
            status=RunStatus(guarded.text_at(outcome, "status")),
            reason=guarded.text_at(outcome, "reason"),
            safe_state=SafeState(guarded.text_at(outcome, "safe_state")),
            ended=damaged.read(lambda: _end(path, run), ""),
            plan=damaged.read(lambda: parse_plan(path, _note(path, run, "plan")), ()),
            trials=trials,
            journal=story.text,
            damaged=tuple(damaged.found),
        )


def _end(path: Path, run: h5py.Group) -> str:
    from campaign.archive import guarded

    with guarded.guarded(path, "/run/end_time"):
        return guarded.text_at(run, "end_time")


def _note(path: Path, run: h5py.Group, name: str) -> str:
    """What a note says."""
    from campaign.archive import guarded

    with guarded.guarded(path, f"/run/{name}"):
        return guarded.text_at(guarded.group_at(run, name, "NXnote"), "data")


def _note_lines(story: Lines, place: str, damaged: DamageList) -> None:
    for number in story.damaged:
        damaged.add(f"{place}:{number}", "is not a line of a journal")


def _note_missing(story: Lines, trials: tuple[ArchivedTrial, ...], damaged: DamageList) -> None:
    """A trial that finished has a group; one that was found damaged is not told of twice."""
    there = {trial.trial.name for trial in trials} | {d.trial for d in damaged.found}
    for number in story.finished:
        if f"trial-{number:05d}" not in there:
            damaged.add(f"/trial_{number:05d}", "is missing, and the journal says that it finished")


def _open_folder(folder: Path) -> RunReader:
    from campaign.archive.trial_reading import read_trial_file

    if folder.suffix != PARTIAL:
        raise ArchiveError(f"{folder}: is a folder, but not that of a run in progress")
    header = read_header(folder)
    damaged = DamageList(folder)
    story = _folder_story(folder, damaged)
    trials = []
    for number, finished in story.finished.items():
        with damaged.noting():
            trials.append(read_trial_file(folder / finished.file, number))
    ended = story.ended
    return RunReader(
        path=folder,
        header=header,
        status=ended.status if ended else RunStatus.INCOMPLETE,
        reason=ended.reason if ended else "the run is in progress or was killed",
        safe_state=ended.safe_state if ended else SafeState.NOT_CONFIRMED,
        ended=ended.at if ended else "",
        plan=damaged.read(lambda: parse_plan(folder / PLAN, read_plan_text(folder)), ()),
        trials=tuple(trials),
        journal=story.text,
        damaged=tuple(damaged.found),
    )


def _folder_story(folder: Path, damaged: DamageList) -> Lines:
    story = read_lines(damaged.read(lambda: _bytes(folder / JOURNAL), b""))
    _note_lines(story, JOURNAL, damaged)
    if not story.all(RunStarted) and not damaged.found:
        damaged.add(JOURNAL, "does not tell of the start of the run")
    return story


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {why(error)}") from None
