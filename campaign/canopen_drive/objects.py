"""Objects of a drive: number, data type, name.

Numbers 1xxxh are from CiA 301, all others from CiA 402 (IEC 61800-7-201). docs/canopen.md lists
those compared with manuals of drives.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass


@dataclass(frozen=True)
class Item:
    """An entry of the object dictionary.

    Attributes:
        code: its type in `struct` format, little-endian: `H` for UNSIGNED16, `i` for INTEGER32.
    """

    index: int
    sub: int
    code: str
    name: str

    def __str__(self) -> str:
        sub = f":{self.sub:02X}" if self.sub else ""
        return f"{self.index:04X}h{sub} ({self.name})"

    @property
    def bits(self) -> int:
        """Length in bits."""
        return 8 * struct.calcsize(self.code)

    @property
    def range(self) -> tuple[int, int]:
        """Smallest and largest value of its type."""
        if self.code.isupper():
            return 0, 2**self.bits - 1
        return -(2 ** (self.bits - 1)), 2 ** (self.bits - 1) - 1

    def pack(self, value: int) -> bytes:
        """Bytes to send."""
        return struct.pack("<" + self.code, value)

    def unpack(self, data: bytes) -> int:
        """Value of received bytes; some drives send more bytes than the type has."""
        return int(struct.unpack("<" + self.code, data[: self.bits // 8])[0])


# CiA 301
CYCLE = Item(0x1006, 0, "I", "communication cycle period")  # us
CONSUMER = Item(0x1016, 1, "I", "consumer heartbeat time")  # node << 16 | ms
VENDOR = Item(0x1018, 1, "I", "vendor-ID")
PRODUCT = Item(0x1018, 2, "I", "product code")
COUNTER = Item(0x1019, 0, "B", "synchronous counter overflow value")
ERROR_BEHAVIOUR = Item(0x1029, 1, "B", "error behaviour, communication error")  # 0: preoperational

# CiA 402: device control
ABORT_OPTION = Item(0x6007, 0, "h", "abort connection option code")
ERROR_CODE = Item(0x603F, 0, "H", "error code")
CONTROLWORD = Item(0x6040, 0, "H", "controlword")
STATUSWORD = Item(0x6041, 0, "H", "statusword")
QUICK_STOP_OPTION = Item(0x605A, 0, "h", "quick stop option code")
FAULT_OPTION = Item(0x605E, 0, "h", "fault reaction option code")
MODE = Item(0x6060, 0, "b", "modes of operation")
MODE_DISPLAY = Item(0x6061, 0, "b", "modes of operation display")
QUICK_STOP_DECELERATION = Item(0x6085, 0, "I", "quick stop deceleration")

# Motion; accelerations are in velocity units per second, unless the drive states another unit.
POSITION = Item(0x6064, 0, "i", "position actual value")
FOLLOWING_ERROR = Item(0x6065, 0, "I", "following error window")
VELOCITY = Item(0x606C, 0, "i", "velocity actual value")
TARGET_TORQUE = Item(0x6071, 0, "h", "target torque")  # per mille of 6076h
MAX_TORQUE = Item(0x6072, 0, "H", "max torque")  # per mille of 6076h
RATED_CURRENT = Item(0x6075, 0, "I", "motor rated current")  # mA
RATED_TORQUE = Item(0x6076, 0, "I", "motor rated torque")  # mN m
TORQUE = Item(0x6077, 0, "h", "torque actual value")  # per mille of 6076h
CURRENT = Item(0x6078, 0, "h", "current actual value")  # per mille of 6075h
LOWEST_POSITION = Item(0x607D, 1, "i", "min software position limit")
HIGHEST_POSITION = Item(0x607D, 2, "i", "max software position limit")
MAX_PROFILE_VELOCITY = Item(0x607F, 0, "I", "max profile velocity")
MAX_MOTOR_SPEED = Item(0x6080, 0, "I", "max motor speed")  # 1/min of the motor
ACCELERATION = Item(0x6083, 0, "I", "profile acceleration")
DECELERATION = Item(0x6084, 0, "I", "profile deceleration")
TORQUE_SLOPE = Item(0x6087, 0, "I", "torque slope")  # per mille of 6076h in a second
CYCLE_VALUE = Item(0x60C2, 1, "B", "interpolation time period value")
CYCLE_EXPONENT = Item(0x60C2, 2, "b", "interpolation time index")  # 10^index s
MAX_ACCELERATION = Item(0x60C5, 0, "I", "max acceleration")
MAX_DECELERATION = Item(0x60C6, 0, "I", "max deceleration")
POSITIVE_TORQUE = Item(0x60E0, 0, "H", "positive torque limit value")  # per mille of 6076h
NEGATIVE_TORQUE = Item(0x60E1, 0, "H", "negative torque limit value")
TARGET_VELOCITY = Item(0x60FF, 0, "i", "target velocity")

# Factors
ENCODER_INCREMENTS = Item(0x608F, 1, "I", "encoder increments")
ENCODER_TURNS = Item(0x608F, 2, "I", "motor revolutions of the encoder increments")
GEAR_MOTOR = Item(0x6091, 1, "I", "gear ratio, motor shaft revolutions")
GEAR_SHAFT = Item(0x6091, 2, "I", "gear ratio, driving shaft revolutions")
FEED = Item(0x6092, 1, "I", "feed constant, feed")
FEED_TURNS = Item(0x6092, 2, "I", "feed constant, driving shaft revolutions")
VELOCITY_NUMERATOR = Item(0x6096, 1, "I", "velocity factor, numerator")
VELOCITY_DIVISOR = Item(0x6096, 2, "I", "velocity factor, divisor")
POSITION_UNIT = Item(0x60A8, 0, "I", "SI unit position")
VELOCITY_UNIT = Item(0x60A9, 0, "I", "SI unit velocity")

MAPPED = ((STATUSWORD, VELOCITY, TORQUE), (POSITION, CURRENT, MODE_DISPLAY))
"""Objects of each TPDO, in order: 64 and 56 bits."""
COUNTED = 240
"""Largest count of a SYNC (1019h)."""
PROFILE_VELOCITY, PROFILE_TORQUE = 3, 4
"""Of `MODE`."""
TARGETS = {PROFILE_VELOCITY: (TARGET_VELOCITY, 0x300), PROFILE_TORQUE: (TARGET_TORQUE, 0x400)}
"""The target of each mode, and the COB-ID of its RPDO for node 0."""


def mapping(item: Item) -> int:
    """Mapping entry of an object in a PDO."""
    return item.index << 16 | item.sub << 8 | item.bits
