"""How much memory a very long recording takes to be written, sealed, verified and gone on with.

    python benchmarks/long_recording.py [--hours 10] [--channels 12] [--rate 1000] [--folder DIR]

Streams one trial in blocks of a second, as a backend does, and prints the peak resident memory
after each stage. It should not depend on the length. Needs about 7 GB of disk for ten hours.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
from pathlib import Path

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.writer import RunWriter
from campaign.trial import ChannelInfo, Ending, Outcome, Task, Trial

NOW = "2026-01-01T00:00:00Z"
COUNT = 2.0**-20  # what one count of the converter is worth (rad/s)


def peak() -> float:
    """Peak resident memory of this process so far (MB)."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def record(writer: RunWriter, trial: Trial, channels: int, rate: int) -> None:
    """Quantised noisy sines, one block per second."""
    recorder = writer.begin(trial)
    recorder.start(
        tuple(ChannelInfo(f"c{k}", "rad/s", f"Channel {k}", "deg/s") for k in range(channels))
    )
    rng = np.random.default_rng(1)
    noise = rng.normal(0, 20, size=(channels, 16 * rate)).round()
    wave = np.sin(2 * np.pi * np.outer(np.arange(1, channels + 1), np.arange(rate) / rate))
    wave = (wave / COUNT).round()
    for second in range(int(trial.task.duration)):
        start = (second % 16) * rate
        block = (wave + np.roll(noise, second)[:, start : start + rate]) * COUNT
        recorder.append((second * rate + np.arange(rate)) / rate, block)
    recorder.finish(Ending(Outcome.COMPLETED), NOW, NOW)


def run(folder: Path, hours: float, channels: int, rate: int) -> dict[str, float]:
    """Peak memory (MB) after each stage, and the size of the archive."""
    peaks = {"start": peak()}
    seconds = round(3600 * hours)
    task = Task(mode="rate", duration=seconds, window=(0, seconds), sample_rate=rate)
    trials = [
        Trial(number=n, test="long", kind="none", seed=n, bench={}, task=task) for n in (1, 2)
    ]
    writer = RunWriter.create(folder, RunHeader(name="long", created=NOW), trials)
    record(writer, trials[0], channels, rate)
    peaks["written"] = peak()
    sealed = writer.seal(RunStatus.INTERRUPTED, ended=NOW)
    peaks["sealed"] = peak()
    if not verify_run(sealed).sound:
        raise SystemExit("the archive is damaged")
    peaks["verified"] = peak()
    size = sealed.stat().st_size / 1e6
    writer = RunWriter.resume(sealed, at=NOW, host={}, versions={}, command=())
    peaks["resumed"] = peak()
    writer.seal(RunStatus.INTERRUPTED, ended=NOW)
    peaks["sealed again"] = peak()
    return peaks | {"archive": size}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--hours", type=float, default=10.0)
    parser.add_argument("--channels", type=int, default=12)
    parser.add_argument("--rate", type=int, default=1000, help="samples per second")
    parser.add_argument("--folder", type=Path, help="where there is room; else a temporary one")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=given.folder) as folder:
        figures = run(Path(folder), given.hours, given.channels, given.rate)
    if given.json:
        print(json.dumps(figures))
        return
    print(f"{given.hours:g} h, {given.channels} channels at {given.rate} Hz: peak memory (MB)")
    for stage, value in figures.items():
        print(f"{stage:14}{value:10.0f}")


if __name__ == "__main__":
    main()
