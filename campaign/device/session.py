"""The session of the emulated controller: its holder and its last exchange."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from campaign.device.configuration import ConfigurationRefusal, check_name
from campaign.wire.codes import NakCode, WireError
from campaign.wire.messages import Message
from campaign.wire.parameters import ArraySlice, Item, Value, assembled, configuration_crc
from campaign.wire.statemachine import SequenceNumbers

LONGEST_ARRAY = 65536
MOST_BYTES = 4 * 1024 * 1024
"""Largest size of a configuration (bytes)."""


@dataclass
class Session:
    """One host's session, until another session begins.

    Attributes:
        client: the connection that holds the controller; None before the first HELLO.
        number: number of the session, from HELLO.
        host: identity of the host, from HELLO.
        numbering: sequence numbers of its commands.
        answers: answers to the last numbered command, for its repetition.
        heard_at: time of the last heartbeat (steady clock, s).
        heartbeat: its counter.
    """

    client: int | None = None
    number: int | None = None
    host: str = ""
    numbering: SequenceNumbers = field(default_factory=SequenceNumbers)
    answers: tuple[Message, ...] = ()
    heard_at: float = -math.inf
    heartbeat: int = 0

    def begin(self, client: int, number: int, sequence: int, host: str, now: float) -> None:
        """Accept a HELLO: `client` holds the controller; commands are numbered from it on."""
        if not self.numbering.same_session(number):
            self.heard_at, self.heartbeat = now, 0  # the first heartbeat arrives later
        self.client, self.number, self.host = client, number, host
        self.numbering.begin(number, sequence)


class Configuration:
    """Parameters received by SET since the controller was idle."""

    def __init__(self) -> None:
        self._bodies: list[bytes] = []
        self._items: list[Item] = []
        self._size = 0

    def add(self, body: bytes, items: Sequence[Item]) -> None:
        """Add one SET. Raises ConfigurationRefusal without adding anything."""
        for item in items:
            check_name(item.name)
            if isinstance(item.value, ArraySlice) and item.value.total > LONGEST_ARRAY:
                text = f"an array of more than {LONGEST_ARRAY} values"
                raise ConfigurationRefusal(NakCode.TOO_LARGE, item.name, text)
        if self._size + len(body) > MOST_BYTES:
            raise ConfigurationRefusal(
                NakCode.TOO_LARGE, "", f"more than {MOST_BYTES} bytes of parameters"
            )
        self._size += len(body)
        self._bodies.append(body)
        self._items += items

    def whole(self, crc: int) -> dict[str, Value]:
        """All parameters, checked against the host's CRC. Raises ConfigurationRefusal."""
        if configuration_crc(self._bodies) != crc:
            text = "the parameters that arrived are not those that were sent"
            raise ConfigurationRefusal(NakCode.CHECKSUM, "", text)
        try:
            return assembled(self._items)
        except WireError as error:
            raise ConfigurationRefusal(NakCode.INCOMPLETE, "", str(error)) from None
