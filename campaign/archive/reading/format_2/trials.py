"""Reading trials back: what was executed and how it ended."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

import h5py
from pydantic import TypeAdapter
from pydantic_core import from_json

from campaign.archive.layout.entries import entry_name
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import guarded
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import DamageList
from campaign.archive.reading.format_2.samples import StoredSamples
from campaign.errors import ArchiveError
from campaign.recording import Ending, Fault, Outcome, SafeState
from campaign.trial import Tree, Trial, canonical_json

_ENTRY = re.compile(r"trial_([0-9]{5,10})")
_TREE: TypeAdapter[Tree] = TypeAdapter(Tree)


def read_trials(path: Path, file: h5py.File, damaged: DamageList) -> Iterator[ArchivedTrial]:
    """The trials of a sealed run that can be read, in plan order; the others are noted."""
    numbers = {int(m[1]) for name in guarded.names(file) if (m := _ENTRY.fullmatch(name))}
    for number in sorted(numbers):
        with damaged.noting():
            yield read_trial(path, file, number)


def read_trial_file(path: Path, number: int) -> ArchivedTrial:
    """The trial in a file of its own."""
    with guarded.open_file(path) as file:
        return read_trial(path, file, number)


def read_trial(path: Path, file: h5py.File, number: int, place: str = "") -> ArchivedTrial:
    """One trial without its samples. Raises ArchiveError naming what is wrong with it.

    `place` is where it lies, when that is not its own group: an earlier attempt.
    """
    name = place or entry_name(number)
    with guarded.guarded(path, f"/{name}"):
        entry = guarded.group_at(file, name, "NXentry")
        record = guarded.group_at(entry, "record", "NXcollection")
        text = guarded.text_at(record, "trial")
        try:
            trial = Trial.model_validate_json(text)
        except ValueError as error:
            raise ArchiveError(f"{path}: /{name}/record/trial: {first_line(error)}") from None
        if trial.number != number:
            raise ArchiveError(f"{path}: /{name}: holds trial number {trial.number}")
        if _fingerprint(text) != guarded.text_at(record, "fingerprint"):
            raise ArchiveError(f"{path}: /{name}/record: does not match its fingerprint")
        ending = Ending(
            Outcome(guarded.text_at(record, "outcome")),
            guarded.text_at(record, "reason"),
            SafeState(guarded.text_at(record, "safe_state")),
            _fault(record),
            _telemetry(record),
        )
        started = guarded.text_at(entry, "start_time")
        ended = guarded.text_at(entry, "end_time")
        return ArchivedTrial(trial, ending, started, ended, path, name, StoredSamples(path, name))


def _fault(record: h5py.Group) -> Fault | None:
    """What failed; format 1 did not keep it."""
    text = guarded.text_at(record, "fault") if "fault" in record else ""
    return Fault(text) if text else None


def _telemetry(record: h5py.Group) -> Tree:
    if "telemetry" not in record:
        return {}
    return _TREE.validate_json(guarded.text_at(record, "telemetry"))


def _fingerprint(trial_text: str) -> str:
    """Of a trial as it was stored.

    `Trial.fingerprint` would be another one as soon as a later program gives a trial a further
    field, with a default that old archives do not have.
    """
    tree = from_json(trial_text)
    what = {key: tree[key] for key in ("bench", "task", "seed")}
    return hashlib.sha256(canonical_json(what).encode()).hexdigest()
