"""The trials that `RUN` or `RUN:TEST` refers to."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.archive import ArchivedTrial, RunReader, find_run, open_run
from campaign.errors import UsageError
from campaign.trial import Outcome, Role


@dataclass(frozen=True)
class ChosenRun:
    """A run, and the trials of it that are meant.

    Attributes:
        test: the one that was named, or "".
        trials: completed measurements, in plan order.
    """

    run: RunReader
    test: str
    trials: tuple[ArchivedTrial, ...]

    @property
    def name(self) -> str:
        """As it was asked for."""
        return f"{self.run.name}:{self.test}" if self.test else self.run.name

    def of_bench(self, bench: str) -> tuple[ArchivedTrial, ...]:
        """Those of its tests on the bench of that name."""
        return tuple(t for t in self.trials if t.trial.bench.get("name") == bench)


def choose(results: Path, named: str) -> ChosenRun:
    """What `RUN` or `RUN:TEST` means. Raises UsageError where there is no such test or trial."""
    path, test = _split(results, named)
    run = open_run(path)
    tests = [str(each.get("name", "")) for each in run.header.tests]
    if test and test not in tests:
        close = difflib.get_close_matches(test, tests, n=1)
        hint = f"did you mean {close[0]!r}?" if close else f"there are {', '.join(tests)}"
        raise UsageError(f"{run.name}: there is no test {test!r}; {hint}")
    trials = tuple(
        each
        for each in run.trials
        if each.ending.outcome is Outcome.COMPLETED
        and each.trial.role is Role.MEASUREMENT
        and (not test or each.trial.test == test)
    )
    if not trials:
        of = f"of {test!r} " if test else ""
        raise UsageError(f"{run.name}: no trial {of}was completed; there is nothing to identify")
    return ChosenRun(run, test, trials)


def same_recordings(chosen: ChosenRun, other: ChosenRun) -> list[int]:
    """Numbers of trials of `other` whose samples are those of a trial of `chosen`.

    A recording that is imported twice is in two runs, and is one recording: channels that both
    have hold the same samples, bit by bit.
    """
    alike = {_length(each) for each in chosen.trials} & {_length(each) for each in other.trials}
    own = [_digests(each) for each in chosen.trials if _length(each) in alike]
    again = {each.trial.number: _digests(each) for each in other.trials if _length(each) in alike}
    return sorted(
        number for number, mine in again.items() if any(_same(mine, theirs) for theirs in own)
    )


def _same(one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    both = one.keys() & other.keys()
    return bool(both) and all(one[name] == other[name] for name in both)


def _length(trial: ArchivedTrial) -> tuple[float, float]:
    return trial.trial.task.duration, trial.trial.task.sample_rate


def _digests(trial: ArchivedTrial) -> Mapping[str, str]:
    """SHA-256 of each channel's samples, by its name; of channels that change."""
    recording = trial.recording()
    found = {}
    for name in recording.channels:
        samples = np.ascontiguousarray(recording[name], dtype=np.float64)
        if len(samples) and np.any(samples != samples[0]):
            found[name] = hashlib.sha256(samples.tobytes()).hexdigest()
    return found


def _split(results: Path, named: str) -> tuple[Path, str]:
    """A run's path and a test; the colon of a path is none of ours."""
    before, colon, after = named.rpartition(":")
    if not colon or not before or Path(named).exists() or any(c in after for c in "/\\"):
        return find_run(results, named), ""
    return find_run(results, before), after
