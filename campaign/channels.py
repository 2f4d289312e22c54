"""Vocabulary of channels: meaning, unit and label by name.

All analyses read channels by these names; `campaign kinds channels` lists them. Other names are
allowed: they are archived as their backend declares them, and no shipped analysis reads them.

Quantity and kind of axis determine the unit: a linear axis has the same names with other units, its
`gyro_rate` is in m/s, its `drive_torque` is a force in N.

All channels of a trial share one time base. A slower channel is held: each sample is the last value
known at its time, at the beginning the value from before the trial. It is never interpolated and
never filled with NaN, which means lost samples only. `ChannelInfo.own_rate` is its update rate
(Hz). For a faster channel the trial is recorded at its rate, and the other channels are held.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import lru_cache

from campaign.axis_kind import AxisKind as AxisKind  # known by this name to backends
from campaign.axis_kind import Sides, axis_unit, in_axis_terms
from campaign.recording import ChannelInfo
from campaign.units import factor

MOST = 256
"""Maximum number of channels of a recording."""
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")

COMMAND = "command"
REFERENCE = "reference"
BASE_RATE = "base_rate"
GYRO_RATE = "gyro_rate"
RELATIVE_RATE = "relative_rate"
RELATIVE_ANGLE = "relative_angle"
MOTOR_ANGLE = "motor_angle"
MOTOR_RATE = "motor_rate"
MOTOR_CURRENT = "motor_current"
DRIVE_TORQUE = "drive_torque"
JOINT_TORQUE = "joint_torque"
POINTING_ERROR = "pointing_error"
COMPENSATION_TORQUE = "compensation_torque"
NORMAL_LOAD = "normal_load"
TEMPERATURE = "temperature"
FRICTION_TORQUE = "friction_torque"
LOAD_RATE = "load_rate"


class Quantity(StrEnum):
    """Quantity of a channel; the terms of a rotary axis apply to both kinds."""

    ANGLE = "angle"
    DEVIATION = "deviation"  # also an angle, displayed in thousandths
    RATE = "rate"
    TORQUE = "torque"
    FORCE = "force"  # on either kind of axis
    CURRENT = "current"
    TEMPERATURE = "temperature"
    DEPENDS = "by mode"  # of the task: see `COMMANDS`


class Side(StrEnum):
    """Part of the bench that a channel describes, hence the side of the gear."""

    LOAD = "load"
    MOTOR = "motor"
    HULL = "hull"
    NONE = "none"


class KnownBy(StrEnum):
    """Source that can provide the values of a channel."""

    SENSOR = "sensor"
    CONTROLLER = "controller"  # computes or receives them
    SIMULATOR = "simulator"  # only a simulation: no bench has a sensor for the truth


@dataclass(frozen=True)
class ChannelMeaning:
    """Meaning of a channel name, the same for all backends.

    Attributes:
        label: displayed label on a rotary axis.
        meaning: one sentence.
        linear_label: label on a linear axis, if `in_axis_terms` does not provide it.
    """

    name: str
    quantity: Quantity
    side: Side
    known_by: KnownBy
    label: str
    meaning: str
    linear_label: str = ""


_LOAD, _MOTOR, _HULL, _NONE = Side
_SENSOR, _CONTROLLER, _SIMULATOR = KnownBy

VOCABULARY = {
    meaning.name: meaning
    for meaning in (
        ChannelMeaning(
            COMMAND,
            Quantity.DEPENDS,
            _LOAD,
            _CONTROLLER,
            "Command",
            "What was commanded at that moment: a rate or a torque, as the task's mode says.",
        ),
        ChannelMeaning(
            REFERENCE,
            Quantity.ANGLE,
            _LOAD,
            _CONTROLLER,
            "Reference of the angle",
            "Where the load should be relative to the hull, for a loop that follows an angle.",
        ),
        ChannelMeaning(
            BASE_RATE,
            Quantity.RATE,
            _HULL,
            _SENSOR,
            "Rate of the hull",
            "Rate of the hull in space, about the axis.",
        ),
        ChannelMeaning(
            GYRO_RATE,
            Quantity.RATE,
            _LOAD,
            _SENSOR,
            "Rate of the load (gyro)",
            "Rate of the load in space, as its gyro shows it.",
            "Rate of the load (inertial)",
        ),
        ChannelMeaning(
            RELATIVE_RATE,
            Quantity.RATE,
            _LOAD,
            _SENSOR,
            "Rate of the load relative to the hull",
            "Rate of the load relative to the hull: where friction acts.",
        ),
        ChannelMeaning(
            RELATIVE_ANGLE,
            Quantity.ANGLE,
            _LOAD,
            _SENSOR,
            "Angle of the load relative to the hull",
            "Angle of the load relative to the hull, as the encoder shows it.",
        ),
        ChannelMeaning(
            MOTOR_ANGLE,
            Quantity.ANGLE,
            _MOTOR,
            _SENSOR,
            "Angle of the motor",
            "Angle of the motor shaft, before the gear.",
        ),
        ChannelMeaning(
            MOTOR_RATE,
            Quantity.RATE,
            _MOTOR,
            _SENSOR,
            "Rate of the motor",
            "Rate of the motor shaft, before the gear.",
        ),
        ChannelMeaning(
            MOTOR_CURRENT,
            Quantity.CURRENT,
            _MOTOR,
            _SENSOR,
            "Motor current",
            "Current through the motor, by its sensor.",
        ),
        ChannelMeaning(
            DRIVE_TORQUE,
            Quantity.TORQUE,
            _LOAD,
            _CONTROLLER,
            "Drive torque at the load",
            "Torque of the drive as seen at the load: motor current, torque constant and gear.",
        ),
        ChannelMeaning(
            JOINT_TORQUE,
            Quantity.TORQUE,
            _LOAD,
            _SENSOR,
            "Torque in the joint",
            "Torque between gear and load, by a sensor that sits there.",
        ),
        ChannelMeaning(
            POINTING_ERROR,
            Quantity.DEVIATION,
            _LOAD,
            _CONTROLLER,
            "Integrated gyro rate",
            "Integral of the gyro's rate: how far the load has moved in space.",
            "Integrated inertial rate",
        ),
        ChannelMeaning(
            COMPENSATION_TORQUE,
            Quantity.TORQUE,
            _LOAD,
            _CONTROLLER,
            "Compensation torque",
            "What the friction compensation adds, as seen at the load.",
        ),
        ChannelMeaning(
            NORMAL_LOAD,
            Quantity.FORCE,
            _NONE,
            _SENSOR,
            "Normal load",
            "Force that presses the rubbing surfaces together.",
        ),
        ChannelMeaning(
            TEMPERATURE,
            Quantity.TEMPERATURE,
            _NONE,
            _SENSOR,
            "Temperature",
            "Temperature of the bench near its friction; the label says of what.",
        ),
        ChannelMeaning(
            FRICTION_TORQUE,
            Quantity.TORQUE,
            _LOAD,
            _SIMULATOR,
            "True friction torque",
            "Friction of the whole axis as seen at the load.",
        ),
        ChannelMeaning(
            LOAD_RATE,
            Quantity.RATE,
            _LOAD,
            _SIMULATOR,
            "True rate of the load",
            "Rate of the load in space without what a sensor adds.",
        ),
    )
}

COMMANDS = {
    "rate": (Quantity.RATE, "Commanded rate"),
    "torque": (Quantity.TORQUE, "Commanded torque"),
    "prescribed": (Quantity.RATE, "Prescribed relative rate"),
    "spring": (Quantity.ANGLE, "Angle of the spring's far end"),
}
"""(Quantity, label) of the command by mode of the task."""

_ROTARY = {
    Quantity.ANGLE: ("rad", "deg"),
    Quantity.DEVIATION: ("rad", "mrad"),
    Quantity.RATE: ("rad/s", "deg/s"),
    Quantity.TORQUE: ("N m", "N m"),
    Quantity.FORCE: ("N", "N"),
    Quantity.CURRENT: ("A", "A"),
    # The usual unit of sensors: units convert by factors only, and no factor converts K to degC.
    Quantity.TEMPERATURE: ("degC", "degC"),
    Quantity.DEPENDS: ("", ""),
}
UNITS = {
    kind: {
        quantity: (axis_unit(unit, Sides(kind)), axis_unit(display, Sides(kind)))
        for quantity, (unit, display) in _ROTARY.items()
    }
    for kind in AxisKind
}
"""(SI unit, display unit) by kind of axis and quantity."""


@lru_cache(maxsize=512)
def info(
    name: str, mode: str = "", *, axis: AxisKind = AxisKind.ROTARY, own_rate: float | None = None
) -> ChannelInfo:
    """Announcement of a channel of the vocabulary. Raises KeyError for other names.

    Args:
        mode: mode of the task; affects only the command.
        axis: kind of axis of the channel's side of the gear: a rotary motor may drive a linear
            load.
        own_rate: update rate of a slower channel (Hz): see the module.
    """
    what = VOCABULARY[name]
    quantity, label = what.quantity, what.label
    if name == COMMAND and mode in COMMANDS:
        quantity, label = COMMANDS[mode]
    if axis == AxisKind.LINEAR:
        label = what.linear_label or in_axis_terms(label, Sides(axis, axis))
    unit, display_unit = UNITS[axis][quantity]
    measured = what.known_by is not KnownBy.SIMULATOR
    return ChannelInfo(name, unit, label, display_unit, measured, own_rate)


def wrong_names(names: Sequence[object]) -> str:
    """Why `names` are invalid as channel names of a recording; empty if they are valid."""
    if not 0 < len(names) <= MOST:
        return f"{len(names) or 'no'} channels were announced; a recording has 1 to {MOST}"
    for name in names:
        if not isinstance(name, str) or not _NAME.fullmatch(name) or name == "time":
            return f"{name!r} cannot name a channel: letters, digits and '_', not 'time'"
    twice = next((name for name in names if names.count(name) > 1), None)
    return f"two channels are called {twice!r}" if twice else ""


def axis_of(name: str, sides: Sides) -> AxisKind:
    """Kind of axis of a channel's side of the gear: of the motor, or of the load."""
    what = VOCABULARY.get(name)
    return sides.motor if what is not None and what.side is Side.MOTOR else sides.load


def unit_of(name: str, mode: str, sides: Sides) -> str:
    """Unit of a channel by the motion of its side; "" for a name outside of the vocabulary."""
    return info(name, mode, axis=axis_of(name, sides)).unit if name in VOCABULARY else ""


def in_known_unit(channel: ChannelInfo, mode: str, sides: Sides) -> tuple[ChannelInfo, float]:
    """Convert a channel to the unit of the vocabulary; the channel, and the factor of its samples.

    Raises ValueError if no factor converts its unit. Channels of other names keep their unit.
    """
    unit = unit_of(channel.name, mode, sides)
    # The quantity of a command depends on the closed loop, which may differ in a recording.
    of_commands = {UNITS[sides.load][quantity][0] for quantity, _ in COMMANDS.values()}
    if (
        not unit
        or channel.unit == unit
        or (channel.name == COMMAND and channel.unit in of_commands)
    ):
        return channel, 1.0
    try:
        times = factor(channel.unit, unit)
    except ValueError:
        raise ValueError(
            f"{channel.name} was announced in {channel.unit!r}, which cannot be converted into "
            f"{unit!r}"
        ) from None
    display = info(channel.name, mode, axis=axis_of(channel.name, sides)).display_unit
    return replace(channel, unit=unit, display_unit=display), times


def missing(required: Iterable[str], available: Collection[str]) -> tuple[str, ...]:
    """The required names that are not available, in their order."""
    return tuple(name for name in required if name not in available)


def meaning_in_sentence(name: str) -> str:
    """Meaning without capital and full stop; empty if the name is not in the vocabulary."""
    text = VOCABULARY[name].meaning.removesuffix(".") if name in VOCABULARY else ""
    return f"{text[:1].lower()}{text[1:]}"


def explained(name: str) -> str:
    """Name with its meaning, for messages; only the name if it is not in the vocabulary."""
    return f"{name} ({meaning_in_sentence(name)})" if name in VOCABULARY else name
