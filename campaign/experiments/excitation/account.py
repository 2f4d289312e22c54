"""Requested and reached excitation of each trial."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.experiments.any_motion.motions import moved
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.common import OF_RECORDING
from campaign.physics.limits import motion as asked_of
from campaign.recording import Recording
from campaign.result import Array
from campaign.trial import Trial


def options_of(trial: Trial) -> ExcitationOptions:
    """Of a trial, as it was planned."""
    return ExcitationOptions.model_validate(trial.options, context={"si": True})


def measured_part(trial: Trial, recording: Recording) -> slice:
    """The samples that are measured: whole periods from the end, or all of them."""
    options, rate = options_of(trial), trial.task.sample_rate
    count = len(recording.time)
    if options.signal != "multisine":
        return slice(0, count)
    return slice(count - round(options.periods * options.period * rate), count)


def metrics_of(data: TrialData) -> Iterator[Estimate]:
    """What was commanded and what came of it, of one trial."""
    trial, recording = data.trial, data.recording()
    cut = measured_part(trial, recording)
    unit = "N m" if trial.task.mode == "torque" else "rad/s"
    command = trial.task.command.sample(recording.time[cut])
    rms = float(np.sqrt(np.mean(command**2)))
    yield _plain("command_peak", float(np.max(np.abs(command))), unit)
    yield _plain("command_rms", rms, unit)
    yield _plain("crest_factor", float(np.max(np.abs(command))) / max(rms, 1e-300), "")
    asked = asked_of(trial.task)
    if trial.task.mode == "rate":
        yield _plain("asked_angle", asked.angle, "rad")
        yield _plain("asked_rate", asked.rate, "rad/s")
    if RELATIVE_ANGLE in recording.channels:
        yield _plain("top_angle", _largest(recording[RELATIVE_ANGLE]), "rad")
    yield _plain("top_rate", _largest(reached_rate(data)[1]), "rad/s")
    torque = recording[DRIVE_TORQUE]
    yield _plain("peak_torque", _largest(torque), "N m")
    yield _plain("rms_torque", _rms(torque[cut]), "N m")


def _largest(samples: Array) -> float:
    known = np.abs(samples[np.isfinite(samples)])
    return float(np.max(known)) if known.size else math.nan


def _rms(samples: Array) -> float:
    known = samples[np.isfinite(samples)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def _plain(name: str, value: float, unit: str) -> Estimate:
    return Estimate.without_interval(name, value, unit, OF_RECORDING())


def reached_rate(data: TrialData) -> tuple[Array, Array]:
    """Times and rate of the part that is measured, each (n,); of a series as its angle has it."""
    if options_of(data.trial).signal == "fourier":
        motion = motion_of(data)
        return motion.time, motion.rate
    recording = data.recording()
    cut = measured_part(data.trial, recording)
    return recording.time[cut], recording[GYRO_RATE][cut]


def motion_of(data: TrialData) -> Motion:
    """How a series moved: its longest part without a lost sample. Raises ValueError for none."""
    pieces = moved((data,), FilterSettings.for_rate(data.trial.task.sample_rate))
    return max((each.motion for each in pieces), key=lambda motion: len(motion.time))
