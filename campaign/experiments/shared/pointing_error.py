"""Pointing error of a trial under base motion: windows and metric.

Several experiments measure it. Their analyses use the metric, which is archived with a trial.
Samples are read for figures only.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from pydantic import Field

from campaign.channels import POINTING_ERROR
from campaign.estimate import Estimate, Window
from campaign.estimation import stabilization_error
from campaign.experiments.interface import TrialData, bench_of, metrics
from campaign.options import Options
from campaign.physics.complete import pointing_high_pass
from campaign.recording import Recording
from campaign.result import Array
from campaign.signals import Sine
from campaign.trial import Task, Trial
from campaign.units import AngularAcceleration, Frequency

MEASURED = "measured"
"""Window of the metric: after the transient; whole cycles of a sinusoidal motion."""
SHOWN = "shown"
"""Beginning of the measured window, for time histories."""
SHOWN_CYCLES = 1.5
"""of the base motion in a time history; more cycles only make the reversals smaller."""
SHOWN_TIME = 60.0
"""s; of a motion that is not sinusoidal."""
ROUNDING = 1e-6
"""of a cycle: tolerance of whole cycles for rounded times."""


class SineMotionOptions(Options):
    """Options of a test under a sinusoidal base motion."""

    frequency: Frequency = Field(default=0.24, gt=0)
    """Frequency of the base motion."""
    acceleration: AngularAcceleration = Field(default=float(np.deg2rad(18.0)), gt=0)
    """Amplitude of the base's acceleration."""
    cycles: int = Field(default=3, ge=1, le=10_000)
    """Whole cycles of the base motion to measure."""
    settle_cycles: int = Field(default=1, ge=0, le=1_000)
    """Cycles before them, for the transient to decay."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""

    def task(self, compensation: str) -> Task:
        """The rate command is zero, and the hull swings."""
        motion = Sine(amplitude=self.acceleration, frequency=self.frequency)
        start = self.settle_cycles / self.frequency
        stop = start + self.cycles / self.frequency
        return rest_task(compensation, start, stop, self.sample_rate, base_acceleration=motion)


def rest_task(
    compensation: str, start: float, stop: float, sample_rate: float, **signals: Any
) -> Task:
    """A task with a zero rate command, measured from start to stop (s); signals act on the load."""
    return Task(
        mode="rate",
        compensation=compensation,
        duration=stop,
        window=(start, stop),
        sample_rate=sample_rate,
        **signals,
    )


def windows_of(task: Task) -> tuple[Window, Window]:
    """Windows of a trial under base motion, for plans and for archives without windows."""
    start, stop = task.window
    signal = task.base_acceleration
    shown = SHOWN_CYCLES / signal.frequency if isinstance(signal, Sine) else SHOWN_TIME
    return Window(MEASURED, start, stop), Window(SHOWN, start, min(stop, start + shown))


def window_of(trial: Trial, name: str) -> Window:
    """A window of the trial by its name."""
    return next(
        window for window in (*trial.windows, *windows_of(trial.task)) if window.name == name
    )


def measured_part(data: TrialData) -> Recording:
    """The part of the recording in the measured window."""
    window = window_of(data.trial, MEASURED)
    return data.recording().window(window.start, window.stop)


def whole_cycles_shown(trial: Trial) -> Window:
    """The shown window, extended to whole cycles as far as these are measured, else shortened;
    unchanged for a motion without cycles, or measured for less than one cycle.
    """
    shown, measured = window_of(trial, SHOWN), window_of(trial, MEASURED)
    signal = trial.task.base_acceleration
    if not isinstance(signal, Sine):
        return shown
    in_all = math.floor(signal.frequency * (measured.stop - shown.start) + ROUNDING)
    cycles = min(math.ceil(signal.frequency * (shown.stop - shown.start) - ROUNDING), in_all)
    if cycles < 1:
        return shown
    return Window(SHOWN, shown.start, min(measured.stop, shown.start + cycles / signal.frequency))


def largest_of(samples: Array) -> float:
    """Largest deviation (rad) of the measured samples, shape (n,), from their mean.

    The samples are whole cycles of a sinusoidal motion: a partial cycle would shift the mean.
    """
    return float(np.max(np.abs(samples - np.mean(samples))))


def rate_of(recording: Recording) -> float:
    """Samples per second."""
    return (len(recording.time) - 1) / float(np.ptp(recording.time))


def error_of(recording: Recording, task: Task) -> Estimate:
    """Stabilization error of the measured part: over cycles, or over blocks without cycles."""
    samples, signal = recording[POINTING_ERROR], task.base_acceleration
    if len(samples) > 1 and isinstance(signal, Sine):
        return stabilization_error.over_cycles(samples, rate_of(recording) / signal.frequency)
    return stabilization_error.over_blocks(samples)


def found(estimates: Iterable[Estimate]) -> list[Estimate]:
    """Estimates with a finite value, for the archive."""
    return [estimate for estimate in estimates if np.isfinite(estimate.value)]


Measure = Callable[[TrialData], Sequence[Estimate]]


def of_each(group: Iterable[TrialData], measure: Measure, name: str) -> list[Estimate]:
    """One metric of each trial that has it, in order. Raises the errors of `measure`."""
    by_trial = (metrics(data, measure) for data in group)
    return [by_name[name] for by_name in by_trial if name in by_name]


def seen_through(trial: Trial) -> str:
    """Sentence for a table of errors on the bench's high-pass; empty without one."""
    corner = pointing_high_pass(bench_of(trial))
    return f" The bench sees it through a high-pass at {corner:.3g} Hz." if corner > 0 else ""
