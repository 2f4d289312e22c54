"""Consistent overhead byte stuffing (COBS).

S. Cheshire and M. Baker, "Consistent Overhead Byte Stuffing", IEEE/ACM Transactions on Networking
7(2), 1999. Adds one byte, and one more per 254 bytes.
"""

from __future__ import annotations

from campaign.wire.codes import WireError

LONGEST_BLOCK = 254


def encoded_length(length: int) -> int:
    """Largest encoded size of `length` bytes."""
    return length + max(1, -(-length // LONGEST_BLOCK))


def encode(data: bytes) -> bytes:
    """Encode `data` without zero bytes; adds no delimiter."""
    out = bytearray()
    parts = data.split(b"\0")
    last = len(parts) - 1
    for index, part in enumerate(parts):
        start, length = 0, len(part)
        while length - start >= LONGEST_BLOCK:
            out.append(0xFF)
            out += part[start : start + LONGEST_BLOCK]
            start += LONGEST_BLOCK
        # A full block implies no zero; at the end of the data, no block follows it.
        if index < last or start < length or start == 0:
            out.append(length - start + 1)
            out += part[start:]
    return bytes(out)


def decode(data: bytes) -> bytes:
    """Inverse of `encode`. Raises WireError if `data` is not a valid encoding."""
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
