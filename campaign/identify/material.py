"""The trials that `RUN` or `RUN:TEST` refers to."""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.trial import Outcome, Role


@dataclass(frozen=True)
class ChosenRun:
    """A run and its selected trials.

    Attributes:
        test: name of the selected test, or "".
        trials: completed measurements, in plan order.
    """

    run: RunReader
    test: str
    trials: tuple[ArchivedTrial, ...]

    @property
    def name(self) -> str:
        """`RUN` or `RUN:TEST`."""
        return f"{self.run.name}:{self.test}" if self.test else self.run.name


def choose(results: Path, named: str) -> ChosenRun:
    """Select the trials of `RUN` or `RUN:TEST`. Raises UsageError without such a test or trial."""
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
    """Numbers of trials of `other` with the samples of a trial of `chosen`.

    A recording that is imported twice is in two runs: their common channels are bit-identical.
    """
    alike = {_length(each) for each in chosen.trials} & {_length(each) for each in other.trials}
    own = [_digests(each) for each in chosen.trials if _length(each) in alike]
    again = {each.trial.number: _digests(each) for each in other.trials if _length(each) in alike}
    return sorted(number for number, new in again.items() if any(_same(new, old) for old in own))


def _same(one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    both = one.keys() & other.keys()
    return bool(both) and all(one[name] == other[name] for name in both)


def _length(trial: ArchivedTrial) -> tuple[float, float]:
    return trial.trial.task.duration, trial.trial.task.sample_rate


def _digests(trial: ArchivedTrial) -> Mapping[str, str]:
    """SHA-256 of the samples by channel; without constant channels."""
    recording = trial.recording()
    digests = {}
    for name in recording.channels:
        samples = np.ascontiguousarray(recording[name], dtype=np.float64)
        if len(samples) and np.any(samples != samples[0]):
            digests[name] = hashlib.sha256(samples.tobytes()).hexdigest()
    return digests


def _split(results: Path, named: str) -> tuple[Path, str]:
    """Path of a run, and a test or ""; a colon that belongs to the path does not count."""
    before, colon, after = named.rpartition(":")
    if not colon or not before or Path(named).exists() or any(c in after for c in "/\\"):
        return find_run(results, named), ""
    return find_run(results, before), after
