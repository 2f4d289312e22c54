"""A drive on a bus: objects by SDO, samples by PDO, and stopping."""

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
"""s; time limit of an answer; two attempts."""
INTERVAL = 0.02
"""s between two commands while the drive comes to rest."""
REST_TIME = 0.1
"""s in which a drive at rest moves by at most `Address.rest` increments."""
READINGS = 5
"""Number of consecutive readings of a drive that is off."""
SYNC = 0x80
TPDOS = (0x180, 0x280)
"""COB-ID of each of `MAPPED` for node 0."""
FORMATS = tuple("<" + "".join(item.code for item in items) for items in MAPPED)
OPERATIONAL, PREOPERATIONAL = 0x01, 0x80
"""Commands of NMT."""


class DriveError(Exception):
    """Failed access to a drive. `silent`: no answer, or the bus is lost."""

    def __init__(self, text: str, *, silent: bool = False, code: int = 0) -> None:
        super().__init__(text)
        self.silent, self.code = silent, code


class RestWatch:
    """Detects rest from constant position readings only."""

    def __init__(self, most: int) -> None:
        self._most, self._at, self._since = most, 0, float("inf")

    def seen(self, position: int) -> bool:
        """Add a reading; whether the position was constant for `REST_TIME`."""
        now = time.monotonic()
        if self._since > now or abs(position - self._at) > self._most:
            self._at, self._since = position, now
        return now - self._since >= REST_TIME

    def unseen(self) -> None:
        """Note a failed reading."""
        self._since = float("inf")


class Drive:
    """One node. Any thread may use it.

    Attributes:
        mapped: whether RPDO 1 carries the controlword, so that a stop needs no answer.
        emergencies: error codes of EMCY messages since the list was cleared.
        boots: number of boot-up messages of the node.
    """

    def __init__(self, address: Address) -> None:
        """Open the bus. Raises UsageError."""
        bus = address.open_bus()  # before the import: it reports missing packages
        import canopen

        nothing: Any = canopen.ObjectDictionary  # empty: objects are accessed by number
        for name in ("canopen", "can"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self.address, self.mapped, self.boots = address, False, 0
        self.emergencies: list[int] = []
        self._asking = threading.Lock()
        self._arrived = threading.Condition()
        self._answers: tuple[list[bytes], ...] = ([], [])
        self._network: Any = canopen.Network(bus)
        self._network.NOTIFIER_CYCLE = 0.1  # s; poll interval of its end
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
        """Close the bus."""
        with contextlib.suppress(Exception):
            self._network.disconnect()

    # Objects

    def read(self, item: Item) -> int:
        """Read an object. Raises DriveError."""
        return int(self._access(item, lambda: item.unpack(self._sdo.upload(item.index, item.sub))))

    def write(self, item: Item, value: int) -> None:
        """Write an object. Raises DriveError."""
        data = item.pack(value)
        self._access(item, lambda: self._sdo.download(item.index, item.sub, data))

    def _access(self, item: Item, transfer: Callable[[], Any]) -> Any:
        import canopen

        try:
            with self._asking:
                return transfer()
        except canopen.SdoAbortedError as error:
            raise DriveError(f"{item}: the drive answers {error}", code=error.code) from None
        except Exception as error:  # noqa: BLE001 - any error of an adapter's driver
            raise DriveError(f"{item}: no answer: {error}", silent=True) from None

    # Frames

    def send(self, cob: int, data: bytes) -> None:
        """Send a frame. Raises DriveError."""
        try:
            self._network.send_message(cob, data)
        except Exception as error:  # noqa: BLE001 - any error of an adapter's driver
            raise DriveError(f"the bus is lost: {error}", silent=True) from None

    def nmt(self, command: int) -> None:
        """Send an NMT command to this node only."""
        self.send(0, bytes((command, self.address.node)))

    def command(self, word: int) -> None:
        """Send a controlword without waiting for an answer."""
        if self.mapped:
            self.send(0x200 + self.address.node, CONTROLWORD.pack(word))

    def sync(self, counter: int | None) -> bool:
        """Send SYNC for the next sample. False if the last sample got duplicate frames."""
        with self._arrived:
            doubled = any(len(frames) > 1 for frames in self._answers)
            self._answers = ([], [])
        self.send(SYNC, b"" if counter is None else bytes((counter,)))
        return not doubled

    def sample(self, patience: float) -> tuple[int, ...] | None:
        """Values of `MAPPED` in answer to the last SYNC; None after `patience` (s)."""
        with self._arrived:
            if not self._arrived.wait_for(lambda: all(self._answers), patience):
                return None
            frames = [each[0] for each in self._answers]
        try:
            parts = [struct.unpack(f, data) for f, data in zip(FORMATS, frames, strict=True)]
        except struct.error:  # wrong length
            return None
        return tuple(value for part in parts for value in part)

    def _take(self, cob: int, data: bytearray, timestamp: float) -> None:
        with self._arrived:
            self._answers[TPDOS.index(cob - self.address.node)].append(bytes(data))
            self._arrived.notify_all()

    def _take_emergency(self, cob: int, data: bytearray, timestamp: float) -> None:
        code = int.from_bytes(data[:2], "little")
        if code:  # 0: error reset
            self.emergencies.append(code)

    def _take_heartbeat(self, cob: int, data: bytearray, timestamp: float) -> None:
        self.boots += data[:1] == b"\0"

    # Rest

    def look(self) -> tuple[State | None, int]:
        """Present state and position. Raises DriveError."""
        return state_of(self.read(STATUSWORD)), self.read(POSITION)

    def bring_to_rest(self, patience: float) -> bool:
        """Quick stop, then off; whether it was observed at rest and off within `patience` (s).

        Sends no command that enables. A statusword can only end the procedure or switch off a drive
        at rest.
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
