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
"""s a read waits for the first byte."""
CHUNK = 65536
ANSWER = 2.0
"""s that the process that owns a CAN bus may take to answer."""
STOLEN_READS = 20
"""Empty reads in a row until a serial port counts as lost: another process may read it as well."""


class Port(Protocol):
    """Bytes both ways. Every method raises OSError when the line is lost."""

    def read(self) -> bytes:
        """What has come, after at most POLL; empty when nothing has."""

    def write(self, data: bytes) -> None:
        """Send all of it."""

    def close(self) -> None:
        """Let go of the line; never raises."""


def open_port(name: str, baud: int, *, exclusive: bool) -> Port:
    """Open `name`; `exclusive` keeps another exclusive opener of a serial port out.

    Raises UsageError, with what to do, when it cannot be opened.
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
    """At the process that owns the bus; on the bus where none is, or where it hangs."""
    from campaign.canopen_drive.address import address_of
    from campaign.canopen_drive.line import DirectLine
    from campaign.link.safe import query_frame

    address = address_of(name)
    port = address.served_at()
    if port is not None:
        with contextlib.suppress(UsageError, OSError):
            line = _open_socket(f"socket://127.0.0.1:{port}")
            line.write(query_frame())
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
        # A heartbeat must not wait for company.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection = connection

    def read(self) -> bytes:
        """What has come, after at most POLL."""
        try:
            ready, _, _ = select.select([self._connection], [], [], POLL)
        except ValueError as error:  # closed meanwhile
            raise ConnectionError("the connection is closed") from error
        if not ready:
            return b""
        data = self._connection.recv(CHUNK)
        if not data:
            raise ConnectionError("the other end closed the connection")
        return data

    def write(self, data: bytes) -> None:
        """Send all of it."""
        self._connection.sendall(data)

    def close(self) -> None:
        """Let go of the line, whatever a thread waits for on it."""
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
        """What has come, after at most POLL."""
        try:
            data = bytes(self._device.read(max(1, self._device.in_waiting)))
        except (TypeError, AttributeError) as error:  # closed meanwhile, by another thread
            raise ConnectionError("the port is closed") from error
        except OSError as error:
            # "Ready, but nothing there" is a plug pulled, or `campaign stop` reading beside us.
            self._empty += 1
            if "no data" not in str(error) or self._empty > STOLEN_READS:
                raise
            time.sleep(0.005)
            return b""
        if data:
            self._empty = 0
        return data

    def write(self, data: bytes) -> None:
        """Send all of it."""
        try:
            self._device.write(data)
        except (TypeError, AttributeError) as error:
            raise ConnectionError("the port is closed") from error

    def close(self) -> None:
        """Let go of the line."""
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
