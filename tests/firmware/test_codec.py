"""Framing in C and in Python: the same bytes, the same verdicts."""

import os
import random
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from campaign.wire import cobs
from campaign.wire.codes import Kind, WireError
from campaign.wire.frames import FrameDecoder, encode_frame
from campaign.wire.messages import Safe, decode
from tests.wire.mutations import stream

from .conftest import FIRMWARE, compile_c
from .console import Console

SHARED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)


def test_the_vectors_are_those_that_the_script_writes() -> None:
    script = FIRMWARE / "make_vectors.py"
    here = {**os.environ, "PYTHONPATH": str(FIRMWARE.parent)}  # the codec beside it, none installed
    done = subprocess.run(
        [sys.executable, str(script)], capture_output=True, text=True, check=True, env=here
    )
    assert done.stdout == (FIRMWARE / "vectors.txt").read_text()


def octets(text: str) -> bytes:
    return b"" if text == "-" else bytes.fromhex(text)


def test_python_agrees_with_the_vectors() -> None:
    lines = [line.split() for line in (FIRMWARE / "vectors.txt").read_text().splitlines()]
    for word, *rest in lines:
        if word == "crc":
            assert zlib.crc32(octets(rest[0])) == int(rest[1], 16)
        elif word == "cobs":
            parts = [octets(part) for part in rest]
            assert (cobs.encode(parts[0]), cobs.decode(parts[1])) == (parts[1], parts[0])
        elif word == "frame":
            kind, sequence, parts = int(rest[0]), int(rest[1]), [octets(part) for part in rest[2:]]
            assert encode_frame(kind, sequence, parts[0]) == parts[1]
            [frame] = FrameDecoder().feed(parts[1])
            assert (frame.kind, frame.sequence, frame.body) == (kind, sequence, parts[0])
        elif word == "safe":
            expected = Safe(int(rest[1]), octets(rest[2]).decode())
            assert decode(Kind.SAFE, octets(rest[0])) == expected
        elif word == "bad":
            decoder = FrameDecoder()
            assert decoder.feed(bytes.fromhex(rest[1])) == []
            assert (getattr(decoder.counts, rest[0]), decoder.counts.bad) == (1, 1)


def test_c_agrees_with_the_vectors(tmp_path: Path) -> None:
    program = compile_c(tmp_path / "check", "check_vectors.c", "campaign_wire.c")
    done = subprocess.run(
        [program, FIRMWARE / "vectors.txt"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout
    assert done.stdout.endswith(" 0 wrong\n")
    assert int(done.stdout.split()[0]) > 50


BYTES = st.one_of(
    st.binary(max_size=40),
    st.lists(st.sampled_from([0, 1, 255]), max_size=600).map(bytes),
    st.integers(250, 258).map(lambda n: b"\x02" * n),
)


@SHARED
@given(data=BYTES)
def test_stuffing_and_checksum_are_equal(console: Console, data: bytes) -> None:
    [line] = console.do("cobs", data.hex() or "-")
    assert line == f"cobs {cobs.encode(data).hex()}"
    assert console.do("crc", data.hex() or "-") == [f"crc {zlib.crc32(data):08x}"]
    try:
        plain = cobs.decode(data)
    except WireError:
        plain = b""
    assert console.do("uncobs", data.hex() or "-") == [f"cobs {plain.hex() or '-'}"]


def verdicts(console: Console, data: bytes, decoder: FrameDecoder) -> None:
    """Both decoders find the same frames in `data`, and count the same damage."""
    found = [
        f"frame {frame.kind} {frame.sequence} {frame.body.hex() or '-'}"
        for frame in decoder.feed(data)
    ]
    assert console.do("decode", data.hex() or "-") == found


def count(console: Console, decoder: FrameDecoder) -> None:
    n = decoder.counts
    expected = (n.good, n.bad_cobs, n.too_short, n.too_long, n.bad_crc, n.wrong_version)
    assert console.do("counts") == ["counts " + " ".join(map(str, expected))]


@SHARED
@given(parts=st.lists(st.one_of(BYTES, st.binary(max_size=1100).map(lambda b: b + b"\0"))))
def test_any_bytes_get_the_same_verdict(console: Console, parts: list[bytes]) -> None:
    console.do("forget")
    decoder = FrameDecoder()
    for part in parts:
        verdicts(console, part, decoder)
    count(console, decoder)


def soak(console: Console, frames: int, seed: int) -> None:
    source, decoder = random.Random(seed), FrameDecoder()
    for index in range(frames // 500):
        data, _ = stream(source, 500, 0.6)
        verdicts(console, data, decoder)
        # The same bytes to a device: whatever they make it do, it goes on answering.
        console.do("receive", index * 20_000, data.hex())
        if index % 7 == 0:
            console.do("samples", index, 1, "00" * 8)
            console.do("tick", index * 20_000 + 1)
    count(console, decoder)
    assert decoder.counts.bad > frames * 0.2


def test_damaged_streams_get_the_same_verdict(console: Console) -> None:
    soak(console, 5_000, seed=3)


@pytest.mark.soak
def test_a_million_damaged_frames_get_the_same_verdict(sanitized: Console) -> None:
    soak(sanitized, 1_000_000, seed=4)
