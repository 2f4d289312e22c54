"""The sealed file while it is made: trials are copied into it, then all else, and it is checked."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from operator import attrgetter
from pathlib import Path

import h5py
from h5py import h5d

from campaign.archive.layout.entries import entry_name
from campaign.archive.layout.files import sha256_of
from campaign.archive.layout.followed import planned_in, stages_in
from campaign.archive.layout.full_plan import PLAN_TREES, PLAN_TRIALS
from campaign.archive.layout.header import FORMAT, RunHeader
from campaign.archive.layout.journal import JOURNAL, RunEnded, Story, TrialFinished
from campaign.archive.layout.record import TrialRecord, parse_trees, trees_text
from campaign.archive.layout.run_folder import PLAN, parse_plan, read_text
from campaign.archive.reading import guarded
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.recorded import PLOTTED, TIME, check_unit, parse_record, series_of
from campaign.archive.reading.seal import SEAL, SealedTexts, seal_text
from campaign.archive.reading.series import layout_of, series_at
from campaign.archive.writing import hdf5, nexus
from campaign.archive.writing.default_plot import telling_trial
from campaign.archive.writing.trial_file import write_root
from campaign.errors import ArchiveError
from campaign.recording import Outcome
from campaign.trial import Tree, canonical_json


@dataclass(frozen=True)
class _Placed:
    """Where a series was read back: the group and the name, its unit, where its chunks lie."""

    group: str
    name: str
    unit: str
    layout: tuple[tuple[int, int], ...]


class SealedFile:
    """A sealed file that is being made: `copy` every attempt, `finish`, and `put_hash`.

    Attributes:
        copied: what was copied, by the name of its group.
        placed: where the samples lie that were read back, by the name of the trial's group.
        not_kept: why an attempt has only its record, by the name that its group would have.
    """

    def __init__(self, part: Path) -> None:
        self.copied: dict[str, TrialFinished] = {}
        self.placed: dict[str, list[_Placed]] = {}
        self.not_kept: dict[str, str] = {}
        self._part = part
        self._lines: dict[str, str] = {}
        self._trees: dict[str, Tree] = {}
        self._instruments: dict[nexus.Described, str] = {}
        self._hash_place: tuple[int, int]  # once it is finished
        self._file = hdf5.create_file(part)

    def is_part_of(self, wanted: Mapping[str, TrialFinished]) -> bool:
        """Whether all that was copied is among `wanted`, under the same names."""
        return self.copied.items() <= wanted.items()

    def copy(self, folder: Path, finished: TrialFinished, entry: str) -> None:
        """Copy an attempt from its file, and read every sample of the copy back.

        Raises ArchiveError when it is not what the journal says was written.
        """
        path, name = folder / finished.file, entry_name(finished.trial)
        if sha256_of(path) != finished.sha256:
            raise ArchiveError(f"{path}: is not what the journal says was written")
        with guarded.open_file(path) as source:
            own = guarded.inner_group(guarded.inner_group(source, name), "record")
            line = guarded.text_at(own, "json", finished.record)
            record = parse_record(path, f"/{name}/record", line)
            trees = parse_trees(guarded.unchecked_text_at(own, "trees"))
            if "not_kept" in own:
                self.not_kept[entry] = guarded.text_at(own, "not_kept")
            else:
                hdf5.copy_entry(source, name, self._file, entry)
                self._describe(entry, record, trees)
                self._read_back(entry, record)
        self._trees |= trees
        self._lines[entry] = line
        self.copied[entry] = finished

    def finish(self, folder: Path, header: RunHeader, story: Story, ended: RunEnded) -> None:
        """Write everything but the trials, and close the file."""
        texts = _texts(folder, header, story, ended)
        planned = parse_trees(read_text(folder / PLAN_TREES))
        texts["trees/data"] = trees_text(planned | self._trees)
        entries = sorted(self._lines, key=_by_number)
        texts["index/data"] = "".join(f"{self._lines[entry]}\n" for entry in entries)
        with hdf5.closing(self._file) as file:
            run = hdf5.make_group(file, "run", "NXentry")
            for place, text in texts.items():
                _put(run, place, text, header)
            if self.not_kept:
                not_kept = canonical_json(self.not_kept)
                for name, text in _note("application/json", "not-kept.json", not_kept).items():
                    _put(run, f"not_kept/{name}", text, header)
            _put(run, SEAL, seal_text(header.name, texts), header)
            write_root(file, header.created, _shown(file, folder, story))
            self._hash_place = hdf5.blank_digest(run["outcome"], "file_sha256")

    def put_hash(self) -> None:
        """Put the hash of the whole file into the file.

        It counts its own place as zeros, so it travels with the file, survives a viewer that opens
        the file for writing and changes nothing, and finds any byte that is not as it was sealed.
        """
        digest = sha256_of(self._part, self._hash_place)
        with self._part.open("r+b") as file:
            file.seek(self._hash_place[0])
            file.write(digest.encode("ascii"))

    def discard(self) -> None:
        """Leave no file."""
        with contextlib.suppress(OSError, RuntimeError, ValueError):
            self._file.close()
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _describe(self, entry: str, record: TrialRecord, trees: Mapping[str, Tree]) -> None:
        """Say that it follows the application definition; each bench is described once."""
        if not nexus.follows_definition(record.series):
            return
        described = nexus.Described.of(trees[str(record.trial["bench"])])
        group = self._file[entry]
        if (first := self._instruments.get(described)) is not None:
            for name in nexus.MEMBERS:
                hdf5.link(self._file[first], name, group, name)
            return
        nexus.write_definition(group, described)
        self._instruments[described] = entry

    def _read_back(self, entry: str, record: TrialRecord) -> None:
        units = {info.name: info.unit for info in (TIME, *record.series)}
        groups = {name: self._file[entry][name] for name in PLOTTED if name in self._file[entry]}
        placed = self.placed[entry] = []
        for group, name, length, digest in series_of(record):
            series = series_at(groups[group], name, length)
            series.check(digest)
            placed.append(_Placed(group, name, units[name], layout_of(series.dataset)))


def check_sealed(part: Path, file: SealedFile) -> None:
    """Open the new file again and hold it against what was written: every text against the seal,
    the record of every trial, and where its samples lie, which were read back when they were
    copied. Raises ArchiveError.
    """
    damaged = DamageList(part)
    with guarded.open_file(part) as opened, guarded.guarded(part):
        texts = SealedTexts(part, opened, damaged)
        if texts.seal is None:
            raise ArchiveError(str(damaged.found[0]))
        for place in texts.seal.texts:
            texts.check(place)
        for entry, finished in file.copied.items():
            if entry not in file.not_kept:
                with guarded.guarded(part, f"/{entry}"):
                    _check_entry(guarded.inner_group(opened, entry), finished, file.placed[entry])


def _check_entry(entry: h5py.Group, finished: TrialFinished, placed: Sequence[_Placed]) -> None:
    """The record is the one of the journal, and samples lie where they were read back."""
    kept = guarded.inner_group(entry, "record")
    guarded.text_at(kept, "json", finished.record)
    guarded.text_at(kept, "trees")
    for group_name, members in groupby(placed, key=attrgetter("group")):
        group = guarded.inner_group(entry, group_name)
        for each in members:
            series = guarded.own_id(group, each.name)
            if not isinstance(series, h5d.DatasetID) or layout_of(series) != each.layout:
                place = f"{group.file.filename}: {group.name}/{each.name}"
                raise ArchiveError(f"{place}: does not lie where it was written")
            check_unit(h5py.Dataset(series), each.unit)


def _texts(folder: Path, header: RunHeader, story: Story, ended: RunEnded) -> dict[str, str | int]:
    """The texts of `/run` that are known without the trials, by their place."""
    failed = sum(f.outcome is not Outcome.COMPLETED for f in story.finished.values())
    texts: dict[str, str | int] = {
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
        "journal": _note(lines, JOURNAL, story.text),
        "plan": _note(lines, PLAN, read_text(folder / PLAN)),
        "plan_trials": _note(lines, PLAN_TRIALS, read_text(folder / PLAN_TRIALS)),
        "trees": _note(lines, PLAN_TREES, ""),
        "index": _note(lines, "index.jsonl", ""),
    }
    for note, members in notes.items():
        texts |= {f"{note}/{name}": text for name, text in members.items()}
    return texts


def _note(kind: str, file_name: str, text: str) -> dict[str, str]:
    return {"type": kind, "file_name": file_name, "data": text}


_CLASSES = {"provenance": "NXcollection", "outcome": "NXcollection"}


def _put(run: h5py.Group, place: str, text: str | int, header: RunHeader) -> None:
    group_name, _, name = place.rpartition("/")
    group = run
    if group_name:
        nx_class = _CLASSES.get(group_name, "NXnote")
        there = group_name in run
        group = run[group_name] if there else hdf5.make_group(run, group_name, nx_class)
    if isinstance(text, int):
        hdf5.put_integer(group, name, text)
    elif place == "program_name":
        version = header.versions.get("campaign", "unknown")
        hdf5.put_text(group, name, text, version=version)
    else:
        hdf5.put_text(group, name, text)


def _by_number(entry: str) -> tuple[int, float]:
    """The order of trials, an earlier attempt before the one that counts."""
    _, number, *attempt = entry.split("_")
    return int(number), int(attempt[1]) if attempt else math.inf


def _shown(file: h5py.File, folder: Path, story: Story) -> h5py.Group | None:
    """What a viewer opens first: see `default_plot`."""
    plan = parse_plan(folder, read_text(folder / PLAN))
    completed = [n for n, each in story.finished.items() if each.outcome is Outcome.COMPLETED]
    with_samples = [
        n
        for n in sorted(story.finished)
        if (name := entry_name(n)) in file and "data" in file[name]
    ]
    followed = planned_in(stages_in(story.entries))
    best = telling_trial((*plan, *followed), completed, with_samples)
    return None if best is None else file[entry_name(best)]
