"""The process that ends the program when it does not obey, and leaves it in peace otherwise."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.execution import guardian
from campaign.execution.guardian import MAKING_SAFE, NOTE, SAFE, STUCK, Asked, Guardian

INT, TERM = bytes((signal.SIGINT,)), bytes((signal.SIGTERM,))
hangs_up = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no SIGHUP here")
on_posix = pytest.mark.skipif(sys.platform == "win32", reason="there is a guardian on POSIX only")


def note(text: bytes) -> bytes:
    return bytes((NOTE,)) + len(text).to_bytes(2) + text


def asked(*numbers: int) -> int:
    count = Asked()
    for number in numbers:
        count.add(number)
    return count.times


def test_each_ctrl_c_and_each_sigterm_counts_and_nothing_else() -> None:
    assert asked() == 0
    assert asked(signal.SIGINT, signal.SIGTERM, signal.SIGINT) == 3
    assert asked(signal.SIGSEGV, 0) == 0


@hangs_up
def test_a_hang_up_counts_only_before_anything_else_does() -> None:
    assert asked(signal.SIGHUP, signal.SIGHUP) == 1
    assert asked(signal.SIGINT, signal.SIGHUP) == 1
    assert asked(signal.SIGHUP, signal.SIGINT) == 2


def test_one_signal_is_handed_on_and_sets_no_deadline() -> None:
    one = Guardian()
    assert one.deadline is None
    assert one.feed(INT, 100.0) == INT
    assert one.deadline is None


def test_the_second_one_sets_a_deadline_that_more_of_them_do_not_put_off() -> None:
    one = Guardian()
    assert one.feed(INT + TERM, 100.0) == INT + TERM
    assert one.deadline == 100.0 + STUCK
    one.feed(INT, 101.0)
    assert one.deadline == 100.0 + STUCK


def test_other_signals_are_handed_on_and_count_for_nothing() -> None:
    other = bytes((signal.SIGSEGV,))
    one = Guardian()
    assert one.feed(INT + other + other, 100.0) == INT + other + other
    assert one.deadline is None
    one.feed(INT, 101.0)
    assert one.deadline == 101.0 + STUCK


def test_a_program_that_makes_safe_has_longer() -> None:
    one = Guardian()
    one.feed(INT + INT, 100.0)
    assert one.feed(bytes((MAKING_SAFE,)), 101.0) == b""
    assert one.deadline == 101.0 + SAFE
    one.feed(INT, 102.0)
    assert one.deadline == 101.0 + SAFE


@pytest.mark.parametrize("text", [b"", b"kept \x02\x02\xfe\xfd", b"x" * 1000])
@pytest.mark.parametrize("piece", [1, 2, 3, 4, 5000])
def test_a_note_comes_through_however_it_is_cut_and_is_no_signal(text: bytes, piece: int) -> None:
    one = Guardian()
    data = INT + note(b"first") + note(text) + TERM
    heard = b"".join(one.feed(data[i : i + piece], 1.0) for i in range(0, len(data), piece))
    assert heard == INT + TERM
    assert one.note == text


def test_a_note_is_known_as_soon_as_it_is_whole() -> None:
    one = Guardian()
    one.feed(note(b"kept"), 1.0)
    assert one.note == b"kept"
    one.feed(note(b"more")[:-1], 1.0)
    assert one.note == b"kept"


def test_before_the_program_has_said_anything_there_is_no_note() -> None:
    assert Guardian().note == b""


@pytest.fixture
def program() -> Iterator[subprocess.Popen[bytes]]:
    """Something to watch over that does not end by itself."""
    process = subprocess.Popen(
        [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL
    )
    with process:
        yield process
        process.kill()


class Watching:
    """A guardian in a process of its own, over a program."""

    def __init__(self, over: subprocess.Popen[bytes], *, edit: str = "") -> None:
        """`edit`: what differs from guardian.py, for instance a shorter patience."""
        path = str(Path(guardian.__file__))
        code = f"import runpy, sys; g = runpy.run_path({path!r}); {edit}; g['main']({over.pid})"
        run = ["-c", code] if edit else [path, str(over.pid)]
        self.process = subprocess.Popen(
            [sys.executable, "-I", "-S", *run],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )

    def say(self, data: bytes) -> None:
        self.process.stdin.write(data)
        self.process.stdin.flush()

    def end(self) -> tuple[bytes, bytes]:
        return self.process.communicate(timeout=60)


IMPATIENT = "g['main'].__globals__.update(STUCK=0.05)"


@on_posix
def test_signals_come_back_at_once_and_it_goes_when_the_program_goes(program) -> None:
    watching = Watching(program)
    watching.say(INT)
    assert os.read(watching.process.stdout.fileno(), 10) == INT
    watching.say(note(b"kept"))
    assert watching.end() == (b"", b"")
    assert watching.process.returncode == 0
    assert program.poll() is None


@on_posix
def test_who_does_not_obey_is_ended_and_the_last_note_is_said(program) -> None:
    watching = Watching(program, edit=IMPATIENT)
    watching.say(note(b"the run is kept") + INT)
    assert os.read(watching.process.stdout.fileno(), 10) == INT
    assert program.poll() is None
    watching.say(INT)
    assert program.wait(60) == -signal.SIGKILL
    # Not `communicate`: it has to go by itself, although its input stays open.
    assert watching.process.wait(60) == 0
    assert watching.process.stdout.read() == INT
    assert watching.process.stderr.read() == b"\nthe run is kept\n"
    watching.end()


@on_posix
def test_a_deadline_that_has_passed_already_is_kept_as_well(program) -> None:
    watching = Watching(program, edit="g['main'].__globals__.update(STUCK=-60.0)")
    watching.say(INT + INT)
    assert program.wait(60) == -signal.SIGKILL
    assert watching.end() == (INT + INT, b"\n\n")


@on_posix
def test_who_makes_the_bench_safe_is_given_the_time_for_it(program) -> None:
    """As long as SAFE, and not as long as STUCK."""
    watching = Watching(program, edit=IMPATIENT)
    watching.say(INT + INT + bytes((MAKING_SAFE,)))
    time.sleep(0.5)
    assert program.poll() is None
    assert watching.end() == (INT + INT, b"")
    assert program.poll() is None


@on_posix
def test_nobody_who_listens_is_no_reason_to_stay(program) -> None:
    watching = Watching(program)
    watching.process.stdout.close()
    watching.say(INT)
    assert watching.process.wait(60) == 0
    assert watching.process.stderr.read() == b""
    watching.process.stderr.close()
    watching.process.stdin.close()
