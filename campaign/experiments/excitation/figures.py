"""Figures of excitations: requested and reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np

from campaign.channels import DRIVE_TORQUE
from campaign.experiments.excitation.account import (
    measured_part,
    motion_of,
    options_of,
    reached_rate,
)
from campaign.experiments.interface import TrialData
from campaign.experiments.responses.figures import FREQUENCY, decibel
from campaign.experiments.shared.captions import setting
from campaign.result import Array, Axis, Curve, Figure, Panel, Style
from campaign.signals import MultiSine

TIME = Axis("Time", "s", "s")
SHOWN = 20.0
"""s; longest drawn part of a course."""
CYCLES = 40.0
"""Largest number of drawn cycles of the highest frequency: more are a black band."""
SEGMENTS = 16
"""of a course without a period, for its spectrum."""
FLOOR = -80.0
"""dB; lower levels are not drawn."""


def command_figure(group: Sequence[TrialData]) -> Figure:
    """Course and spectrum of the command of the first trial, and of the reached motion."""
    data = group[0]
    trial, recording = data.trial, data.recording()
    options, command = options_of(trial), trial.task.command
    in_torque = trial.task.mode == "torque"
    time, reached = reached_rate(data)
    if in_torque:
        reached = recording[DRIVE_TORQUE][measured_part(trial, recording)]
    axis = Axis("Torque", "N m", "N m") if in_torque else Axis("Rate", "rad/s", "deg/s")
    setpoint = command.sample(time)
    length, part = SHOWN, f"up to {setting(SHOWN, 's')} of it"
    if isinstance(command, MultiSine):
        length, part = options.period, "one period"
        if CYCLES / max(command.frequencies) < length:
            length, part = CYCLES / max(command.frequencies), "the beginning of a period"
    shown = time - time[0] <= length
    course = [
        Curve(time[shown], setpoint[shown], "asked", "reference"),
        Curve(time[shown], reached[shown], "reached", "measured", "thin"),
    ]
    several = " Of several trials the first is drawn." if len(group) > 1 else ""
    return Figure(
        key="command",
        title="Command and response",
        caption=f"Left, {part}; right, where in frequency the command has its power, and what came "
        f"of it there, both over the largest of the command.{several}",
        alt="Command and measured course over time, and the levels of both over frequency.",
        panels=(
            Panel(TIME, axis, course),
            _spectrum(command, setpoint, reached, 1.0 / (time[1] - time[0])),
        ),
        across=2,
        trials=(trial.number,),
    )


def _spectrum(command: object, asked: Array, reached: Array, rate: float) -> Panel:
    if isinstance(command, MultiSine):
        at = np.round(np.array(command.frequencies) * len(asked) / rate).astype(int)
        frequency, lines = np.array(command.frequencies), True
        one, other = (np.abs(np.fft.rfft(_filled(each)))[at] for each in (asked, reached))
    else:
        from scipy.signal import welch

        length = max(8, len(asked) // SEGMENTS)
        lines = False
        frequency, one = welch(asked, rate, nperseg=length)
        other = np.sqrt(welch(_filled(reached), rate, nperseg=length)[1])
        one = np.sqrt(one)
    largest = max(float(np.max(one)), 1e-300)
    curves = []
    style: Style
    for values, label, series in ((one, "asked", "reference"), (other, "reached", "measured")):
        level = decibel(values / largest)
        seen = (level > FLOOR) & (frequency > 0)
        style = ("points" if series == "reference" else "line+points") if lines else "line"
        curves.append(Curve(frequency[seen], level[seen], label, series, style))
    return Panel(FREQUENCY, Axis("Level, dB of the largest asked"), curves)


def _filled(samples: Array) -> Array:
    """Samples with zeros for lost ones: for drawing only."""
    return np.asarray(np.nan_to_num(samples))


def plane_figure(group: Sequence[TrialData]) -> Figure:
    """Path of a series in angle and rate, requested and reached."""
    data = group[0]
    moved, task = motion_of(data), data.trial.task
    first = slice(round(options_of(data.trial).period * task.sample_rate) + 1)
    time = moved.time[first]
    command = cast("MultiSine", task.command)
    angle = command.integral(time, 1) - command.integral(np.zeros(1), 1) + task.start_angle
    return Figure(
        key="plane",
        title="Path of the series",
        caption="Rate over angle of one period, setpoint and measured. Friction is determined at "
        "the rates of the path, torques that depend on position at its angles.",
        alt="Rate over angle, setpoint and measured.",
        panels=(
            Panel(
                Axis("Angle", "rad", "deg"),
                Axis("Rate", "rad/s", "deg/s"),
                [
                    Curve(angle, command.sample(time), "asked", "reference"),
                    Curve(moved.position[first], moved.rate[first], "reached", "measured", "thin"),
                ],
            ),
        ),
        trials=(data.trial.number,),
    )
