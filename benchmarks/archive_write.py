"""How fast a trial is archived, beside HDF5's own shuffle and gzip-4 filters on the same samples.

    python benchmarks/archive_write.py [--seconds 600] [--repeats 3]

Both write 12 channels at 1 kHz in blocks of one second; ours also computes checksums and a preview
and syncs the file to the disk. Prints ratios: on a shared machine they say more than times.
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from campaign.archive.writing.trial_writer import TrialWriter
from campaign.trial import ChannelInfo, Ending, Outcome, Task, Trial

RATE = 1000
CHANNELS = 12
CHUNK = 12_500


def recording(seconds: int) -> tuple[np.ndarray, np.ndarray]:
    """A loop's signals with a 23-bit gyro's resolution: smooth, quantised, not trivial."""
    times = np.arange(seconds * RATE) / RATE
    rng = np.random.default_rng(1)
    count = 2.0**-20
    rows = [
        np.round((np.sin(0.3 * k * times) + rng.normal(0, 1e-4, len(times))) / count) * count
        for k in range(1, CHANNELS + 1)
    ]
    return times, np.stack(rows)


def write_ours(folder: Path, times: np.ndarray, block: np.ndarray) -> Path:
    task = Task(mode="rate", duration=times[-1] + 1, window=(0, 1), sample_rate=RATE)
    trial = Trial(number=1, test="speed", kind="none", seed=1, bench={}, task=task)
    notes = []
    file = TrialWriter(folder, trial, 1, notes.append)
    file.start(tuple(ChannelInfo(f"c{k}", "rad/s", f"Channel {k}", "deg/s") for k in range(12)))
    for start in range(0, len(times), RATE):
        file.append(times[start : start + RATE], block[:, start : start + RATE])
    now = "2026-01-01T00:00:00Z"
    file.finish(Ending(Outcome.COMPLETED), now, now)
    return folder / notes[0].file


def write_with_filters(folder: Path, times: np.ndarray, block: np.ndarray) -> Path:
    path = folder / "filters.h5"
    options = {"maxshape": (None,), "chunks": (CHUNK,), "shuffle": True, "compression": 4}
    with h5py.File(path, "w") as file:
        rows = [times, *block]
        datasets = [
            file.create_dataset(f"c{k}", (0,), dtype="<f8", **options) for k in range(len(rows))
        ]
        for start in range(0, len(times), RATE):
            for dataset, row in zip(datasets, rows, strict=True):
                dataset.resize((start + RATE,))
                dataset[start : start + RATE] = row[start : start + RATE]
    return path


def best(write: Callable[..., Path], samples: tuple, repeats: int) -> tuple[float, int]:
    """Shortest time (s) and the file's size (bytes)."""
    times, size = [], 0
    for _ in range(repeats):
        with tempfile.TemporaryDirectory() as folder:
            before = time.perf_counter()
            path = write(Path(folder), *samples)
            times.append(time.perf_counter() - before)
            size = path.stat().st_size
    return min(times), size


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seconds", type=int, default=600, help="length of the recording")
    parser.add_argument("--repeats", type=int, default=3, help="the best of so many counts")
    arguments = parser.parse_args()
    samples = recording(arguments.seconds)
    raw = samples[0].nbytes + samples[1].nbytes
    ours, our_size = best(write_ours, samples, arguments.repeats)
    theirs, their_size = best(write_with_filters, samples, arguments.repeats)
    print(
        f"{CHANNELS} channels and time, {arguments.seconds} s at {RATE} Hz, {raw / 1e6:.0f} MB raw"
    )
    print(f"{'':26}{'campaign':>12}{'gzip-4 filter':>16}{'ratio':>8}")
    print(f"{'size / raw':26}{our_size / raw:12.3f}{their_size / raw:16.3f}", end="")
    print(f"{our_size / their_size:8.2f}")
    per_second = [1e3 * t / arguments.seconds for t in (ours, theirs)]
    print(f"{'ms per recorded second':26}{per_second[0]:12.3f}{per_second[1]:16.3f}", end="")
    print(f"{per_second[0] / per_second[1]:8.2f}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"peak resident memory {peak:.0f} MB, of which the samples themselves {raw / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
