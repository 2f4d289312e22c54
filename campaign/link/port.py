"""The port of a controller: a serial device, TCP as `socket://HOST:PORT`, or a drive on CAN."""

from __future__ import annotations

import contextlib
import select
import socket
import time
from typing import Any, Protocol
from urllib.parse import urlsplit

from campaign.errors import UsageError

POLL = 0.05
"""Time limit (s) of a read for the first byte."""
CHUNK = 65536
ANSWER = 2.0
"""Time limit (s) for the answer of the process that owns a CAN bus."""
STOLEN_READS = 20
"""Successive empty reads until a serial port counts as lost: another process may read it, too."""


class Port(Protocol):
    """Bytes in both directions. Every method raises OSError if the line is lost."""

    def read(self) -> bytes:
        """Received bytes, after at most POLL; may be empty."""

    def write(self, data: bytes) -> None:
        """Send all bytes."""

    def close(self) -> None:
        """Close the line; never raises."""


def open_port(name: str, baud: int, *, exclusive: bool) -> Port:
    """Open `name`; `exclusive` excludes other exclusive users of a serial port.

    Raises UsageError, with an action, if it cannot be opened.
    """
    if name.startswith("socket://"):
        return _open_socket(name)
    if name.startswith("can://"):
        return _open_drive(name)
    return _open_serial(name, baud, exclusive)


def _open_socket(name: str) -> Port:
    try:
        parts = urlsplit(name)
        host, number = parts.hostname, parts.port
    except ValueError:
        host = number = None
    if not host or not number:
        raise UsageError(f"port {name!r}: TCP is written socket://HOST:PORT")
    try:
        return SocketPort(socket.create_connection((host, number), timeout=5.0))
    except OSError as error:
        raise UsageError(
            f"port {name!r}: no answer ({error.strerror or error}); "
            "is the controller, or `campaign device --tcp`, running?"
        ) from None


def _open_drive(name: str) -> Port:
    """Connect to the process that owns the bus; if there is none or it hangs, use the bus."""
    from campaign.canopen_drive.address import address_of
    from campaign.canopen_drive.line import DirectLine
    from campaign.wire.messages import Query, framed

    address = address_of(name)
    port = address.served_at()
    if port is not None:
        with contextlib.suppress(UsageError, OSError):
            line = _open_socket(f"socket://127.0.0.1:{port}")
            line.write(framed(Query()))
            deadline = time.monotonic() + ANSWER
            while time.monotonic() < deadline:
                if line.read():
                    return line
            line.close()
    return DirectLine(address)


class SocketPort:
    """A TCP connection."""

    def __init__(self, connection: socket.socket) -> None:
        connection.settimeout(None)
        # Send a heartbeat at once, not together with later data.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection = connection

    def read(self) -> bytes:
        try:
            ready, _, _ = select.select([self._connection], [], [], POLL)
        except ValueError as error:  # closed by another thread
            raise ConnectionError("the connection is closed") from error
        if not ready:
            return b""
        data = self._connection.recv(CHUNK)
        if not data:
            raise ConnectionError("the other end closed the connection")
        return data

    def write(self, data: bytes) -> None:
        self._connection.sendall(data)

    def close(self) -> None:
        """Close the line, even if a thread waits for data."""
        with contextlib.suppress(OSError):
            self._connection.shutdown(socket.SHUT_RDWR)
        self._connection.close()


def _open_serial(name: str, baud: int, exclusive: bool) -> Port:
    try:
        import serial
    except ImportError:
        raise UsageError(
            f"port {name!r}: serial ports need pyserial; `pip install 'campaign[serial]'` brings it"
        ) from None
    try:
        device = serial.Serial(
            name, baud, timeout=POLL, write_timeout=2.0, exclusive=True if exclusive else None
        )
    except (OSError, ValueError) as error:  # pyserial's own errors are OSErrors
        raise UsageError(
            f"port {name!r} cannot be opened: {_plain(error)}; {_advice(error)}"
        ) from None
    return SerialPort(device)


class SerialPort:
    """A serial device by pyserial."""

    def __init__(self, device: Any) -> None:
        self._device = device
        self._empty = 0

    def read(self) -> bytes:
        try:
            data = bytes(self._device.read(max(1, self._device.in_waiting)))
        except (TypeError, AttributeError) as error:  # closed by another thread
            raise ConnectionError("the port is closed") from error
        except OSError as error:
            # "Ready, but no data": the adapter was removed, or `campaign stop` reads the port, too.
            self._empty += 1
            if "no data" not in str(error) or self._empty > STOLEN_READS:
                raise
            time.sleep(0.005)
            return b""
        if data:
            self._empty = 0
        return data

    def write(self, data: bytes) -> None:
        try:
            self._device.write(data)
        except (TypeError, AttributeError) as error:
            raise ConnectionError("the port is closed") from error

    def close(self) -> None:
        with contextlib.suppress(OSError):
            self._device.close()


def _plain(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def _advice(error: Exception) -> str:
    text = str(error)
    if "No such file" in text or "FileNotFound" in text:
        return (
            "is the adapter plugged in? `python -m serial.tools.list_ports` lists the ports; a TCP "
            "port is written socket://HOST:PORT"
        )
    if "ermission" in text:
        return "your account may lack the right to use it (on Linux the group `dialout`)"
    if "lock" in text or "temporarily unavailable" in text:
        return "another program has it; `campaign stop --port` works all the same"
    return "check its name and the baud rate"
