"""Silence of a controller, told from the sleep of this program."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from campaign.link.errors import SilenceError
from campaign.link.session import Session


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [100.0]
    monkeypatch.setattr("campaign.link.session.time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


class Line:
    """Nothing comes; each look takes as long as `naps` says, or what it was asked to wait."""

    def __init__(self, clock: list[float], *naps: float) -> None:
        self.clock, self.naps = clock, list(naps)

    def receive(self, timeout: float) -> bytes:
        self.clock[0] += self.naps.pop(0) if self.naps else timeout
        return b""


def look_for_ever(session: Session) -> None:
    while True:
        session.look(0.02)


def test_a_controller_that_says_nothing_is_lost_after_its_time(clock: list[float]) -> None:
    session = Session(Line(clock), 3.0, 1, "test")  # type: ignore[arg-type]
    with pytest.raises(SilenceError, match="not been heard for 3 s"):
        look_for_ever(session)
    assert clock[0] == pytest.approx(103.0, abs=0.05)


def test_a_program_that_was_stopped_gives_it_that_time_anew(clock: list[float]) -> None:
    session = Session(Line(clock, 0.02, 60.0), 3.0, 1, "test")  # type: ignore[arg-type]
    with pytest.raises(SilenceError):
        look_for_ever(session)
    assert clock[0] == pytest.approx(163.02, abs=0.05)


def test_a_look_says_whether_anything_had_come(clock: list[float]) -> None:
    """So that all that waits is taken before a command: `_drain` looks until nothing comes."""
    line = Line(clock)
    came = [b"\x00", b"\x00\x01", b""]
    line.receive = lambda timeout: came.pop(0)  # type: ignore[method-assign]
    session = Session(line, 3.0, 1, "test")  # type: ignore[arg-type]
    session._drain()
    assert came == []
    assert session.traffic.received == 3
