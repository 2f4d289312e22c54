"""Messages from device to host."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.wire.codes import Fault, Format, Kind, LatchCause, NakCode, Outcome, State
from campaign.wire.parameters import Item


@dataclass(frozen=True)
class Capabilities:
    """What the device is and can do: the answer to HELLO.

    Attributes:
        sequence: of the HELLO.
        version: of the protocol from now on; 0 when there is none in common.
        lowest, highest: versions that the device speaks.
        boot: changes with every start of the device.
        state: now.
        heartbeat_timeout: it stops by itself after so long without a heartbeat (s).
        ring_records: how many records it can keep.
        longest_array: most values of an array parameter.
        sample_rate: highest rate of a recording (Hz).
        name, firmware: for people and for the archive.
        features: words of the protocol's list: `rate`, `torque`, `rehearsal`, `message-clock` ...
        compensations: methods it knows.
        limits: what no configuration may exceed, SI: `limits.angle` ...
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
    """Command `sequence` was carried out, now or when it came first; the state afterwards."""

    sequence: int
    kind: Kind
    state: State
    boot: int


@dataclass(frozen=True)
class Nak:
    """Command `sequence` was refused and nothing has changed.

    Attributes:
        kind: of the command; may be one the device does not know.
        name: the parameter it is about, or empty.
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
    """Part of what the armed trial will record: channels `first` and following of `total`.

    Attributes:
        sequence: of the ARM it answers.
        sample_rate: sample n is taken at n / sample_rate (Hz).
    """

    sequence: int
    total: int
    first: int
    sample_rate: float
    channels: tuple[Channel, ...]


@dataclass(frozen=True)
class Status:
    """How the device is: the answer to HEARTBEAT and to SAFE, and sent when the state changes.

    Attributes:
        fault: why it is in state FAULT.
        at_rest, drive_on: seen now; safe is at rest with the drive off.
        boot: see Capabilities.
        clock: of the device, since it started (s).
        heartbeat: counter of the last one heard, 0 before the first.
        heartbeat_age: time since then (s).
        trial: whose records it holds, 0 for none.
        first_record, next_record: numbers of the oldest one held and of the next one to come.
        ring_used: records held now.
        bad_frames: frames it had to throw away since it started.
        temperature: of the drive (degree Celsius); None when it has no sensor.
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
        data: sample after sample, in each channel after channel, packed little-endian.
    """

    trial: int
    number: int
    first: int
    count: int
    data: bytes


@dataclass(frozen=True)
class Event:
    """Record: something that happened at `time` of the trial (s)."""

    trial: int
    number: int
    time: float
    text: str


@dataclass(frozen=True)
class End:
    """Record: the trial is over; the last of its records.

    Attributes:
        samples: how many were taken in all.
        safe: whether the axis was seen at rest with its drive off.
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
    """Records `first` to `first + count - 1` are no longer held and can never be had again."""

    trial: int
    first: int
    count: int


@dataclass(frozen=True)
class Latch:
    """Whether somebody has stopped the device: then nothing arms until UNLATCH clears it.

    Attributes:
        count: of the latest stop; UNLATCH has to name it.
        age: time since that stop (s); None when the device does not know.
        by: who stopped it, as far as the SAFE said.
    """

    latched: bool
    count: int
    cause: LatchCause
    age: float | None
    by: str = ""


@dataclass(frozen=True)
class Holder:
    """Who holds the device.

    Attributes:
        held: whether its heartbeats are heard, so that nobody else gets the device.
        age: time since the last one (s); None when there was none.
        host: as its HELLO said; of the last session when it is held no more.
    """

    held: bool
    age: float | None
    host: str = ""
