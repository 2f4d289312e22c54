"""Trials with intact samples, and the names of the others.

Samples are held against their checksums when they are read, which may be as late as an analysis
asks a recording for a channel. An error there costs the one trial.
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
    """The recording, every channel of it read now. Raises ArchiveError when one is damaged."""
    recording = trial.recording()
    return replace(recording, channels=dict(recording.channels.items()))


def sound_part(path: Path, trial: ArchivedTrial) -> tuple[Recording | None, tuple[Damage, ...]]:
    """The recording without the channels that are damaged, and what is damaged.

    Args:
        path: the run's.

    None when no channel can be told from another, or when the samples were not kept.
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
    """The trials whose every sample can be read, and what is damaged of the others."""
    good: list[ArchivedTrial] = []
    damaged: list[Damage] = []
    for trial in trials:
        _, found = sound_part(path, trial)
        if found:
            damaged += found
        else:
            good.append(trial)
    return tuple(good), tuple(damaged)


def damaged_records(run: RunReader, trials: Trials) -> tuple[Damage, ...]:
    """Damage of the records that stand with the samples of a sealed run; no sample is read.

    The index has every record again, and opening a run looks there alone. In the folder of a run in
    progress there is no index: whatever opens that has looked at them.
    """
    from campaign.archive.reading import safe_hdf5

    # Of a damaged journal some are missing, and that is told already.
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
    """What `make` makes of `trials`; of those that are whole when it meets one that is not.

    Returns what was made, the trials of which it was made, and what is damaged of the others. On
    undamaged trials nothing is read but by `make`.

    Raises ArchiveError when it meets damage even so.
    """
    try:
        return make(trials), trials, ()
    except ArchiveError:
        good, damaged = readable(path, trials)
        if not damaged:
            raise
    return make(good), good, damaged


def _of_trial(path: Path, trial: ArchivedTrial, error: ArchiveError) -> Damage:
    """Damage found in reading a trial is that trial's, also where the error only names the file."""
    damage = Damage.of(path, error)
    return damage if damage.trial else replace(damage, trial=trial.trial.name)
