"""What excitations come to: what was asked and reached, and inverse dynamics."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate
from campaign.estimation.excitation_design.fourier import STILL
from campaign.estimation.gate import admitted_together
from campaign.estimation.inverse.coefficients import coefficients
from campaign.estimation.inverse.motion import (
    REGRESSION_RATE,
    Filtering,
    Motion,
    decimated,
    first_kept,
    motion_of_position,
)
from campaign.estimation.inverse.regression import Regression
from campaign.estimation.inverse.rows import all_rows, moving, rows
from campaign.estimation.inverse.terms import TERMS, Term
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.common import OF_RECORDING
from campaign.experiments.shared.imported_scale import with_scale
from campaign.experiments.shared.systematic import TORQUE_CONSTANT, with_systematic
from campaign.physics.limits import motion as asked_of
from campaign.recording import Recording
from campaign.result import Array
from campaign.signals import MultiSine
from campaign.trial import Trial

BAND, LOWEST_BAND = 40.0, 25.0
"""Corner of the low-pass of a series: times its highest harmonic, and at least (Hz)."""
FORCES = ("inertia", "viscous", "coulomb", "offset", "gravity", "spring")
"""Beginnings of terms that grow with the torque constant."""


@dataclass(frozen=True)
class Dynamics:
    """An inverse dynamic model of the series of one place, and how well its motion told it.

    Attributes:
        time, torque, predicted: of the rows of the first trial, shape (n,).
        moves: 1 for rows that count, 0 where the axis stands, shape (n,).
        designed: condition number of the columns of the motion that was asked, of unit length.
    """

    fit: Regression
    estimates: Mapping[str, Estimate]
    time: Array
    torque: Array
    predicted: Array
    moves: Array
    designed: float


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


# Inverse dynamics ---------------------------------------------------------------------------------


def filtering_of(trial: Trial) -> Filtering:
    """For rows of a series: its harmonics and what friction adds, not the sensor's noise."""
    options = options_of(trial)
    rate = trial.task.sample_rate / _first_decimation(trial)
    corner = max(LOWEST_BAND, BAND * options.harmonics / options.period)
    corner = min(corner, Filtering.for_rate(rate).low_pass)
    slowest = STILL * asked_of(trial.task).rate
    return Filtering(corner, max(1, round(rate / corner)), slowest=slowest)


def _first_decimation(trial: Trial) -> int:
    """In two steps: a filter that passes as little as a series needs is not exact in one."""
    return max(1, round(trial.task.sample_rate / REGRESSION_RATE))


def motion_of(data: TrialData) -> Motion:
    """How a series moved. Raises ValueError for lost samples, and for a sensor that is dead."""
    recording = data.recording()
    angle, torque = recording[RELATIVE_ANGLE], recording[DRIVE_TORQUE]
    if not np.all(np.isfinite(angle)) or not np.all(np.isfinite(torque)):
        raise ValueError("it has lost samples")
    for name in (RELATIVE_ANGLE, DRIVE_TORQUE):
        if np.ptp(recording[name]) == 0.0:
            raise ValueError(f"{name} never changes: is its sensor connected?")
    fewer = decimated(np.column_stack([angle, torque]), _first_decimation(data.trial))
    low_pass = filtering_of(data.trial).low_pass
    return motion_of_position(_fewer_times(data), fewer[:, 0], fewer[:, 1], low_pass)


def _fewer_times(data: TrialData) -> Array:
    time, factor = data.recording().time, _first_decimation(data.trial)
    return time[first_kept(len(time), factor) :: factor]


def wanted_of(data: TrialData) -> Motion:
    """How it was meant to move."""
    task, time = data.trial.task, _fewer_times(data)
    command = task.command
    if not isinstance(command, MultiSine):
        raise ValueError("its command is no sum of sines")
    angle = command.integral(time, 1) - command.integral(np.zeros(1), 1) + task.start_angle
    rate, acceleration = command.sample(time), command.integral(time, -1)
    return Motion(time, angle, rate, acceleration, np.zeros_like(time))


def dynamics_of(group: Sequence[TrialData]) -> Dynamics:
    """Of all trials of one place together. Raises ValueError where they do not tell the terms."""
    first = group[0]
    options, filtering = options_of(first.trial), filtering_of(first.trial)
    terms = [TERMS[name] for name in options.terms]
    motions = [motion_of(data) for data in group]
    fit, found = coefficients(motions, terms, filtering)
    piece = all_rows(motions[0], terms, filtering)
    scaled = {name: _with_constants(each, first) for name, each in found.items()}
    matters = dict(zip(options.terms, map(float, fit.matters), strict=True))
    return Dynamics(
        fit,
        admitted_together(scaled, matters),
        piece.time,
        piece.force,
        piece.columns @ fit.values,
        moving(motions[0], filtering),
        _designed(wanted_of(first), terms, filtering),
    )


def _designed(wanted: Motion, terms: Sequence[Term], filtering: Filtering) -> float:
    """Through the same filters as what was measured."""
    columns = rows(wanted, terms, filtering).columns
    length = np.linalg.norm(columns, axis=0)
    return float(np.linalg.cond(columns / length)) if np.all(length > 0) else math.inf


def _with_constants(one: Estimate, data: TrialData) -> Estimate:
    """With what a wrong constant of the torque would do to it."""
    if not one.has_interval or not one.name.startswith(FORCES):
        return one
    bench = bench_of(data.trial)
    if bench.motor is not None and not data.trial.recording:
        one = with_systematic(one, bench, TORQUE_CONSTANT, one.value)
    return with_scale(replace(one), data, DRIVE_TORQUE)
