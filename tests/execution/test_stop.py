"""Signals: the first asks, the second insists, and afterwards everything is as before."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from campaign.execution.stop import StopSwitch

hangs_up = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no SIGHUP here")
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
