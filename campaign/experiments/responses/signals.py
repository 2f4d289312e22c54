"""Input, output and reference of a response; stretches, period and amplitude of recordings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
from pydantic import Field

from campaign.arrays import Array
from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    MOTOR_ANGLE,
    MOTOR_RATE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.estimate import Window
from campaign.estimation.frequency.multisine import repetition
from campaign.estimation.frequency.two_mass_model import Side
from campaign.estimation.frequency.welch import Estimator
from campaign.estimation.inverse.motion import whole_pieces
from campaign.experiments.interface import TrialData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.signals import MultiSine, Polyline, Sine
from campaign.trial import Recording, Task, Trial
from campaign.units import Frequency, Time, rate_text, torque_text

SENSORS: Mapping[Side, tuple[str, ...]] = {
    "load": (GYRO_RATE, RELATIVE_RATE, RELATIVE_ANGLE),
    "motor": (MOTOR_RATE, MOTOR_ANGLE),
}
"""Channels of a side, the best first."""
ANGLES = (RELATIVE_ANGLE, MOTOR_ANGLE)
SHARE_TOLERANCE = 1e-6
"""Largest deviation of a line from a multiple of the base frequency, relative to the line."""

STEADY = "steady"
"""Window of the samples that are measured: after the transient."""

Excited = Literal["auto", "input", "reference"]


class ResponseOptions(Options):
    """Options of the responses of trials."""

    excited: Excited = "auto"
    """input: no loop acts on the torque; reference: a loop makes the torque, and the command is the
    external input of the loop; auto: by the trials' modes."""
    estimator: Estimator = "H1"
    """Estimator for torques without a loop: H1 (noise on the rate), H2 (on the torque), Hv (on
    both)."""
    resolution: Frequency | None = Field(default=None, gt=0)
    """Resolution of averaged spectra; absent: a segment is a sixteenth of all samples."""
    period: Time | None = Field(default=None, gt=0)
    """Period of a multisine in recordings without its command; absent: that of the command."""


def steady_window(trial: Trial) -> Window:
    """The measured window: `STEADY`, or that of the task for an older trial."""
    named = (window for window in trial.windows if window.name == STEADY)
    return next(named, Window(STEADY, *trial.task.window))


@dataclass(frozen=True)
class Signals:
    """Signals of one trial: torque, answers by side, and reference of its loop.

    Attributes:
        data: the trial.
        rate: sample rate (Hz).
        time, torque: shape (n,); NaN where a sample was lost.
        answers: rate or angle at the load by side, shape (n,); `channels`: its source.
        reference: command, shape (n,); None if it is unknown or constant.
    """

    data: TrialData
    rate: float
    time: Array
    torque: Array
    answers: Mapping[Side, Array]
    channels: Mapping[Side, str]
    reference: Array | None

    @property
    def leading(self) -> Array:
        """Excited signal, shape (n,): the reference, or the torque without a reference."""
        return self.torque if self.reference is None else self.reference

    def is_angle(self, side: Side) -> bool:
        """Whether the answer of that side is an angle, not a rate."""
        return self.channels[side] in ANGLES


CORNERS = 100
"""Fewest corners of a command that excites many frequencies. Ramps and steps have fewer: the effect
of friction on their motion is not noise and resembles modes."""


def usable(trials: Sequence[TrialData]) -> tuple[Sequence[TrialData], str]:
    """Trials with excitation, drive torque, and rate or angle; without any, the reason."""
    moving = [
        each
        for each in trials
        if _excites(each.trial.task)
        and DRIVE_TORQUE in each.channel_names()
        and any(set(names) & each.channel_names() for names in SENSORS.values())
    ]
    if moving:
        return moving, ""
    return (), (
        "no trial is recorded elsewhere, or commanded by sines, multisines or noise, with a drive "
        "torque and a rate or angle that answers it"
    )


def _excites(task: Task) -> bool:
    """Whether a command is a sine, multisine or noise; true for `recorded`, where it is unknown."""
    if task.mode not in ("rate", "torque"):
        return task.mode == "recorded"
    command = task.command
    if isinstance(command, Polyline):
        return len(command.times) >= CORNERS
    return isinstance(command, Sine | MultiSine)


def signals(trial: TrialData, bench: Bench, excited: Excited) -> Signals:
    """Signals of one trial. Raises ValueError without motion or with unknown excitation."""
    task, recording = trial.trial.task, trial.recording()
    answers, channels = _answers(recording, bench)
    if not changes(recording[DRIVE_TORQUE]):
        raise ValueError(f"{DRIVE_TORQUE} never changes")
    reference = None
    command = recording[COMMAND] if COMMAND in recording.channels else None
    if command is None and task.mode != "recorded":
        command = task.command.sample(recording.time)
    if command is not None and changes(command):
        reference = command
    if reference is None and excited == "reference":
        raise ValueError(
            "its loop is closed and nothing that comes into it is recorded: output over input "
            "would be a mixture of the drive and its controller"
        )
    if reference is None and excited == "auto" and task.mode == "recorded":
        raise ValueError(
            "it does not say what was excited: import the command (channel `command`). Only where "
            "the torque itself was commanded (open loop) use --set frequency_response.excited=input"
        )
    n = len(recording.time)
    duration = float(np.ptp(recording.time)) if n > 1 else 0.0
    if duration <= 0:
        raise ValueError("it has no samples")
    return Signals(
        trial,
        (n - 1) / duration,
        recording.time,
        recording[DRIVE_TORQUE],
        answers,
        channels,
        reference,
    )


def changes(samples: Array) -> bool:
    """Whether a signal, shape (n,), is not constant; lost samples do not count."""
    known = samples[np.isfinite(samples)]
    return bool(known.size and np.ptp(known) > 0)


def _answers(recording: Recording, bench: Bench) -> tuple[dict[Side, Array], dict[Side, str]]:
    answers: dict[Side, Array] = {}
    channels: dict[Side, str] = {}
    for side, names in SENSORS.items():
        for name in names:
            if name not in recording.channels or name in channels.values():
                continue
            samples = recording[name]
            if not changes(samples):
                continue
            if side == "motor":
                if bench.ratio is None:
                    continue  # the ratio gives the angle at the load
                samples = samples / bench.ratio
            answers[side], channels[side] = samples, name
            break
    if not answers:
        only = bench.ratio is None and any(name in recording.channels for name in SENSORS["motor"])
        why = ": a motor's angle says nothing of the load's without the bench's [gear] ratio"
        raise ValueError(f"nothing that answers its torque moves{why if only else ''}")
    return answers, channels


def whole_stretches(parts: Sequence[Array], shortest: int) -> Sequence[slice]:
    """Segments of at least `shortest` samples in which all signals have numbers."""
    return whole_pieces(np.all([np.isfinite(part) for part in parts], axis=0), shortest)


def base_frequency(frequencies: Sequence[float]) -> float:
    """Largest common divisor of the frequencies (Hz); zero without one."""
    base = 0.0
    for each in frequencies:
        one, other = each, base
        while other > SHARE_TOLERANCE * each:
            rest = one % other
            if other - rest < SHARE_TOLERANCE * each:
                rest = 0.0
            one, other = other, rest
        base = one
    return base if base > 1e-3 * min(frequencies, default=0.0) else 0.0


def repeated(trial: TrialData, excited: Excited) -> float | None:
    """Period (s) of a recorded multisine; None without repetition, and for planned trials."""
    if trial.trial.task.mode != "recorded":
        return None
    recording = trial.recording()
    name = DRIVE_TORQUE if excited == "input" else COMMAND
    if name not in recording.channels or len(recording.time) < 2:
        return None
    samples = repetition(np.nan_to_num(recording[name]))
    step = float(np.ptp(recording.time)) / (len(recording.time) - 1)
    return None if samples is None else samples * step


def unused(trials: Sequence[TrialData], bench: Bench) -> Iterator[str]:
    """Sentence on recorded motor sensors that cannot be used without a gear ratio."""
    if bench.ratio is not None:
        return
    recorded = {name for trial in trials for name in trial.channel_names()}
    if names := [name for name in SENSORS["motor"] if name in recorded]:
        verb = "is" if len(names) == 1 else "are"
        yield (
            f"{' and '.join(names)} {verb} not used: without `[gear]` motor and load move as one. "
            "Where they do not, write `[gear] ratio` into the bench."
        )


SAME_SIZE = 1.1
"""Ratio of neighbouring rms below which recordings are realisations of one amplitude. Realisations
of one command have the same rms whatever their phases, and noise and a torque loop add a few
percent; amplitudes that are to show the effect of friction differ by a quarter or more."""


def by_amplitude(trials: Sequence[Signals], period: float) -> list[list[Signals]]:
    """Groups of equal rms of the excited signal, the largest first; in each by trial number.

    A new group begins where neighbours in size differ by more than `SAME_SIZE`.

    Args:
        period: of the excitation (s).
    """
    sizes = {each.data.trial.number: _rms(each.leading, each, period) for each in trials}
    falling = sorted(trials, key=lambda each: -sizes[each.data.trial.number])
    groups = [falling[:1]]
    for before, each in pairwise(falling):
        if sizes[before.data.trial.number] > SAME_SIZE * sizes[each.data.trial.number]:
            groups.append([])
        groups[-1].append(each)
    return [sorted(group, key=lambda each: each.data.trial.number) for group in groups]


def _rms(samples: Array, signal: Signals, period: float) -> float:
    """Rms of the last period less its mean; rest or a transient may precede it."""
    return float(np.nanstd(samples[-round(period * signal.rate) :]))


def size_of(first: Signals, period: float) -> str:
    """Text of the rms of one amplitude; of a recording that of its torque, whose unit is known."""
    mode = first.data.trial.task.mode
    rms = _rms(first.torque if mode == "recorded" else first.leading, first, period)
    return f"rms {rate_text(rms) if mode == 'rate' else torque_text(rms)}"
