"""Verifying the trials of a run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import h5py
from h5py import h5o

from campaign.archive.layout import storage
from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.files import sha256_of
from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.names import entry_name
from campaign.archive.layout.record import Trees, TrialRecord, series_of
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.archived_samples import TIME, PackedSamples
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.in_parts import in_parts
from campaign.archive.reading.packed_trial_reader import packed_record, read_packed
from campaign.archive.reading.sealed_run import read_entry
from campaign.archive.reading.series import series_at
from campaign.archive.verification.consistency import TrialFacts
from campaign.archive.verification.result import UNFINISHED, Progress
from campaign.archive.writing import nexus
from campaign.archive.writing.default_plot import Aim
from campaign.errors import ArchiveError
from campaign.recording import ChannelInfo

_MEMBERS = frozenset(("title", "start_time", "end_time", "record"))
_PLOT = frozenset(("axes", "time_indices"))
"""Attributes that viewers need to plot a group, besides its signal."""

Entries = Sequence[tuple[str, TrialFinished]]
"""Names of groups in a sealed run, each with its line of the journal."""


class EntryCheck:
    """Accumulated result of checking trials of a run.

    Attributes:
        executed, unreadable: by the name of the trial's group.
        datasets: number of datasets compared with their checksums.
        size: bytes read.
        instruments: of each, its address in the file, the bench it describes, and its check.
            Trials of one bench share it.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.problems = DamageList(path)
        self.remarks = DamageList(path)
        self.executed: dict[str, TrialFacts] = {}
        self.unreadable: set[str] = set()
        self.datasets = 0
        self.size = 0
        self.instruments: list[tuple[int, nexus.InstrumentDescription, EntryCheck]] = []

    def absorb(self, other: EntryCheck) -> None:
        """Add another result; an instrument counts once."""
        self.problems.found += other.problems.found
        self.remarks.found += other.remarks.found
        self.executed |= other.executed
        self.unreadable |= other.unreadable
        self.datasets += other.datasets
        for address, described, check in other.instruments:
            if not self._has(address, described):
                self.instruments.append((address, described, check))
                self.absorb(check)

    def _has(self, address: int, described: nexus.InstrumentDescription) -> bool:
        return any(each[0] == address and each[1] == described for each in self.instruments)

    def trial_file(self, entry: str, finished: TrialFinished) -> None:
        """Check a trial's own file: record, samples, and hash of the file."""
        path, name = self.path / finished.file, entry_name(finished.trial)
        known = len(self.problems.found)
        self.unreadable.add(entry)
        with self.problems.noting(), safe_hdf5.guarded(path, f"/{name}"):
            packed = read_packed(path, name)
            record, trees = packed_record(path, name, packed, finished.record)
            self._record(f"{path.name}/{name}", entry, record, trees)
            samples = PackedSamples(path, name, record, packed.not_kept)
            for problem in samples.problems():
                self.problems.note(ArchiveError(problem))
            self.datasets += 1 + (0 if packed.not_kept else len(list(series_of(record))))
        same = path.is_file() and sha256_of(path) == finished.sha256
        if not same and len(self.problems.found) == known:
            self.problems.add(finished.file, UNFINISHED)

    def trial(self, file: h5py.File, entry: str, finished: TrialFinished) -> None:
        """Check the group of a trial: record, texts, members, samples."""
        self.unreadable.add(entry)
        with self.problems.noting(), safe_hdf5.guarded(self.path, f"/{entry}"):
            group = safe_hdf5.group_at(file, entry, "NXentry")
            record, trees = read_entry(self.path, file, entry, finished)
            self.datasets += 1
            self._record(f"/{entry}", entry, record, trees)
            self._says(group, record)
            self._members(group, f"/{entry}", record, trees)
            self._series(group, f"/{entry}", record)

    def _record(self, place: str, entry: str, record: TrialRecord, trees: Trees) -> None:
        if record.fingerprint_of(trees) != record.fingerprint:
            self.problems.add(f"{place}/record", "does not match its fingerprint")
        self.executed[entry] = TrialFacts.of(place, record, record.fingerprint)
        self.unreadable.discard(entry)

    def _says(self, group: h5py.Group, record: TrialRecord) -> None:
        """Check the texts for viewers against the record."""
        texts = {"title": record.label, "start_time": record.started, "end_time": record.ended}
        for name, wanted in texts.items():
            with self.problems.noting():
                safe_hdf5.text_at(group, name, text_digest(storage.storable(wanted)))
                self.datasets += 1

    def _members(self, group: h5py.Group, place: str, record: TrialRecord, trees: Trees) -> None:
        """Check the members of an entry; report missing and unknown ones."""
        kept = safe_hdf5.names(safe_hdf5.inner_group(group, "record"))
        wanted = set(_MEMBERS)
        if record.samples is not None:
            wanted.add("data")
            if nexus.follows_definition(record.series):
                wanted |= set(nexus.MEMBERS)
        if record.preview is not None:
            wanted.add("preview")
        present = set(safe_hdf5.names(group))
        for name in sorted(wanted - present):
            self.problems.add(f"{place}/{name}", "is missing")
        others = set(kept) - {"json", "trees"}
        unknown = sorted(present - wanted) + sorted(f"record/{name}" for name in others)
        for name in unknown:
            self.remarks.add(f"{place}/{name}", "is nothing that the format knows")
        self._by_themselves(group, place, "record", ("trees",))
        if set(nexus.MEMBERS) <= present & wanted:
            described = nexus.InstrumentDescription.of(trees[str(record.trial["bench"])])
            self._instrument(group, place, described)

    def _instrument(
        self, group: h5py.Group, place: str, described: nexus.InstrumentDescription
    ) -> None:
        """Check definition and instrument once for all trials of a bench, which share them."""
        address = h5o.get_info(safe_hdf5.inner_group(group, "instrument").id).addr
        if self._has(address, described):
            return
        check = EntryCheck(self.path)
        self.instruments.append((address, described, check))
        with check.problems.noting(), safe_hdf5.guarded(self.path, f"{place}/instrument"):
            for name, what in nexus.differences(group, described):
                check.problems.add(f"{place}/{name}", what)
        check._by_themselves(group, place, "", ("definition",))
        for inner in places(group, "instrument", "instrument/"):
            parent, _, name = inner.rpartition("/")
            check._by_themselves(group, place, parent, (name,))

    def _by_themselves(
        self, group: h5py.Group, place: str, inner: str, names: Iterable[str]
    ) -> None:
        """Check datasets with their own checksum attributes, in the group path `inner`."""
        with self.problems.noting(), safe_hdf5.guarded(self.path, f"{place}/{inner}"):
            for step in filter(None, inner.split("/")):
                group = safe_hdf5.inner_group(group, step)
            for name in names:
                if name in group:
                    safe_hdf5.check_dataset(group, name)
                    self.datasets += 1

    def _series(self, group: h5py.Group, place: str, record: TrialRecord) -> None:
        """Check each series of samples against its digest, and that no others exist."""
        aim = Aim.of_tree(record.trial)
        infos = {info.name: info for info in (TIME, *record.series)}
        for inner, series in groupby(series_of(record), key=itemgetter(0)):
            with self.problems.noting(), safe_hdf5.guarded(self.path, f"{place}/{inner}"):
                data = safe_hdf5.group_at(group, inner, "NXdata")
                recorded = {name: (length, digest) for _, name, length, digest in series}
                for name, (length, digest) in recorded.items():
                    with self.problems.noting():
                        self._one_series(data, f"{place}/{inner}", infos[name], length, digest)
                for name in sorted(set(safe_hdf5.names(data)) - recorded.keys() - {"title"}):
                    self.problems.add(f"{place}/{inner}/{name}", "is there, and was not announced")
                with self.problems.noting():
                    safe_hdf5.text_at(data, "title", text_digest(storage.storable(record.label)))
                for name in sorted(_PLOT - set(data.attrs)):
                    self.problems.add(f"{place}/{inner}@{name}", "is missing")
                shown = [name for name in recorded if name != "time"]
                if safe_hdf5.attribute(data, "signal") not in aim.accepted(shown):
                    self.problems.add(f"{place}/{inner}@signal", "is not the channel to plot first")
                if safe_hdf5.text_list(data, "axes") != ["time"]:
                    self.problems.add(f"{place}/{inner}@axes", "is not the time")

    def _one_series(
        self, data: h5py.Group, place: str, info: ChannelInfo, length: int, digest: str
    ) -> None:
        with safe_hdf5.guarded(self.path, f"{place}/{info.name}"):
            dataset, series = series_at(data, info.name, length)
            self.size += series.check(digest)
            self.datasets += 1
            safe_hdf5.check_attribute(dataset, "units", info.unit)
            safe_hdf5.check_attribute(dataset, "long_name", info.long_name)


def check_entries(check: EntryCheck, entries: Entries, progress: Progress) -> None:
    """Check trials of a sealed run, or the trial files of a folder; add the result to `check`."""
    for part in in_parts(_check, check.path, entries):
        check.absorb(part)
        progress(part.size)


def _check(path: Path, part: Entries) -> EntryCheck:
    check = EntryCheck(path)
    if path.is_dir():
        for entry, finished in part:
            check.trial_file(entry, finished)
        return check
    with safe_hdf5.open_file(path) as file:
        for entry, finished in part:
            check.trial(file, entry, finished)
    return check


def places(parent: h5py.Group, name: str, prefix: str = "") -> Iterator[str]:
    """Paths of all datasets in a group, recursively, relative to the group."""
    group = safe_hdf5.member(parent, name)
    if group is None:
        return
    for inner in safe_hdf5.names(group):
        if safe_hdf5.member(group, inner) is None:
            yield f"{prefix}{inner}"
        else:
            yield from places(group, inner, f"{prefix}{inner}/")
