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
from campaign.experiments.friction_map.figures import rate_caption, rate_panels
from campaign.experiments.friction_map.points import coefficient_of
from campaign.experiments.motion.account import Motion
from campaign.experiments.shared.captions import amount, sentence
from campaign.result import Array, Axis, Curve, Figure, Mark, Panel
from campaign.text import count

TIME = Axis("Time", "s", "s")


def motion_figure(motion: Motion) -> Figure:
    """Position with its reference, rate, drive torque and tracking error over time."""
    recording = motion.data.recording()
    time = recording.time
    panels = []
    marks = [
        Mark("" if k else "slides", x=each.start, until=each.stop)
        for k, each in enumerate(motion.sliding.points)
    ]
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
    shown = count(len(marks), "steady stretch", "steady stretches")
    steady = f"shaded: {shown}" if marks else "nowhere is it steady"
    top = amount(motion.found["top_rate"].value, "rad/s", "deg/s")
    return Figure(
        key="motion",
        title=f"Motion of {motion.data.trial.label}",
        caption=sentence(f"the axis moves at up to {top}; {steady}") + error,
        alt="Angle, rate and drive torque over time, with the tracking error where a reference was "
        "recorded; steady stretches are shaded.",
        panels=tuple(panels),
        trials=(motion.data.trial.number,),
    )


def friction_figure(motion: Motion) -> Figure:
    """Friction of the steady stretches over their rate, in both directions, with the fits."""
    sliding = motion.sliding
    panels = [panel for each in sliding.maps for panel in rate_panels(each)]
    distances = zip(_distances(motion), sliding.points, strict=True)
    loaded = [(at, point) for at, point in distances if np.isfinite(point.load)]
    if loaded:
        coefficients = [coefficient_of(point, sliding.first) for _, point in loaded]
        at = np.array([distance for distance, _ in loaded])
        panels.append(
            Panel(
                Axis("Distance slid", "rad", "deg"),
                Axis("Friction coefficient"),
                [Curve.of(at, coefficients, "", "measured")],
                "Friction over normal load",
            )
        )
    return Figure(
        key="friction",
        title=f"Friction over rate of {motion.data.trial.label}",
        caption=rate_caption(sliding.maps[0]),
        alt="Friction torque over rate: a dot for each steady stretch, in both directions, and "
        "what was fitted to those of each.",
        panels=tuple(panels),
        across=2,
        trials=(motion.data.trial.number,),
    )


def _distances(motion: Motion) -> list[float]:
    """Total slid distance, in either direction, up to the middle of each stretch."""
    recording = motion.data.recording()
    rate = np.nan_to_num(np.abs(recording[RELATIVE_RATE]))
    slid = np.concatenate(
        [[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(recording.time))]
    )
    middles = [0.5 * (each.start + each.stop) for each in motion.sliding.points]
    return [float(np.interp(at, recording.time, slid)) for at in middles]
