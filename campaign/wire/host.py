"""Messages from host to device."""

from __future__ import annotations

from dataclasses import dataclass

from campaign.wire.parameters import Item


@dataclass(frozen=True)
class Hello:
    """Begin or renew a session; answered by CAPABILITIES.

    Attributes:
        lowest, highest: versions of the protocol that the host speaks.
        session: a random number; the same one after a lost connection.
        host: who it is, for the device's log.
    """

    lowest: int
    highest: int
    session: int
    host: str = ""


@dataclass(frozen=True)
class Set:
    """Add parameters to the configuration. At least one item."""

    items: tuple[Item, ...]


@dataclass(frozen=True)
class Arm:
    """Check everything and be ready to start; answered by ACK and CHANNELS.

    Attributes:
        crc: `configuration_crc` of all SET bodies since the device was idle.
    """

    crc: int


@dataclass(frozen=True)
class Start:
    """Set the axis in motion. `trial` (from 1) is chosen by the host and marks every record."""

    trial: int


@dataclass(frozen=True)
class Heartbeat:
    """The host is alive; answered by STATUS. Not a command: it is neither numbered nor repeated.

    Attributes:
        counter: one more each time; STATUS returns it.
        trial, next: of this trial every record before `next` has arrived; the device frees them.
        session: whose it is; another's than the device's keeps nothing alive and frees nothing.
    """

    counter: int
    trial: int
    next: int
    session: int


@dataclass(frozen=True)
class Resend:
    """Send `count` records from number `first` again; answered by them, or by LOST."""

    trial: int
    first: int
    count: int


@dataclass(frozen=True)
class Release:
    """Every record of an ended trial is safe; the device forgets it and is idle."""

    trial: int


@dataclass(frozen=True)
class Stop:
    """End the running trial in a controlled way; its END follows."""


@dataclass(frozen=True)
class Safe:
    """Drive off now: accepted in every state and from anybody; answered by ACK and STATUS.

    Unless it is of the session that holds the device, it latches it; then LATCH follows.

    Attributes:
        session: whose it is; 0, or no body at all, for nobody's.
        host: who sends it, for whoever asks later.
    """

    session: int = 0
    host: str = ""


@dataclass(frozen=True)
class Clear:
    """Leave SAFE or FAULT, or give up a configuration: the device is idle and remembers nothing.

    All but the latch: see Unlatch.
    """


@dataclass(frozen=True)
class Query:
    """How is the device? Changes nothing; answered by STATUS, LATCH and HOLDER, to anybody."""


@dataclass(frozen=True)
class Unlatch:
    """A person has seen that the device was stopped and lets it move again.

    Attributes:
        count: of the stop that the person has seen.
        host: who it is, for the device's log.
    """

    count: int
    host: str = ""


@dataclass(frozen=True)
class Bye:
    """The host of `session` leaves: from now on it counts as not heard. Not acknowledged."""

    session: int
