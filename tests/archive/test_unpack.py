"""A chunk is unpacked to exactly the samples that it ought to hold, or refused."""

from __future__ import annotations

import tracemalloc
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.archive.layout.storage import pack, unpack

NOISE = np.random.default_rng(1).normal(size=1000)
COUNT = len(NOISE)


@pytest.mark.slow
@given(st.lists(st.floats(width=64), min_size=1, max_size=300), st.booleans())
@settings(max_examples=60, deadline=None)
def test_what_was_packed_is_unpacked_to_the_bit(values, shuffled):
    samples = np.array(values)
    found = unpack(pack(samples, shuffled), len(samples), shuffled)
    assert found is not None
    assert found.tobytes() == samples.tobytes()


def test_what_another_deflate_packed_is_unpacked():
    assert unpack(zlib.compress(NOISE.tobytes(), 9), COUNT, shuffled=False).tolist() == list(NOISE)


# Of noise, one byte more is still in the input when the output is full; of zeros it is a repetition
# that was read already. Both have to be noticed.
@pytest.mark.parametrize("more", [1, 8, 1000, 100_000])
@pytest.mark.parametrize("content", [NOISE.tobytes(), bytes(8 * COUNT)])
@pytest.mark.parametrize("shuffled", [True, False])
def test_a_chunk_of_more_than_it_says_is_refused(content, more, shuffled):
    assert unpack(zlib.compress(content), COUNT, shuffled) is not None
    assert unpack(zlib.compress(content + bytes(more)), COUNT, shuffled) is None


@pytest.mark.parametrize("less", [1, 8, 7999, 8000])
def test_a_chunk_of_less_than_it_says_is_refused(less):
    assert unpack(zlib.compress(NOISE.tobytes()[:-less]), COUNT, shuffled=False) is None


@pytest.mark.slow
def test_a_chunk_that_would_expand_to_a_gigabyte_takes_no_more_than_its_samples():
    packer = zlib.compressobj(9)
    bomb = b"".join(packer.compress(bytes(1 << 20)) for _ in range(256)) + packer.flush()
    assert len(bomb) < 300_000
    tracemalloc.start()
    try:
        assert unpack(bomb, COUNT, shuffled=True) is None
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 2 * len(bomb)


PACKED = pack(NOISE, shuffled=True)


@pytest.mark.parametrize(
    "packed",
    [
        b"",
        b"\0",
        b"garbage" * 99,
        b"\xff" * 5000,
        NOISE.tobytes(),
        PACKED[:1],
        PACKED[: len(PACKED) // 2],
        PACKED[:-1],  # without the last byte of its checksum
        PACKED[:-4],
        PACKED[:-4] + b"abcd",
        PACKED[2:],
        PACKED + b"\0",
        PACKED + PACKED,
    ],
)
def test_what_is_no_chunk_is_refused(packed):
    assert unpack(PACKED, COUNT, shuffled=True) is not None
    assert unpack(packed, COUNT, shuffled=True) is None


def test_any_flipped_bit_is_noticed():
    """Deflate's own checksum notices it, before the tree of checksums does."""
    for place in np.random.default_rng(2).integers(0, 8 * len(PACKED), 300):
        changed = bytearray(PACKED)
        changed[place // 8] ^= 1 << (place % 8)
        found = unpack(bytes(changed), COUNT, shuffled=True)
        assert found is None or found.tobytes() == NOISE.tobytes()  # some bits mean nothing
