"""Signals: the first asks, the second insists, and afterwards everything is as before."""

from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path

import pytest

from campaign.backends.calls import HEARTBEAT
from campaign.execution.guardian import OURS, SILENCE, Guardian
from campaign.execution.safety import NOT_SAFE
from campaign.execution.stop import GuardianPipes, StopSwitch

hangs_up = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no SIGHUP here")
on_posix = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX, and a guardian")
STOPPING = [signal.SIGINT, signal.SIGTERM]


@pytest.mark.parametrize(
    ("number", "who"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")]
)
def test_the_first_signal_only_asks(number: signal.Signals, who: str):
    with StopSwitch().on_signals() as stop:
        assert not stop()
        signal.raise_signal(number)
        assert stop()
        assert stop.reason == who


def test_before_anybody_asks_nobody_has_and_the_first_who_does_is_named():
    stop = StopSwitch()
    assert stop() is False
    assert stop.reason == ""
    stop.request("the operator")
    stop.request("Ctrl-C")
    assert stop() is True
    assert stop.reason == "the operator"


@pytest.fixture
def left(monkeypatch: pytest.MonkeyPatch) -> threading.Event:
    """Set when the program would have been left at once."""
    event = threading.Event()
    monkeypatch.setattr(StopSwitch, "_leave", lambda self: event.set())
    return event


def test_the_second_signal_insists(left: threading.Event):
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGTERM)
        assert not left.is_set()
        signal.raise_signal(signal.SIGINT)  # and raises nothing
        assert left.wait(60)
        assert stop.reason == "SIGTERM"


def test_handlers_are_put_back():
    before = [signal.getsignal(number) for number in STOPPING]
    with StopSwitch().on_signals():
        for number, handler in zip(STOPPING, before, strict=True):
            assert signal.getsignal(number) != handler
    assert [signal.getsignal(number) for number in STOPPING] == before


@hangs_up
def test_a_terminal_that_closes_asks_and_never_insists(
    left: threading.Event, monkeypatch: pytest.MonkeyPatch
):
    with heeding_hang_ups(), StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)  # the shell sends one, and the kernel another
        assert stop.reason == "SIGHUP"
    assert not left.is_set()  # whatever was heard has been counted when the block is left
    with heeding_hang_ups(), StopSwitch().on_signals():
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGTERM)
        assert left.wait(60)


def test_one_signal_is_one_although_two_listen(left: threading.Event):
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGINT)
    assert stop()
    assert not left.is_set()  # whatever was heard has been counted when the block is left


def test_who_insists_at_the_last_moment_is_heard_before_the_block_is_left(
    monkeypatch: pytest.MonkeyPatch,
):
    left = []

    def leave(self: StopSwitch) -> None:
        time.sleep(0.2)  # long enough for a block that does not wait
        left.append(self.reason)

    monkeypatch.setattr(StopSwitch, "_leave", leave)
    with StopSwitch().on_signals():
        signal.raise_signal(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
    assert set(left) == {"SIGTERM"}


@on_posix
def test_the_signals_of_others_ask_nothing(left: threading.Event):
    heard = []
    before = signal.signal(signal.SIGUSR1, lambda number, frame: heard.append(number))
    try:
        with StopSwitch().on_signals() as stop:
            signal.raise_signal(signal.SIGUSR1)
            signal.raise_signal(signal.SIGUSR1)
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert heard == [signal.SIGUSR1, signal.SIGUSR1]
    assert not stop()
    assert not left.is_set()


@contextmanager
def heeding_hang_ups() -> Iterator[None]:
    """As without nohup, under which these tests must pass as well."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGHUP, before)


@hangs_up
def test_nohup_is_respected():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with StopSwitch().on_signals() as stop:
            signal.raise_signal(signal.SIGHUP)
            assert not stop()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_stop_is_taken_although_nobody_can_read_the_notice(monkeypatch: pytest.MonkeyPatch):
    def gone(*arguments: object) -> int:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("campaign.execution.stop.os.write", gone)
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGTERM)
        assert stop.reason == "SIGTERM"


def test_where_there_are_no_hang_ups_the_others_are_heard(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.delattr(signal, "SIGHUP", raising=False)
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGTERM)
        assert stop.reason == "SIGTERM"


def test_a_handler_that_python_does_not_know_is_left_alone(monkeypatch: pytest.MonkeyPatch):
    """There is no way to put it back, and no reason to fail."""
    before = signal.getsignal(signal.SIGTERM)
    known = signal.signal

    def unknown(number: int, handler: object) -> object:
        was = known(number, handler)
        return None if number == signal.SIGTERM else was

    monkeypatch.setattr(signal, "signal", unknown)
    try:
        with StopSwitch().on_signals() as stop:
            pass
        signal.raise_signal(signal.SIGTERM)
        assert stop()
    finally:
        known(signal.SIGTERM, before)


def test_it_is_said_once_that_the_run_is_being_stopped(left: threading.Event, capfd):
    with StopSwitch().on_signals():
        signal.raise_signal(signal.SIGINT)
        signal.raise_signal(signal.SIGINT)
    assert capfd.readouterr().err.count("stopping: ") == 1


def open_files() -> set[Path]:
    return {file for file in Path("/dev/fd").iterdir() if file.exists()}  # not its own


@on_posix
def test_nothing_is_left_behind():
    come, back = os.pipe()
    os.set_blocking(back, False)
    outer = signal.set_wakeup_fd(back)
    try:
        threads, files = set(threading.enumerate()), open_files()
        with StopSwitch().on_signals():
            assert all(thread.daemon for thread in set(threading.enumerate()) - threads)
        assert not set(threading.enumerate()) - threads
        assert open_files() == files
        assert signal.set_wakeup_fd(-1) == back
    finally:
        signal.set_wakeup_fd(outer)
        os.close(come)
        os.close(back)


class FakeGuardian:
    """The ends that a guardian holds; not blocking."""

    def __init__(self) -> None:
        come, self.back = os.pipe()
        self.told, tell = os.pipe()
        for end in (self.told, tell):
            os.set_blocking(end, False)
        self.pipes = GuardianPipes(come, os.dup(self.back), tell)
        self.known = Guardian()

    def heard(self) -> Guardian:
        """What the program has told, up to now."""
        with suppress(BlockingIOError):
            while data := os.read(self.told, 100_000):
                self.known.feed(data, 0.0)
        return self.known


@pytest.fixture
def guardian() -> Iterator[FakeGuardian]:
    one = FakeGuardian()
    yield one
    HEARTBEAT.send = lambda more: None
    for end in (one.back, one.told, one.pipes.to_guardian):
        with suppress(OSError):
            os.close(end)


@on_posix
def test_the_guardian_knows_that_a_bench_is_connected_and_what_is_kept(guardian: FakeGuardian):
    with StopSwitch(guardian.pipes).on_signals() as stop:
        assert guardian.heard().moves
        assert guardian.heard().note == NOT_SAFE.encode()  # if it dies while it connects
        stop.kept(lambda: "kept \udcff", moves=True, stopper=("stop", "--port", "x"))
        assert guardian.heard().note == f"{NOT_SAFE}\nkept ?".encode()
        assert guardian.heard().stopper == b"stop\0--port\0x"
        assert guardian.heard().deadline is None
        with HEARTBEAT.expected():
            assert guardian.heard().deadline == SILENCE
            with HEARTBEAT.expected():
                pass
            assert guardian.heard().deadline == SILENCE
        assert guardian.heard().deadline is None
    assert not guardian.heard().moves


@pytest.mark.slow
@on_posix
def test_what_guardian_and_program_have_both_heard_is_one(
    guardian: FakeGuardian, left: threading.Event
):
    with StopSwitch(guardian.pipes).on_signals() as stop:
        os.write(guardian.back, bytes((OURS + signal.SIGINT, signal.SIGINT)))
        signal.raise_signal(signal.SIGINT)
        while not stop():
            pass
    assert not left.is_set()
    again = FakeGuardian()  # who hears it once more
    with StopSwitch(again.pipes).on_signals():
        os.write(again.back, bytes((OURS + signal.SIGINT, OURS + signal.SIGTERM)))
        assert left.wait(60)


def test_who_insists_leaves_although_nobody_can_look_at_what_is_kept(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    def stale() -> str:
        raise OSError("stale file handle")

    left = threading.Event()
    monkeypatch.setattr(os, "_exit", lambda code: left.set())
    with StopSwitch().on_signals() as stop:
        stop.kept(lambda: "", moves=False)
        stop._note = stale
        os.kill(os.getpid(), signal.SIGINT)
        os.kill(os.getpid(), signal.SIGINT)
        assert left.wait(60)
    assert "cannot be looked at: stale file handle" in capfd.readouterr().err


@on_posix
def test_a_program_whose_guardian_is_gone_is_asked_to_stop(guardian: FakeGuardian):
    with StopSwitch(guardian.pipes).on_signals() as stop:
        assert not stop()
        os.close(guardian.told)
        with HEARTBEAT.expected():
            assert stop.reason == "the death of its guardian process"


@on_posix
def test_a_guardian_that_does_nothing_holds_nothing_up(guardian: FakeGuardian, left, capfd):
    with StopSwitch(guardian.pipes).on_signals() as stop:
        for text in ("x" * 5000, ""):  # more than a pipe can hold, to the last byte
            for _ in range(1000):
                stop.kept(partial(str, text), moves=False)
        signal.raise_signal(signal.SIGINT)
        assert not left.is_set()
        signal.raise_signal(signal.SIGINT)
        assert left.wait(60)
        signal.raise_signal(signal.SIGINT)
    assert "ignored" not in capfd.readouterr().err  # what Python says of a wakeup pipe that is full


@on_posix
def test_a_note_is_never_longer_than_a_pipe_takes_whole(guardian: FakeGuardian):
    with StopSwitch(guardian.pipes).on_signals() as stop:
        stop.kept(lambda: "x" * 100_000, moves=False)
    assert 1000 < len(guardian.heard().note) <= select.PIPE_BUF - 3


def test_without_a_guardian_nobody_is_told(monkeypatch: pytest.MonkeyPatch):
    with StopSwitch().on_signals() as stop:
        stop.kept(lambda: "kept", moves=True)
        with HEARTBEAT.expected():
            HEARTBEAT.beat()


PROGRAM = """
import ctypes, pathlib, signal, sys, time
from campaign.errors import ExitCode
from campaign.execution.stop import StopSwitch

def hang(library):
    "In a call that no signal breaks off: the shell says when it has begun."
    library(None).system(b"echo ready; read line")

def made_safe(code=ExitCode.INTERRUPTED, seconds=0.0):
    time.sleep(seconds)
    pathlib.Path("safe").touch()
    return code

def kept(text):
    stop.kept(lambda: text, moves=False)

def asked():
    signal.raise_signal(signal.SIGTERM)

with StopSwitch().on_signals() as stop:
    {does}
"""


def insisted(folder: Path, does: str, stderr: int = subprocess.PIPE) -> tuple[int, str]:
    """The exit code of a program that was asked twice, the second time while it hangs, and what it
    said."""
    come, back = os.pipe()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM.format(does=does)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        stdin=come,
        stdout=subprocess.PIPE,
        stderr=stderr,
        text=True,
    )
    os.close(come)
    with process:
        try:
            assert process.stdout.readline() == "ready\n"
            if "asked()" not in does:
                process.send_signal(signal.SIGTERM)
                assert process.stderr.readline() == "\n"
                assert process.stderr.readline().startswith("stopping: ")
            process.send_signal(signal.SIGTERM)
            code = process.wait(60)
        finally:
            process.kill()
            os.close(back)  # ends what it hangs in
        return code, process.stderr.read() if process.stderr else ""


NOTHING = "stopped at once; nothing was begun\n"
SEEN_SAFE = "safe state confirmed: the bench is at rest with its drive off\n"


@on_posix
@pytest.mark.parametrize(
    ("before", "code", "said"),
    [
        ("asked(); ", 130, f".*abort\n\n{NOTHING}"),
        ("", 130, f"\n{NOTHING}"),  # it hangs already: it is heard to be stopped as well
        ("asked(); sys.stderr = sys.__stderr__ = None; ", 130, f".*abort\n\n{NOTHING}"),
        (
            "asked(); stop.make_safe = lambda: made_safe(ExitCode.NOT_SAFE); ",
            5,
            f".*\n{NOT_SAFE}\nstopped at once.*",
        ),
        ("asked(); stop.kept(lambda: 'kept', moves=True); ", 130, f".*{SEEN_SAFE}kept\n"),
    ],
)
def test_who_insists_leaves_at_once_and_is_told(tmp_path: Path, before: str, code: int, said: str):
    found, told = insisted(tmp_path, f"{before}hang(ctypes.CDLL)")
    assert found == code
    assert re.fullmatch(said, told, re.DOTALL), told


@pytest.mark.slow
@on_posix
def test_the_bench_is_made_safe_first_however_long_that_takes(tmp_path: Path):
    does = "asked(); stop.make_safe = lambda: made_safe(seconds=2.0); kept('kept')"
    code, said = insisted(tmp_path, f"{does}; hang(ctypes.CDLL)")
    assert (tmp_path / "safe").exists()
    assert code == 130
    assert said.endswith("abort\n\nkept\n")


@on_posix
def test_a_terminal_gets_its_cursor_back(tmp_path: Path):
    ours, theirs = os.openpty()
    try:
        code, _ = insisted(tmp_path, "asked(); hang(ctypes.CDLL)", stderr=theirs)
        said = os.read(ours, 4096).decode()
    finally:
        os.close(ours)
        os.close(theirs)
    assert code == 130
    assert "\x1b[?25h\r\nstopped at once" in said
