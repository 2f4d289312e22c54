"""Periodicity of the excitation in recordings from elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from campaign.channels import COMMAND, DRIVE_TORQUE
from campaign.estimation.frequency.multisine import repetition
from campaign.experiments.interface import TrialData
from campaign.experiments.responses.signals import SENSORS, Excited
from campaign.physics.bench import Bench


def repeated(trial: TrialData, excited: Excited) -> float | None:
    """The period (s) of a recorded multisine; None where nothing repeats, and of planned trials."""
    if trial.trial.task.mode != "recorded":
        return None
    recording = trial.recording()
    name = DRIVE_TORQUE if excited == "input" else COMMAND
    if name not in recording.channels or len(recording.time) < 2:
        return None
    samples = repetition(np.nan_to_num(recording[name]))
    step = float(np.ptp(recording.time)) / (len(recording.time) - 1)
    return None if samples is None else samples * step


def found_repeating(period: float) -> str:
    """The remark of a recording that was taken for a multisine."""
    return (
        f"What excites repeats every {period:.6g} s and has many lines: it is taken for a "
        "multisine of that period. `frequency_response.period` says it otherwise."
    )


def unused(trials: Sequence[TrialData], bench: Bench) -> Iterator[str]:
    """Of motor sensors that nobody can use, a sentence."""
    if bench.ratio is not None:
        return
    there = {name for trial in trials for name in trial.channel_names()}
    if names := [name for name in SENSORS["motor"] if name in there]:
        verb = "is" if len(names) == 1 else "are"
        yield (
            f"{' and '.join(names)} {verb} not used: without `[gear]` motor and load move as one. "
            "Where they do not, write `[gear] ratio` into the bench."
        )
