"""Numbers of the protocol: message types, states, refusals, outcomes, faults, formats.

Every enumeration is one byte on the wire; `.text` is the same word as elsewhere in the program,
e.g. `campaign.recording.Fault(Fault.OVER_TEMPERATURE.text)`.
"""

from __future__ import annotations

from enum import IntEnum

from campaign.errors import BackendError

VERSION = 2
"""The version of the protocol that this package speaks, as HELLO negotiates it."""
FRAME_VERSION = 1
"""The version of frames. It never changes: whoever stops a device need not match its version."""


class WireError(BackendError):
    """Bytes that are no message of this protocol, or a message that does not fit into a frame."""


class Code(IntEnum):
    """A named byte."""

    @property
    def text(self) -> str:
        """Its name in words: `over-temperature`."""
        return self.name.lower().replace("_", "-")


class Kind(Code):
    """Message types; those of a device have bit 7 set."""

    HELLO = 0x01
    SET = 0x02
    ARM = 0x03
    START = 0x04
    HEARTBEAT = 0x05
    RESEND = 0x06
    RELEASE = 0x07
    STOP = 0x08
    SAFE = 0x09
    CLEAR = 0x0A
    QUERY = 0x0B
    UNLATCH = 0x0C
    BYE = 0x0D
    CAPABILITIES = 0x81
    ACK = 0x82
    NAK = 0x83
    CHANNELS = 0x84
    STATUS = 0x85
    SAMPLES = 0x86
    EVENT = 0x87
    END = 0x88
    LOST = 0x89
    LATCH = 0x8A
    HOLDER = 0x8B


COMMANDS = frozenset(
    {
        Kind.HELLO, Kind.SET, Kind.ARM, Kind.START, Kind.RELEASE, Kind.STOP, Kind.SAFE, Kind.CLEAR,
        Kind.UNLATCH,
    }
)  # fmt: skip
"""What a device acknowledges, by the frame's sequence number; the others it does not."""


class State(Code):
    """What a device is doing. The drive is on in RUNNING only."""

    IDLE = 0  # nothing configured
    CONFIGURED = 1  # parameters are being received
    ARMED = 2  # everything checked; START sets it in motion
    RUNNING = 3
    ENDED = 4  # the trial is over, its records are kept until released
    SAFE = 5  # switched off by SAFE; CLEAR leaves it
    FAULT = 6  # switched off by itself; CLEAR leaves it when the cause is gone


class NakCode(Code):
    """Why a command was refused."""

    WRONG_STATE = 1  # not in this state
    UNKNOWN_MESSAGE = 2  # no message of this type
    MALFORMED = 3  # its body is not what its type demands
    UNKNOWN_NAME = 4  # no parameter of this name
    WRONG_TYPE = 5  # a parameter of another type
    OUT_OF_RANGE = 6  # a parameter's value
    TOO_LARGE = 7  # more than this device can hold
    CHECKSUM = 8  # the configuration differs from what the host meant
    INCOMPLETE = 9  # a parameter is missing
    LIMIT = 10  # what is commanded would break a limit
    NOT_READY = 11  # not at rest, not at the start angle, drive not available ...
    OUT_OF_ORDER = 12  # neither the next sequence number nor a repetition of the last
    BUSY = 13  # another session is using it
    VERSION = 14  # no common version
    WRONG_TRIAL = 15  # not the trial whose records are held
    CAUSE_PERSISTS = 16  # the fault is still there
    NO_HEARTBEAT = 17  # no heartbeat has been heard lately
    LATCHED = 18  # somebody stopped the device; UNLATCH lets it go on
    OTHER_STOP = 19  # not the stop that the latch is from


class Outcome(Code):
    """How a trial ended; `campaign.recording.Outcome` by `.text`."""

    COMPLETED = 0
    LIMIT = 1
    DIVERGED = 2
    FAULT = 3
    INTERRUPTED = 4


class Fault(Code):
    """What failed; all but NONE are `campaign.recording.Fault` by `.text`."""

    NONE = 0
    LOST_CONNECTION = 1
    LOST_SAMPLES = 2
    HEARTBEAT = 3
    RESET = 4
    OVER_TEMPERATURE = 5
    LIMIT_SWITCH = 6
    SENSOR = 7
    DRIVE = 8
    REFUSED = 9
    OTHER = 255


class LatchCause(Code):
    """Why a device is latched."""

    NONE = 0  # it is not
    STOPPED = 1  # by a SAFE that was not its session's
    NO_MEMORY = 2  # it has started, and cannot know whether it was


class Format(Code):
    """How one channel's sample is stored, little-endian."""

    F64 = 1
    F32 = 2
    I32 = 3
    I16 = 4

    @property
    def size(self) -> int:
        """Bytes per sample."""
        return {Format.F64: 8, Format.F32: 4, Format.I32: 4, Format.I16: 2}[self]

    @property
    def letter(self) -> str:
        """For `struct`, after a `<`."""
        return {Format.F64: "d", Format.F32: "f", Format.I32: "i", Format.I16: "h"}[self]

    @property
    def dtype(self) -> str:
        """For numpy, e.g. `<f8`."""
        return {Format.F64: "<f8", Format.F32: "<f4", Format.I32: "<i4", Format.I16: "<i2"}[self]


class Tag(Code):
    """The type of a parameter's value."""

    F64 = 1
    I64 = 2
    BOOL = 3
    TEXT = 4
    F64_ARRAY = 5
