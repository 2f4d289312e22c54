"""The `replay` backend: archived recordings under a new protocol.

A planned trial gets the recording of an archived one with the same bench and task; only the
measuring window, which concerns the analysis, may differ. Every archived trial is used once;
interrupted ones are not used. An unreadable trial ends as a fault that names the damage.
"""

from __future__ import annotations

import contextlib
import json
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage_words import in_one_line, in_words, lost_trials
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.reading.sound_samples import whole_recording
from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.errors import ArchiveError
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.recording import Ending, Fault, Outcome, Recorder, SafeState
from campaign.trial import Task, Tree, Trial, canonical_json

_BLOCK = 4096  # samples between two checks of the stop flag
_NOT_ASKED = {"window"}  # fields of a task that only an analysis uses
_COMPARED = 2000  # archived trials that are searched for the nearest, to explain a refusal
_TOLD = 3  # maximum number of differing fields in a refusal
_ABSENT = object()


class ReplayOptions(Options):
    """Options of the replay."""

    run: str = Field(min_length=1)
    """Path of the archive to replay, or a run's name in `results`."""


@dataclass(frozen=True)
class _Lost:
    """An unreadable archived trial, with its trial from the archived plan."""

    trial: Trial
    reason: str


_Archived = ArchivedTrial | _Lost


@dataclass
class _Alike:
    """Archived trials of one bench and task, and the planned trials assigned to them."""

    archived: list[_Archived] = field(default_factory=list)
    answers: dict[int, Trial] = field(default_factory=dict)  # by index in `archived`

    def assign(self, trial: Trial) -> bool:
        """Assign the best matching archived trial to `trial`; False if all are assigned.

        A planned trial cedes its recording to a better match and takes its next best. So each gets
        its own recording, if it exists, independent of the order of the plan.
        """
        if len(self.answers) == len(self.archived):
            return False
        asking: Trial | None = trial
        while asking is not None:
            asking = self._take(asking)
        return True

    def _take(self, trial: Trial) -> Trial | None:
        """Assign the best recording that is free or held by a worse match; its former holder."""
        suits = [_likeness(trial, archived.trial) for archived in self.archived]
        for place in sorted(range(len(suits)), key=lambda place: suits[place], reverse=True):
            holder = self.answers.get(place)
            if holder is None or _likeness(holder, self.archived[place].trial) < suits[place]:
                self.answers[place] = trial
                return holder
        raise AssertionError("a free place suits everybody")

    def answer_to(self, trial: Trial) -> _Archived | None:
        """The archived trial assigned to `trial`, or None."""
        for place, planned in self.answers.items():
            if planned.number == trial.number:
                return self.archived[place]
        return None


class ReplayBackend:
    """Serves the trials of one archive in any order."""

    def __init__(self, run: RunReader) -> None:
        self._run = run
        self._lock = threading.Lock()
        self._trials = [t for t in run.trials if t.ending.outcome is not Outcome.INTERRUPTED]
        self._alike: dict[str, _Alike] = {}
        self._channels: dict[tuple[Path, str], frozenset[str] | None] = {}
        answers: list[_Archived] = [*self._trials, *_lost(run)]
        for archived in answers:
            key = canonical_json(_asked_of_bench(archived.trial))
            self._alike.setdefault(key, _Alike()).archived.append(archived)

    @property
    def archive(self) -> RunReader:
        return self._run

    def __enter__(self) -> ReplayBackend:
        return self

    def __exit__(self, *exception: object) -> None:
        return None

    def refuses(self, trial: Trial) -> str | None:
        """Why no recording fits `trial`, with the differing fields of the nearest; or None."""
        return None if self._answer(trial) else self._why_not(trial)

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Archived channels for `trial`; None if they are unknown.

        They are unknown if the archived trial ended before their announcement, or is damaged. The
        trial then ends as the archived one, or as a fault.
        """
        archived = self._answer(trial)
        if archived is None or isinstance(archived, _Lost):
            return None
        key = (archived.path, archived.entry)
        if key not in self._channels:
            try:
                self._channels[key] = archived.channel_names() or None
            except ArchiveError:
                self._channels[key] = None
        return self._channels[key]

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Copy channels, samples, events and ending of the archived trial; repeatable.

        Nothing moves: the safe state is confirmed, whatever the archived one was.
        """
        archived = self._answer(trial)
        if archived is None:
            return Ending(Outcome.FAULT, self._why_not(trial), fault=Fault.REFUSED)
        if stop():
            return Ending(Outcome.INTERRUPTED, "stopped by the operator")
        if isinstance(archived, _Lost):
            return Ending(Outcome.FAULT, archived.reason, fault=Fault.OTHER)
        try:
            recording = whole_recording(archived)
        except ArchiveError as error:
            return Ending(Outcome.FAULT, str(error), fault=Fault.OTHER)
        channels = list(recording.channels.values())
        if channels:
            recorder.start(tuple(channel.info for channel in channels))
            samples = np.stack([channel.samples for channel in channels])
            for first in range(0, len(recording.time), _BLOCK):
                if stop():
                    for event in recording.events:
                        if event.time < recording.time[first]:
                            recorder.event(event)
                    return Ending(Outcome.INTERRUPTED, "stopped by the operator")
                block = slice(first, first + _BLOCK)
                recorder.append(recording.time[block], samples[:, block])
        for event in recording.events:
            recorder.event(event)
        return replace(archived.ending, safe_state=SafeState.CONFIRMED)

    def make_safe(self) -> SafeState:
        """Confirm: a replay moves nothing."""
        return SafeState.CONFIRMED

    def _answer(self, trial: Trial) -> _Archived | None:
        alike = self._alike.get(canonical_json(_asked_of_bench(trial)))
        if alike is None:
            return None
        with self._lock:
            if alike.answer_to(trial) is None and not alike.assign(trial):
                return None
            return alike.answer_to(trial)

    def _why_not(self, trial: Trial) -> str:
        why = self._no_such(trial)
        if self._run.damaged:
            why += f"; it may have been lost: {in_one_line(self._run.path, self._run.damaged)}"
        return why

    def _no_such(self, trial: Trial) -> str:
        asked = _asked_of_bench(trial)
        alike = self._alike.get(canonical_json(asked))
        if alike is not None:
            count = len(alike.archived)
            return f"{self._run.name} has no more such trials; all {count} are asked for"
        if not self._trials:
            return f"{self._run.name} has no recordings"
        wanted = dict(_leaves(asked))
        same_test_first = sorted(self._trials, key=lambda t: t.trial.test != trial.test)
        nearest, differing = min(
            (
                (t, _differences(_asked_of_bench(t.trial), wanted))
                for t in same_test_first[:_COMPARED]
            ),
            key=lambda pair: len(pair[1]),
        )
        more = f" and {len(differing) - _TOLD} more" if len(differing) > _TOLD else ""
        return (
            f"{self._run.name} has no such trial; the nearest, {nearest.trial.name} "
            f"({nearest.trial.label}), differs in {'; '.join(differing[:_TOLD])}{more}"
        )


def _lost(run: RunReader) -> Iterator[_Lost]:
    """Unreadable trials that were not interrupted, if the archived plan contains them."""
    finished = run.story.finished
    for number, damage in sorted(lost_trials(run).items()):
        if number in finished and finished[number].outcome is Outcome.INTERRUPTED:
            continue
        with contextlib.suppress(ArchiveError):  # without a plan the trial is unknown
            yield _Lost(run.planned(number), f"{run.path}: {in_words(damage)}")


def _asked_of_bench(trial: Trial) -> dict[str, Any]:
    """All that determines a recording except the seed: bench, truth, task without window, files.

    Validated by the present classes: an option newer than the archive has its default.
    """
    task = Task.model_dump(trial.task, mode="json", exclude=_NOT_ASKED)
    asked: dict[str, Any] = {"bench": _normalised(canonical_json(trial.bench)), "task": task}
    asked |= {"recording": trial.recording} if trial.recording else {}
    return asked | ({"truth": trial.truth} if trial.truth else {})


@lru_cache(maxsize=256)
def _normalised(bench: str) -> Tree:
    tree: Tree = json.loads(bench)
    try:
        return Bench.model_validate(tree, context={"si": True}).model_dump(mode="json")
    except ValueError:  # a bench of another version; compared unchanged
        return tree


def _likeness(trial: Trial, archived: Trial) -> tuple[bool, ...]:
    """Rank of an archived trial of the same bench and task; larger is better."""
    return (
        trial.seed == archived.seed,
        trial.test == archived.test,
        trial.point == archived.point,
        trial.repeat == archived.repeat,
        trial.number == archived.number,
    )


def _differences(archived: Mapping[str, Any], wanted: Mapping[str, Any]) -> list[str]:
    """Differences as `path: archived value there, wanted value here`; task before bench."""
    leaves = dict(_leaves(archived))
    differing = [
        f"{path}: {_text(leaves.get(path, _ABSENT))} there, {_text(wanted.get(path, _ABSENT))} here"
        for path in dict.fromkeys((*leaves, *wanted))
        if leaves.get(path, _ABSENT) != wanted.get(path, _ABSENT)
    ]
    return sorted(differing, key=lambda text: text.startswith("bench."))


def _leaves(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping) and value:
            yield from _leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def _text(value: object) -> str:
    text = "absent" if value is _ABSENT else canonical_json(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def _open(options: ReplayOptions) -> ReplayBackend:
    return ReplayBackend(open_run(find_run(Path("results"), options.run)))


BACKEND = BackendKind(
    name="replay",
    summary="the recordings of an archived run",
    options=ReplayOptions,
    open=_open,
    source=Source.RECORDING,
    several=True,
)
