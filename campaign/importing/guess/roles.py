"""From a quantity, and what else a name says, to a channel of the vocabulary."""

from __future__ import annotations

from campaign.channels import (
    BASE_RATE,
    COMMAND,
    DRIVE_TORQUE,
    GYRO_RATE,
    JOINT_TORQUE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    NORMAL_LOAD,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    TEMPERATURE,
)
from campaign.importing.guess.quantities import FORCES, UNKNOWN, has
from campaign.importing.guess.stated import stated_unit


def role_of(kind: str, said: list[str], unit: str) -> tuple[str, bool]:
    """The channel, and whether the name says its side of the gear."""
    target, motor, load = (has(said, each) for each in ("target", "motor", "load"))
    target = target or kind == "target" or (said[:1] == ["input"] and len(said) > 1)
    if kind == "warmth":
        return (UNKNOWN if target else TEMPERATURE), True
    if kind == "normal":
        return NORMAL_LOAD, True
    if target:
        return (REFERENCE if kind == "angle" else COMMAND), False
    if kind == "angle":
        return (MOTOR_ANGLE, True) if motor and not load else (RELATIVE_ANGLE, load)
    if kind == "current":
        return MOTOR_CURRENT, True
    return _rate(said, unit) if kind == "rate" else _torque(said)


def _rate(said: list[str], unit: str) -> tuple[str, bool]:
    if has(said, "hull"):
        return BASE_RATE, True
    if has(said, "gyro"):
        return GYRO_RATE, True
    load = has(said, "load")
    rotor = has(said, "motor") or not {"drehzahl", "rpm"}.isdisjoint(said)
    rotor = (rotor or stated_unit(unit)[1] == "rpm") and not has(said, "friction")
    return (MOTOR_RATE, True) if rotor and not load else (RELATIVE_RATE, load)


def _torque(said: list[str]) -> tuple[str, bool]:
    component = next((word for word in said if word in FORCES), "")
    if not component and len(said) > 1 and said[0] == "f":
        component = f"f{said[1]}"
    if component in FORCES and not has(said, "motor"):
        return FORCES[component], True
    if has(said, "normal"):
        return NORMAL_LOAD, True
    sensed = has(said, "sensor") or has(said, "friction") or said == ["ff"] or "j" in said[1:]
    return (JOINT_TORQUE, True) if sensed else (DRIVE_TORQUE, False)
