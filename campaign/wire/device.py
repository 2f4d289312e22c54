"""Messages from device to host."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.wire.codes import Fault, Format, Kind, LatchCause, NakCode, Outcome, State
from campaign.wire.parameters import Item


@dataclass(frozen=True)
class Capabilities:
    """Identity and capabilities of the device: the answer to HELLO.

    Attributes:
        sequence: sequence number of the HELLO.
        version: version of the protocol for the session; 0 without a common version.
        lowest, highest: versions that the device supports.
        boot: changes with every start of the device.
        state: present state.
        heartbeat_timeout: time without a heartbeat after which the device stops (s).
        ring_records: capacity of the ring buffer (records).
        longest_array: largest number of values of an array parameter.
        sample_rate: highest rate of a recording (Hz).
        name, firmware: for display and for the archive.
        features: keywords of the protocol: `rate`, `torque`, `rehearsal`, `message-clock` ...
        compensations: supported methods.
        limits: upper bounds of configured limits, SI: `limits.angle` ...
    """

    sequence: int
    version: int
    lowest: int
    highest: int
    boot: int
    state: State
    heartbeat_timeout: float
    ring_records: int
    longest_array: int
    sample_rate: float
    name: str
    firmware: str = ""
    features: tuple[str, ...] = ()
    compensations: tuple[str, ...] = ()
    limits: tuple[Item, ...] = ()


@dataclass(frozen=True)
class Ack:
    """Command `sequence` was executed, now or at its first arrival; `state` after it."""

    sequence: int
    kind: Kind
    state: State
    boot: int


@dataclass(frozen=True)
class Nak:
    """Command `sequence` was refused without any change.

    Attributes:
        kind: type of the command; the device may not know it.
        name: the affected parameter, or empty.
        text: one sentence for the user.
    """

    sequence: int
    kind: int
    code: NakCode
    state: State
    name: str = ""
    text: str = ""


@dataclass(frozen=True)
class Channel:
    """One recorded quantity: value = scale * stored number, in `unit` (SI)."""

    name: str
    unit: str
    display_unit: str
    label: str
    measured: bool = True
    format: Format = Format.F64
    scale: float = 1.0


@dataclass(frozen=True)
class Channels:
    """Part of the channels of the armed trial: `first` and following of `total`.

    Attributes:
        sequence: sequence number of the ARM that it answers.
        sample_rate: sample n is taken at n / sample_rate (Hz).
    """

    sequence: int
    total: int
    first: int
    sample_rate: float
    channels: tuple[Channel, ...]


@dataclass(frozen=True)
class Status:
    """Status of the device: the answer to HEARTBEAT and SAFE, and sent when the state changes.

    Attributes:
        fault: cause of the state FAULT.
        at_rest, drive_on: measured now; safe means at rest with the drive off.
        boot: see Capabilities.
        clock: time since the start of the device (s).
        heartbeat: counter of the last received heartbeat, 0 before the first.
        heartbeat_age: time since then (s).
        trial: trial of the stored records, 0 for none.
        first_record, next_record: numbers of the oldest stored record and of the next new one.
        ring_used: number of stored records.
        bad_frames: number of frames discarded since the start.
        temperature: temperature of the drive (degree Celsius); None without a sensor.
    """

    state: State
    fault: Fault
    at_rest: bool
    drive_on: bool
    boot: int
    clock: float
    heartbeat: int
    heartbeat_age: float
    trial: int
    first_record: int
    next_record: int
    ring_used: int
    bad_frames: int = 0
    temperature: float | None = None


@dataclass(frozen=True)
class Samples:
    """Record: `count` samples of all channels from sample number `first`.

    Attributes:
        data: packed little-endian, sample by sample; within a sample channel by channel.
    """

    trial: int
    number: int
    first: int
    count: int
    data: bytes


@dataclass(frozen=True)
class Event:
    """Record: an event at `time` of the trial (s)."""

    trial: int
    number: int
    time: float
    text: str


@dataclass(frozen=True)
class End:
    """Record: the end of the trial; its last record.

    Attributes:
        samples: total number of samples.
        safe: whether the axis is confirmed at rest with its drive off.
    """

    trial: int
    number: int
    outcome: Outcome
    fault: Fault
    samples: int
    safe: bool
    reason: str = ""


@dataclass(frozen=True)
class LostRecords:
    """Records `first` to `first + count - 1` are no longer stored, and lost."""

    trial: int
    first: int
    count: int


@dataclass(frozen=True)
class Latch:
    """State of the latch: a latched device refuses to arm until UNLATCH clears it.

    Attributes:
        count: number of the latest stop, required in UNLATCH.
        age: time since that stop (s); None if unknown.
        by: sender of the stop, if its SAFE contained it.
    """

    latched: bool
    count: int
    cause: LatchCause
    age: float | None
    by: str = ""


@dataclass(frozen=True)
class Holder:
    """The host that holds the device.

    Attributes:
        held: whether its heartbeats arrive; this excludes other hosts.
        age: time since the last one (s); None before the first.
        host: identity from its HELLO; of the last session if the device is no longer held.
    """

    held: bool
    age: float | None
    host: str = ""
