"""What a trial costs besides its simulation: a campaign of many short trials, archived and sealed.

    python benchmarks/small_trials.py [--trials 2000] [--seconds 1] [--profile seal.prof]

Trials of one second at 1 kHz, 11 channels, simulated from a bench's description. Tells processor
time (user and system, all threads), which a busy machine disturbs least, for the simulation into
memory, for archiving the same recordings, and for sealing, which checks them; and bytes per trial
beside those of the samples as they are.
"""

from __future__ import annotations

import argparse
import cProfile
import os
import tempfile
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as the command line has it

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import SimBackend, SimOptions
from campaign.physics.bench import Bench
from campaign.signals import Sine
from campaign.trial import ChannelInfo, Ending, MemoryRecorder, Recording, Task, Trial

BENCH = Path(__file__).parents[1] / "protocols" / "benches" / "simulink.toml"
NOW = "2026-01-01T00:00:00Z"


def make_trials(count: int, seconds: float) -> list[Trial]:
    """Different commands on one bench."""
    bench = Bench.model_validate(tomllib.loads(BENCH.read_text())).model_dump(mode="json")
    task = {"mode": "rate", "duration": seconds, "window": (0, seconds), "sample_rate": 1000.0}
    return [
        Trial(
            number=number,
            test="small",
            kind="none",
            point={"amplitude": 0.1 + 1e-4 * number},
            seed=number,
            bench=bench,
            task=Task(command=Sine(amplitude=0.1 + 1e-4 * number, frequency=2.0), **task),
        )
        for number in range(1, count + 1)
    ]


def simulate(trial: Trial) -> tuple[Recording, Ending]:
    memory = MemoryRecorder()
    with SimBackend(SimOptions()) as backend:
        ending = backend.execute(trial, memory, lambda: False)
    return memory.recording(ending), ending


def write(writer: RunWriter, trial: Trial, recording: Recording, ending: Ending) -> None:
    recorder = writer.begin(trial)
    recorder.start(
        tuple(
            ChannelInfo(c.name, c.unit, c.label, c.display_unit, c.measured)
            for c in recording.channels.values()
        )
    )
    block = np.stack([channel.samples for channel in recording.channels.values()])
    recorder.append(recording.time, block)
    recorder.finish(ending, NOW, NOW)


def timed(work: Callable[[], Any]) -> tuple[Any, float, float]:
    """What `work` returns, its processor time and its time on the wall (s)."""
    wall, before = time.perf_counter(), os.times()
    result = work()
    after = os.times()
    used = after.user + after.system - before.user - before.system
    return result, used, time.perf_counter() - wall


def measure(folder: Path, count: int, seconds: float) -> None:
    trials = make_trials(count, seconds)
    simulate(trials[0])  # compiles
    writer = RunWriter.create(folder, RunHeader(name="small", created=NOW), trials)
    simulated = written = on_wall = 0.0
    raw = 0
    for trial in trials:
        (recording, ending), used, _ = timed(lambda trial=trial: simulate(trial))
        simulated += used
        pending = (trial, recording, ending)
        _, used, wall = timed(lambda pending=pending: write(writer, *pending))
        written += used
        on_wall += wall
        raw += 8 * len(recording.time) * (1 + len(recording.channels))
    path, sealed, wall = timed(lambda: writer.seal(RunStatus.COMPLETE, ended=NOW))
    print(f"{count} trials of {seconds:g} s at 1 kHz{'CPU s':>14}{'ms/trial':>10}{'wall s':>8}")
    rows = [("simulated", simulated, simulated), ("archived", written, on_wall)]
    for what, used, elapsed in [*rows, ("sealed, checked", sealed, wall)]:
        print(f"{what:34}{used:10.2f}{1e3 * used / count:10.2f}{elapsed:8.2f}")
    size = path.stat().st_size
    print(
        f"{size / 1e6:.1f} MB, {size / count / 1e3:.1f} kB a trial; samples {raw / count / 1e3:.1f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--trials", type=int, default=2000)
    parser.add_argument("--seconds", type=float, default=1.0, help="length of each")
    parser.add_argument("--profile", type=Path, help="write a profile (cProfile) there")
    arguments = parser.parse_args()
    profile = cProfile.Profile(time.process_time)
    with tempfile.TemporaryDirectory() as folder:
        if arguments.profile:
            profile.enable()
        measure(Path(folder), arguments.trials, arguments.seconds)
    if arguments.profile:
        profile.disable()
        profile.dump_stats(arguments.profile)


if __name__ == "__main__":
    main()
