"""Scale between numbers of a drive and SI values at the load."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.objects import Item

INCREMENTS, TURNS, RADIANS, DEGREES = 0xB5, 0xB4, 0x10, 0x41
"""Codes of units in 60A8h and 60A9h (CiA 303-2 and its use in CiA 402)."""
PER_TURN = {TURNS: 1.0, RADIANS: 2 * math.pi, DEGREES: 360.0}
SECONDS = {0x03: 1.0, 0x47: 60.0}
"""Time in s by the codes of 1/s and 1/min."""
PER_MILLE = 1e-3

Read = Callable[[Item], int | None]
"""Reads an object of the drive; None for a missing one. Raises DriveError."""


@dataclass(frozen=True)
class Scale:
    """Numbers of the drive per SI unit at the load; negative for the opposite direction.

    Attributes:
        position: 6064h per rad.
        rate: 606Ch and 60FFh per rad/s; also accelerations per rad/s^2.
        torque: 6077h and 6071h per N m at the load.
        current: 6078h per A.
        motor_rate: 6080h (1/min at the motor) per rad/s of the load.
    """

    position: float
    rate: float
    torque: float
    current: float
    motor_rate: float


def scale_of(
    read: Read,
    *,
    ratio: float,
    reverse: bool,
    units_per_turn: float | None,
    rate_units: float | None,
    rated_torque: float | None,
    rated_current: float | None,
) -> Scale:
    """Scale from the drive's factors, or from options.

    Args:
        ratio: motor rate divided by load rate, of the bench.
        reverse: whether the drive's direction is opposite.
        units_per_turn: units of 6064h per turn of the load.
        rate_units: units of 606Ch at one turn of the load per second.
        rated_torque, rated_current: N m of the motor and A; they replace 6076h and 6075h.

    Raises DriveError that names a missing object and the option that replaces it.
    """
    sign = -1.0 if reverse else 1.0
    turn = units_per_turn or _units_per_turn(read, ratio)
    rate = rate_units or _rate_units(read, turn, ratio)
    torque = rated_torque or _rated(read, od.RATED_TORQUE, "rated_torque") * 1e-3
    current = rated_current or _rated(read, od.RATED_CURRENT, "rated_current") * 1e-3
    return Scale(
        position=sign * turn / (2 * math.pi),
        rate=sign * rate / (2 * math.pi),
        torque=sign / (PER_MILLE * torque * ratio),
        current=sign / (PER_MILLE * current),
        motor_rate=ratio * 60 / (2 * math.pi),
    )


def _shaft_turns(read: Read, ratio: float) -> float:
    """Turns of the drive's shaft per turn of the load: the drive may include the gear or not."""
    own = _quotient(read, od.GEAR_MOTOR, od.GEAR_SHAFT) or 1.0
    if math.isclose(own, ratio, rel_tol=1e-3):
        return 1.0
    if own == 1.0:
        return ratio
    raise DriveError(
        f"{od.GEAR_MOTOR} says a gear of {own:g}, the bench gear.ratio = {ratio:g}; correct one of "
        "them, or state --set backend.units_per_turn and backend.rate_units"
    )


def _units_per_turn(read: Read, ratio: float) -> float:
    unit = read(od.POSITION_UNIT)
    kind = INCREMENTS if not unit else unit >> 16 & 0xFF
    each, shaft = PER_TURN.get(kind), _shaft_turns(read, ratio)
    if each is not None and unit:
        return each / _prefix(unit) * shaft
    if feed := _quotient(read, od.FEED, od.FEED_TURNS):
        return feed * shaft
    increments = _quotient(read, od.ENCODER_INCREMENTS, od.ENCODER_TURNS)
    if increments is None or kind != INCREMENTS:
        raise DriveError(
            f"{od.POSITION_UNIT} and {od.ENCODER_INCREMENTS} do not say the scale; state "
            "--set backend.units_per_turn=NUMBER (units of 6064h per turn of the load)"
        )
    return increments * ratio


def _rate_units(read: Read, turn: float, ratio: float) -> float:
    """Units of velocity at one turn of the load per second; `turn`: units of position per turn."""
    unit = read(od.VELOCITY_UNIT)
    if not unit:
        factor = _quotient(read, od.VELOCITY_NUMERATOR, od.VELOCITY_DIVISOR)
        return turn * (factor or 1.0)
    kind = unit >> 16 & 0xFF
    each, seconds = PER_TURN.get(kind), SECONDS.get(unit >> 8 & 0xFF)
    if seconds is None or (each is None and kind != INCREMENTS):
        raise DriveError(
            f"{od.VELOCITY_UNIT} is {unit:08X}h, which is not known; state --set "
            "backend.rate_units=NUMBER (units of 606Ch at one turn of the load per second)"
        )
    own = turn if each is None else each * _shaft_turns(read, ratio)
    return own * seconds / _prefix(unit)


def _prefix(unit: int) -> float:
    """Ten to the power of the first byte (signed)."""
    exponent = unit >> 24
    return 10.0 ** (exponent - 256 if exponent > 127 else exponent)


def _quotient(read: Read, upper: Item, lower: Item) -> float | None:
    above, below = read(upper), read(lower)
    return above / below if above and below else None


def _rated(read: Read, item: Item, option: str) -> int:
    value = read(item)
    if not value:
        raise DriveError(f"{item} is missing or 0; state --set backend.{option}=...")
    return value
