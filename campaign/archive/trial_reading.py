"""Reading trials back: what was executed, how it ended, and its samples."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

import h5py
import numpy as np
from pydantic import BaseModel, TypeAdapter

from campaign.archive import guarded
from campaign.archive.reader import ArchivedTrial
from campaign.archive.run_folder import first_line
from campaign.archive.trial_file import entry_name
from campaign.errors import ArchiveError
from campaign.trial import (
    Channel,
    ChannelInfo,
    Ending,
    Event,
    Outcome,
    Recording,
    SafeState,
    Trial,
    canonical_json,
)


class _Event(BaseModel):
    time: float
    text: str


_EVENTS = TypeAdapter(list[_Event])
_CHANNELS = TypeAdapter(list[ChannelInfo])
_ENTRY = re.compile(r"trial_([0-9]{5,10})")


def read_trials(path: Path, file: h5py.File) -> Iterator[ArchivedTrial]:
    """The trials of a sealed run, in plan order."""
    numbers = [int(m[1]) for name in guarded.names(file) if (m := _ENTRY.fullmatch(name))]
    for number in sorted(numbers):
        yield read_trial(path, file, number)


def read_trial_file(path: Path, number: int) -> ArchivedTrial:
    """The trial in a file of its own."""
    with guarded.open_file(path) as file:
        return read_trial(path, file, number)


def read_trial(path: Path, file: h5py.File, number: int) -> ArchivedTrial:
    """One trial without its samples. Raises ArchiveError naming what is wrong with it."""
    name = entry_name(number)
    with guarded.guarded(path, name):
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
        )
        started = guarded.text_at(entry, "start_time")
        ended = guarded.text_at(entry, "end_time")
        return ArchivedTrial(trial, ending, started, ended, path, name)


def _fingerprint(trial_text: str) -> str:
    """Of a trial as it was stored.

    `Trial.fingerprint` would be another one as soon as a later program gives a trial a further
    field, with a default that old archives do not have.
    """
    tree = json.loads(trial_text)
    what = {key: tree[key] for key in ("bench", "task", "seed")}
    return hashlib.sha256(canonical_json(what).encode()).hexdigest()


def read_recording(path: Path, entry_name: str, ending: Ending) -> Recording:
    """A trial's samples and events, checked; a trial that recorded nothing has no channels."""
    with guarded.open_file(path) as file, guarded.guarded(path, entry_name):
        entry = guarded.group_at(file, entry_name, "NXentry")
        record = guarded.group_at(entry, "record", "NXcollection")
        told = _EVENTS.validate_json(guarded.text_at(record, "events"))
        events = tuple(Event(event.time, event.text) for event in told)
        if "data" not in entry:
            return Recording(np.empty(0), {}, events, ending)
        data = guarded.group_at(entry, "data", "NXdata")
        time = guarded.read_samples(guarded.samples_at(data, "time"))
        infos = _CHANNELS.validate_json(guarded.text_at(record, "channels"))
        channels = {info.name: _channel(data, info, len(time)) for info in infos}
        return Recording(time, channels, events, ending)


def check_recordings(path: Path, entries: Iterable[str]) -> Iterator[str]:
    """What is damaged of the trials in a file, one line each; reads them in flat memory."""
    try:
        with guarded.open_file(path) as file:
            for name in entries:
                yield from _check_entry(path, file, name)
    except ArchiveError as error:
        yield str(error)


def _check_entry(path: Path, file: h5py.File, name: str) -> Iterator[str]:
    try:
        entry = guarded.group_at(file, name, "NXentry")
        for group in ("data", "preview"):
            if group in entry:
                yield from _damaged(path, guarded.group_at(entry, group, "NXdata"))
    except ArchiveError as error:
        yield str(error)


def _damaged(path: Path, data: h5py.Group) -> Iterator[str]:
    plotted = [guarded.attribute(data, "signal"), *guarded.text_list(data, "auxiliary_signals")]
    for name in ["time", *plotted]:
        try:
            with guarded.guarded(path, f"{data.name}/{name}"):
                guarded.check_samples(guarded.samples_at(data, name))
        except ArchiveError as error:
            yield str(error)


def _channel(data: h5py.Group, info: ChannelInfo, length: int) -> Channel:
    dataset = guarded.samples_at(data, info.name)
    if dataset.shape[0] != length:
        raise ArchiveError(
            f"{data.file.filename}: {data.name}/{info.name}: has {dataset.shape[0]} samples, "
            f"and time has {length}"
        )
    return info.with_samples(guarded.read_samples(dataset))
