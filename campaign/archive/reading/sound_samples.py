"""Trials with intact samples, and the damage of the others.

Samples are compared with their checksums when read, which may be as late as the access to a
channel in an analysis. An error then excludes only that trial.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage, DamageList
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError
from campaign.recording import Recording

_Made = TypeVar("_Made")

Trials = tuple[ArchivedTrial, ...]


def whole_recording(trial: ArchivedTrial) -> Recording:
    """The recording with all channels read. Raises ArchiveError if one is damaged."""
    recording = trial.recording()
    return replace(recording, channels=dict(recording.channels.items()))


def sound_part(path: Path, trial: ArchivedTrial) -> tuple[Recording | None, tuple[Damage, ...]]:
    """The recording without its damaged channels, and the damage.

    Args:
        path: path of the run.

    The recording is None if it cannot be opened, or if the samples were not kept.
    """
    if trial.not_kept:
        return None, ()
    try:
        recording = trial.recording()
    except ArchiveError as error:
        return None, (_of_trial(path, trial, error),)
    channels, damaged = {}, []
    for name in recording.channels:
        try:
            channels[name] = recording.channels[name]
        except ArchiveError as error:
            damaged.append(_of_trial(path, trial, error))
    return replace(recording, channels=channels), tuple(damaged)


def readable(path: Path, trials: Sequence[ArchivedTrial]) -> tuple[Trials, tuple[Damage, ...]]:
    """The trials with all samples readable, and the damage of the others."""
    good: list[ArchivedTrial] = []
    damaged: list[Damage] = []
    for trial in trials:
        _, damage = sound_part(path, trial)
        if damage:
            damaged += damage
        else:
            good.append(trial)
    return tuple(good), tuple(damaged)


def damaged_records(run: RunReader, trials: Trials) -> tuple[Damage, ...]:
    """Damage of the records in the groups of trials of a sealed run; no sample is read.

    Opening a sealed run reads the copies in the index only. A run in progress has no index:
    opening it reads these records.
    """
    from campaign.archive.reading import safe_hdf5

    # A damaged journal lacks some digests; its damage is reported elsewhere.
    digests = {each.trial: each.record for each in run.story.finished.values()}
    wanted = [t for t in trials if t.trial.number in digests and not t.not_kept]
    if not run.sealed or not wanted:
        return ()
    damaged = DamageList(run.path)
    with damaged.noting(), safe_hdf5.open_file(run.path) as file:
        for each in wanted:
            with damaged.noting(), safe_hdf5.guarded(run.path, f"/{each.entry}/record"):
                record = safe_hdf5.inner_group(safe_hdf5.inner_group(file, each.entry), "record")
                safe_hdf5.text_at(record, "json", digests[each.trial.number])
    return tuple(damaged.found)


def without_damaged(
    path: Path, trials: Trials, make: Callable[[Trials], _Made]
) -> tuple[_Made, Trials, tuple[Damage, ...]]:
    """Result of `make` on `trials`; if it fails by damage, on the undamaged trials only.

    Returns the result, the trials it used, and the damage of the others. If no trial is damaged,
    only `make` reads samples.

    Raises ArchiveError if `make` fails on undamaged trials too.
    """
    try:
        return make(trials), trials, ()
    except ArchiveError:
        good, damaged = readable(path, trials)
        if not damaged:
            raise
    return make(good), good, damaged


def _of_trial(path: Path, trial: ArchivedTrial, error: ArchiveError) -> Damage:
    """Damage of this trial, even if the error names only the file."""
    damage = Damage.of(path, error)
    return damage if damage.trial else replace(damage, trial=trial.trial.name)
