"""Signals: the first asks, the second insists, and afterwards everything is as before."""

from __future__ import annotations

import signal

import pytest

from campaign.execution.stop import StopSwitch

hangs_up = pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no SIGHUP here")
STOPPING = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


@pytest.mark.parametrize(
    ("number", "who"), [(signal.SIGINT, "Ctrl-C"), (signal.SIGTERM, "SIGTERM")]
)
def test_the_first_signal_only_asks(number: signal.Signals, who: str):
    with StopSwitch().on_signals() as stop:
        assert not stop()
        signal.raise_signal(number)
        assert stop()
        assert stop.reason == who


def test_the_second_signal_insists():
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert stop.reason == "SIGTERM"


def test_handlers_are_put_back():
    before = [signal.getsignal(number) for number in STOPPING]
    with StopSwitch().on_signals():
        for number, handler in zip(STOPPING, before, strict=True):
            assert signal.getsignal(number) != handler
    assert [signal.getsignal(number) for number in STOPPING] == before


@hangs_up
def test_a_terminal_that_closes_asks_and_never_insists():
    with StopSwitch().on_signals() as stop:
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGHUP)  # the shell sends one, and the kernel another
        assert stop.reason == "SIGHUP"
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGTERM)


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
