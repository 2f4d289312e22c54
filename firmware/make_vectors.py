"""Write vectors.txt: what both codecs, the host's and the reference in C, must agree on.

`python firmware/make_vectors.py > firmware/vectors.txt`, after a change of the protocol only.
"""

from __future__ import annotations

import struct
import sys
import zlib

from campaign.wire import cobs
from campaign.wire import messages as wire
from campaign.wire.frames import MAX_BODY, encode_frame

EXAMPLES: list[tuple[int, wire.Message]] = [
    (1, wire.Hello(2, 2, 0x12345678, "campaign")),
    (
        2,
        wire.Set(
            (
                wire.Item("task.mode", "rate"),
                wire.Item("task.command.amplitude", 0.5),
                wire.Item("rehearsal.seed", -1),
                wire.Item("task.hold", True),
                wire.Item("task.command.times", wire.ArraySlice(3, 1, (0.0, 2.5))),
            )
        ),
    ),
    (3, wire.Arm(0xCBF43926)),
    (4, wire.Start(1)),
    (0, wire.Heartbeat(1, 1, 17, 0x12345678)),
    (0, wire.Resend(1, 5, 2)),
    (5, wire.Stop()),
    (6, wire.Release(1)),
    (0, wire.Safe()),
    (9, wire.Safe(0x12345678, "stop")),
    (7, wire.Clear()),
    (0, wire.Query()),
    (10, wire.Unlatch(3, "ada")),
    (0, wire.Bye(0x12345678)),
    (
        0,
        wire.Capabilities(
            1, 2, 2, 2, 0xB007, wire.State.IDLE, 0.1, 256, 4096, 1000.0, "servo", "1.0",
            ("rate", "torque"), ("observer",), (wire.Item("limits.angle", 0.75),),
        ),
    ),
    (1, wire.Ack(2, wire.Kind.SET, wire.State.CONFIGURED, 0xB007)),
    (2, wire.Nak(3, 3, wire.NakCode.LIMIT, wire.State.CONFIGURED, "task.command", "too fast")),
    (
        3,
        wire.Channels(
            3, 2, 0, 1000.0,
            (
                wire.Channel("gyro_rate", "rad/s", "deg/s", "Rate"),
                wire.Channel("current", "A", "A", "Strom (µ)", False, wire.Format.I16, 0.001),
            ),
        ),
    ),
    (
        4,
        wire.Status(
            wire.State.RUNNING, wire.Fault.NONE, False, True, 0xB007, 12.5, 9, 0.0125, 1, 3, 17, 14,
            2, 41.5,
        ),
    ),
    (5, wire.Samples(1, 0, 0, 2, struct.pack("<dhdh", 0.5, 100, -0.5, -100))),
    (6, wire.Event(1, 1, 0.002, "the rate that ends the trial was reached")),
    (7, wire.End(1, 2, wire.Outcome.FAULT, wire.Fault.DRIVE, 2, True, "drive fault 17")),
    (8, wire.LostRecords(1, 0, 3)),
    (9, wire.Latch(True, 3, wire.LatchCause.STOPPED, 2.5, "stop")),
    (10, wire.Holder(True, 0.0125, "ada@lab-3 pid 4711, run")),
]  # fmt: skip
"""Sequence number and message: one of every type, and the second form of SAFE."""

SAFE_BODIES = [
    b"",
    b"\x78\x56\x34\x12",
    b"\x78\x56\x34\x12\x04stop",
    b"\x78\x56\x34\x12\x00",
    bytes(4),
    bytes(4) + b"\x04stop",
    b"\x78\x56\x34",
    b"\x78\x56\x34\x12\x05stop",
    b"\x78\x56\x34\x12\x04stop\0",
    b"\x78\x56\x34\x12\x04st\xffp",
    b"\x78\x56\x34\x12\x05" + "µm/h".encode(),
]
"""Whole and damaged ones: each is a SAFE, if only nobody's."""


def vectors() -> list[str]:
    """The lines of the file."""
    every = bytes(range(256))
    plain = [b"", b"\0", b"\0\0", b"\x11\x22\0\x33", b"\x11\0\0\0", every[1:255], every[:255]]
    plain += [every[1:], every[2:] + b"\0", every[3:] + b"\0\x01", b"\x01" * 508, bytes(300)]
    lines = ["# What both codecs agree on; octets in hexadecimal, - for none."]
    lines += ["# crc DATA CRC", "# cobs PLAIN ENCODED", "# frame TYPE SEQUENCE BODY FRAME"]
    lines += ["# bad REASON STREAM: no frame in it, and one count of this reason"]
    lines += ["# safe BODY SESSION HOST: what such a SAFE says; 0 and no host of what is nobody's"]
    for data in (b"", b"123456789", bytes(4), every):
        lines.append(f"crc {_hex(data)} {zlib.crc32(data):08x}")
    lines += [f"cobs {_hex(data)} {_hex(cobs.encode(data))}" for data in plain]
    for sequence, message in EXAMPLES:
        kind, body = wire.encode(message)
        frame = encode_frame(kind, sequence, body)
        lines.append(f"frame {int(kind)} {sequence} {_hex(body)} {_hex(frame)}")
    longest = (b"\0\x01" + every[1:]) * 4
    lines.append(f"frame 134 65535 {_hex(longest[:MAX_BODY])} ")
    lines[-1] += _hex(encode_frame(134, 65535, longest[:MAX_BODY]))
    good = encode_frame(wire.Kind.STOP, 5, b"")
    damaged = bytearray(good)
    damaged[3] ^= 0x01
    bad = {
        "bad_crc": bytes(damaged),
        "bad_cobs": good[:-3] + good[-1:],
        "too_short": b"\0" + cobs.encode(b"abc") + b"\0",
        "too_long": b"\0" + b"\x01" * 2000 + b"\0",
        "wrong_version": encode_frame(wire.Kind.STOP, 5, b"", version=2),
    }
    lines += [f"bad {reason} {_hex(stream)}" for reason, stream in bad.items()]
    lines += [f"safe {_hex(body)} {_understood(body)}" for body in SAFE_BODIES]
    return lines


def _understood(body: bytes) -> str:
    message = wire.decode(wire.Kind.SAFE, body)
    if not isinstance(message, wire.Safe):
        raise TypeError("every SAFE is one")
    return f"{message.session} {_hex(message.host.encode())}"


def _hex(data: bytes) -> str:
    return data.hex() or "-"


if __name__ == "__main__":
    sys.stdout.write("\n".join(vectors()) + "\n")
