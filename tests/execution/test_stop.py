"""Signals: the first asks, the second insists, and afterwards everything is as before."""

from __future__ import annotations

import signal

import pytest

from campaign.execution.stop import StopSwitch


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
    before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
    with StopSwitch().on_signals():
        assert signal.getsignal(signal.SIGINT) != before[0]
    assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
