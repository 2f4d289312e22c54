"""Reading a run: the sealed file, or the folder of one that is in progress or was killed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.archive.archived_trial import ArchivedTrial
from campaign.archive.files import PART, sha256_of
from campaign.archive.header import PARTIAL, PlannedTrial, RunHeader, RunStatus
from campaign.archive.journal import JOURNAL, read_journal
from campaign.archive.run_folder import (
    check_format,
    first_line,
    parse_plan,
    read_header,
    read_plan_text,
)
from campaign.errors import ArchiveError
from campaign.trial import SafeState, Tree

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

    def unchanged(self) -> bool:
        """Whether every byte of the sealed file is as it was written (reads it all)."""
        from campaign.archive import guarded

        if not self.sealed:
            return False
        with guarded.open_file(self.path) as file:
            digest, place = guarded.digest_at(file, "run/outcome/file_sha256")
        return digest == sha256_of(self.path, place)

    def problems(self) -> list[str]:
        """What in the samples is damaged (reads them all, in flat memory); empty when sound."""
        from campaign.archive.sample_reading import check_recordings

        entries: dict[Path, list[str]] = {}
        for trial in self.trials:
            entries.setdefault(trial.path, []).append(trial.entry)
        return [
            problem for path, names in entries.items() for problem in check_recordings(path, names)
        ]


def open_run(path: Path) -> RunReader:
    """Open a sealed run, or the folder of a run in progress.

    Raises ArchiveError, naming file and place, when it is none or is damaged.
    """
    if path.is_dir():
        return _open_folder(path)
    if path.suffix == PART:
        raise ArchiveError(f"{path}: was never finished; what was is in the run's folder")
    return read_sealed(path)


def read_sealed(path: Path) -> RunReader:
    """Read a sealed file, whatever its name; its hash is not looked at (`RunReader.unchanged`)."""
    from campaign.archive import guarded
    from campaign.archive.trial_reading import read_trials

    with guarded.open_file(path) as file, guarded.guarded(path, "/run"):
        run = guarded.group_at(file, "run", "NXentry")
        header = read_provenance(path, run)
        outcome = guarded.group_at(run, "outcome", "NXcollection")
        return RunReader(
            path=path,
            header=header,
            status=RunStatus(guarded.text_at(outcome, "status")),
            reason=guarded.text_at(outcome, "reason"),
            safe_state=SafeState(guarded.text_at(outcome, "safe_state")),
            ended=guarded.text_at(run, "end_time"),
            plan=parse_plan(path, _note(run, "plan")),
            trials=tuple(read_trials(path, file)),
            journal=_note(run, "journal"),
        )


def read_provenance(path: Path, run: h5py.Group) -> RunHeader:
    """The header of a sealed run."""
    from campaign.archive import guarded

    provenance = guarded.group_at(run, "provenance", "NXcollection")
    check_format(path, guarded.integer_at(provenance, "format"))
    tree: dict[str, object] = {"sources": dict(_sources(run))}
    for name, info in RunHeader.model_fields.items():
        if name == "sources" or (name not in provenance and not info.is_required()):
            continue
        text = guarded.text_at(provenance, name)
        tree[name] = text if info.annotation is str else _json(path, name, text)
    try:
        return RunHeader.model_validate(tree)
    except ValueError as error:
        raise ArchiveError(f"{path}: /run/provenance: {first_line(error)}") from None


def _sources(run: h5py.Group) -> Iterator[tuple[str, str]]:
    from campaign.archive import guarded

    for name in guarded.names(run):
        if name.startswith("source_"):
            note = guarded.group_at(run, name, "NXnote")
            yield guarded.text_at(note, "file_name"), guarded.text_at(note, "data")


def _note(run: h5py.Group, name: str) -> str:
    from campaign.archive import guarded

    return guarded.text_at(guarded.group_at(run, name, "NXnote"), "data")


def _json(path: Path, name: str, text: str) -> object:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ArchiveError(f"{path}: /run/provenance/{name}: {first_line(error)}") from None


def _open_folder(folder: Path) -> RunReader:
    from campaign.archive.trial_reading import read_trial_file

    if folder.suffix != PARTIAL:
        raise ArchiveError(f"{folder}: is a folder, but not that of a run in progress")
    header = read_header(folder)
    story = read_journal(folder / JOURNAL)
    ended = story.ended
    return RunReader(
        path=folder,
        header=header,
        status=ended.status if ended else RunStatus.INCOMPLETE,
        reason=ended.reason if ended else "the run is in progress or was killed",
        safe_state=ended.safe_state if ended else SafeState.NOT_CONFIRMED,
        ended=ended.at if ended else "",
        plan=parse_plan(folder, read_plan_text(folder)),
        trials=tuple(read_trial_file(folder / f.file, n) for n, f in story.finished.items()),
        journal=story.text,
    )
