"""Messages from host to device."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.wire.fields import U8, U32, ShortText
from campaign.wire.parameters import Items


@dataclass(frozen=True)
class Hello:
    """Begin or renew a session; answered by CAPABILITIES.

    Attributes:
        lowest, highest: versions of the protocol that the host supports.
        session: a random number; unchanged after a lost connection.
        host: its identity, for the device's log.
    """

    lowest: U8
    highest: U8
    session: U32
    host: ShortText = ""


@dataclass(frozen=True)
class Set:
    """Add parameters (at least one item) to the configuration."""

    items: Items


@dataclass(frozen=True)
class Arm:
    """Check everything and prepare the start; answered by ACK and CHANNELS.

    Attributes:
        crc: `configuration_crc` of all SET bodies since the device was idle.
    """

    crc: U32


@dataclass(frozen=True)
class Start:
    """Start the motion. The host selects `trial` (from 1), which marks every record."""

    trial: U32


@dataclass(frozen=True)
class Heartbeat:
    """Sign of life of the host; answered by STATUS. Not a command: neither numbered nor repeated.

    Attributes:
        counter: increases by 1; STATUS returns it.
        trial, next: every record of this trial before `next` has arrived; the device frees them.
        session: session of the host; another session frees nothing and does not prevent a timeout.
    """

    counter: U32
    trial: U32
    next: U32
    session: U32


@dataclass(frozen=True)
class Resend:
    """Send `count` records from number `first` again; answered by them, or by LOST."""

    trial: U32
    first: U32
    count: U32


@dataclass(frozen=True)
class Release:
    """Every record of an ended trial is stored; the device deletes the trial and becomes idle."""

    trial: U32


@dataclass(frozen=True)
class Stop:
    """End the running trial under control; its END follows."""


@dataclass(frozen=True)
class Safe:
    """Drive off now: accepted in every state and from any sender; answered by ACK and STATUS.

    If it is not from the session that holds the device, it latches the device; LATCH follows.

    Attributes:
        session: session of the sender; 0, or an empty body, without a session.
        host: identity of the sender, for later queries.
    """

    session: U32 = 0
    host: ShortText = ""


@dataclass(frozen=True)
class Clear:
    """Leave SAFE or FAULT, or discard a configuration: the device becomes idle.

    It deletes everything except the latch: see Unlatch.
    """


@dataclass(frozen=True)
class Query:
    """Query the device without a change; answered by STATUS, LATCH and HOLDER, for any sender."""


@dataclass(frozen=True)
class Unlatch:
    """The user has noticed the stop of the device and allows motion again.

    Attributes:
        count: number of the stop that the user has noticed.
        host: identity of the host, for the device's log.
    """

    count: U32
    host: ShortText = ""


@dataclass(frozen=True)
class Bye:
    """The host of `session` leaves: the device no longer counts it as present. No answer."""

    session: U32
