"""Figures of a recorded motion: its course, and friction where it is steady."""

from __future__ import annotations

import numpy as np

from campaign.channels import (
    DRIVE_TORQUE,
    JOINT_TORQUE,
    NORMAL_LOAD,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.experiments.motion.account import Motion
from campaign.experiments.shared.captions import amount, sentence
from campaign.experiments.shared.conclusion_parts import count
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel, ends_of

TIME = Axis("Time", "s", "s")
FINE = 60
"""Points of a line with its band."""


def motion_figure(motion: Motion, suffix: str) -> Figure:
    """Position with its reference, rate, drive torque and tracking error over time."""
    recording = motion.data.recording()
    time = recording.time
    panels = []
    marks = [Mark("", x=each.first, until=each.last) for each in motion.stretches]
    if RELATIVE_ANGLE in recording.channels:
        angle = [Curve(time, recording[RELATIVE_ANGLE], "measured", "measured")]
        if REFERENCE in recording.channels:
            angle.append(Curve(time, recording[REFERENCE], "reference", "reference", "thin"))
        panels.append(Panel(TIME, Axis("Angle", "rad", "deg"), angle, "Angle of the load"))
    rate = Curve(time, recording[RELATIVE_RATE], "", "measured")
    panels.append(Panel(TIME, Axis("Rate", "rad/s", "deg/s"), [rate], "Rate of the load", marks))
    for name, label in ((DRIVE_TORQUE, "Drive torque"), (JOINT_TORQUE, "Torque in the joint")):
        if name in recording.channels:
            torque = Curve(time, recording[name], "", "measured")
            panels.append(Panel(TIME, Axis(label, "N m", "N m"), [torque], label))
    error = ""
    if REFERENCE in recording.channels and RELATIVE_ANGLE in recording.channels:
        off: Array = recording[REFERENCE] - recording[RELATIVE_ANGLE]
        curve = Curve(time, off, "", "measured")
        axis = Axis("Tracking error", "rad", "mrad")
        panels.append(Panel(TIME, axis, [curve], "Reference less angle"))
        error = (
            f" The tracking error is {amount(motion.found['rms_error'].value, 'rad', 'mrad')} "
            f"(RMS), at most {amount(motion.found['peak_error'].value, 'rad', 'mrad')}."
        )
    if NORMAL_LOAD in recording.channels:
        load = Curve(time, recording[NORMAL_LOAD], "", "measured")
        panels.append(Panel(TIME, Axis("Normal load", "N", "N"), [load], "Normal load"))
    steady = f"shaded: {_stretches(motion)}" if motion.stretches else "nowhere is it steady"
    top = amount(motion.found["top_rate"].value, "rad/s", "deg/s")
    return Figure(
        key=f"motion{suffix}",
        title=f"Motion of {motion.data.trial.label}",
        caption=sentence(f"the axis moves at up to {top}; {steady}") + error,
        alt="Angle, rate and drive torque over time, with the tracking error where a reference was "
        "recorded; steady stretches are shaded.",
        panels=tuple(panels),
        trials=(motion.data.trial.number,),
    )


def friction_figure(motion: Motion, suffix: str) -> Figure:
    """Friction of the steady stretches over their rate, both directions, with lines."""
    curves: list[Curve] = []
    against: list[Curve] = []
    for direction, sign in (("positive", 1.0), ("negative", -1.0)):
        own = [each for each in motion.stretches if each.direction == direction]
        if not own:
            continue
        rate = np.array([each.rate.value for each in own])
        label = f"{direction} direction"
        curves.append(Curve.of(rate, [each.torque for each in own], label, direction))
        ends = np.array([sorted(sign * e for e in ends_of(each.torque)) for each in own])
        torque = sign * np.array([each.torque.value for each in own])
        against.append(
            Curve(sign * rate, torque, label, direction, "points", low=ends[:, 0], high=ends[:, 1])
        )
        line = motion.lines.get(direction)
        if line is not None:
            speed = np.linspace(float(np.abs(rate).min()), float(np.abs(rate).max()), FINE)
            low, high = line.band(speed)
            middle = line.coulomb.value + line.viscous.value * speed
            edges = (low, high) if sign > 0 else (-high, -low)
            curves.append(
                Curve(sign * speed, sign * middle, "", direction, low=edges[0], high=edges[1])
            )
            against.append(Curve(speed, middle, "", direction, low=low, high=high))
    panels = [
        Panel(
            Axis("Rate", "rad/s", "deg/s"),
            Axis("Friction torque", "N m", "N m"),
            curves,
            "Friction of steady stretches",
        ),
        Panel(
            Axis("Speed", "rad/s", "deg/s"),
            Axis("Friction, in its direction", "N m", "N m"),
            against,
            "Both directions",
        ),
    ]
    distances = zip(_distances(motion), motion.stretches, strict=True)
    loaded = [(at, each.coefficient) for at, each in distances if each.coefficient is not None]
    if loaded:
        found = [ratio for _, ratio in loaded]
        at = np.array([distance for distance, _ in loaded])
        panels.append(
            Panel(
                Axis("Distance slid", "rad", "deg"),
                Axis("Friction coefficient"),
                [Curve.of(at, found, "", "measured")],
                "Friction over normal load",
            )
        )
    lines = "Lines: Coulomb and viscous friction of each direction, with their 95 % band; " * bool(
        motion.lines
    )
    return Figure(
        key=f"friction{suffix}",
        title=f"Friction over rate of {motion.data.trial.label}",
        caption=f"Mean torque of {_stretches(motion)} over the mean rate. {lines}bars: "
        "95 % of each stretch alone, without what differs between them.",
        alt="Friction torque over rate: a dot for each steady stretch, in both directions, and a "
        "straight line through those of each.",
        panels=tuple(panels),
        across=2,
        trials=(motion.data.trial.number,),
    )


def _stretches(motion: Motion) -> str:
    return count(len(motion.stretches), "steady stretch", "steady stretches")


def _distances(motion: Motion) -> list[float]:
    """How far the axis had slid in all by the middle of each stretch, whichever way."""
    recording = motion.data.recording()
    rate = np.nan_to_num(np.abs(recording[RELATIVE_RATE]))
    slid = np.concatenate(
        [[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(recording.time))]
    )
    middles = [0.5 * (each.first + each.last) for each in motion.stretches]
    return [float(np.interp(at, recording.time, slid)) for at in middles]
