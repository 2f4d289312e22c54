"""The C reference under arbitrary input, built with sanitizers: see firmware/fuzz.c.

Inputs are made from the 58 vectors and from ways into every state. By default a driver of our own
runs seeded ones; in the soak test libFuzzer, where clang has it, looks for more by itself.
"""

from __future__ import annotations

import shutil
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.wire import messages as wire

from .conftest import CONSOLE, FIRMWARE, SANITIZE, STRICT, compile_c
from .host import CRC, OURS, SETS, TRIAL, hello

SOURCES = ("fuzz.c", *(name for name in CONSOLE if name != "console.c"))
RAW, FRAME, TIME, SAMPLES, EVENT, FINISH, WORLD, RESET, WATCH = range(9)
"""The steps of an input."""


def raw(octets: bytes) -> bytes:
    return struct.pack("<BH", RAW, len(octets)) + octets


def frame(kind: int, sequence: int, body: bytes) -> bytes:
    return struct.pack("<BBBH", FRAME, kind, sequence % 256, len(body)) + body


def message(sequence: int, what: wire.Message) -> bytes:
    return frame(int(wire.encode(what)[0]), sequence, wire.encode(what)[1])


def beat(counter: int, following: int = 0) -> bytes:
    return message(0, wire.Heartbeat(counter, TRIAL, following, OURS))


def pause(seconds: float) -> bytes:
    return struct.pack("<BH", TIME, round(seconds * 1e4))


def octets(text: str) -> bytes:
    return b"" if text == "-" else bytes.fromhex(text)


def of_vectors() -> Iterator[bytes]:
    """Every vector as the device may meet it."""
    for line in (FIRMWARE / "vectors.txt").read_text().splitlines():
        word, *rest = line.split()
        if word == "frame":
            body, whole = octets(rest[2]), octets(rest[3])
            yield raw(whole) + frame(int(rest[0]), int(rest[1]), body)
        elif word == "safe":
            yield frame(int(wire.Kind.SAFE), 0, octets(rest[0]))
        elif word in ("crc", "cobs", "bad"):
            yield raw(octets(rest[-1]))


def of_states() -> Iterator[bytes]:
    """A trial from HELLO to its end, cut after each step; then what can come between."""
    running = [
        message(0, hello()), beat(1), message(1, SETS[0]), message(2, wire.Arm(CRC)), beat(2),
        message(3, wire.Start(TRIAL)), pause(0.05), beat(3),
        bytes([SAMPLES, 0, 4, 10]) + bytes(40), bytes([EVENT, 1]) + b"gear",
        bytes([SAMPLES, 1, 2, 10]) + bytes(20),
    ]  # fmt: skip
    for count in range(1, len(running) + 1):
        yield b"".join(running[:count])
    whole = b"".join(running)
    done = bytes([FINISH, 0, 0, 1]) + b"done" + pause(0.01)
    yield whole + message(0, wire.Resend(TRIAL, 0, 3)) + done + message(4, wire.Release(TRIAL))
    yield whole + bytes([WORLD, 0]) + message(4, wire.Stop()) + pause(2.5)
    yield whole + pause(0.2) + message(4, wire.Clear())
    yield whole + message(0, wire.Safe(OURS + 1, "somebody")) + message(0, wire.Query())
    yield (
        whole
        + message(0, wire.Safe())
        + bytes([RESET, 0])
        + message(0, hello())
        + message(1, wire.Unlatch(1, "ada"))
        + message(2, wire.Clear())
    )
    yield whole + bytes([RESET, 1]) + whole
    yield (
        whole + bytes([WORLD, 5]) + message(0, wire.Safe()) + pause(0.01) + message(0, wire.Query())
    )
    yield whole + bytes([FINISH, 3, 8, 1]) + b"hot!" + message(0, wire.Bye(OURS))
    yield bytes([WATCH, 31]) + struct.pack("<HB", 1000, 20) + bytes(range(160))


def corpus(folder: Path) -> list[str]:
    folder.mkdir()
    made = list(dict.fromkeys([*of_vectors(), *of_states()]))
    for number, content in enumerate(made):
        (folder / f"{number:03}").write_bytes(content)
    return sorted(str(file) for file in folder.iterdir())


def run(program: Path, seed: int, count: int, files: list[str]) -> None:
    done = subprocess.run(
        [str(program), str(seed), str(count), *files], capture_output=True, text=True, timeout=1200
    )
    assert done.returncode == 0, done.stderr[-5000:]


@pytest.mark.slow
def test_arbitrary_input_harms_nothing(tmp_path: Path) -> None:
    """With whatever compiler there is, sanitizers and all."""
    flags = (*SANITIZE, "-O1")
    define = "-DCAMPAIGN_FUZZ_MAIN"
    program = compile_c(tmp_path / "fuzz", *SOURCES, flags=(*flags, define))
    run(program, 1, 20_000, corpus(tmp_path / "corpus"))


@pytest.mark.soak
@pytest.mark.parametrize("seed", range(2, 6))
def test_arbitrary_input_harms_nothing_for_long(tmp_path: Path, seed: int) -> None:
    flags = (*SANITIZE, "-O1", "-DCAMPAIGN_FUZZ_MAIN")
    program = compile_c(tmp_path / "fuzz", *SOURCES, flags=flags)
    run(program, seed, 250_000, corpus(tmp_path / "corpus"))


@pytest.mark.soak
def test_libfuzzer_finds_nothing(tmp_path: Path) -> None:
    """It looks for inputs that reach code which no earlier one did."""
    clang = next(filter(None, map(shutil.which, CLANGS)), None)
    if clang is None:
        pytest.skip("no clang")
    program = tmp_path / "fuzz"
    build = subprocess.run(
        [clang, *STRICT, "-g", "-O1", "-fsanitize=fuzzer,address,undefined",
         "-fno-sanitize-recover=all", *(str(FIRMWARE / name) for name in SOURCES), "-o", program],
        capture_output=True, text=True,
    )  # fmt: skip
    if build.returncode and "clang_rt" in build.stderr:
        pytest.skip("clang has no libFuzzer here")
    assert build.returncode == 0, build.stderr
    corpus(tmp_path / "corpus")
    done = subprocess.run(
        [program, "-seed=1", "-runs=200000", "-max_len=8192", "-timeout=20", tmp_path / "corpus"],
        cwd=tmp_path, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-5000:]


CLANGS = ("clang", *(f"clang-{version}" for version in range(22, 11, -1)))
"""As distributions call it."""


def test_the_vectors_are_all_there(tmp_path: Path) -> None:
    vectors = (FIRMWARE / "vectors.txt").read_text().splitlines()
    assert sum(not line.startswith("#") for line in vectors) == 58
    assert len(corpus(tmp_path / "corpus")) > 58
