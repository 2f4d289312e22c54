"""Address of a drive, `can://INTERFACE/CHANNEL?node=N`, and the process that serves it."""

from __future__ import annotations

import hashlib
import json
import os
import socket
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl, urlsplit

from platformdirs import user_state_path

from campaign.errors import UsageError

SCHEME = "can://"
FORM = "a drive is written can://INTERFACE/CHANNEL?node=N, as can://socketcan/can0?node=5"
BITRATE = 1_000_000
OWN = {"node": (1, 127), "host": (1, 127), "bitrate": (10_000, 1_000_000), "rest": (0, 10**6)}


@dataclass(frozen=True)
class Address:
    """Address of one drive on one bus.

    Attributes:
        text: as written.
        interface, channel: of python-can.
        node: the drive's node-ID.
        host: the node-ID of this program's heartbeat.
        bitrate: bit/s.
        rest: largest motion at rest within `REST_TIME`, in increments of 6064h.
        others: further arguments for python-can.
    """

    text: str
    interface: str
    channel: str
    node: int
    host: int = 127
    bitrate: int = BITRATE
    rest: int = 2
    others: tuple[tuple[str, str], ...] = ()

    def open_bus(self) -> Any:
        """Open a bus of python-can. Raises UsageError with the required action."""
        try:
            import can
            import canopen  # noqa: F401 - one message for both packages
            from can.util import cast_from_string
        except ImportError:
            raise UsageError(
                f"port {self.text!r} needs canopen and python-can; "
                "`pip install 'campaign[canopen]'` brings them"
            ) from None
        extra: dict[str, Any] = {name: cast_from_string(value) for name, value in self.others}
        try:
            return can.Bus(
                interface=self.interface, channel=self.channel, bitrate=self.bitrate, **extra
            )
        except Exception as error:  # noqa: BLE001 - any error of an adapter's driver
            raise UsageError(
                f"port {self.text!r} cannot be opened: {error}; is the adapter plugged in, the "
                "interface up, and does no other program own it?"
            ) from None

    def file(self, kind: str) -> Path:
        """Path of the file for `kind` (`latch` or `port`) of the drive on this computer.

        One per drive (node on its channel), independent of the spelling of its address.
        """
        key = f"{self.interface}/{self.channel}/{self.node}"
        name = hashlib.sha256(key.encode()).hexdigest()[:16]
        return user_state_path("campaign") / "canopen" / f"{name}.{kind}.json"

    def served_at(self) -> int | None:
        """Local TCP port of the process that owns the bus; None without such a process."""
        try:
            port = int((read_tree(self.file("port")) or {})["port"])
            socket.create_connection(("127.0.0.1", port), 1.0).close()
        except (OSError, ValueError, KeyError, TypeError, OverflowError):
            return None
        return port


def address_of(text: str) -> Address:
    """Parse an address. Raises UsageError with the expected form."""
    parts = urlsplit(text)
    values, others = dict[str, int](), []
    for name, value in parse_qsl(parts.query):
        if name not in OWN:
            others.append((name, value))
            continue
        low, high = OWN[name]
        if not value.isascii() or not value.isdigit() or not low <= int(value) <= high:
            raise UsageError(f"port {text!r}: {name} is a number from {low} to {high}; {FORM}")
        values[name] = int(value)
    channel = parts.path.removeprefix("/")
    if not text.startswith(SCHEME) or not parts.netloc or not channel or "node" not in values:
        raise UsageError(f"port {text!r}: {FORM}")
    if values["node"] == values.get("host", 127):
        raise UsageError(f"port {text!r}: node and host are two different numbers")
    return Address(text, parts.netloc, channel, others=tuple(others), **values)


def read_tree(path: Path) -> dict[str, Any] | None:
    """JSON object of a file; None without the file. Raises ValueError for a damaged file."""
    try:
        tree = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    if not isinstance(tree, dict):
        raise ValueError(f"{path} holds no object")
    return tree


def write_whole(path: Path, tree: dict[str, Any]) -> None:
    """Write a file atomically: a crash leaves the old content."""
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_suffix(f".{os.getpid()}")
    beside.write_text(json.dumps(tree), encoding="utf-8")
    beside.replace(path)
