"""What a step of the engine costs, alone and in a block of trials side by side.

    python -m benchmarks.lanes [--write]

Each trial has a plant of its own; all outputs are recorded every millisecond, at a step of 1 ms.
Minima of short stretches, in turn: what counts are the ratios, since a busy machine disturbs all.
`--write` puts the table into docs/developers/performance.md.
"""

from __future__ import annotations

import argparse
import math
import os
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it

import numpy as np

from benchmarks.document import machine, table, write_section
from campaign.physics.bench import Bench
from campaign.physics.blocks import zeros
from campaign.physics.engine import advance_block, advance_one
from campaign.physics.lanes import Lane, Lanes, together
from campaign.physics.rows import OUTPUTS
from campaign.physics.vector import LANES
from campaign.signals import Sine
from campaign.trial import Task

SIMULINK = Path(__file__).parents[1] / "protocols" / "benches" / "simulink.toml"
STEP, STEPS, REPEATS = 1e-3, 4000, 30
SWING = Sine(amplitude=math.radians(18.0), frequency=0.24)
NOISY = {
    "controller": {"sample_rate": "1 kHz"},
    "sensors": {"gyro": {"noise": "1e-4 rad/s"}, "encoder": {"noise": "1e-6 rad"}},
}
CASES = {
    "none": ("none", {}),
    "LuGre compensated": ("lugre", {}),
    "sampled at 1 kHz, noisy": ("none", NOISY),
}


def bench(number: int, changes: dict[str, dict[str, object]]) -> Bench:
    """The shipped bench with an inertia of its own."""
    tree = tomllib.loads(SIMULINK.read_text(encoding="utf-8"))
    for each, entries in changes.items():
        tree.setdefault(each, {}).update(entries)
    tree["axis"]["inertia"] = f"{35 + number} kg m^2"
    return Bench.model_validate(tree)


def lanes(compensation: str, changes: dict[str, dict[str, object]], count: int) -> Lanes:
    """Trials side by side."""
    duration = STEPS * STEP
    task = Task(
        mode="rate",
        base_acceleration=SWING,
        compensation=compensation,
        duration=duration,
        window=(0.0, duration),
        sample_rate=1.0 / STEP,
    )
    trials = [Lane.of(bench(number, changes), task, number, STEP) for number in range(count)]
    return together(trials, count)


def stretch(these: Lanes) -> Callable[[], None]:
    """Advances over one stretch, noise included."""
    at = np.arange(STEPS + 1) * STEP
    signals, out = these.signals(at), zeros(len(OUTPUTS), STEPS, these.width)
    advance = advance_one if these.width == 1 else advance_block

    def run() -> None:
        advance(
            these.system, these.friction, these.compensation, these.controller, these.memory,
            signals, these.noise(STEPS), 1, out,
        )  # fmt: skip

    return run


def rows() -> Iterator[list[str]]:
    """Nanoseconds of one core per trial and step: case, alone, in lanes, ratio."""
    for name, (compensation, changes) in CASES.items():
        runs = [stretch(lanes(compensation, changes, count)) for count in (1, LANES)]
        best = [math.inf, math.inf]
        for _ in range(REPEATS):
            for which, run in enumerate(runs):
                began = time.perf_counter()
                run()
                best[which] = min(best[which], time.perf_counter() - began)
        alone, block = best[0] / STEPS * 1e9, best[1] / STEPS / LANES * 1e9
        yield [name, f"{alone:.0f}", f"{block:.1f}", f"{alone / block:.1f}"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true", help="into docs/developers/performance.md")
    found = table(["ns per trial and step", "alone", f"in {LANES} lanes", "ratio"], list(rows()))
    print(found)
    if parser.parse_args().write:
        write_section("lanes", f"{machine()}.\n\n{found}")


if __name__ == "__main__":
    main()
