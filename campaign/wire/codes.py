"""Numbers of the protocol: message types, states, refusals, outcomes, faults, formats.

Every enumeration is one byte on the wire; `.text` is the value used in the rest of the program,
e.g. `campaign.recording.Fault(Fault.OVER_TEMPERATURE.text)`.
"""

from __future__ import annotations

from enum import IntEnum

from campaign.errors import BackendError

VERSION = 2
"""Version of the protocol in this package, negotiated by HELLO."""
FRAME_VERSION = 1
"""Version of frames. It never changes, so that a host of any version can stop a device."""


class WireError(BackendError):
    """Bytes that are not a message of this protocol, or a message too large for a frame."""


class Code(IntEnum):
    """A named byte."""

    @property
    def text(self) -> str:
        """Its name as text: `over-temperature`."""
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
"""Messages that a device acknowledges, by the frame's sequence number."""


class State(Code):
    """State of a device. The drive is on only in RUNNING."""

    IDLE = 0  # nothing configured
    CONFIGURED = 1  # receives parameters
    ARMED = 2  # everything checked; START starts the motion
    RUNNING = 3
    ENDED = 4  # the trial has ended; its records are kept until RELEASE
    SAFE = 5  # switched off by SAFE; CLEAR leaves this state
    FAULT = 6  # switched off by the device; CLEAR leaves this state after the cause is removed


class NakCode(Code):
    """Reason for the refusal of a command."""

    WRONG_STATE = 1  # not allowed in this state
    UNKNOWN_MESSAGE = 2  # no message of this type
    MALFORMED = 3  # its body does not match its type
    UNKNOWN_NAME = 4  # no parameter of this name
    WRONG_TYPE = 5  # wrong type of a parameter
    OUT_OF_RANGE = 6  # a parameter's value
    TOO_LARGE = 7  # exceeds the memory of this device
    CHECKSUM = 8  # the received configuration differs from the sent one
    INCOMPLETE = 9  # a parameter is missing
    LIMIT = 10  # the command would exceed a limit
    NOT_READY = 11  # not at rest, not at the start angle, drive not available ...
    OUT_OF_ORDER = 12  # neither the next sequence number nor a repetition of the last
    BUSY = 13  # another session holds the device
    VERSION = 14  # no common version
    WRONG_TRIAL = 15  # not the trial of the stored records
    CAUSE_PERSISTS = 16  # the cause of the fault persists
    NO_HEARTBEAT = 17  # no recent heartbeat
    LATCHED = 18  # latched by a panic stop; UNLATCH clears it
    OTHER_STOP = 19  # not the stop of the latch


class Outcome(Code):
    """Outcome of a trial; `campaign.recording.Outcome` by `.text`."""

    COMPLETED = 0
    LIMIT = 1
    DIVERGED = 2
    FAULT = 3
    INTERRUPTED = 4


class Fault(Code):
    """Kind of a fault; all except NONE are `campaign.recording.Fault` by `.text`."""

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
    """Cause of the latch of a device."""

    NONE = 0  # not latched
    STOPPED = 1  # by a SAFE from outside its session
    NO_MEMORY = 2  # after a start without a memory of earlier stops


class Format(Code):
    """Storage format of a channel's samples, little-endian."""

    F64 = 1
    F32 = 2
    I32 = 3
    I16 = 4

    @property
    def dtype(self) -> str:
        """Type of numpy, e.g. `<f8`."""
        return {Format.F64: "<f8", Format.F32: "<f4", Format.I32: "<i4", Format.I16: "<i2"}[self]

    @property
    def size(self) -> int:
        """Bytes per sample."""
        return int(self.dtype[-1])


class Tag(Code):
    """The type of a parameter's value."""

    F64 = 1
    I64 = 2
    BOOL = 3
    TEXT = 4
    F64_ARRAY = 5
