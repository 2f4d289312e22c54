"""A CAN adapter of the tests: slcan over TCP on one side, a virtual bus on the other.

It drops, doubles and delays frames as a test says.
"""

from __future__ import annotations

import contextlib
import socket
import threading
import time
from collections.abc import Callable

import can

Fate = Callable[[bool, int, bytes], list[float]]
"""Whether a frame goes to the drive, its identifier and data: the delay (s) of each copy of it."""


def unharmed(to_drive: bool, cob: int, data: bytes) -> list[float]:
    return [0.0]


def cut(to_drive: bool, cob: int, data: bytes) -> list[float]:
    return []


class Hub:
    """Attributes:
    fate: of every frame.
    beats: heartbeats of the host that came.
    """

    def __init__(self, channel: str) -> None:
        self.fate: Fate = unharmed
        self.beats = 0
        self._bus = can.Bus(interface="virtual", channel=channel)
        self._listener = socket.create_server(("127.0.0.1", 0))
        port = self._listener.getsockname()[1]
        self.port = f"can://slcan/socket://127.0.0.1:{port}?node=5&sleep_after_open=0"
        self.clients: list[socket.socket] = []
        self._closed = False
        self._threads = [
            threading.Thread(target=work, daemon=True) for work in (self._accept, self._from_bus)
        ]
        for thread in self._threads:
            thread.start()

    def __enter__(self) -> Hub:
        return self

    def __exit__(self, *exception: object) -> None:
        self._closed = True
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        for client in self.clients[:]:
            with contextlib.suppress(OSError):
                client.shutdown(socket.SHUT_RDWR)
            client.close()
        for thread in self._threads:
            thread.join(10)
        self._bus.shutdown()

    def _accept(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                near.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                self.clients.append(near)
                thread = threading.Thread(target=self._from_client, args=(near,), daemon=True)
                self._threads.append(thread)
                thread.start()

    def _from_client(self, near: socket.socket) -> None:
        rest = b""
        with contextlib.suppress(OSError, can.CanError):
            while True:
                if hasattr(socket, "TCP_QUICKACK"):  # pyserial's second frame waits for it
                    near.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
                if not (data := near.recv(65536)):
                    break
                *lines, rest = (rest + data).split(b"\r")
                for line in lines:
                    if line[:1] == b"t":
                        cob, content = int(line[1:4], 16), bytes.fromhex(line[5:].decode())
                        self._to_drive(cob, content)
        self.clients.remove(near)
        near.close()

    def _to_drive(self, cob: int, data: bytes) -> None:
        self.beats += cob == 0x77F
        for delay in self.fate(True, cob, data):
            time.sleep(delay)
            self._bus.send(can.Message(arbitration_id=cob, data=data, is_extended_id=False))

    def _from_bus(self) -> None:
        while not self._closed:
            message = self._bus.recv(0.05)
            if message is None:
                continue
            cob, data = message.arbitration_id, bytes(message.data)
            for delay in self.fate(False, cob, data):
                time.sleep(delay)
                line = b"t%03X%d%s\r" % (cob, len(data), data.hex().encode())
                for client in self.clients[:]:
                    with contextlib.suppress(OSError):
                        client.sendall(line)
