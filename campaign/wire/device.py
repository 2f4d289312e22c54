"""Messages from device to host."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Annotated

from campaign.wire.codes import Fault, Format, Kind, LatchCause, NakCode, Outcome, State
from campaign.wire.fields import (
    F64,
    U8,
    U16,
    U32,
    Flag,
    LongText,
    OptionalF64,
    Rest,
    ShortText,
    Words,
    listed,
    read,
    written,
)
from campaign.wire.parameters import Items


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

    sequence: U16
    version: U8
    lowest: U8
    highest: U8
    boot: U32
    state: State
    heartbeat_timeout: F64
    ring_records: U32
    longest_array: U32
    sample_rate: F64
    name: ShortText
    firmware: ShortText = ""
    features: Words = ()
    compensations: Words = ()
    limits: Items = ()


@dataclass(frozen=True)
class Ack:
    """Command `sequence` was executed, now or at its first arrival; `state` after it."""

    sequence: U16
    kind: Kind
    state: State
    boot: U32


@dataclass(frozen=True)
class Nak:
    """Command `sequence` was refused without any change.

    Attributes:
        kind: type of the command; the device may not know it.
        name: the affected parameter, or empty.
        text: one sentence for the user.
    """

    sequence: U16
    kind: U8
    code: NakCode
    state: State
    name: ShortText = ""
    text: ShortText = ""


@dataclass(frozen=True)
class Channel:
    """One recorded quantity: value = scale * stored number, in `unit` (SI)."""

    name: ShortText
    unit: ShortText
    display_unit: ShortText
    label: ShortText
    measured: Flag = True
    format: Format = Format.F64
    scale: F64 = 1.0


ChannelList = Annotated[tuple[Channel, ...], listed(written, partial(read, Channel))]


@dataclass(frozen=True)
class Channels:
    """Part of the channels of the armed trial: `first` and following of `total`.

    Attributes:
        sequence: sequence number of the ARM that it answers.
        sample_rate: sample n is taken at n / sample_rate (Hz).
    """

    sequence: U16
    total: U8
    first: U8
    sample_rate: F64
    channels: ChannelList


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
    at_rest: Flag
    drive_on: Flag
    boot: U32
    clock: F64
    heartbeat: U32
    heartbeat_age: F64
    trial: U32
    first_record: U32
    next_record: U32
    ring_used: U32
    bad_frames: U32 = 0
    temperature: OptionalF64 = None


@dataclass(frozen=True)
class Samples:
    """Record: `count` samples of all channels from sample number `first`.

    Attributes:
        data: packed little-endian, sample by sample; within a sample channel by channel.
    """

    trial: U32
    number: U32
    first: U32
    count: U16
    data: Rest


@dataclass(frozen=True)
class Event:
    """Record: an event at `time` of the trial (s)."""

    trial: U32
    number: U32
    time: F64
    text: LongText


@dataclass(frozen=True)
class End:
    """Record: the end of the trial; its last record.

    Attributes:
        samples: total number of samples.
        safe: whether the axis is confirmed at rest with its drive off.
    """

    trial: U32
    number: U32
    outcome: Outcome
    fault: Fault
    samples: U32
    safe: Flag
    reason: LongText = ""


@dataclass(frozen=True)
class LostRecords:
    """Records `first` to `first + count - 1` are no longer stored, and lost."""

    trial: U32
    first: U32
    count: U32


@dataclass(frozen=True)
class Latch:
    """State of the latch: a latched device refuses to arm until UNLATCH clears it.

    Attributes:
        count: number of the latest stop, required in UNLATCH.
        age: time since that stop (s); None if unknown.
        by: sender of the stop, if its SAFE contained it.
    """

    latched: Flag
    count: U32
    cause: LatchCause
    age: OptionalF64
    by: ShortText = ""


@dataclass(frozen=True)
class Holder:
    """The host that holds the device.

    Attributes:
        held: whether its heartbeats arrive; this excludes other hosts.
        age: time since the last one (s); None before the first.
        host: identity from its HELLO; of the last session if the device is no longer held.
    """

    held: Flag
    age: OptionalF64
    host: ShortText = ""
