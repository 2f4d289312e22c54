"""A TCP line between host and controller on which something happens just before a chosen frame."""

from __future__ import annotations

import contextlib
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from campaign.wire.codes import Kind
from campaign.wire.frames import Frame, FrameDecoder


class Cut:
    """Finds whole frames in one direction of a stream, each with the bytes up to its end."""

    def __init__(self) -> None:
        self._decoder = FrameDecoder()

    def feed(self, data: bytes) -> Iterator[tuple[bytes, list[Frame]]]:
        """Pieces of `data`, and the frames that each of them completes."""
        while data:
            end = data.find(b"\0") + 1 or len(data)
            piece, data = data[:end], data[end:]
            yield piece, self._decoder.feed(piece)


class Proxy:
    """Forwards everything; before the `number`-th frame of `kind` from the host, `act` is called.

    `act` has ended before the controller hears that frame.
    """

    def __init__(self, port: str, kind: Kind, number: int, act: Callable[[], None]) -> None:
        host, _, target = port.removeprefix("socket://").rpartition(":")
        self._target = host, int(target)
        self._kind, self._left, self._act = kind, number, act
        self._lock = threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"
        self.acted = threading.Event()
        self._ends: list[socket.socket] = []
        self._whole = threading.Event()
        self._whole.set()

    def serve(self) -> None:
        """Until the listener is closed."""
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                self._whole.wait()
                far = socket.create_connection(self._target)
                self._ends += [near, far]
                for one, other, cut in ((near, far, Cut()), (far, near, None)):
                    threading.Thread(
                        target=self._forward, args=(one, other, cut), daemon=True
                    ).start()

    def cut(self) -> None:
        """Nothing passes until `mend`, and what is connected is not any more."""
        self._whole.clear()
        for end in self._ends:
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)

    def mend(self) -> None:
        """The line is whole again for who connects."""
        self._whole.set()

    def close(self) -> None:
        self._whole.set()
        # A thread that waits in accept would keep the socket listening.
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()

    def _forward(self, one: socket.socket, other: socket.socket, cut: Cut | None) -> None:
        with contextlib.suppress(OSError):
            while data := one.recv(65536):
                for piece, frames in cut.feed(data) if cut is not None else [(data, [])]:
                    for frame in frames:
                        self._see(frame)
                    other.sendall(piece)
        for end in (one, other):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _see(self, frame: Frame) -> None:
        with self._lock:
            if frame.kind != self._kind or self._left == 0:
                return
            self._left -= 1
            due = self._left == 0
        if due:
            self._act()
            self.acted.set()


@contextmanager
def proxy(port: str, kind: Kind, number: int, act: Callable[[], None]) -> Iterator[Proxy]:
    """A serving proxy in front of `port`."""
    line = Proxy(port, kind, number, act)
    thread = threading.Thread(target=line.serve, daemon=True)
    thread.start()
    try:
        yield line
    finally:
        line.close()
        thread.join(10)
