"""Frames in a stream: found whole or thrown away and counted, never wrong."""

import random
import struct
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from campaign.wire import cobs
from campaign.wire.codes import WireError
from campaign.wire.frames import MAX_BODY, MAX_ENCODED, Frame, FrameDecoder, encode_frame

from .mutations import stream

KINDS = st.integers(0, 255)
SEQUENCES = st.integers(0, 2**16 - 1)


def test_a_frame_is_what_the_document_says() -> None:
    # CRC-32 of 01 08 05 00, by the bitwise definition
    crc = 0xFFFFFFFF
    for byte in (1, 8, 5, 0):
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ (0xEDB88320 if crc & 1 else 0)
    checksum = struct.pack("<I", crc ^ 0xFFFFFFFF)
    assert 0 not in checksum
    assert encode_frame(8, 5, b"") == b"\0\x04\x01\x08\x05\x05" + checksum + b"\0"
    assert zlib.crc32(b"123456789") == 0xCBF43926


@given(
    st.lists(st.tuples(KINDS, SEQUENCES, st.binary(max_size=300)), max_size=5),
    st.lists(st.integers(1, 50), min_size=1, max_size=10),
)
def test_frames_are_found_however_the_stream_is_cut(
    sent: list[tuple[int, int, bytes]], cuts: list[int]
) -> None:
    data = b"".join(encode_frame(*each) for each in sent)
    decoder, found, index = FrameDecoder(), [], 0
    while data:
        cut = cuts[index % len(cuts)]
        found += decoder.feed(data[:cut])
        data, index = data[cut:], index + 1
    assert found == [Frame(*each) for each in sent]
    assert decoder.counts.good == len(sent)
    assert decoder.counts.bad == 0


@given(st.lists(st.binary(max_size=200), max_size=5))
def test_noise_is_no_frame_and_hides_none_after_it(noise: list[bytes]) -> None:
    decoder = FrameDecoder()
    for part in noise:
        assert decoder.feed(part) == []  # 2^-32 apart
    assert decoder.feed(encode_frame(8, 5, b"body")) == [Frame(8, 5, b"body")]


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (encode_frame(8, 5, b"", version=2), "wrong_version"),
        (b"\0" + cobs.encode(b"1234567") + b"\0", "too_short"),
        (b"\0" + b"\x01" * (MAX_ENCODED + 1) + b"\0", "too_long"),
        (b"\0" + b"\x01" * 100_000 + b"\0", "too_long"),
        (b"\0\x09abc\0", "bad_cobs"),
        (b"\0" + cobs.encode(b"12345678") + b"\0", "bad_crc"),
    ],
)
def test_each_kind_of_damage_is_counted(data: bytes, reason: str) -> None:
    decoder = FrameDecoder()
    assert decoder.feed(data) == []
    assert getattr(decoder.counts, reason) == 1
    assert decoder.counts.bad == 1


def test_the_longest_body_passes_and_no_longer_one() -> None:
    body = b"\x01" * MAX_BODY
    assert FrameDecoder().feed(encode_frame(0x86, 1, body)) == [Frame(0x86, 1, body)]
    with pytest.raises(WireError, match="1025"):
        encode_frame(0x86, 1, body + b"\x01")
    overlong = b"\0" + cobs.encode(struct.pack("<BBH", 1, 2, 3) + bytes(MAX_BODY + 5)) + b"\0"
    decoder = FrameDecoder()
    assert decoder.feed(overlong) == []
    assert decoder.counts.bad == 1


def test_a_decoder_holds_no_more_than_one_frame() -> None:
    decoder = FrameDecoder()
    for _ in range(1000):
        decoder.feed(b"\x55" * 1000)
    assert len(decoder._partial) <= MAX_ENCODED + 1000


def soak(frames: int, seed: int) -> None:
    """Whatever the damage: nothing is accepted that was not sent."""
    source, decoder, accepted = random.Random(seed), FrameDecoder(), 0
    for _ in range(frames // 100):
        data, meant = stream(source, 100, 0.6)
        sent = set(meant)
        # The delimiter of the last one may be lost: the frame is whole with the next zero.
        for frame in decoder.feed(data + b"\0"):
            assert (frame.kind, frame.sequence, frame.body) in sent
            accepted += 1
    assert frames * 0.3 < accepted < frames
    assert decoder.counts.good == accepted
    assert decoder.counts.bad > frames * 0.2


@pytest.mark.slow
def test_damaged_frames_are_never_accepted() -> None:
    soak(20_000, seed=1)


@pytest.mark.soak
def test_a_million_damaged_frames_are_never_accepted() -> None:
    soak(1_000_000, seed=2)
