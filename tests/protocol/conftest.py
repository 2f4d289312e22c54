"""A tiny experiment, and protocols written with the place of their mistake marked."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field

from campaign.errors import Problem, ProtocolError
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.protocol import ExperimentKind, Protocol, load_protocol
from campaign.signals import Polyline, Sine
from campaign.trial import Role, Task, TrialRequest
from campaign.units import AngularAcceleration, AngularRate, Frequency

SHIPPED = Path(__file__).parents[2] / "protocols"
MARK = "§"


class SwingOptions(Options):
    """Options of the swing."""

    frequency: Frequency = Field(gt=0)
    """Of the base motion."""
    acceleration: AngularAcceleration = Field(default=0.1, gt=0)
    """Of the base motion."""
    compensation: str = "none"
    """A method of the bench."""
    cycles: int = Field(default=2, ge=1, le=100)
    """How many."""
    gain: float = Field(default=1.0, ge=0)
    """A bare number."""
    style: Literal["slow", "fast"] = "slow"
    """One of two words."""
    flag: bool = False
    """True or false."""


def _swing(options: SwingOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.gain > 100:
        raise ValueError("the gain is too high for this bench")
    duration = options.cycles / options.frequency
    yield TrialRequest(
        Task(
            mode="rate",
            base_acceleration=Sine(amplitude=options.acceleration, frequency=options.frequency),
            compensation=options.compensation,
            duration=duration,
            window=(0.0, duration),
            sample_rate=100.0,
        )
    )


class SpeedsOptions(Options):
    """Options of the speeds."""

    speeds: tuple[AngularRate, ...] = Field(min_length=1)
    """One trial each."""


def _speeds(options: SpeedsOptions, bench: Bench) -> Iterator[TrialRequest]:
    for role, speeds in ((Role.WARM_UP, options.speeds[:1]), (Role.MEASUREMENT, options.speeds)):
        for speed in speeds:
            command = Polyline(times=(0.0, 1.0, 2.0), values=(0.0, speed, 0.0))
            task = Task(
                mode="rate", command=command, duration=2.0, window=(0.0, 2.0), sample_rate=10.0
            )
            yield TrialRequest(task, role=role, point={"speed": speed})


class StillOptions(Options):
    """Nothing can be chosen."""


def _still(options: StillOptions, bench: Bench) -> Iterator[TrialRequest]:
    task = Task(mode="rate", duration=1.0, window=(0.0, 1.0), sample_rate=10.0)
    yield TrialRequest(task, role=Role.WARM_UP)


KINDS = {
    "swing": ExperimentKind("swing", "", SwingOptions, _swing),
    "speeds": ExperimentKind("speeds", "", SpeedsOptions, _speeds),
    "still": ExperimentKind("still", "", StillOptions, _still),
}


class Desk:
    """A folder to write protocols into, and to load them from."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.marks: list[tuple[Path, int, int]] = []

    def write(self, name: str, text: str) -> Path:
        """Write a file; each § is taken out, and its place remembered as line and column."""
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        while MARK in text:
            before, after = text.split(MARK, 1)
            line = before.count("\n") + 1
            self.marks.append((path, line, len(before) - (before.rfind("\n") + 1) + 1))
            text = before + after
        path.write_bytes(text.encode())
        return path

    def load(self, text: str, *overrides: str, name: str = "protocol.toml") -> Protocol:
        path = self.write(name, text)
        return load_protocol(path, KINDS, overrides=overrides, shipped=SHIPPED)

    def problems(self, text: str, *overrides: str) -> tuple[Problem, ...]:
        """What is wrong with it; AssertionError when nothing is, or it is not at the marks."""
        with pytest.raises(ProtocolError) as caught:
            self.load(text, *overrides)
        found = {(p.file, p.line, p.column) for p in caught.value.problems if p.line}
        assert found == set(self.marks), str(caught.value)
        return caught.value.problems


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    return Desk(tmp_path)


@pytest.fixture
def simulink() -> str:
    """Text of the shipped bench."""
    return (SHIPPED / "benches" / "simulink.toml").read_text()
