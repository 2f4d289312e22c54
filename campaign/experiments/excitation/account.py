"""Requested and reached excitation: numbers of each trial, and their table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate
from campaign.estimation.inverse.motion import FilterSettings, Motion
from campaign.experiments.any_motion.motions import moved
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.interface import TrialData, bench_of, validated
from campaign.experiments.shared.common import OF_RECORDING, of_recording
from campaign.physics.complete import limits_of
from campaign.physics.limits import motion as asked_of
from campaign.recording import Recording
from campaign.result import Array, Cell, Column, Table
from campaign.trial import Trial


def options_of(trial: Trial) -> ExcitationOptions:
    """Options of a trial, as planned."""
    return validated(ExcitationOptions, trial.options)


def measured_part(trial: Trial, recording: Recording) -> slice:
    """The measured samples: whole periods before the end for a multisine, else all."""
    options, rate = options_of(trial), trial.task.sample_rate
    count = len(recording.time)
    if options.signal != "multisine":
        return slice(0, count)
    return slice(count - round(options.periods * options.period * rate), count)


def metrics_of(data: TrialData) -> Iterator[Estimate]:
    """Numbers of the command and the reached motion of one trial."""
    trial, recording = data.trial, data.recording()
    cut = measured_part(trial, recording)
    unit = "N m" if trial.task.mode == "torque" else "rad/s"
    command = trial.task.command.sample(recording.time[cut])
    rms = float(np.sqrt(np.mean(command**2)))
    yield of_recording("command_peak", float(np.max(np.abs(command))), unit)
    yield of_recording("command_rms", rms, unit)
    yield of_recording("crest_factor", float(np.max(np.abs(command))) / max(rms, 1e-300), "")
    asked = asked_of(trial.task)
    if trial.task.mode == "rate":
        yield of_recording("asked_angle", asked.angle, "rad")
        yield of_recording("asked_rate", asked.rate, "rad/s")
    if RELATIVE_ANGLE in recording.channels:
        yield of_recording("top_angle", _largest(recording[RELATIVE_ANGLE]), "rad")
    yield of_recording("top_rate", _largest(reached_rate(data)[1]), "rad/s")
    torque = recording[DRIVE_TORQUE]
    yield of_recording("peak_torque", _largest(torque), "N m")
    yield of_recording("rms_torque", _rms(torque[cut]), "N m")


def _largest(samples: Array) -> float:
    known = np.abs(samples[np.isfinite(samples)])
    return float(np.max(known)) if known.size else math.nan


def _rms(samples: Array) -> float:
    known = samples[np.isfinite(samples)]
    return float(np.sqrt(np.mean(known**2))) if known.size else math.nan


def reached_rate(data: TrialData) -> tuple[Array, Array]:
    """Times and rate of the measured part, each (n,); for a series the rate from its angle."""
    if options_of(data.trial).signal == "fourier":
        motion = motion_of(data)
        return motion.time, motion.rate
    recording = data.recording()
    cut = measured_part(data.trial, recording)
    return recording.time[cut], recording[GYRO_RATE][cut]


def motion_of(data: TrialData) -> Motion:
    """Longest part of a series without a lost sample. Raises ValueError for none."""
    pieces = moved((data,), FilterSettings.for_rate(data.trial.task.sample_rate))
    return max((each.motion for each in pieces), key=lambda motion: len(motion.time))


Account = tuple[TrialData, Mapping[str, Estimate]]
USED = (("top_angle", "angle"), ("top_rate", "rate"), ("peak_torque", "torque"))
"""Metrics, and the limits to which they are compared."""


def reached_tables(accounts: Sequence[Account]) -> Iterator[Table]:
    """Requested and reached numbers of each trial; one table for each mode."""
    modes = dict.fromkeys(data.trial.task.mode for data, _ in accounts)
    for mode in modes:
        own = [each for each in accounts if each[0].trial.task.mode == mode]
        yield _reached(own, mode, f"-{mode}" if len(modes) > 1 else "")


def _reached(accounts: Sequence[Account], mode: str, suffix: str) -> Table:
    in_torque = mode == "torque"
    unit, display = ("N m", "N m") if in_torque else ("rad/s", "deg/s")
    asked = () if in_torque else (Column("asked_angle", "Angle asked", "rad", "deg", exact=True),)
    return Table(
        key=f"reached{suffix}",
        title="Commanded and reached excitation",
        columns=(
            Column("trial", "Trial"),
            Column("realisation", "Realisation", exact=True),
            Column("command_peak", "Largest command", unit, display, exact=True),
            Column("command_rms", "RMS", unit, display, exact=True),
            Column("crest_factor", "Crest factor", exact=True),
            *asked,
            Column("top_angle", "Angle reached", "rad", "deg", reason=OF_RECORDING()),
            Column("top_rate", "Rate reached", "rad/s", "deg/s", reason=OF_RECORDING()),
            Column("peak_torque", "Torque reached", "N m", "N m", reason=OF_RECORDING()),
            Column("used", "Of its limit", "", "percent", reason=OF_RECORDING()),
            Column("limit", "Nearest limit"),
        ),
        rows=tuple(_row(data, found) for data, found in accounts),
        note="Largest magnitudes; the crest factor is the largest command over its RMS. What came "
        "nearest to its limit is in the last two columns.",
    )


def _row(data: TrialData, found: Mapping[str, Estimate]) -> dict[str, Cell]:
    limits = limits_of(bench_of(data.trial))
    shares = {
        name: found[metric].value / getattr(limits, name)
        for metric, name in USED
        if metric in found and math.isfinite(found[metric].value)
    }
    nearest = max(shares, key=lambda name: shares[name], default=None)
    realisation = data.trial.point.get("realisation")
    return {
        "trial": data.trial.name,
        "realisation": realisation if isinstance(realisation, int) else None,
        **{name: found[name].value for name in ("command_peak", "command_rms", "crest_factor")},
        "asked_angle": found["asked_angle"].value if "asked_angle" in found else None,
        **{name: found.get(name) for name, _ in USED},
        "used": None if nearest is None else shares[nearest],
        "limit": nearest,
    }
