"""Recordings of multisines: their period, and which have one amplitude."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from campaign.channels import COMMAND, DRIVE_TORQUE
from campaign.estimation.frequency.multisine import repetition
from campaign.estimation.least_squares import Array
from campaign.experiments.interface import TrialData
from campaign.experiments.responses.signals import SENSORS, Excited, Signals
from campaign.physics.bench import Bench
from campaign.units import rate_text


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


SAME_SIZE = 1.1
"""Ratio of neighbouring rms below which recordings are realisations of one amplitude. Realisations
of one command have the same rms whatever their phases, and noise and a torque loop add a few
percent; amplitudes that are to tell friction's part differ by a quarter or more."""

Recorded = tuple[TrialData, Signals]


def by_amplitude(told: Sequence[Recorded], period: float) -> list[list[Recorded]]:
    """Groups of one rms of what was excited, the largest first; within each by number of trial.

    A new group begins where neighbours in size differ by more than `SAME_SIZE`.

    Args:
        period: of the excitation (s).
    """
    sizes = {signal.number: _rms(signal.leading, signal, period) for _, signal in told}
    falling = sorted(told, key=lambda each: -sizes[each[1].number])
    groups = [falling[:1]]
    for (_, before), each in pairwise(falling):
        if sizes[before.number] > SAME_SIZE * sizes[each[1].number]:
            groups.append([])
        groups[-1].append(each)
    return [sorted(group, key=lambda each: each[1].number) for group in groups]


def _rms(samples: Array, signal: Signals, period: float) -> float:
    """Of the last period without its mean: before, there may be rest, or a transient."""
    return float(np.nanstd(samples[-round(period * signal.rate) :]))


def size_of(told: Sequence[Recorded], period: float) -> str:
    """The rms of one amplitude, in words; of a recording that of its torque: its unit is known."""
    trial, first = told[0]
    mode = trial.trial.task.mode
    rms = _rms(first.torque if mode == "recorded" else first.leading, first, period)
    return f"rms {rate_text(rms) if mode == 'rate' else f'{rms:.3g} N·m'}"
