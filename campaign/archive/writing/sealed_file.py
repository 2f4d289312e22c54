"""The sealed file during writing: copied trials, header, check."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import h5py
from h5py import h5d

from campaign import __version__
from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.files import sha256_of
from campaign.archive.layout.followup_trials import planned_in, stages_in
from campaign.archive.layout.header import FORMAT, RunHeader
from campaign.archive.layout.journal import RunEnded, TrialFinished
from campaign.archive.layout.journal_summary import Lines
from campaign.archive.layout.names import JOURNAL, PLAN, PLAN_TREES, PLAN_TRIALS, entry_name
from campaign.archive.layout.packed_trial import Place
from campaign.archive.layout.record import TrialRecord, parse_trees, series_of
from campaign.archive.layout.run_folder import parse_plan, read_text
from campaign.archive.layout.storage import storable
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.archived_samples import TIME
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.in_parts import in_parts
from campaign.archive.reading.packed_trial_reader import packed_record, read_packed
from campaign.archive.reading.seal import SEAL, SealedTexts, seal_text
from campaign.archive.reading.series import layout_of
from campaign.archive.writing import hdf5, nexus
from campaign.archive.writing.default_plot import leading_trial
from campaign.archive.writing.long_text import LongText, file_pieces, text_of
from campaign.archive.writing.sealed_entry import EntryWriter
from campaign.errors import ArchiveError
from campaign.recording import Outcome
from campaign.trial import Tree, canonical_json

Placed = Mapping[tuple[str, str], tuple[str, tuple[Place, ...]]]
"""Unit and places of chunks of each series of a trial, by group and name."""
Text = str | LongText | int


class Copy(NamedTuple):
    """A copied attempt: name of its group, line of the journal, and places of its samples."""

    entry: str
    finished: TrialFinished
    placed: Placed


class SealedFile:
    """A sealed file during writing: `copy` every attempt, `finish`, and `put_hash`.

    Attributes:
        copied: copied attempts, by the name of their group.
        placed: places of the samples that were read back, by the name of the trial's group.
        not_kept: reason why an attempt has only its record, by the name its group would have.
    """

    def __init__(self, part: Path) -> None:
        self.copied: dict[str, TrialFinished] = {}
        self.placed: dict[str, Placed] = {}
        self.not_kept: dict[str, str] = {}
        self._part = part
        self._trees: dict[str, str] = {}  # lines by digest
        self._instruments: dict[nexus.InstrumentDescription, str] = {}
        self._hash_place: tuple[int, int]  # set by `finish`
        self._file = hdf5.create_file(part)
        self._entries = EntryWriter(self._file)

    def is_part_of(self, wanted: Mapping[str, TrialFinished]) -> bool:
        """Whether all copied attempts are in `wanted`, with the same names."""
        return self.copied.items() <= wanted.items()

    def copy(self, folder: Path, finished: TrialFinished, entry: str) -> None:
        """Copy an attempt from its file, and read every sample of the copy back.

        Raises ArchiveError if the file differs from the journal.
        """
        path, name = folder / finished.file, entry_name(finished.trial)
        if sha256_of(path) != finished.sha256:
            raise ArchiveError(f"{path}: is not what the journal says was written")
        packed = read_packed(path, name)
        record, trees = packed_record(path, name, packed, finished.record)
        if packed.not_kept:
            self.not_kept[entry] = sys.intern(packed.not_kept)
        else:
            with safe_hdf5.guarded(path, f"/{entry}"), path.open("rb") as source:
                written = self._entries.write(entry, record, packed, source)
                self._describe(entry, record, trees)
                for group, series, _, digest in series_of(record):
                    written[group, series][1].check(digest)
                units = {info.name: info.unit for info in (TIME, *record.series)}
                self.placed[entry] = {
                    key: (units[key[1]], layout_of(made)) for key, (made, _) in written.items()
                }
        for digest, line in zip(trees, packed.trees.splitlines(), strict=True):
            self._trees.setdefault(digest, line)
        self.copied[entry] = finished

    def finish(self, folder: Path, header: RunHeader, story: Lines, ended: RunEnded) -> None:
        """Write everything except the trials, and close the file."""
        texts = _texts(folder, header, story, ended)
        planned = read_text(folder / PLAN_TREES)
        lines = dict(zip(parse_trees(planned), planned.splitlines(), strict=True)) | self._trees
        texts["trees/data"] = "".join(f"{line}\n" for _, line in sorted(lines.items()))
        texts["index/data"] = text_of(partial(self._index, folder))
        rooms: dict[int, LongText] = {}
        with hdf5.closing(self._file) as file:
            run = hdf5.make_group(file, "run", "NXentry")
            for place, text in texts.items():
                _put(run, place, text, header, rooms)
            if self.not_kept:
                not_kept = canonical_json(self.not_kept)
                for name, text in _note("application/json", "not-kept.json", not_kept).items():
                    _put(run, f"not_kept/{name}", text, header, rooms)
            digests = {place: _digest(text) for place, text in texts.items()}
            _put(run, SEAL, seal_text(header.name, digests), header, rooms)
            shown = _shown(file, self.placed, folder, story)
            hdf5.put_root(file, __version__, header.created, shown)
            self._hash_place = hdf5.blank_digest(run["outcome"], "file_sha256")
        with self._part.open("r+b") as raw:
            for offset, long in rooms.items():
                raw.seek(offset)
                raw.writelines(long.pieces())
                if raw.tell() != offset + long.size:  # a longer text has overwritten samples
                    raise ArchiveError(f"{folder}: a text was changed while it was sealed")

    def _index(self, folder: Path) -> Iterator[bytes]:
        """The records as lines, in the order of trials, read again from the trial files."""
        for entry in sorted(self.copied, key=_by_number):
            finished = self.copied[entry]
            packed = read_packed(folder / finished.file, entry_name(finished.trial))
            if text_digest(packed.record) != finished.record:
                raise ArchiveError(f"{folder / finished.file}: was changed while it was sealed")
            yield f"{packed.record}\n".encode()

    def put_hash(self) -> None:
        """Write the hash of the whole file into the file."""
        hdf5.put_file_hash(self._part, self._hash_place)

    def discard(self) -> None:
        """Close and remove the file."""
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _describe(self, entry: str, record: TrialRecord, trees: Mapping[str, Tree]) -> None:
        """Mark it as following the application definition; each bench is described once."""
        if not nexus.follows_definition(record.series):
            return
        described = nexus.InstrumentDescription.of(trees[str(record.trial["bench"])])
        group = self._file[entry]
        if (first := self._instruments.get(described)) is not None:
            for name in nexus.MEMBERS:
                hdf5.link(self._file[first], name, group, name)
            return
        nexus.write_definition(group, described)
        self._instruments[described] = entry


def check_sealed(part: Path, file: SealedFile) -> None:
    """Open the new file again and check it: every text against the seal, the record of every trial,
    and the places of its samples, which were read back during copying. Raises ArchiveError.
    """
    damaged = DamageList(part)
    with safe_hdf5.open_file(part) as opened, safe_hdf5.guarded(part):
        texts = SealedTexts(part, opened, damaged)
        if texts.seal is None:
            raise ArchiveError(str(damaged.found[0]))
        for place in texts.seal.texts:
            texts.check(place)
    copies = [Copy(entry, file.copied[entry], placed) for entry, placed in file.placed.items()]
    for _ in in_parts(_check_copies, part, copies):
        pass


def _check_copies(part: Path, copies: Sequence[Copy]) -> None:
    """Check records against the journal, and places of samples. Raises ArchiveError."""
    with safe_hdf5.open_file(part) as file:
        for copy in copies:
            with safe_hdf5.guarded(part, f"/{copy.entry}"):
                _check_copy(safe_hdf5.inner_group(file, copy.entry), copy)


def _check_copy(entry: h5py.Group, copy: Copy) -> None:
    kept = safe_hdf5.inner_group(entry, "record")
    safe_hdf5.text_at(kept, "json", copy.finished.record)
    safe_hdf5.text_at(kept, "trees")
    inner = cache(partial(safe_hdf5.inner_group, entry))
    for (group, name), (unit, layout) in copy.placed.items():
        series = h5d.open(inner(group).id, name.encode())
        if layout_of(series) != layout:
            place = f"{entry.file.filename}: {entry.name}/{group}/{name}"
            raise ArchiveError(f"{place}: does not lie where it was written")
        safe_hdf5.check_attribute(series, "units", unit)


def _digest(text: Text) -> str:
    return text.sha256 if isinstance(text, LongText) else text_digest(storable(str(text)))


def _texts(folder: Path, header: RunHeader, story: Lines, ended: RunEnded) -> dict[str, Text]:
    """The texts of `/run` that do not depend on the trials, by their place."""
    failed = sum(f.outcome is not Outcome.COMPLETED for f in story.finished.values())
    texts: dict[str, Text] = {
        "title": header.title or header.protocol_name or header.name,
        "entry_identifier": header.name,
        "start_time": header.created,
        "end_time": ended.at,
        "program_name": "campaign",
        "provenance/format": FORMAT,
        "outcome/status": ended.status,
        "outcome/reason": ended.reason,
        "outcome/safe_state": ended.safe_state,
        "outcome/trials_finished": len(story.finished),
        "outcome/trials_failed": failed,
    }
    for field, value in header.model_dump(mode="json", exclude={"sources"}).items():
        texts[f"provenance/{field}"] = value if isinstance(value, str) else canonical_json(value)
    toml, lines = "application/toml", "application/jsonl"
    notes = {
        f"source_{number:03d}": _note(toml, name, text)
        for number, (name, text) in enumerate(sorted(header.sources.items()), start=1)
    } | {
        "journal": _note(
            lines, JOURNAL, text_of(partial(file_pieces, folder / JOURNAL, story.size))
        ),
        "plan": _note(lines, PLAN, text_of(partial(file_pieces, folder / PLAN))),
        "plan_trials": _note(
            lines, PLAN_TRIALS, text_of(partial(file_pieces, folder / PLAN_TRIALS))
        ),
        "trees": _note(lines, PLAN_TREES, ""),
        "index": _note(lines, "index.jsonl", ""),
    }
    for note, members in notes.items():
        texts |= {f"{note}/{name}": text for name, text in members.items()}
    return texts


def _note(kind: str, file_name: str, text: str | LongText) -> dict[str, str | LongText]:
    return {"type": kind, "file_name": file_name, "data": text}


_CLASSES = {"provenance": "NXcollection", "outcome": "NXcollection"}


def _put(
    run: h5py.Group, place: str, text: Text, header: RunHeader, rooms: dict[int, LongText]
) -> None:
    """Write a text; for a long text, only allocate it and add its offset to `rooms`."""
    group_name, _, name = place.rpartition("/")
    group = run
    if group_name:
        nx_class = _CLASSES.get(group_name, "NXnote")
        exists = group_name in run
        group = run[group_name] if exists else hdf5.make_group(run, group_name, nx_class)
    if isinstance(text, int):
        hdf5.put_integer(group, name, text)
    elif isinstance(text, LongText):
        rooms[hdf5.put_long_text(group, name, text)] = text
    elif place == "program_name":
        version = header.versions.get("campaign", "unknown")
        hdf5.put_text(group, name, text, version=version)
    else:
        hdf5.put_text(group, name, text)


def _by_number(entry: str) -> tuple[int, float]:
    """Sort key: trial number, then attempt; the last attempt comes last."""
    _, number, *attempt = entry.split("_")
    return int(number), int(attempt[1]) if attempt else math.inf


def _shown(file: h5py.File, placed: Collection[str], folder: Path, story: Lines) -> str:
    """Name of the entry that a viewer opens first: see `default_plot`; empty if there is none."""
    completed = [n for n, each in story.finished.items() if each.outcome is Outcome.COMPLETED]
    with_samples = [
        n
        for n in sorted(story.finished)
        if (name := entry_name(n)) in placed and "data" in file[name]
    ]
    if not with_samples:
        return ""
    plan = parse_plan(folder, read_text(folder / PLAN))
    followed = planned_in(stages_in(story.entries))
    best = leading_trial((*plan, *followed), completed, with_samples)
    return "" if best is None else entry_name(best)
