"""A controller of version 1: it knows no latch, and answers SAFE as it always did.

Written from the protocol of then, frame by frame, and not from today's messages.
"""

from __future__ import annotations

import socketserver
import struct
import threading
from typing import Self

from campaign.wire.frames import FrameDecoder, encode_frame

HELLO, SAFE, CAPABILITIES, ACK, STATUS = 0x01, 0x09, 0x81, 0x82, 0x85
BOOT = 77


def status(state: int) -> bytes:
    """At rest, drive off."""
    head = struct.pack("<BBBBI", state, 0, 1, 0, BOOT)
    clock, age, celsius = 1.0, 0.5, float("nan")
    return head + struct.pack("<dIdIIIIId", clock, 0, age, 0, 0, 0, 0, 0, celsius)


def capabilities(sequence: int) -> bytes:
    """Of a device that speaks version 1 only, to a host that does not."""
    head = struct.pack("<HBBBIBdIId", sequence, 0, 1, 1, BOOT, 0, 0.1, 16, 64, 1000.0)
    texts = b"".join(bytes((len(text),)) + text for text in (b"old", b"1.0"))
    return head + texts + bytes(3)  # no features, no compensations, no limits


class OldController(socketserver.ThreadingTCPServer):
    """Listens on a free port.

    Attributes:
        stops: how many SAFE were heard.
    """

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Line)
        self.stops = 0
        self.port = f"socket://127.0.0.1:{self.server_address[1]}"

    def __enter__(self) -> Self:
        threading.Thread(target=self.serve_forever, args=(0.01,), daemon=True).start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.shutdown()
        self.server_close()


class _Line(socketserver.BaseRequestHandler):
    server: OldController

    def handle(self) -> None:
        decoder = FrameDecoder()
        while data := self.request.recv(4096):
            for frame in decoder.feed(data):
                if frame.kind == HELLO:
                    self._send(CAPABILITIES, capabilities(frame.sequence))
                if frame.kind == SAFE:
                    self.server.stops += 1
                    self._send(ACK, struct.pack("<HBBI", frame.sequence, SAFE, 5, BOOT))
                    self._send(STATUS, status(5))

    def _send(self, kind: int, body: bytes) -> None:
        self.request.sendall(encode_frame(kind, 0, body))
