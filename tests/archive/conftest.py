"""What the tests of the archive write."""

import hashlib
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.writing.writer import RunWriter
from campaign.policy import SampleRetention
from campaign.recording import ChannelInfo, Ending, Event, Outcome
from campaign.trial import Task, Trial
from tests import forks

CREATED = "2026-11-21T09:36:58Z"
STARTED = "2026-11-21T09:37:00.250Z"
ENDED = "2026-11-21T09:37:01.500Z"

CHANNELS = (
    ChannelInfo("command", "rad/s", "Command", "deg/s"),
    ChannelInfo("gyro_rate", "rad/s", "Load rate", "deg/s"),
    ChannelInfo("friction_torque", "N m", "Friction torque", "N m", measured=False),
)

NORMALISED = {"tests": [{"name": "map", "numbers": [1, 1.0, 1e-300, None, True]}], "published": "x"}
FINGERPRINT = hashlib.sha256(
    b'{"tests":[{"name":"map","numbers":[1,1.0,1e-300,null,true]}]}'
).hexdigest()
RESUMED = {"at": "2026-11-22T08:00:00Z", "host": {"name": "other"}, "versions": {}, "command": []}


def make_trial(number: int, test: str = "map") -> Trial:
    """A small valid trial; the archive does not look into the bench."""
    return Trial(
        number=number,
        test=test,
        kind="velocity_map",
        point={"speed": 0.1 * number, "compensation": "none"},
        seed=2**62 + number,
        bench={"name": "tiny", "axis": {"inertia": 35.0}, "given": ["5.1"], "count": 3},
        task=Task(mode="rate", duration=2.0, window=(0.5, 2.0), sample_rate=1000.0),
    )


def make_header(name: str = "2026-11-21T09-36-58-tiny", **fields: object) -> RunHeader:
    """A header with something in every kind of field."""
    return RunHeader.model_validate(
        {
            "name": name,
            "created": CREATED,
            "title": "A tiny run: 20 °/s",
            "protocol_name": "tiny",
            "sources": {"tiny.toml": 'title = "20 °/s"\n', "benches/tiny.toml": "# π\r\n"},
            "normalised": NORMALISED,
            "tests": [{"name": "map", "kind": "velocity_map", "options": {"speed": 0.1}}],
            "versions": {"campaign": "0.1.0", "numpy": "2.0"},
            "host": {"name": "lab"},
            "command": ["campaign", "run", "tiny.toml"],
            "operator": "Ada",
            "tags": ["first"],
            "backend": "sim",
            "overrides": {"bench.axis.inertia": "35 kg m^2"},
            "fingerprint": FINGERPRINT,
            **fields,
        }
    )


def make_samples(count: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """Times and a block of noise, with the values that careless code loses."""
    time = np.arange(count) / 1000.0
    block = np.random.default_rng(seed).normal(size=(len(CHANNELS), count))
    special = [np.nan, np.inf, -np.inf, -0.0, 5e-324, np.finfo(float).max]
    block[1, : min(count, len(special))] = special[:count]
    return time, block


def begin(
    results: Path, planned: int | list[Trial], counts: Sequence[int | None] = (), **fields: object
) -> tuple[RunWriter, list[Trial]]:
    """A run of trials (or so many), of which the first have recorded as many samples as `counts`
    says; None for one that failed before any."""
    if isinstance(planned, int):
        planned = [make_trial(number) for number in range(1, planned + 1)]
    writer = RunWriter.create(results, make_header(**fields), planned)
    for trial, count in zip(planned, counts, strict=False):
        write_trial(writer, trial, count)
    return writer, planned


def write_run(
    results: Path, counts: Sequence[int | None] = (50, 120), block: int = 1000, **fields: object
) -> Path:
    """Seal a run whose trials have `counts` samples; None for one that failed before any."""
    writer, trials = begin(results, len(counts), **fields)
    for trial, count in zip(trials, counts, strict=True):
        write_trial(writer, trial, count, block)
    failed = None in counts
    status = RunStatus.FAILED_TRIALS if failed else RunStatus.COMPLETE
    return writer.seal(status, "no power" if failed else "", ended="2026-11-21T09:40:00Z")


def write_trial(writer: RunWriter, trial: Trial, count: int | None, block: int = 1000) -> None:
    """Record one trial in blocks of `block` samples, and copy what waits into the sealed file."""
    if count is None:
        writer.begin(trial).finish(Ending(Outcome.FAULT, "no power"), STARTED, ENDED)
        copy_ended(writer)
        return
    recorder = begin_trial(writer, trial, ())
    time, samples = make_samples(count, trial.number)
    for start in range(0, count, block):
        cut = slice(start, start + block)
        recorder.append(time[cut], samples[:, cut])
    recorder.event(Event(0.25, "the load breaks away ↗"))
    recorder.finish(Ending(Outcome.COMPLETED), STARTED, ENDED)
    copy_ended(writer)


def copy_ended(writer: RunWriter) -> None:
    """Copy all that waits into the sealed file, as a run does between its trials."""
    while writer.seal_next():
        pass


Samples = int | tuple[np.ndarray, np.ndarray]


def begin_trial(
    writer: Any,
    trial: Trial,
    samples: Samples | tuple[()],
    channels: Sequence[ChannelInfo] = CHANNELS,
    *keeping: SampleRetention,
) -> Any:
    """A trial under way: its recorder, which has these samples, or so many."""
    recorder = writer.begin(trial, *keeping)
    recorder.start(tuple(channels))
    if samples != ():
        recorder.append(*(make_samples(samples) if isinstance(samples, int) else samples))
    return recorder


def record_trial(
    writer: Any, trial: Trial, samples: Any, *how: Any, ending: Ending | None = None
) -> Any:
    """A trial that has ended, as `begin_trial` begins it: its recorder."""
    recorder = begin_trial(writer, trial, samples, *how)
    recorder.finish(ending or Ending(Outcome.COMPLETED), STARTED, ENDED)
    return recorder


@pytest.fixture(scope="session")
def sealed_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sealed run of two trials; to be copied, not changed."""
    return write_run(tmp_path_factory.mktemp("sealed"))


@pytest.fixture
def sealed(sealed_once: Path, tmp_path: Path) -> Path:
    """A sealed run of two trials, of the test's own."""
    (tmp_path / "results").mkdir()
    return Path(shutil.copy(sealed_once, tmp_path / "results"))


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 2 MB, where the machine lets us have one."""
    disk = tmp_path / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=2m", "none", str(disk)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("no file system of our own can be mounted")
    yield disk
    subprocess.run(["umount", str(disk)], check=True)


@pytest.fixture(scope="session")
def kit() -> "type[Kit]":
    """The makers above, for tests: pytest imports no test module by name."""
    return Kit


class Kit:
    """Everything a test of the archive builds with."""

    CHANNELS, RESUMED = CHANNELS, RESUMED
    CREATED, STARTED, ENDED = CREATED, STARTED, ENDED
    trial: Callable[..., Trial] = staticmethod(make_trial)
    header: Callable[..., RunHeader] = staticmethod(make_header)
    samples = staticmethod(make_samples)
    begin = staticmethod(begin)
    run = staticmethod(write_run)
    record = staticmethod(write_trial)
    started = staticmethod(begin_trial)
    recorded = staticmethod(record_trial)
    python = partial(forks.python, "from tests.archive import conftest as kit")
    """A process that runs a program, which has the makers above as `kit`."""
