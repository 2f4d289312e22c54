"""Connections of the emulated controller: TCP or a pseudo-terminal, nonblocking."""

from __future__ import annotations

import os
import socket
from typing import Protocol

from campaign.errors import UsageError

CHUNK = 65536


class Stream(Protocol):
    """Bytes to and from one client."""

    def fileno(self) -> int:
        """File descriptor for a selector."""

    def read(self) -> bytes | None:
        """Received bytes; None if the client has disconnected."""

    def write(self, data: bytes) -> int:
        """Send a part of `data`; return the number of bytes sent."""

    def close(self) -> None:
        """Close the connection."""


class TcpStream:
    """One TCP connection."""

    def __init__(self, connection: socket.socket) -> None:
        connection.setblocking(False)
        # Send a status at once, not together with later data.
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._connection = connection

    def fileno(self) -> int:
        return self._connection.fileno()

    def read(self) -> bytes | None:
        try:
            return self._connection.recv(CHUNK) or None
        except BlockingIOError:
            return b""
        except OSError:
            return None

    def write(self, data: bytes) -> int:
        """Send a part of `data`; reading detects a disconnected client."""
        try:
            return self._connection.send(data)
        except BlockingIOError:
            return 0
        except OSError:
            return len(data)

    def close(self) -> None:
        self._connection.close()


class TcpLine:
    """A listening socket.

    Attributes:
        name: address in the form of `--port`.
    """

    def __init__(self, address: str) -> None:
        """`address`: HOST:PORT, port 0 for any. Raises UsageError."""
        host, _, port = address.rpartition(":")
        host = host.removeprefix("[").removesuffix("]")
        if not host or not (port.isascii() and port.isdigit()) or int(port) > 65535:
            raise UsageError(f"--tcp {address}: an address is HOST:PORT, e.g. 127.0.0.1:4000")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            if os.name != "nt":  # on Windows it would let two controllers share a port
                self._listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            self._listener.bind((host, int(port)))
            self._listener.listen()
        except OSError as error:
            self._listener.close()
            reason = error.strerror or str(error)
            raise UsageError(f"--tcp {address}: cannot listen there: {reason}") from None
        self._listener.setblocking(False)
        bound = self._listener.getsockname()
        shown = f"[{bound[0]}]" if family == socket.AF_INET6 else bound[0]
        self.name = f"socket://{shown}:{bound[1]}"

    def fileno(self) -> int:
        """File descriptor for a selector: readable when a client connects."""
        return self._listener.fileno()

    def accept(self) -> TcpStream | None:
        """The next connection; None if no client waits."""
        try:
            connection, _ = self._listener.accept()
        except OSError:
            return None
        return TcpStream(connection)

    def close(self) -> None:
        self._listener.close()


class PtyStream:
    """The controller's end of a pseudo-terminal; the process at the other end is the only client.

    Attributes:
        name: path in the form of `--port`.
    """

    def __init__(self) -> None:
        """Open a pseudo-terminal. Raises UsageError if the system has none."""
        try:
            import pty
            import tty
        except ImportError:
            raise UsageError("--pty: this system has no pseudo-terminals; use --tcp") from None
        try:
            self._ours, self._theirs = pty.openpty()
        except OSError as error:
            raise UsageError(f"--pty: {error.strerror}") from None
        # The client's end stays open here, too: without a client, reading would fail.
        tty.setraw(self._theirs)
        os.set_blocking(self._ours, False)
        self.name = os.ttyname(self._theirs)

    def fileno(self) -> int:
        return self._ours

    def read(self) -> bytes | None:
        try:
            return os.read(self._ours, CHUNK)
        except OSError:
            return b""

    def write(self, data: bytes) -> int:
        try:
            return os.write(self._ours, data)
        except OSError:
            return 0

    def close(self) -> None:
        """Close both ends."""
        os.close(self._ours)
        os.close(self._theirs)
