"""All defects of a recording, by the meaning of its channels."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    FRICTION_TORQUE,
    GYRO_RATE,
    JOINT_TORQUE,
    LOAD_RATE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.importing.defects.between import of_rate
from campaign.importing.defects.defect import Array, Defect
from campaign.importing.defects.drives import of_drive, of_drive_delay, of_drive_sign, of_twins
from campaign.importing.defects.samples import continuous, frozen, of_channel, slower

ANGLES = (RELATIVE_ANGLE, MOTOR_ANGLE)
DRIVES = (DRIVE_TORQUE, JOINT_TORQUE, MOTOR_CURRENT)
ASKED = (COMMAND, REFERENCE)
"""Channels that are not measured: they may be constant and may jump."""
TOLD = (*ASKED, FRICTION_TORQUE, LOAD_RATE)
_DERIVATIVES = ((RELATIVE_ANGLE, RELATIVE_RATE), (MOTOR_ANGLE, MOTOR_RATE))
LARGEST = 1e100
"""Largest magnitude of a plausible number, in any unit."""


def find(
    time: Array, channels: Mapping[str, Array], *, gear: float | None = None
) -> tuple[Defect, ...]:
    """All defects of a recording, the worst first.

    Args:
        time: shape (n,), s, even.
        channels: by their name in the vocabulary, each shape (n,), in one system of units.
        gear: ratio of motor to load, if known.
    """
    defects = [*_absurd(channels)]
    channels = {
        name: np.where(np.isinf(values), np.nan, values)  # infinity is no measurement
        for name, values in channels.items()
        if not any(name in each.channels for each in defects)
    }
    sound = {}
    # A channel that follows a held or interpolated command has the same period.
    asked = (slower(name, channels[name]) for name in ASKED if name in channels)
    drawn = {(each.kind, each.size) for own in asked for each in own}
    for name, values in channels.items():
        own = list(of_channel(name, values, angle=name in ANGLES))
        if name not in ASKED:
            own += [each for each in slower(name, values) if (each.kind, each.size) not in drawn]
        defects += own
        scale = next((each.size for each in own if each.kind == "wraparound"), None)
        sound[name] = values if scale is None else continuous(values, scale)
    for name, values in sound.items():
        defects += frozen(name, values) if name not in TOLD else ()
        defects += of_drive(name, values) if name in DRIVES else ()
    if len(time) > 1:
        defects += _between(time, sound, gear)
    return tuple(sorted(defects, key=lambda each: (each.noted, each.rows)))


def _absurd(series: Mapping[str, Array]) -> Iterator[Defect]:
    """Defects for numbers with a magnitude above `LARGEST`: their squares may overflow."""
    for name, values in series.items():
        beyond = np.flatnonzero(np.isfinite(values) & (np.abs(values) > LARGEST))
        if len(beyond):
            first, last = int(beyond[0]), int(beyond[-1])
            what = f"{name} is {values[first]:.3g} in row {first + 1}: no measurement is that large"
            size = float(values[first])
            yield Defect("absurd", (name,), what, (first, last), size)


def _between(time: Array, channels: Mapping[str, Array], gear: float | None) -> list[Defect]:
    defects: list[Defect] = []
    for names in (both for both in _DERIVATIVES if channels.keys() >= set(both)):
        defects += of_rate(time, channels[names[0]], channels[names[1]], names, gear)
    if gear is not None:
        defects += _across_the_gear(time, channels, gear)
    drives = [name for name in DRIVES if name in channels]
    drive = next((name for name in (DRIVE_TORQUE, MOTOR_CURRENT) if name in channels), None)
    moving = _motion(time, channels)
    if drive is not None and moving is not None:
        name, angle, moves = moving
        defects += of_drive_sign(time, angle, moves, channels[drive], (drive, name))
        for each in drives:
            defects += of_drive_delay(time, moves, channels[each], (each, name))
    for pair in combinations(drives, 2):
        defects += of_twins(pair, channels[pair[0]], channels[pair[1]])
    return defects


def _across_the_gear(time: Array, channels: Mapping[str, Array], gear: float) -> Iterator[Defect]:
    """Defects of a rate against the angle across the gear, if its own side has no angle."""
    across = (
        (RELATIVE_ANGLE, RELATIVE_RATE, MOTOR_ANGLE, MOTOR_RATE, gear),
        (MOTOR_ANGLE, MOTOR_RATE, RELATIVE_ANGLE, RELATIVE_RATE, 1.0 / gear),
    )
    for angle, own_rate, own_angle, rate, ratio in across:
        alone = own_rate not in channels and own_angle not in channels
        if alone and angle in channels and rate in channels:
            names = (angle if ratio == 1 else f"{ratio:g} times {angle}", rate)
            for each in of_rate(time, ratio * channels[angle], channels[rate], names):
                yield replace(each, channels=(rate, angle))


def _motion(time: Array, channels: Mapping[str, Array]) -> tuple[str, Array | None, Array] | None:
    """Motion to compare a drive's torque with: name of the rate, angle, rate; None if absent."""
    for angle, rate in _DERIVATIVES:
        if rate in channels:
            return rate, channels.get(angle), channels[rate]
    for angle, _ in _DERIVATIVES:
        if angle in channels and len(time) > 2:
            position = channels[angle]
            step = float(time[-1] - time[0]) / (len(time) - 1)
            return f"the derivative of {angle}", position, np.gradient(position, step)
    return (GYRO_RATE, None, channels[GYRO_RATE]) if GYRO_RATE in channels else None
