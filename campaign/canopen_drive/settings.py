"""Settings of a drive before a motion, all read back; load of its bus."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

from campaign.canopen_drive import objects as od
from campaign.canopen_drive.drive import DriveError
from campaign.canopen_drive.objects import MAPPED, TARGET_VELOCITY, Item, mapping
from campaign.canopen_drive.units import Scale
from campaign.errors import UsageError
from campaign.physics.bench import LimitsOptions

ABORTS = (3, 1, 2)
"""Values of 6007h, best first: quick stop, fault reaction, no voltage. 0 would be no reaction."""
FOLLOWING = 0.02
"""Largest following error as a share of the angle limit, in position modes."""
SYNCHRONOUS, AT_ONCE = 1, 255
"""Transmission types of PDOs."""


class Objects(Protocol):
    """Access to objects of a drive. Both methods raise DriveError."""

    def read(self, item: Item) -> int: ...

    def write(self, item: Item, value: int) -> None: ...


def present(drive: Objects, item: Item) -> int | None:
    """Value of an object; None if the drive refuses the access."""
    try:
        return drive.read(item)
    except DriveError as error:
        if error.silent:
            raise
        return None


def written(drive: Objects, item: Item, value: int) -> None:
    """Write and read back. Raises DriveError."""
    drive.write(item, value)
    value_read = drive.read(item)
    if value_read != value:
        raise DriveError(f"{item} is {value_read} after {value} was written")


def compare_eds(drive: Objects, path: str) -> None:
    """Compare the EDS with the drive. Raises DriveError, or UsageError for an unreadable EDS."""
    import canopen

    try:
        described = canopen.import_od(path)
    except Exception as error:  # noqa: BLE001 - any error of the parser
        raise UsageError(f"eds = {path!r} cannot be read: {error}") from None
    device = described.device_information
    vendor, product = drive.read(od.VENDOR), present(drive, od.PRODUCT) or 0
    if (device.vendor_number, device.product_number) != (vendor, product):
        raise DriveError(
            f"wrong EDS: {path} is of vendor {device.vendor_number}, product "
            f"{device.product_number}; the drive says {vendor:#x}, {product:#x}"
        )
    for item in vars(od).values():
        variable = isinstance(item, Item) and described.get_variable(item.index, item.sub)
        if variable and len(variable) != item.bits:
            raise DriveError(f"{item} has {len(variable)} bits in the EDS, not {item.bits}")


def set_reactions(drive: Objects, host: int, heartbeat: float) -> None:
    """Set the drive's reactions to a loss of the host's heartbeat for `heartbeat` (s).

    Raises DriveError that names a missing object; without it no motion is permitted.
    """
    wanted: tuple[tuple[Item, Sequence[int]], ...] = (
        (od.CONSUMER, (host << 16 | round(heartbeat * 1e3),)),
        (od.ERROR_BEHAVIOUR, (0,)),  # pre-operational: PDOs have no effect then
        (od.ABORT_OPTION, ABORTS),
        (od.QUICK_STOP_OPTION, (2,)),  # along its ramp, then off
        (od.FAULT_OPTION, (2, 1)),  # along the quick stop ramp, else the slow-down ramp
    )
    for item, values in wanted:
        _set_reaction(drive, item, values)


def _set_reaction(drive: Objects, item: Item, values: Sequence[int]) -> None:
    """Set the first of `values` that the drive accepts. Raises DriveError if it accepts none."""
    lacks: DriveError | None = None
    for value in values:
        try:
            written(drive, item, value)
        except DriveError as error:
            if error.silent:
                raise
            lacks = error
        else:
            return
    raise DriveError(f"the drive lacks a reaction that a motion needs: {lacks}")


def set_pdos(drive: Objects, node: int) -> None:
    """Map RPDO 1: controlword, 2: target velocity, 3: target torque; TPDO 1 and 2: samples."""
    for number, (item, cob) in enumerate(((od.CONTROLWORD, 0x200), *od.TARGETS.values())):
        kind = AT_ONCE if item is od.CONTROLWORD else SYNCHRONOUS
        _map(drive, 0x1400 + number, cob + node, (item,), kind)
    for number, items in enumerate(od.MAPPED):
        _map(drive, 0x1800 + number, 0x180 + 0x100 * number + node, items, SYNCHRONOUS)


def _map(drive: Objects, index: int, cob: int, items: Sequence[Item], kind: int) -> None:
    """Map one PDO; it is invalid (bit 31) while its mapping changes."""
    name = f"{'R' if index < 0x1800 else 'T'}PDO {(index & 0xFF) + 1}"
    valid = Item(index, 1, "I", f"COB-ID of {name}")
    count = Item(index + 0x200, 0, "B", f"number of objects in {name}")
    drive.write(valid, 1 << 31 | cob)
    written(drive, Item(index, 2, "B", f"transmission type of {name}"), kind)
    drive.write(count, 0)
    for sub, item in enumerate(items, start=1):
        written(drive, Item(index + 0x200, sub, "I", f"{name}, entry {sub}"), mapping(item))
    written(drive, count, len(items))
    drive.write(valid, cob)
    value_read = drive.read(valid)
    if value_read & 0x800007FF != cob:  # bits 30 and 29 may be set
        raise DriveError(f"{valid} is {value_read:08X}h after {cob:08X}h was written")


def set_times(drive: Objects, period: float) -> bool:
    """Set the period of SYNC (s) in 1006h and 60C2h, if present; whether SYNC is counted."""
    value, exponent = cycle(period)
    for item, wanted in (
        (od.CYCLE, 0),  # 1019h may change only while it is 0
        (od.COUNTER, od.COUNTED),
        (od.CYCLE, round(period * 1e6)),
        (od.CYCLE_EXPONENT, exponent),
        (od.CYCLE_VALUE, value),
    ):
        if present(drive, item) is not None:
            written(drive, item, wanted)
    return present(drive, od.COUNTER) is not None


def cycle(period: float) -> tuple[int, int]:
    """Value and exponent of 60C2h: period (s) = value · 10^exponent, value from 1 to 255.

    Raises ValueError for a period without such a representation.
    """
    for exponent in range(-3, -7, -1):
        value = period / 10.0**exponent
        if 1 <= round(value) <= 255 and math.isclose(value, round(value), rel_tol=1e-9):
            return round(value), exponent
    raise ValueError(f"a period of {period * 1e3:.9g} ms is no whole number of 60C2h")


def set_limits(drive: Objects, limits: LimitsOptions, scale: Scale, own: dict[Item, int]) -> str:
    """Set the bench's limits in the drive; narrower limits of the drive stay.

    Args:
        own: original values of the drive, stored at the first call and never exceeded.

    Returns the limits that the drive lacks: only this program supervises them. Raises DriveError
    without a torque limit, a speed limit, or a ramp of the quick stop.
    """
    position, rate, torque = abs(scale.position), abs(scale.rate), abs(scale.torque)
    largest = {
        od.MAX_TORQUE: limits.torque * torque,
        od.POSITIVE_TORQUE: limits.torque * torque,
        od.NEGATIVE_TORQUE: limits.torque * torque,
        od.MAX_PROFILE_VELOCITY: limits.rate * rate,
        od.MAX_MOTOR_SPEED: limits.rate * scale.motor_rate,
        od.HIGHEST_POSITION: limits.angle * position,
        od.LOWEST_POSITION: -limits.angle * position,
        od.MAX_ACCELERATION: limits.acceleration * rate,
        od.MAX_DECELERATION: limits.acceleration * rate,
        od.FOLLOWING_ERROR: FOLLOWING * limits.angle * position,
    }
    lacking = [item for item, most in largest.items() if not _limited(drive, item, most, own)]
    both = {od.POSITIVE_TORQUE, od.NEGATIVE_TORQUE}
    if od.MAX_TORQUE in lacking and both & set(lacking):
        raise DriveError(f"the drive limits no torque: {od.MAX_TORQUE}, or 60E0h and 60E1h")
    if {od.MAX_PROFILE_VELOCITY, od.MAX_MOTOR_SPEED} <= set(lacking):
        raise DriveError(
            f"the drive limits no speed: {od.MAX_PROFILE_VELOCITY}, or {od.MAX_MOTOR_SPEED}"
        )
    _set_reaction(drive, od.QUICK_STOP_DECELERATION, (max(1, round(limits.acceleration * rate)),))
    return ", ".join(str(item) for item in lacking)


def _limited(drive: Objects, item: Item, most: float, own: dict[Item, int]) -> bool:
    """Whether the drive limits to `most`: written and read back, or already narrower."""
    if not math.isfinite(most):
        return True
    had = own.get(item, present(drive, item))
    if had is None:
        return False
    own.setdefault(item, had)
    low, high = item.range
    wanted = min(max(math.trunc(most), low), high)
    # 0 means unset: in 607Dh both 0 is no limit; 0 in another object would prevent any motion.
    if had and abs(had) < abs(wanted):
        wanted = had
    if not wanted:  # less than one unit of the drive; for some drives 0 is no limit
        return False
    try:
        written(drive, item, wanted)
    except DriveError as error:
        if error.silent:
            raise
        value_read = present(drive, item)
        return value_read is not None and 0 < abs(value_read) <= abs(most)
    return True


LARGEST = 0.5
"""Largest load as a share of the bus. The rest is for SDO, emergency messages, other nodes."""
PROMISED = 100.0
"""Hz; largest sample rate without a measurement of the jitter."""


def frame_bits(size: int) -> int:
    """Bits of a data frame with 11-bit identifier and `size` bytes, with 3 bits between frames.

    34 + 8 size bits are subject to stuffing, at worst one bit in each four after the first
    (R. I. Davis et al., Controller Area Network schedulability analysis, 2007, eq. 1).
    """
    stuffed = 34 + 8 * size
    return stuffed + 13 + (stuffed - 1) // 4


def bus_load(sample_rate: float, bitrate: int, heartbeat: float) -> float:
    """Load as a share of the bus: SYNC, target and answers of each sample, and both heartbeats.

    `sample_rate` in Hz, `bitrate` in bit/s; `heartbeat` (s): the drive's time limit for one.
    """
    answers = sum(frame_bits(sum(item.bits for item in pdo) // 8) for pdo in MAPPED)
    each = frame_bits(1) + frame_bits(TARGET_VELOCITY.bits // 8) + answers
    beats = 2 * frame_bits(1) * 4 / heartbeat
    return (each * sample_rate + beats) / bitrate


def beyond_bus(sample_rate: float, bitrate: int, heartbeat: float) -> str | None:
    """Why a bus cannot carry a trial, or None; arguments as of `bus_load`."""
    try:
        cycle(1 / sample_rate)
    except ValueError as error:
        return f"task.sample_rate = {sample_rate:g} Hz: {error}; take {PROMISED:g} Hz"
    load = bus_load(sample_rate, bitrate, heartbeat)
    if load <= LARGEST:
        return None
    return (
        f"task.sample_rate = {sample_rate:g} Hz takes {load:.0%} of a bus of {bitrate:g} bit/s; "
        f"at most {LARGEST:.0%} is used: sample_rate = \"{PROMISED:g} Hz\""
    )  # fmt: skip
