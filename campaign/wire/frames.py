"""Frames: header, body and checksum between two zero bytes.

A frame is `0x00 COBS(header body crc) 0x00`; the header is version u8, type u8, sequence u16; the
checksum is CRC-32 (the one of Ethernet and zlib) over header and body; everything little-endian.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

from campaign.wire import cobs
from campaign.wire.codes import FRAME_VERSION, WireError

MAX_BODY = 1024
"""Largest body (bytes)."""
HEADER = struct.Struct("<BBH")
CHECKSUM = struct.Struct("<I")
OVERHEAD = HEADER.size + CHECKSUM.size
MAX_ENCODED = cobs.encoded_length(MAX_BODY + OVERHEAD)
"""Largest number of bytes between two delimiters."""


@dataclass(frozen=True)
class Frame:
    """An intact frame; its `kind` may be unknown, its `body` malformed."""

    kind: int
    sequence: int
    body: bytes
    version: int = FRAME_VERSION


@dataclass
class Counts:
    """Numbers of frames in a decoder, by result."""

    good: int = 0
    bad_cobs: int = 0
    too_short: int = 0
    too_long: int = 0
    bad_crc: int = 0
    wrong_version: int = 0

    @property
    def bad(self) -> int:
        """Number of discarded frames."""
        return self.bad_cobs + self.too_short + self.too_long + self.bad_crc + self.wrong_version


def encode_frame(kind: int, sequence: int, body: bytes, version: int = FRAME_VERSION) -> bytes:
    """The bytes to send, delimiters included. Raises WireError if the body is too long."""
    if len(body) > MAX_BODY:
        raise WireError(f"a message of {len(body)} bytes; a frame carries {MAX_BODY}")
    content = HEADER.pack(version, kind, sequence & 0xFFFF) + body
    return b"\0" + cobs.encode(content + CHECKSUM.pack(zlib.crc32(content))) + b"\0"


def decode_frame(encoded: bytes, counts: Counts) -> Frame | None:
    """Decode the bytes between two delimiters; update `counts`; None if they are not a frame."""
    if len(encoded) > MAX_ENCODED:
        counts.too_long += 1
        return None
    try:
        content = cobs.decode(encoded)
    except WireError:
        counts.bad_cobs += 1
        return None
    if len(content) < OVERHEAD:
        counts.too_short += 1
        return None
    if len(content) > MAX_BODY + OVERHEAD:
        counts.too_long += 1
        return None
    end = len(content) - CHECKSUM.size
    if zlib.crc32(content[:end]) != CHECKSUM.unpack_from(content, end)[0]:
        counts.bad_crc += 1
        return None
    version, kind, sequence = HEADER.unpack_from(content)
    if version != FRAME_VERSION:
        counts.wrong_version += 1
        return None
    counts.good += 1
    return Frame(kind, sequence, content[HEADER.size : end], version)


class FrameDecoder:
    """Decoder of frames in any byte stream; buffers at most one frame.

    Attributes:
        counts: numbers of accepted and discarded frames.
    """

    def __init__(self) -> None:
        self.counts = Counts()
        self._partial = bytearray()
        self._overlong = False

    def feed(self, data: bytes) -> list[Frame]:
        """The frames that `data` completes, in order."""
        frames = []
        *whole, rest = bytes(data).split(b"\0")
        for part in whole:
            frame = self._complete(part)
            if frame is not None:
                frames.append(frame)
        self._keep(rest)
        return frames

    def _keep(self, part: bytes) -> None:
        if self._overlong:
            return
        self._partial += part
        if len(self._partial) > MAX_ENCODED:
            self._overlong = True  # counted once, at its delimiter
            self._partial.clear()

    def _complete(self, part: bytes) -> Frame | None:
        self._keep(part)
        encoded, overlong = bytes(self._partial), self._overlong
        self._partial.clear()
        self._overlong = False
        if overlong:
            self.counts.too_long += 1
            return None
        return decode_frame(encoded, self.counts) if encoded else None
