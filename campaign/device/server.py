"""The loop of the emulated controller: read, execute, write."""

from __future__ import annotations

import contextlib
import math
import selectors
import socket
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from campaign.device.controller import Controller, Interruption
from campaign.device.faults import FaultSpec
from campaign.device.line import PtyStream, Stream, TcpLine
from campaign.device.machine import Setup
from campaign.device.noise import BadLine
from campaign.wire.frames import FrameDecoder
from campaign.wire.messages import End, Event, Message, Samples, framed

BACKLOG = 256 * 1024
"""Largest send buffer (bytes); a frame that exceeds it is lost, as in a real controller."""
ENOUGH = 64 * 1024
"""Bytes in the send buffer from which the line counts as busy."""


@dataclass
class Client:
    """One connection: send buffer, and decoder of received bytes."""

    stream: Stream
    decoder: FrameDecoder = field(default_factory=FrameDecoder)
    waiting: bytearray = field(default_factory=bytearray)


class Server:
    """Server of a controller until `stop`, or until an exception such as KeyboardInterrupt.

    Attributes:
        controller: the controller.
    """

    def __init__(
        self,
        line: TcpLine | PtyStream,
        setup: Setup,
        *,
        timeout: float,
        faults: Sequence[FaultSpec] = (),
        fault_seed: int = 0,
    ) -> None:
        self._line = line
        self._waker, self._woken = socket.socketpair()
        for end in (self._waker, self._woken):
            end.setblocking(False)
        setup = replace(setup, faults=faults, wake=self.wake, busy=self._busy)
        self._noise = BadLine(faults, fault_seed)
        self._clients: dict[int, Client] = {}
        self._gone_bad = 0  # bad frames of closed connections
        self._names = 0
        self._sequence = 0
        self._stopped = False
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._woken, selectors.EVENT_READ, None)
        self.controller = Controller(setup, self._send, timeout)
        if isinstance(line, PtyStream):
            self._join(line)
        else:
            self._selector.register(line, selectors.EVENT_READ, None)

    def wake(self) -> None:
        """Wake the loop; from any thread."""
        with contextlib.suppress(OSError):  # full: it wakes anyway; closed: it has ended
            self._waker.send(b"\0")

    def stop(self) -> None:
        """End the loop; from any thread."""
        self._stopped = True
        self.wake()

    def serve(self) -> None:
        """Serve, then close the line."""
        try:
            while not self._stopped:
                self._turn()
        finally:
            self.controller.machine.drop()
            for client in list(self._clients.values()):
                client.stream.close()
            self._line_closed()
            self._selector.close()
            self._waker.close()
            self._woken.close()

    def _turn(self) -> None:
        cut = self._cut()
        if cut is not None and cut.unplugged:
            self._unplug()
        for key, events in self._selector.select(self._patience(cut)):
            if key.fileobj is self._woken:
                with contextlib.suppress(OSError):
                    self._woken.recv(4096)
            elif isinstance(key.fileobj, TcpLine):
                self._accept(key.fileobj, cut)
            elif events & selectors.EVENT_READ:
                self._read(key.data, self._cut())
        cut = self._cut()
        if cut is None or cut.unplugged:
            self.controller.tick()
            self._noise.enter(self.controller.machine.running)
        self._flush()

    def _cut(self) -> Interruption | None:
        """Present interruption of the line by a fault, or None."""
        interruption = self.controller.interruption
        return interruption if time.monotonic() < interruption.until else None

    def _patience(self, cut: Interruption | None) -> float | None:
        """Longest wait of the loop (s); None without a limit."""
        if cut is not None and not cut.unplugged:
            due = cut.until
        else:
            due = min(self.controller.deadline(), cut.until if cut else math.inf)
        return None if math.isinf(due) else max(0.0, due - time.monotonic())

    # Clients

    def _join(self, stream: Stream) -> None:
        self._names += 1
        self._clients[self._names] = Client(stream)
        self._selector.register(stream, selectors.EVENT_READ, self._names)

    def _accept(self, line: TcpLine, cut: Interruption | None) -> None:
        stream = line.accept()
        if stream is None:
            return
        if cut is not None and cut.unplugged:
            stream.close()
        else:
            self._join(stream)

    def _leave(self, number: int) -> None:
        client = self._clients.pop(number)
        self._gone_bad += client.decoder.counts.bad
        self._selector.unregister(client.stream)
        client.stream.close()

    def _unplug(self) -> None:
        for number, client in list(self._clients.items()):
            if isinstance(client.stream, PtyStream):
                client.waiting.clear()
            else:
                self._leave(number)

    def _line_closed(self) -> None:
        if isinstance(self._line, TcpLine):
            self._line.close()

    # Bytes

    def _read(self, number: int, cut: Interruption | None) -> None:
        client = self._clients.get(number)
        if client is None:
            return
        data = client.stream.read()
        if data is None:
            self._leave(number)
            return
        if cut is not None:
            return  # received bytes are lost
        for frame in client.decoder.feed(self._noise.received(data)):
            self.controller.bad_frames = self._bad_frames()
            self.controller.handle(number, frame)

    def _bad_frames(self) -> int:
        return self._gone_bad + sum(each.decoder.counts.bad for each in self._clients.values())

    def _send(self, number: int | None, message: Message) -> None:
        if isinstance(message, Samples | Event | End) and self._noise.loses_block():
            return
        cut = self._cut()
        if cut is not None and cut.unplugged:
            return
        self._sequence = (self._sequence + 1) % 2**16
        data = self._noise.sent(framed(message, self._sequence))
        for name, client in self._clients.items():
            if number in (None, name) and len(client.waiting) + len(data) <= BACKLOG:
                client.waiting += data

    def _busy(self) -> bool:
        if any(len(client.waiting) >= ENOUGH for client in self._clients.values()):
            self._flush()
        return any(len(client.waiting) >= ENOUGH for client in self._clients.values())

    def _flush(self) -> None:
        for number, client in self._clients.items():
            if client.waiting:
                del client.waiting[: client.stream.write(bytes(client.waiting[:65536]))]
            wanted = selectors.EVENT_READ | (selectors.EVENT_WRITE if client.waiting else 0)
            if self._selector.get_key(client.stream).events != wanted:
                self._selector.modify(client.stream, wanted, number)
