"""Streams of frames, damaged in every way a line knows; for soak tests of both codecs."""

from __future__ import annotations

import random
import struct

from campaign.wire import messages as wire
from campaign.wire.frames import encode_frame


def some_message(source: random.Random) -> wire.Message:
    """A message that real traffic has."""
    u32 = source.getrandbits(32)
    count = source.randint(1, 9)
    data = b"".join(struct.pack("<dd", source.gauss(0, 1), 0.0) for _ in range(count))
    return source.choice(
        [
            wire.Hello(2, 2, u32 | 1, "host"),
            wire.Set((wire.Item("task.duration", source.random()), wire.Item("a.b", "text"))),
            wire.Set((wire.Item("task.times", wire.ArraySlice(2, 0, (1.0, 2.0))),)),
            wire.Arm(u32),
            wire.Start(u32 | 1),
            wire.Heartbeat(u32, 1, source.randint(0, 99), u32 & 3),
            wire.Resend(1, source.randint(0, 99), source.randint(1, 99)),
            wire.Release(1),
            wire.Stop(),
            wire.Safe(),
            wire.Safe(u32, "somebody"),
            wire.Clear(),
            wire.Query(),
            wire.Unlatch(u32 & 7, "ada"),
            wire.Bye(u32 | 1),
            wire.Ack(source.getrandbits(16), wire.Kind.SET, wire.State.CONFIGURED, u32),
            wire.Samples(1, u32, u32, count, data),
            wire.Event(1, 3, source.random(), "something"),
            wire.End(1, 4, wire.Outcome.COMPLETED, wire.Fault.NONE, 9, True),
            wire.Latch(True, u32, wire.LatchCause.STOPPED, None, "somebody"),
            wire.Holder(True, 0.0125, "host"),
        ]
    )


def some_frame(source: random.Random) -> tuple[int, int, bytes]:
    """Type, sequence number and body."""
    kind, body = wire.encode(some_message(source))
    return int(kind), source.getrandbits(16), body


def damaged(source: random.Random, frame: bytes) -> bytes:
    """`frame` with bytes changed, lost, doubled, swapped or added, cut, or of pure noise."""
    data = bytearray(frame)
    for _ in range(source.randint(1, 3)):
        at = source.randrange(len(data)) if data else 0
        action = source.randrange(8)
        if action == 0 or not data:
            data[at:at] = source.randbytes(source.randint(1, 8))
        elif action == 1:
            data[at] ^= 1 << source.randrange(8)
        elif action == 2:
            data[at] = source.randrange(256)
        elif action == 3:
            del data[at]
        elif action == 4:
            data[at:at] = data[at : at + 1]
        elif action == 5 and at:
            data[at - 1], data[at] = data[at], data[at - 1]
        elif action == 6:
            del data[at:]
        else:
            data = bytearray(source.randbytes(source.randint(0, 40)))
    return bytes(data)


def stream(
    source: random.Random, frames: int, damage: float
) -> tuple[bytes, list[tuple[int, int, bytes]]]:
    """Bytes of `frames` frames, a share `damage` of them damaged, and all that were ever meant."""
    parts, meant = [], []
    for _ in range(frames):
        what = some_frame(source)
        meant.append(what)
        frame = encode_frame(*what)
        parts.append(damaged(source, frame) if source.random() < damage else frame)
    return b"".join(parts), meant
