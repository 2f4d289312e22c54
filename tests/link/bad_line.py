"""A TCP line with faults: loses, repeats, swaps, delays, dribbles, goes deaf, hangs up.

TCP itself never loses or reorders a byte; a serial line or a radio does. What happens to which
bytes is a function of the seed and of their place in the stream alone, so a failure comes back as
far as two programs that talk by the clock can be made to repeat themselves.
"""

from __future__ import annotations

import contextlib
import itertools
import random
import socket
import struct
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum

LONGEST = 300
"""Bytes of a block at most: less than a frame or several of them."""
DRIP = 0.001
"""s between two bytes that dribble."""


class Trouble(StrEnum):
    """What happens to a block of bytes in one direction."""

    DROP = "drop"
    DUPLICATE = "duplicate"
    SWAP = "swap"  # with the block that follows
    DELAY = "delay"
    DRIBBLE = "dribble"  # byte by byte
    DEAF = "deaf"  # nothing more goes this way, not even that it is closed: half open
    RESET = "reset"  # both directions end at once


@dataclass(frozen=True)
class Block:
    """`length` bytes of a direction, and what happens to them; `seconds` of a delay."""

    length: int
    trouble: Trouble | None = None
    seconds: float = 0.0


def schedule(seed: object, rates: Mapping[Trouble, float], quiet: int = 0) -> Iterator[Block]:
    """Endless blocks of drawn length; each meets a trouble with that one's probability.

    `quiet`: bytes before the first.
    """
    source = random.Random(str(seed))
    troubles, weights = list(rates), list(rates.values())
    if quiet:
        yield Block(quiet)
    while True:
        length = source.randint(1, LONGEST)
        (trouble,) = source.choices([*troubles, None], [*weights, 1.0 - sum(weights)])
        yield Block(length, trouble, source.uniform(0.0, 0.4))


class Damage:
    """One direction of one connection. Pure: bytes in, bytes and pauses out.

    Attributes:
        deaf: nothing more goes this way.
    """

    def __init__(self, blocks: Iterator[Block]) -> None:
        """`blocks`: what happens; nothing any more after the last one."""
        self._blocks = itertools.chain(blocks, itertools.repeat(Block(2**62)))
        self._block, self._left = Block(0), 0
        self._kept = bytearray()  # of a block that is needed as a whole
        self._behind: bytes | None = None  # of a block that lets the next one pass
        self.deaf = False

    def feed(self, data: bytes) -> Iterator[bytes | float]:
        """What to send, piece by piece, and how long (s) to wait meanwhile.

        Raises ConnectionResetError where the line is to break.
        """
        while data and not self.deaf:
            if not self._left:
                self._block = next(self._blocks)
                self._left = self._block.length
                yield from self._begin()
                continue
            piece, data = data[: self._left], data[self._left :]
            self._left -= len(piece)
            yield from self._carry(piece)
            if not self._left:
                yield from self._end()

    def _begin(self) -> Iterator[float]:
        if self._block.trouble is Trouble.RESET:
            raise ConnectionResetError
        if self._block.trouble is Trouble.DELAY:
            yield self._block.seconds
        self.deaf = self._block.trouble is Trouble.DEAF

    def _carry(self, piece: bytes) -> Iterator[bytes | float]:
        trouble = self._block.trouble
        if trouble is Trouble.DROP:
            return
        if trouble is Trouble.SWAP or self._behind is not None:
            self._kept += piece
        elif trouble is Trouble.DRIBBLE:
            for value in piece:
                yield bytes([value])
                yield DRIP
        else:
            if trouble is Trouble.DUPLICATE:
                self._kept += piece
            yield piece

    def _end(self) -> Iterator[bytes]:
        whole = bytes(self._kept)
        self._kept.clear()
        if self._behind is not None:
            whole, self._behind = whole + self._behind, None
        elif self._block.trouble is Trouble.SWAP:
            self._behind, whole = whole, b""
        if whole:
            yield whole


class BadLine:
    """Forwards between whoever connects to `port` and a controller, with faults.

    Several connections one after the other share the two streams of blocks, so that a trouble that
    has happened does not happen again to who comes back.

    Attributes:
        met: how many blocks met which trouble.
    """

    def __init__(self, port: str, out: Iterable[Block], back: Iterable[Block]) -> None:
        """`port`: the controller's; `out`: what happens to the host's words, `back`: to its own."""
        host, _, target = port.removeprefix("socket://").rpartition(":")
        self._target = host, int(target)
        self.met: Counter[Trouble] = Counter()
        self._ways = _Shared(out, self.met), _Shared(back, self.met)
        self._ends: list[socket.socket] = []
        self._threads: list[threading.Thread] = []
        self._closed = threading.Event()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def serve(self) -> None:
        """Until it is closed."""
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                try:
                    far = socket.create_connection(self._target)
                except OSError:  # the controller has gone: so has who asks for it
                    near.close()
                    continue
                self._ends += [near, far]
                for one, other, blocks in ((near, far, 0), (far, near, 1)):
                    one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                    thread = threading.Thread(
                        target=self._forward,
                        args=(one, other, Damage(self._ways[blocks])),
                        daemon=True,
                    )
                    thread.start()
                    self._threads.append(thread)

    def close(self) -> None:
        """Nothing is forwarded any more, and no thread is left."""
        self._closed.set()
        # A thread that waits in accept or recv would not notice a close.
        for end in (self._listener, *self._ends):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
        for thread in self._threads:
            thread.join(10)
        for end in (self._listener, *self._ends):
            end.close()

    def _forward(self, one: socket.socket, other: socket.socket, damage: Damage) -> None:
        try:
            while data := one.recv(65536):
                for step in damage.feed(data):
                    if isinstance(step, float):
                        self._closed.wait(step)
                    else:
                        with contextlib.suppress(BrokenPipeError):  # it ends where it is read
                            other.sendall(step)
        except ConnectionResetError:
            for end in (one, other):
                _reset(end)
        except OSError:
            pass
        if not damage.deaf:
            with contextlib.suppress(OSError):
                other.shutdown(socket.SHUT_WR)


class _Shared:
    """An iterator that several threads may draw from, and that counts what it gave."""

    def __init__(self, blocks: Iterable[Block], met: Counter[Trouble]) -> None:
        self._blocks, self._lock, self._met = iter(blocks), threading.Lock(), met

    def __iter__(self) -> _Shared:
        return self

    def __next__(self) -> Block:
        with self._lock:
            block = next(self._blocks)
            if block.trouble is not None:
                self._met[block.trouble] += 1
            return block


def _reset(end: socket.socket) -> None:
    """Break a connection: the other end gets a reset or, at the least, the end of the stream."""
    with contextlib.suppress(OSError):
        end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        end.shutdown(socket.SHUT_RDWR)


@contextmanager
def bad_line(port: str, out: Iterable[Block] = (), back: Iterable[Block] = ()) -> Iterator[BadLine]:
    """A serving line in front of `port`."""
    line = BadLine(port, out, back)
    thread = threading.Thread(target=line.serve, daemon=True)
    thread.start()
    try:
        yield line
    finally:
        line.close()
        thread.join(10)
