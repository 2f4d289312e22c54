"""Consistent overhead byte stuffing (COBS).

S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking
7(2), 1999. Costs one byte, and one more per 254 bytes.
"""

from __future__ import annotations

from campaign.wire.codes import WireError

LONGEST_BLOCK = 254


def encoded_length(length: int) -> int:
    """The most bytes that `length` bytes may become."""
    return length + max(1, -(-length // LONGEST_BLOCK))


def encode(data: bytes) -> bytes:
    """`data` without a zero byte and without any delimiter."""
    out = bytearray()
    parts = data.split(b"\0")
    last = len(parts) - 1
    for index, part in enumerate(parts):
        start, length = 0, len(part)
        while length - start >= LONGEST_BLOCK:
            out.append(0xFF)
            out += part[start : start + LONGEST_BLOCK]
            start += LONGEST_BLOCK
        # A full block implies no zero; only at the very end nothing needs to follow it.
        if index < last or start < length or start == 0:
            out.append(length - start + 1)
            out += part[start:]
    return bytes(out)


def decode(data: bytes) -> bytes:
    """What `encode` was given; WireError when `data` cannot be an encoding of anything."""
    out = bytearray()
    position, length = 0, len(data)
    if not length:
        raise WireError("an empty COBS block")
    while position < length:
        code = data[position]
        end = position + code
        if code == 0 or end > length:
            raise WireError(f"bad COBS block at byte {position}")
        out += data[position + 1 : end]
        position = end
        if code != 0xFF and position < length:
            out.append(0)
    if data.find(0) >= 0:
        raise WireError("a zero inside a COBS block")
    return bytes(out)
