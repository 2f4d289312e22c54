"""Recordings that cannot hold what their test is after: found before any analysis.

A sensor that is not connected, a log that was cut off, a drive that never moved: such a recording
costs its own numbers and a note, not those of the other trials.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from campaign.channels import missing
from campaign.estimate import Estimate
from campaign.recording import Ending, Outcome, Recording
from campaign.signals import Zero
from campaign.trial import Role, Trial


class Finished(Protocol):
    """What is looked at of a finished trial: a part of `interface.TrialData`."""

    @property
    def trial(self) -> Trial: ...

    @property
    def ending(self) -> Ending: ...

    def recording(self) -> Recording: ...

    def channel_names(self) -> frozenset[str]: ...

    @property
    def estimates(self) -> Sequence[Estimate]: ...


FEWEST = 3
"""Samples below which nothing can be said of any signal."""


@dataclass(frozen=True)
class Doubt:
    """What is wrong with a recording, and whether it may be analysed all the same."""

    label: str
    what: str
    fatal: bool


def doubt(data: Finished) -> Doubt | None:
    """What is wrong with the recording of a completed measurement.

    Nothing where it was measured when the trial ended, as its samples are not read again then, nor
    where the trial requires no channel: what it is after, its experiment alone knows.
    """
    trial = data.trial
    measured = data.ending.outcome == Outcome.COMPLETED and trial.role == Role.MEASUREMENT
    if not measured or data.estimates or not trial.requires:
        return None
    lacking = missing(trial.requires, data.channel_names())
    if lacking:
        return Doubt(trial.label, f"no {' and no '.join(lacking)} was recorded", True)
    return _doubt(data.recording(), trial)


def _doubt(recording: Recording, trial: Trial) -> Doubt | None:
    if len(recording.time) < FEWEST:
        return Doubt(trial.label, f"{len(recording.time)} samples were recorded", True)
    samples = {name: recording[name] for name in trial.requires}
    for name, values in samples.items():
        if np.all(np.isnan(values)):
            return Doubt(trial.label, f"{name} has no numbers", False)
    task = trial.task
    if all(isinstance(s, Zero) for s in (task.command, task.disturbance, task.base_acceleration)):
        return None  # nothing was to move
    still = [name for name, values in samples.items() if np.all(values == values[0])]
    if not still:
        return None
    return Doubt(trial.label, f"{', '.join(still)} never changed", len(still) == len(samples))


def notes_on(doubts: Iterable[Doubt]) -> tuple[str, ...]:
    """A sentence for each thing that was wrong, with the trials that it was wrong with."""
    labels: dict[tuple[str, bool], list[str]] = {}
    for each in doubts:
        labels.setdefault((each.what, each.fatal), []).append(each.label)
    return tuple(
        f"{_listed(shown)}: {what}{'; not analysed' if fatal else ''}."
        for (what, fatal), shown in labels.items()
    )


def _listed(labels: list[str]) -> str:
    return labels[0] if len(labels) == 1 else f"{labels[0]} and {len(labels) - 1} more trials"
