"""Checks of a recording before its analysis.

A recording of an unconnected sensor, a truncated log or a drive that never moved has no numbers and
adds a note. Numbers of other trials remain.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from campaign.channels import missing
from campaign.entry_points import one_line
from campaign.experiments.interface import TrialData
from campaign.reason import Cause, Reason
from campaign.recording import Outcome, Recording
from campaign.result import RecordingDoubt
from campaign.signals import Zero
from campaign.trial import Role, Trial

FEWEST = 3
"""Fewest samples for an analysis."""
NOT_RECORDED = Cause("channel not recorded", "no {channels} was recorded")
TOO_SHORT = Cause("too short", "{samples} samples were recorded")
NO_NUMBERS = Cause("no numbers", "{channel} has no numbers")
NEVER_CHANGED = Cause("never changed", "{channels} never changed")
NOT_MEASURED = Cause("not measured", "{error}")
NOT_KEPT = Cause("samples not kept", "nothing was measured, and the samples were not kept: {why}")


def doubt(data: TrialData) -> RecordingDoubt | None:
    """Doubt about the recording of a completed measurement, or None.

    None if it was measured when the trial ended, because its samples are not read again, and if the
    trial requires no channel, because only its experiment can check it.
    """
    trial = data.trial
    measured = data.ending.outcome == Outcome.COMPLETED and trial.role == Role.MEASUREMENT
    if not measured or data.estimates:
        return None
    if data.not_kept:
        return doubted(trial, NOT_KEPT(why=data.not_kept))
    if not trial.requires:
        return None
    lacking = missing(trial.requires, data.channel_names())
    if lacking:
        return doubted(trial, NOT_RECORDED(channels=" and no ".join(lacking)))
    return _doubt(data.recording(), trial)


def _doubt(recording: Recording, trial: Trial) -> RecordingDoubt | None:
    if len(recording.time) < FEWEST:
        return doubted(trial, TOO_SHORT(samples=len(recording.time)))
    samples = {name: recording[name] for name in trial.requires}
    for name, values in samples.items():
        if np.all(np.isnan(values)):
            return doubted(trial, NO_NUMBERS(channel=name), fatal=False)
    task = trial.task
    if all(isinstance(s, Zero) for s in (task.command, task.disturbance, task.base_acceleration)):
        return None  # no motion was commanded
    still = [name for name, values in samples.items() if np.all(values == values[0])]
    if not still:
        return None
    return doubted(
        trial, NEVER_CHANGED(channels=", ".join(still)), fatal=len(still) == len(samples)
    )


def not_measured(trial: Trial, error: BaseException) -> RecordingDoubt:
    """Doubt for a failed analysis of one trial; a ValueError has a message for the user."""
    message = str(error) if isinstance(error, ValueError) else ""
    return doubted(trial, NOT_MEASURED(error=message.partition("\n")[0][:300] or one_line(error)))


def doubted(trial: Trial, reason: Reason, *, fatal: bool = True) -> RecordingDoubt:
    """Doubt about the recording of a trial."""
    return RecordingDoubt(trial.number, trial.label, reason, fatal)


def notes_on(doubts: Iterable[RecordingDoubt], trials: int) -> tuple[str, ...]:
    """One sentence for each defect, with its share of the number of all `trials`."""
    groups: dict[tuple[Reason, bool], list[RecordingDoubt]] = {}
    for each in doubts:
        groups.setdefault((each.reason, each.fatal), []).append(each)
    return tuple(
        f"{_listed(group)}: {reason}"
        f"{f'; not analysed ({len(group)} of {trials} trials)' if fatal else ''}."
        for (reason, fatal), group in groups.items()
    )


def _listed(group: Sequence[RecordingDoubt]) -> str:
    label = f"{group[0].label} (trial {group[0].number})"
    more = len(group) - 1
    return f"{label} and {more} more trial{'s' if more > 1 else ''}" if more else label
