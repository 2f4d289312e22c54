"""A latch of its own for each test, and a fast clock for the relay."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from campaign.canopen_drive import proof, relay
from tests.canopen_drive.rig import FastClock, channel
from tests.canopen_drive.simulated import SimulatedDrive

SPEED = 10.0


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch) -> float:
    """The relay's clock; a simulated drive with this `speed` counts heartbeats as fast."""
    monkeypatch.setattr(relay, "time", FastClock(SPEED))
    # What waits for the drive waits as long as before: a busy machine is not as fast.
    monkeypatch.setattr(proof, "REACTION", SPEED * proof.REACTION)
    monkeypatch.setattr(relay, "ENABLE", SPEED * relay.ENABLE)
    return SPEED


@pytest.fixture
def drives(fast: float) -> Iterator[Callable[..., tuple[str, SimulatedDrive]]]:
    """Makes simulated drives: the name of the bus, and the drive."""
    with ExitStack() as stack:

        def make(**quirks: Any) -> tuple[str, SimulatedDrive]:
            name = channel()
            return name, stack.enter_context(SimulatedDrive(name, speed=fast, **quirks))

        yield make
