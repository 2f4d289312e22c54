"""What the tests of the archive write."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from campaign.archive import RunHeader, RunStatus, RunWriter
from campaign.recording import ChannelInfo, Ending, Event, Outcome
from campaign.trial import Task, Trial

CREATED = "2026-11-21T09:36:58Z"
STARTED = "2026-11-21T09:37:00.250Z"
ENDED = "2026-11-21T09:37:01.500Z"

CHANNELS = (
    ChannelInfo("command", "rad/s", "Command", "deg/s"),
    ChannelInfo("gyro_rate", "rad/s", "Load rate", "deg/s"),
    ChannelInfo("friction_torque", "N m", "Friction torque", "N m", measured=False),
)


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
            "normalised": {"title": "x", "numbers": [1, 1.0, 1e-300, None, True]},
            "tests": [{"name": "map", "kind": "velocity_map", "options": {"speed": 0.1}}],
            "versions": {"campaign": "0.1.0", "numpy": "2.0"},
            "host": {"name": "lab"},
            "command": ["campaign", "run", "tiny.toml"],
            "operator": "Ada",
            "tags": ["first"],
            "backend": "sim",
            "overrides": {"bench.axis.inertia": "35 kg m^2"},
            "fingerprint": "ab" * 32,
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


def write_run(
    results: Path, counts: Sequence[int | None] = (50, 120), block: int = 1000, **fields: object
) -> Path:
    """Seal a run whose trials have `counts` samples; None for one that failed before any."""
    trials = [make_trial(number) for number in range(1, len(counts) + 1)]
    writer = RunWriter.create(results, make_header(**fields), trials)
    for trial, count in zip(trials, counts, strict=True):
        write_trial(writer, trial, count, block)
    failed = None in counts
    status = RunStatus.FAILED_TRIALS if failed else RunStatus.COMPLETE
    return writer.seal(status, "no power" if failed else "", ended="2026-11-21T09:40:00Z")


def write_trial(writer: RunWriter, trial: Trial, count: int | None, block: int = 1000) -> None:
    """Record one trial in blocks of `block` samples."""
    recorder = writer.begin(trial)
    if count is None:
        recorder.finish(Ending(Outcome.FAULT, "no power"), STARTED, ENDED)
        return
    recorder.start(CHANNELS)
    time, samples = make_samples(count, trial.number)
    for start in range(0, count, block):
        cut = slice(start, start + block)
        recorder.append(time[cut], samples[:, cut])
    recorder.event(Event(0.25, "the load breaks away ↗"))
    recorder.finish(Ending(Outcome.COMPLETED), STARTED, ENDED)


@pytest.fixture(scope="session")
def sealed_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sealed run of two trials; to be copied, not changed."""
    return write_run(tmp_path_factory.mktemp("sealed"))


@pytest.fixture
def sealed(sealed_once: Path, tmp_path: Path) -> Path:
    """A sealed run of two trials, of the test's own."""
    (tmp_path / "results").mkdir()
    return Path(shutil.copy(sealed_once, tmp_path / "results"))


@pytest.fixture(scope="session")
def kit() -> "type[Kit]":
    """The makers above, for tests: pytest imports no test module by name."""
    return Kit


class Kit:
    """Everything a test of the archive builds with."""

    CHANNELS = CHANNELS
    CREATED, STARTED, ENDED = CREATED, STARTED, ENDED
    trial: Callable[..., Trial] = staticmethod(make_trial)
    header: Callable[..., RunHeader] = staticmethod(make_header)
    samples = staticmethod(make_samples)
    run = staticmethod(write_run)
    record = staticmethod(write_trial)
