"""A drive on a bus: objects by SDO, samples by PDO, and the way to rest."""

from __future__ import annotations

import contextlib
import logging
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

from campaign.canopen_drive.address import Address
from campaign.canopen_drive.objects import CONTROLWORD, MAPPED, POSITION, STATUSWORD, Item
from campaign.canopen_drive.state import State, state_of, stop_word

SDO_TIMEOUT = 0.5
"""s for an answer, which is asked for twice."""
INTERVAL = 0.02
"""s between two commands on the way to rest."""
REST_TIME = 0.1
"""s in which a drive at rest moves by `Address.rest` increments at most."""
READINGS = 5
"""In a row, of a drive that is off."""
SYNC = 0x80
TPDOS = (0x180, 0x280)
"""COB-ID of each of `MAPPED` for node 0."""
FORMATS = tuple("<" + "".join(item.code for item in items) for items in MAPPED)
OPERATIONAL, PREOPERATIONAL = 0x01, 0x80
"""Commands of NMT."""


class DriveError(Exception):
    """What a drive did not do. `silent`: it did not answer, or the bus is gone."""

    def __init__(self, text: str, *, silent: bool = False, code: int = 0) -> None:
        super().__init__(text)
        self.silent, self.code = silent, code


class RestWatch:
    """Whether a position stays where it is; nothing else counts as rest."""

    def __init__(self, most: int) -> None:
        self._most, self._at, self._since = most, 0, float("inf")

    def seen(self, position: int) -> bool:
        """At rest for `REST_TIME`, with this reading."""
        now = time.monotonic()
        if self._since > now or abs(position - self._at) > self._most:
            self._at, self._since = position, now
        return now - self._since >= REST_TIME

    def unseen(self) -> None:
        """A reading failed."""
        self._since = float("inf")


class Drive:
    """One node. Any thread may use it.

    Attributes:
        mapped: whether RPDO 1 carries the controlword, so that a stop needs no answer.
        emergencies: error codes of EMCY messages that came since they were cleared.
        boots: how often the node has said that it started.
    """

    def __init__(self, address: Address) -> None:
        """Open the bus. Raises UsageError."""
        bus = address.open_bus()  # before the import: it says what is missing
        import canopen

        nothing: Any = canopen.ObjectDictionary  # objects are read by number
        for name in ("canopen", "can"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self.address, self.mapped, self.boots = address, False, 0
        self.emergencies: list[int] = []
        self._asking = threading.Lock()
        self._arrived = threading.Condition()
        self._answers: tuple[list[bytes], ...] = ([], [])
        self._network: Any = canopen.Network(bus)
        self._network.NOTIFIER_CYCLE = 0.1  # s until it notices that it is to end
        self._network.connect()
        node = self._network.add_node(address.node, nothing())
        self._sdo: Any = node.sdo
        self._sdo.RESPONSE_TIMEOUT, self._sdo.MAX_RETRIES = SDO_TIMEOUT, 2
        for cob, take in (
            (TPDOS[0], self._take), (TPDOS[1], self._take), (0x80, self._take_emergency),
            (0x700, self._take_heartbeat),
        ):  # fmt: skip
            self._network.subscribe(cob + address.node, take)

    def close(self) -> None:
        """Let go of the bus."""
        with contextlib.suppress(Exception):
            self._network.disconnect()

    # Objects

    def read(self, item: Item) -> int:
        """Raises DriveError."""
        return int(self._access(item, lambda: item.unpack(self._sdo.upload(item.index, item.sub))))

    def write(self, item: Item, value: int) -> None:
        """Raises DriveError."""
        data = item.pack(value)
        self._access(item, lambda: self._sdo.download(item.index, item.sub, data))

    def _access(self, item: Item, transfer: Callable[[], Any]) -> Any:
        import canopen

        try:
            with self._asking:
                return transfer()
        except canopen.SdoAbortedError as error:
            raise DriveError(f"{item}: the drive answers {error}", code=error.code) from None
        except Exception as error:  # noqa: BLE001 - of any adapter's driver
            raise DriveError(f"{item}: no answer: {error}", silent=True) from None

    # Frames

    def send(self, cob: int, data: bytes) -> None:
        """Raises DriveError."""
        try:
            self._network.send_message(cob, data)
        except Exception as error:  # noqa: BLE001 - of any adapter's driver
            raise DriveError(f"the bus is lost: {error}", silent=True) from None

    def nmt(self, command: int) -> None:
        """To this node alone."""
        self.send(0, bytes((command, self.address.node)))

    def command(self, word: int) -> None:
        """A controlword that waits for no answer."""
        if self.mapped:
            self.send(0x200 + self.address.node, CONTROLWORD.pack(word))

    def sync(self, counter: int | None) -> bool:
        """The next sample begins. False when more frames had come for the last than it has."""
        with self._arrived:
            doubled = any(len(frames) > 1 for frames in self._answers)
            self._answers = ([], [])
        self.send(SYNC, b"" if counter is None else bytes((counter,)))
        return not doubled

    def sample(self, patience: float) -> tuple[int, ...] | None:
        """The values of `MAPPED` that answer the last SYNC; None without them for so long (s)."""
        with self._arrived:
            if not self._arrived.wait_for(lambda: all(self._answers), patience):
                return None
            frames = [each[0] for each in self._answers]
        try:
            parts = [struct.unpack(f, data) for f, data in zip(FORMATS, frames, strict=True)]
        except struct.error:  # of another length
            return None
        return tuple(value for part in parts for value in part)

    def _take(self, cob: int, data: bytearray, timestamp: float) -> None:
        with self._arrived:
            self._answers[TPDOS.index(cob - self.address.node)].append(bytes(data))
            self._arrived.notify_all()

    def _take_emergency(self, cob: int, data: bytearray, timestamp: float) -> None:
        code = int.from_bytes(data[:2], "little")
        if code:  # 0: an error has gone
            self.emergencies.append(code)

    def _take_heartbeat(self, cob: int, data: bytearray, timestamp: float) -> None:
        self.boots += data[:1] == b"\0"

    # Rest

    def look(self) -> tuple[State | None, int]:
        """State and position now. Raises DriveError."""
        return state_of(self.read(STATUSWORD)), self.read(POSITION)

    def bring_to_rest(self, patience: float) -> bool:
        """Quick stop, then off; whether it was seen at rest with its drive off within `patience`.

        Sends nothing that enables. What a statusword says only ends it, or switches off a drive
        that stands.
        """
        deadline = time.monotonic() + patience
        watch, state, at_rest, off = RestWatch(self.address.rest), None, False, 0
        while True:
            word = stop_word(state, at_rest=at_rest)
            with contextlib.suppress(DriveError):
                self.command(word)
            try:
                self.write(CONTROLWORD, word)
                state, position = self.look()
                at_rest = watch.seen(position)
            except DriveError:
                watch.unseen()
                state, at_rest = None, False
            off = off + 1 if state is not None and state.off else 0
            if off >= READINGS and at_rest:
                return True
            if time.monotonic() >= deadline:
                return False
            time.sleep(INTERVAL)
