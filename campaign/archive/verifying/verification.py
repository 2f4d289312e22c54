"""Verifying a run: every text against the seal, every trial against its record.

A damaged sample is named by trial and channel. Damage in what HDF5 keeps for itself may change
nothing that can be read; the hash of the file finds it, and it is reported as structure.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import h5py
from h5py import h5o

from campaign.archive.layout import storage
from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.entries import ENTRY, entry_name, entry_names
from campaign.archive.layout.files import PART, sha256_of
from campaign.archive.layout.full_plan import PLAN_TREES, PLAN_TRIALS
from campaign.archive.layout.journal import JOURNAL, TrialFinished
from campaign.archive.layout.journal_summary import Lines, read_lines
from campaign.archive.layout.record import Trees, TrialRecord, series_of
from campaign.archive.layout.run_folder import HEADER, PLAN, SEALING
from campaign.archive.reading import guarded
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.folder import open_folder
from campaign.archive.reading.opening import read_sealed
from campaign.archive.reading.packed import packed_record, read_packed
from campaign.archive.reading.recorded import TIME, PackedSamples
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.seal import NUMBERS, OUTSIDE, SealedTexts
from campaign.archive.reading.sealed import NOTES, read_entry, read_not_kept
from campaign.archive.reading.series import series_at
from campaign.archive.verifying import consistency
from campaign.archive.verifying.consistency import Executed
from campaign.archive.verifying.result import (
    STRUCTURE,
    UNFINISHED,
    UNREADABLE_HASH,
    Progress,
    Verification,
)
from campaign.archive.writing import nexus
from campaign.archive.writing.default_plot import Aim
from campaign.errors import ArchiveError
from campaign.recording import ChannelInfo

_HASH = "outcome/file_sha256"
_REQUIRED = frozenset(
    [
        *("title", "entry_identifier", "start_time", "end_time", "program_name", *NUMBERS),
        *("provenance/name", "provenance/created"),
        *("outcome/status", "outcome/reason", "outcome/safe_state"),
        *(f"{note}/{name}" for note in NOTES for name in ("type", "file_name", "data")),
    ]
) - {f"not_kept/{name}" for name in ("type", "file_name", "data")}
_OWN_FILES = {HEADER, PLAN, JOURNAL, PLAN_TRIALS, PLAN_TREES, SEALING}
_MEMBERS = frozenset(("title", "start_time", "end_time", "record"))
_PLOT = frozenset(("axes", "time_indices"))
"""Attributes by which viewers plot a group, besides its signal."""


def verify_run(path: Path, progress: Progress = lambda count: None) -> Verification:
    """Verify a sealed run or the folder of a run in progress, in flat memory; never raises
    for what is in it.
    """
    check = _Check(path, progress)
    with check.problems.noting(), guarded.guarded(path):
        if path.is_dir():
            check.folder()
        else:
            check.sealed()
    return Verification(
        path,
        tuple(dict.fromkeys(check.problems.found)),
        tuple(check.remarks.found),
        len(check.trials) + len(check.unreadable),
        check.datasets,
        check.root,
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
        self.root = ""
        self._instruments: dict[int, nexus.Described] = {}

    def sealed(self) -> None:
        """A sealed file: its content first, so that the hash speaks of what that does not show."""
        with self.problems.noting():
            self._content()
        self._hash()

    def folder(self) -> None:
        """The folder of a run in progress, as far as its journal tells."""
        run = open_folder(self.path)
        content = self.path / JOURNAL
        story = read_lines(content.read_bytes() if content.is_file() else b"")
        if story.torn:
            self.remarks.add(JOURNAL, "has a last line that was torn by a crash and never reported")
        for entry, finished in entry_names(story.attempts).items():
            self._trial_file(entry, finished)
        named = {finished.file for finished in story.attempts}
        for file in sorted(self.path.iterdir()):
            if file.name not in named | _OWN_FILES:
                kind = "was never finished" if file.suffix == PART else "is not part of the run"
                self.remarks.add(file.name, kind)
        self._agreement(run, story, HEADER, JOURNAL, PLAN)

    def _content(self) -> None:
        run = read_sealed(self.path)
        self.root = run.root
        story = read_lines(run.journal.encode())
        with guarded.open_file(self.path) as file:
            texts = SealedTexts(self.path, file, DamageList(self.path))
            self._texts(file, texts)
            not_kept: dict[str, str] = {}
            with self.problems.noting():
                not_kept = read_not_kept(texts)
            self._index(texts, story)
            told = entry_names(story.attempts)
            for entry, finished in told.items():
                if entry in not_kept and entry not in file:
                    what = f"its samples are not kept: {not_kept[entry]}; their digests are"
                    self.remarks.add(f"/{entry}", what)
                    self._without_samples(run, entry, finished)
                else:
                    self._trial(file, entry, finished)
            for entry in sorted(not_kept.keys() - told.keys()):
                self.problems.add("/run/not_kept", f"names {entry!r}, and no such trial finished")
            for entry in sorted(not_kept.keys() & told.keys()):
                if entry in file:
                    what = "is there, and its samples are said not to be kept"
                    self.problems.add(f"/{entry}", what)
            for name in guarded.names(file):
                if name not in told and name != "run":
                    known = ENTRY.fullmatch(name) is not None
                    note = self.problems if known else self.remarks
                    what = "is there, and no line of the journal says that it finished"
                    note.add(f"/{name}", what if known else "is nothing that the format knows")
        self._agreement(run, story, "/run/provenance", "/run/journal", "/run/plan")
        self._outcome(run, story)

    def _texts(self, file: h5py.File, texts: SealedTexts) -> None:
        """Every text of the run against the seal."""
        if texts.seal is None:
            return  # which was found when the run was opened
        bound = texts.seal.texts.keys()
        self.datasets += 1
        for place in sorted(_REQUIRED - bound):
            self.problems.add(f"/run/{place}", "is missing from the seal")
        for place in bound:
            with self.problems.noting():
                texts.check(place)
            self.datasets += 1
        for place in sorted(set(_places(file, "run")) - bound - OUTSIDE):
            self.remarks.add(f"/run/{place}", "is nothing that the format knows")

    def _index(self, texts: SealedTexts, story: Lines) -> None:
        """The index has the records that the journal names, and no others."""
        with self.problems.noting():
            lines = {text_digest(line) for line in texts.text("index/data").splitlines()}
            told = {finished.record for finished in story.attempts}
            if lines != told:
                count = len(lines ^ told)
                self.problems.add("/run/index", f"differs from the journal in {count} records")

    def _hash(self) -> None:
        try:
            with guarded.open_file(self.path) as file, guarded.guarded(self.path):
                digest, place = guarded.digest_at(file, f"run/{_HASH}")
        except ArchiveError:
            if not self.problems.found:
                self.problems.add("", UNREADABLE_HASH)
            return
        same = sha256_of(self.path, place, self.progress) == digest
        if not same and not self.problems.found:
            self.problems.add("", STRUCTURE)

    def _trial_file(self, entry: str, finished: TrialFinished) -> None:
        """A trial's own file: its record, its samples, and its bytes."""
        path, name = self.path / finished.file, entry_name(finished.trial)
        known = len(self.problems.found)
        self.unreadable.add(entry)
        with self.problems.noting(), guarded.guarded(path, f"/{name}"):
            packed = read_packed(path, name)
            record, trees = packed_record(path, name, packed, finished.record)
            self._record(f"{path.name}/{name}", entry, record, trees)
            samples = PackedSamples(path, name, record, packed.not_kept)
            for problem in samples.problems():
                self.problems.note(ArchiveError(problem))
            self.datasets += 1 + (0 if packed.not_kept else len(list(series_of(record))))
        same = path.is_file() and sha256_of(path, progress=self.progress) == finished.sha256
        if not same and len(self.problems.found) == known:
            self.problems.add(finished.file, UNFINISHED)

    def _trial(self, file: h5py.File, entry: str, finished: TrialFinished) -> None:
        """What a trial says of itself, and that its samples are those that were recorded."""
        self.unreadable.add(entry)
        with self.problems.noting(), guarded.guarded(self.path, f"/{entry}"):
            group = guarded.group_at(file, entry, "NXentry")
            record, trees = read_entry(self.path, file, entry, finished.record)
            self.datasets += 1
            self._record(f"/{entry}", entry, record, trees)
            self._says(group, record)
            self._members(group, f"/{entry}", record, trees)
            self._series(group, f"/{entry}", record)

    def _without_samples(self, run: RunReader, entry: str, finished: TrialFinished) -> None:
        """A trial that has no group: what the index says of it was read when the run was opened."""
        attempts = run.earlier_attempts.get(finished.trial, ())
        for archived in (*run.trials, *attempts):
            if archived.entry == entry:
                fingerprint = archived.trial.fingerprint
                self.trials[entry] = Executed.of(entry, f"/{entry}", archived, fingerprint)

    def _record(self, place: str, entry: str, record: TrialRecord, trees: Trees) -> None:
        if record.fingerprint_of(trees) != record.fingerprint:
            self.problems.add(f"{place}/record", "does not match its fingerprint")
        self.trials[entry] = Executed(
            entry=entry,
            place=place,
            number=record.number,
            test=str(record.trial["test"]),
            kind=str(record.trial["kind"]),
            role=str(record.trial.get("role", "measurement")),
            fingerprint=record.fingerprint,
            outcome=record.outcome,
            reason=record.reason,
            safe_state=record.safe_state,
        )
        self.unreadable.discard(entry)

    def _says(self, group: h5py.Group, record: TrialRecord) -> None:
        """What viewers show beside the record is what the record says."""
        says = {"title": record.label, "start_time": record.started, "end_time": record.ended}
        for name, wanted in says.items():
            with self.problems.noting():
                guarded.text_at(group, name, text_digest(storage.storable(wanted)))
                self.datasets += 1

    def _members(self, group: h5py.Group, place: str, record: TrialRecord, trees: Trees) -> None:
        """What else an entry holds; what is missing or unknown is told."""
        kept = guarded.names(guarded.inner_group(group, "record"))
        wanted = set(_MEMBERS)
        if record.samples is not None:
            wanted.add("data")
            if nexus.follows_definition(record.series):
                wanted |= set(nexus.MEMBERS)
        if record.preview is not None:
            wanted.add("preview")
        there = set(guarded.names(group))
        for name in sorted(wanted - there):
            self.problems.add(f"{place}/{name}", "is missing")
        others = set(kept) - {"json", "trees"}
        unknown = sorted(there - wanted) + sorted(f"record/{name}" for name in others)
        for name in unknown:
            self.remarks.add(f"{place}/{name}", "is nothing that the format knows")
        self._by_themselves(group, place, "record", ("trees",))
        if set(nexus.MEMBERS) <= there & wanted:
            described = nexus.Described.of(trees[str(record.trial["bench"])])
            self._instrument(group, place, described)

    def _instrument(self, group: h5py.Group, place: str, described: nexus.Described) -> None:
        """The definition and the instrument, which trials of one bench share: each once."""
        address = h5o.get_info(guarded.inner_group(group, "instrument").id).addr
        if self._instruments.get(address) == described:
            return
        self._instruments[address] = described
        with self.problems.noting(), guarded.guarded(self.path, f"{place}/instrument"):
            for name, what in nexus.differences(group, described):
                self.problems.add(f"{place}/{name}", what)
        self._by_themselves(group, place, "", ("definition",))
        for inner in _places(group, "instrument", "instrument/"):
            parent, _, name = inner.rpartition("/")
            self._by_themselves(group, place, parent, (name,))

    def _by_themselves(
        self, group: h5py.Group, place: str, inner: str, names: Iterable[str]
    ) -> None:
        """Datasets that have checksums of their own, in the groups `inner` of an entry."""
        with self.problems.noting(), guarded.guarded(self.path, f"{place}/{inner}"):
            for step in filter(None, inner.split("/")):
                group = guarded.inner_group(group, step)
            for name in names:
                if name in group:
                    guarded.check_dataset(group, name)
                    self.datasets += 1

    def _series(self, group: h5py.Group, place: str, record: TrialRecord) -> None:
        """The samples, each series against its digest, and that there are no others."""
        aim = Aim.of_tree(record.trial)
        infos = {info.name: info for info in (TIME, *record.series)}
        for inner, series in groupby(series_of(record), key=itemgetter(0)):
            with self.problems.noting(), guarded.guarded(self.path, f"{place}/{inner}"):
                data = guarded.group_at(group, inner, "NXdata")
                told = {name: (length, digest) for _, name, length, digest in series}
                for name, (length, digest) in told.items():
                    with self.problems.noting():
                        self._one_series(data, f"{place}/{inner}", infos[name], length, digest)
                for name in sorted(set(guarded.names(data)) - told.keys() - {"title"}):
                    self.problems.add(f"{place}/{inner}/{name}", "is there, and was not announced")
                with self.problems.noting():
                    guarded.text_at(data, "title", text_digest(storage.storable(record.label)))
                for name in sorted(_PLOT - set(data.attrs)):
                    self.problems.add(f"{place}/{inner}@{name}", "is missing")
                shown = [name for name in told if name != "time"]
                if guarded.attribute(data, "signal") not in aim.accepted(shown):
                    self.problems.add(f"{place}/{inner}@signal", "is not the channel to plot first")
                if guarded.text_list(data, "axes") != ["time"]:
                    self.problems.add(f"{place}/{inner}@axes", "is not the time")

    def _one_series(
        self, data: h5py.Group, place: str, info: ChannelInfo, length: int, digest: str
    ) -> None:
        with guarded.guarded(self.path, f"{place}/{info.name}"):
            dataset, series = series_at(data, info.name, length)
            self.progress(series.check(digest))
            self.datasets += 1
            guarded.check_attribute(dataset, "units", info.unit)
            guarded.check_attribute(dataset, "long_name", info.long_name)

    def _agreement(
        self, run: RunReader, story: Lines, header_place: str, journal: str, plan: str
    ) -> None:
        """Whether the parts of the run agree; what cannot be read is told of once."""
        known = {damage.place for damage in self.problems.found}
        for damage in run.damaged:
            if damage.place not in known:
                self.problems.found.append(damage)
        broken = {damage.place.split(":")[0] for damage in self.problems.found}
        if not any(place.startswith(journal) for place in broken) or story.damaged:
            consistency.check_journal(story, run.header, journal, self.problems)
            consistency.check_measured(story, journal, self.problems)
            consistency.check_stages(story, run.header, journal, self.problems)
            consistency.check_trials(story, self.trials, self.unreadable, self.problems)
        if not any(place.startswith(plan) for place in broken):
            executed = self.trials.values()
            followed = len(run.plan) - len(run.first_stage)
            consistency.check_plan(run.plan, run.header, executed, plan, self.problems, followed)
            with self.problems.noting():
                consistency.check_full_plan(
                    run.full_plan, run.plan, f"{plan} in full", self.problems
                )
        if not any(place.startswith(header_place) for place in broken):
            consistency.check_protocol(run.header, header_place, self.problems)

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


def _places(parent: h5py.Group, name: str, prefix: str = "") -> Iterator[str]:
    """Every dataset in a group and the groups in it, by its path in the group."""
    group = guarded.member(parent, name)
    if group is None:
        return
    for inner in guarded.names(group):
        if guarded.member(group, inner) is None:
            yield f"{prefix}{inner}"
        else:
            yield from _places(group, inner, f"{prefix}{inner}/")
