"""Verifying a run of format 1 or 2: every dataset, the hash of the file, the schema, the journal.

A damaged sample is named by trial and channel. Damage in what HDF5 keeps for itself may change
nothing that can be read; the hash of the file finds it, and it is reported as structure.
"""

from __future__ import annotations

from pathlib import Path

import h5py
from pydantic import TypeAdapter

from campaign.archive.layout.entries import entry_name, entry_names
from campaign.archive.layout.files import PART, sha256_of
from campaign.archive.layout.full_plan import PLAN_TREES, PLAN_TRIALS
from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import JOURNAL, TrialFinished
from campaign.archive.layout.run_folder import HEADER, PLAN, read_format
from campaign.archive.layout.story import Lines, read_lines
from campaign.archive.reading import guarded
from campaign.archive.reading.damage import Damage, DamageList
from campaign.archive.reading.format_2 import schema
from campaign.archive.reading.format_2.trials import read_trial
from campaign.archive.reading.opening import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.verifying import consistency
from campaign.archive.verifying.consistency import Executed
from campaign.archive.verifying.result import (
    PER_DATASET,
    STRUCTURE,
    UNFINISHED,
    UNREADABLE_HASH,
    Progress,
    Verification,
)
from campaign.errors import ArchiveError
from campaign.recording import ChannelInfo

_CHANNELS = TypeAdapter(list[ChannelInfo])
_OWN_FILES = {HEADER, PLAN, JOURNAL, PLAN_TRIALS, PLAN_TREES}


def verify(path: Path, progress: Progress) -> Verification:
    """Verify a sealed run or the folder of a run in progress of format 1 or 2."""
    check = _Check(path, progress)
    with check.problems.noting(), guarded.guarded(path):
        if path.is_dir():
            check.folder()
        else:
            check.sealed()
    return Verification(
        path,
        tuple(dict.fromkeys(check.problems.found)),
        (*check.remarks.found, Damage("", PER_DATASET)),
        len(check.trials) + len(check.unreadable),
        check.datasets,
    )


class _Check:
    """One verification; `problems` and what else was found grow as it goes."""

    def __init__(self, path: Path, progress: Progress) -> None:
        self.path = path
        self.progress = progress
        self.problems = DamageList(path)
        self.remarks = DamageList(path)
        self.trials: dict[str, Executed] = {}
        self.unreadable: set[str] = set()
        self.datasets = 0

    def sealed(self) -> None:
        """A sealed file: its content first, so that the hash speaks of what that does not show."""
        with self.problems.noting():
            self._content()
        self._hash()

    def folder(self) -> None:
        """The folder of a run in progress, as far as its journal tells."""
        run = open_run(self.path)
        version = read_format(self.path)
        content = self.path / JOURNAL
        story = read_lines(content.read_bytes() if content.is_file() else b"")
        if story.torn:
            self.remarks.add(JOURNAL, "has a last line that was torn by a crash and never reported")
        for entry, finished in entry_names(story.attempts).items():
            self._trial_file(entry, finished, version)
        named = {finished.file for finished in story.attempts}
        for file in sorted(self.path.iterdir()):
            if file.name not in named | _OWN_FILES:
                kind = "was never finished" if file.suffix == PART else "is not part of the run"
                self.remarks.add(file.name, kind)
        self._agreement(run, story, HEADER, JOURNAL, PLAN)

    def _content(self) -> None:
        with guarded.open_file(self.path) as file:
            version = 1
            with guarded.guarded(self.path, "/run/provenance/format"):
                run = guarded.group_at(file, "run", "NXentry")
                provenance = guarded.group_at(run, "provenance", "NXcollection")
                version = guarded.integer_at(provenance, "format")
            self._group(file, "/", version)
            for name in guarded.names(file):
                if match := schema.ENTRY.fullmatch(name):
                    self._trial(self.path, file, name, name, int(match[1]))
        run_read = open_run(self.path)
        story = read_lines(run_read.journal.encode())
        self._agreement(run_read, story, "/run/provenance", "/run/journal", "/run/plan")
        self._outcome(run_read, story)

    def _hash(self) -> None:
        try:
            with guarded.open_file(self.path) as file, guarded.guarded(self.path):
                digest, place = guarded.digest_at(file, schema.HASH_PLACE.strip("/"))
        except ArchiveError:
            if not self.problems.found:
                self.problems.add("", UNREADABLE_HASH)
            return
        same = sha256_of(self.path, place, self.progress) == digest
        if not same and not self.problems.found:
            self.problems.add("", STRUCTURE)

    def _group(self, group: h5py.Group, place: str, version: int) -> None:
        """A group and all that the format knows in it; every dataset against its checksum."""
        shape = schema.shape_of(place, version)
        if shape is None:
            return
        prefix = place.rstrip("/")
        with self.problems.noting(), guarded.guarded(self.path, place):
            if shape.nx_class and guarded.attribute(group, "NX_class") != shape.nx_class:
                raise ArchiveError(f"{self.path}: {place}: is not of class {shape.nx_class}")
        with self.problems.noting(), guarded.guarded(self.path, place):
            for name in sorted(shape.attributes - set(group.attrs)):
                self.problems.add(f"{place}@{name}", "is missing")
            names = guarded.names(group)
            for name in sorted(shape.required - set(names)):
                self.problems.add(f"{prefix}/{name}", "is missing")
            for name in names:
                if not shape.knows(name):
                    self.remarks.add(f"{prefix}/{name}", "is nothing that the format knows")
                else:
                    self._member(group, name, f"{prefix}/{name}", version)

    def _member(self, group: h5py.Group, name: str, place: str, version: int) -> None:
        with self.problems.noting(), guarded.guarded(self.path, place):
            child = guarded.member(group, name)
            if child is not None:
                self._group(child, place, version)
            elif place != schema.HASH_PLACE:
                self.progress(guarded.check_dataset(group, name))
                self.datasets += 1

    def _trial_file(self, entry: str, finished: TrialFinished, version: int) -> None:
        path, name = self.path / finished.file, entry_name(finished.trial)
        before = len(self.problems.found)
        with self.problems.noting(), guarded.open_file(path) as file:
            with guarded.guarded(path, f"/{name}"):
                group = guarded.member(file, name)
                if group is not None:
                    self._group_in_file(path, group, f"/{name}", version)
            self._trial(path, file, name, entry, finished.trial)
        if entry not in self.trials:
            self.unreadable.add(entry)
        same = path.is_file() and sha256_of(path, progress=self.progress) == finished.sha256
        if not same and len(self.problems.found) == before:
            self.problems.add(finished.file, UNFINISHED)

    def _group_in_file(self, path: Path, group: h5py.Group, place: str, version: int) -> None:
        """`_group` of a trial's own file, whose name then begins the places."""
        inner = _Check(path, self.progress)
        inner._group(group, place, version)
        self.datasets += inner.datasets
        for mine, theirs in ((self.problems, inner.problems), (self.remarks, inner.remarks)):
            for damage in theirs.found:
                mine.add(f"{path.name}{damage.place}", damage.reason)

    def _trial(self, path: Path, file: h5py.File, name: str, entry: str, number: int) -> None:
        """What a trial says of itself, and that its channels are those it announced."""
        self.unreadable.add(entry)
        place = f"/{name}" if path == self.path else path.name
        with self.problems.noting(), guarded.guarded(path, f"/{name}"):
            archived = read_trial(path, file, number, name)
            record = file[name]["record"]
            fingerprint = guarded.text_at(record, "fingerprint")
            self.trials[entry] = Executed.of(entry, place, archived, fingerprint)
            self.unreadable.discard(entry)
            self._channels(file[name], guarded.text_at(record, "channels"), place)

    def _channels(self, entry: h5py.Group, text: str, place: str) -> None:
        announced = {info.name: info for info in _CHANNELS.validate_json(text)}
        data = guarded.group_at(entry, "data", "NXdata") if "data" in entry else None
        there = set(guarded.names(data)) - {"time", "title"} if data is not None else set()
        for name in sorted(announced.keys() - there) if data is not None else ():
            self.problems.add(f"{place}/data/{name}", "is missing, and was announced")
        for name in sorted(there - announced.keys()):
            self.problems.add(f"{place}/data/{name}", "is there, and was not announced")
        if data is None or "time" not in data:
            return
        length = guarded.samples_at(data, "time").shape[0]
        for name in sorted(there & announced.keys()):
            samples = guarded.samples_at(data, name)
            if samples.shape[0] != length:
                told = f"has {samples.shape[0]} samples, and time has {length}"
                self.problems.add(f"{place}/data/{name}", told)
            if guarded.attribute(samples, "units") != announced[name].unit:
                self.problems.add(f"{place}/data/{name}@units", "is not the unit announced")

    def _agreement(
        self, run: RunReader, story: Lines, header_place: str, journal: str, plan: str
    ) -> None:
        """Whether the parts of the run agree; what cannot be read is told of once."""
        header: RunHeader = run.header
        known = {damage.place for damage in self.problems.found}
        for damage in run.damaged:
            if damage.place not in known and not damage.trial:
                self.problems.found.append(damage)
        broken = {damage.place.split(":")[0] for damage in self.problems.found}
        if not any(place.startswith(journal) for place in broken) or story.damaged:
            consistency.check_journal(story, header, journal, self.problems)
            consistency.check_trials(story, self.trials, self.unreadable, self.problems)
        if not any(place.startswith(plan) for place in broken):
            executed = self.trials.values()
            consistency.check_plan(run.plan, header, executed, plan, self.problems)
            with self.problems.noting():
                consistency.check_full_plan(
                    run.full_plan, run.plan, f"{plan} in full", self.problems, may_be_absent=True
                )
        if not any(place.startswith(header_place) for place in broken):
            consistency.check_protocol(header, header_place, self.problems)

    def _outcome(self, run: RunReader, story: Lines) -> None:
        """The end of a sealed run is the one of its journal."""
        ended = story.ended
        if ended is None:
            if story.entries:
                self.problems.add("/run/journal", "does not tell of the end of the run")
            return
        for what in ("status", "reason", "safe_state"):
            mine, theirs = str(getattr(run, what)), str(getattr(ended, what))
            if mine != theirs:
                told = f"is {mine!r}, and the journal says {theirs!r}"
                self.problems.add(f"/run/outcome/{what}", told)
