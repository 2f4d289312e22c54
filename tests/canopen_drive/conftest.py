"""A latch of its own for each test, and a fast clock for the relay."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from tests.canopen_drive.rig import channel, quicken
from tests.canopen_drive.simulated import SimulatedDrive

SPEED = 10.0


@pytest.fixture(autouse=True)
def state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"


@pytest.fixture
def fast(monkeypatch: pytest.MonkeyPatch) -> float:
    """How much faster the relay's clock is, and that of its drive."""
    quicken(SPEED, monkeypatch.setattr)
    return SPEED


@pytest.fixture
def drives(fast: float) -> Iterator[Callable[..., tuple[str, SimulatedDrive]]]:
    """Makes simulated drives: the name of the bus, and the drive."""
    with ExitStack() as stack:

        def make(**quirks: Any) -> tuple[str, SimulatedDrive]:
            name = channel()
            return name, stack.enter_context(SimulatedDrive(name, speed=fast, **quirks))

        yield make
