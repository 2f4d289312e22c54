"""Machine code for simulations, compiled in advance.

The engine has four entry points, for one trial and for a block of LANES trials, with a plant and
with a prescribed motion. Each has one signature, independent of the bench. Friction models have
separate functions, compiled for the number of lanes, the sizes from their options, and the number
of equal interfaces of a bench, when a trial is prepared. All code is cached on disk
(`campaign.physics.compilation`), so it is compiled once per installation.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from llvmlite import binding
from numba.core import event

from campaign.physics.compilation import cache_folder, is_kept_for_good
from campaign.physics.complete import CompleteBench
from campaign.physics.lanes import Lane, together
from campaign.physics.simulate import simulate_together
from campaign.physics.vector import LANES
from campaign.signals import Sine
from campaign.trial import Task

WIDTHS = (1, LANES)
"""Lanes for which the engine is compiled."""


@dataclass(frozen=True)
class Part:
    """A unit of machine code.

    Attributes:
        name: for display.
        make: loads it from the disk, or compiles and caches it.
    """

    name: str
    make: Callable[[], object]


@dataclass(frozen=True)
class CompiledPart:
    """A loaded part; wall-clock seconds, and whether it was compiled."""

    name: str
    seconds: float
    compiled: bool


def folder() -> Path | None:
    """Cache folder of the engine; None if the user's cache is not usable."""
    kept = cache_folder(__name__)
    return kept if kept is not None and is_kept_for_good(kept) else None


def parts(width: int, benches: Sequence[CompleteBench]) -> Iterator[Part]:
    """Parts for simulations of `benches`, for one trial (`width` 1) or LANES in parallel."""
    yield engine(width, benches[0])
    for bench in benches:
        name = f"friction models of the bench {bench.name}, {_side_by_side(width)}"
        yield Part(name, partial(_make_ready, bench, width))
    yield engine(width, benches[0], "prescribed")


def engine(width: int, bench: CompleteBench, mode: str = "rate") -> Part:
    """The engine, which is the same for any bench; `mode`: of a loop, or `prescribed`."""
    what = "engine, prescribed motion" if mode == "prescribed" else "engine"
    make = partial(_simulate, bench.with_friction({}), mode, width)
    return Part(f"{what}, {_side_by_side(width)}", make)


def make(part: Part) -> CompiledPart:
    """Make one part; returns its time."""
    compiling = _Compiling()
    began = time.perf_counter()
    with event.install_listener("numba:run_pass", compiling):
        part.make()
    return CompiledPart(part.name, time.perf_counter() - began, compiling.seen)


def is_made(width: int) -> bool:
    """Whether the engine is already compiled for this kind of machine."""
    note = _note(width)
    return note is not None and note.exists()


def note_made(width: int) -> None:
    """Record that the engine is compiled: `is_made` until a source or the processor changes."""
    note = _note(width)
    if note is not None:
        with suppress(OSError):
            note.touch()


class _Compiling(event.Listener):  # type: ignore[misc]
    """Detector of compiler passes; code from the disk causes none."""

    def __init__(self) -> None:
        self.seen = False

    def on_start(self, event: Any) -> None:
        self.seen = True

    def on_end(self, event: Any) -> None:
        pass


def _note(width: int) -> Path | None:
    """Path of an empty marker file; its name has the processor, which the folder's name lacks."""
    kept = folder()
    if kept is None:
        return None
    processor = f"{binding.get_host_cpu_name()}\n{binding.get_host_cpu_features().flatten()}"
    return kept / f"made-{width}-{hashlib.sha256(processor.encode()).hexdigest()[:16]}"


def _side_by_side(width: int) -> str:
    return "one trial" if width == 1 else f"{width} trials side by side"


def _make_ready(bench: CompleteBench, width: int) -> None:
    """Prepare trials of a bench in every mode, with every compensation."""
    for mode in ("rate", "prescribed"):
        for compensation in ("none", *bench.compensation):
            together([Lane.of(bench, _some_task(bench, mode, compensation), 0)], width)


def _simulate(bench: CompleteBench, mode: str, width: int) -> None:
    """Simulate some milliseconds of a bench without friction, so that only the engine compiles."""
    for _ in simulate_together([Lane.of(bench, _some_task(bench, mode), 0)] * width):
        pass


def _some_task(bench: CompleteBench, mode: str, compensation: str = "none") -> Task:
    rate = bench.controller.sample_rate or 1000.0
    return Task(
        mode=mode,
        command=Sine(amplitude=0.1, frequency=1.0),
        compensation=compensation,
        duration=2.5 / rate,
        window=(0.0, 0.0),
        sample_rate=rate,
    )
