"""A real scheduler on loopback: samples to the bit, whatever workers die, or are slow or others."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import UsageError
from campaign.execution import dask_executor
from campaign.execution.dask_executor import _scheduler
from tests.forks import PROGRAM, Forks
from tests.system import user
from tests.system.user import SEA, begun, campaign, write

pytest.importorskip("distributed", reason="dask.distributed is an extra")
pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="signals"),
    pytest.mark.slow,
]

PROTOCOL = SEA.replace('"simulink"', '"platform"\nrepeat = 12\nseed = 5')
IMPORTS = f"""{PROGRAM}
import distributed.cli.dask_scheduler, distributed.cli.dask_worker
from campaign.execution import dask_executor
dask_executor.GONE = 3.0
"""
OTHER = """
import campaign
campaign.__version__ = "0.0.9"
"""
SLOW = """
import time
from campaign.execution import dask_executor
if not hasattr(dask_executor, "swift"):  # Dask executes a preload twice
    dask_executor.swift = dask_executor.execute_remotely
    def slowly(*arguments):
        time.sleep(1.0)
        return dask_executor.swift(*arguments)
    dask_executor.execute_remotely = slowly
"""
SLOWER = SLOW.replace("1.0", "0.3")
"""Than the run is stopped: 24 trials last 3 s, or 7."""


@pytest.fixture(scope="module")
def forks() -> Iterator[Forks]:
    """Of a process that has imported Dask as well: for commands, schedulers and workers."""
    made = Forks(user.USUAL, IMPORTS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(user, "forks", lambda: made)
        yield made
    made.close()


class Site:
    """A scheduler and its workers; each is known by its pid."""

    def __init__(self, folder: Path, forks: Forks) -> None:
        self.folder, self.forks = folder, forks
        self.begun: list[int] = []
        told = folder / "scheduler.json"
        arguments = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.scheduler = self._begin("scheduler", *arguments, "--scheduler-file", str(told))
        deadline = time.monotonic() + 60.0
        while not told.is_file() or not told.read_text():
            assert time.monotonic() < deadline, "no scheduler"
            time.sleep(0.1)
        address = told.read_text().partition("tcp://")[2].partition('"')[0]
        self.address = f"dask://{address}"

    def worker(self, preload: str = "") -> int:
        """Begin one; `preload` is code that it runs first."""
        arguments = ["--nthreads", "1", "--no-nanny", "--no-dashboard"]
        arguments += ["--local-directory", str(self.folder)]
        if preload:
            path = self.folder / f"preload_{len(self.begun)}.py"
            path.write_text(preload)
            arguments += ["--preload", str(path)]
        return self._begin("worker", self.address.replace("dask", "tcp"), *arguments)

    def await_workers(self, count: int) -> None:
        # Another process: a client leaves its loop and sockets to the garbage collector.
        at = self.address.replace("dask", "tcp")
        does = (
            f"from distributed import Client\nClient({at!r}).wait_for_workers({count}, timeout=60)"
        )
        assert self.forks.run(self.folder, "-c", does).returncode == 0

    def end(self) -> None:
        for pid in self.begun:
            os.kill(pid, signal.SIGKILL)
            self.forks.ended(pid)

    def _begin(self, what: str, *arguments: str) -> int:
        does = f"from distributed.cli.dask_{what} import main; main({arguments})"
        self.begun.append(self.forks.fork(self.folder, ("-c", does), [os.devnull] * 3))
        return self.begun[-1]


@pytest.fixture
def site(tmp_path: Path, forks: Forks) -> Iterator[Site]:
    (tmp_path / "site").mkdir()
    made = Site(tmp_path / "site", forks)
    yield made
    made.end()


@pytest.fixture(scope="module")
def at_home(tmp_path_factory: pytest.TempPathFactory, forks: Forks) -> RunReader:
    folder = tmp_path_factory.mktemp("home")
    write(folder, PROTOCOL)
    campaign(folder, "run", "protocol.toml")
    return open_run(find_run(folder / "results"))


def assert_equal(folder: Path, at_home: RunReader, status: RunStatus = RunStatus.COMPLETE) -> str:
    """The run in `folder` has the samples and metrics of that at home; its journal."""
    run = open_run(find_run(folder / "results"))
    assert run.status is status
    assert run.problems() == []
    for here, there in zip(at_home.trials, run.trials, strict=True):
        assert there.digests() == here.digests()
        assert there.estimates == here.estimates
    return run.journal


def test_samples_are_those_at_home_and_a_worker_of_another_version_is_refused(
    site: Site, tmp_path: Path, at_home: RunReader
):
    site.worker()
    site.worker(SLOW)
    site.worker(OTHER)
    site.await_workers(3)
    write(tmp_path, PROTOCOL)
    done = campaign(tmp_path, "run", "protocol.toml", "--executor", site.address)
    assert "is not used: it has campaign 0.0.9, here it is " in " ".join(done.err.split())
    assert "2 parallel trials or blocks of trials" in " ".join(done.err.split())
    assert_equal(tmp_path, at_home)


def test_a_worker_that_is_killed_costs_its_batch_and_one_that_joins_is_used(
    site: Site, tmp_path: Path, at_home: RunReader
):
    slow = site.worker(SLOW)
    site.await_workers(1)
    write(tmp_path, PROTOCOL)
    process = begun(tmp_path, "run", "protocol.toml", "--executor", site.address)
    deadline = time.monotonic() + 60.0
    while not list((tmp_path / "results").glob("*.partial/plan.jsonl")):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    site.worker()
    site.await_workers(2)
    os.kill(slow, signal.SIGKILL)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 0, out + err
    assert_equal(tmp_path, at_home)


def test_without_its_scheduler_a_run_ends_and_is_resumed_at_home(
    site: Site, tmp_path: Path, at_home: RunReader, monkeypatch: pytest.MonkeyPatch
):
    site.worker(SLOWER)
    site.await_workers(1)
    write(tmp_path, PROTOCOL)
    process = begun(tmp_path, "run", "protocol.toml", "--executor", site.address)
    await_trials(tmp_path, 1)
    os.kill(site.scheduler, signal.SIGKILL)
    out, err = process.communicate(timeout=120)
    assert process.returncode == 3, out + err
    assert "the scheduler of the cluster, or the last" in " ".join((out + err).split())
    assert "Traceback" not in err
    (partial,) = (tmp_path / "results").glob("*.partial")
    assert list(partial.glob("*.trial"))
    campaign(tmp_path, "resume", partial.name)
    assert_equal(tmp_path, at_home)


def test_ctrl_c_ends_the_work_and_the_run_is_resumed_on_the_cluster(
    site: Site, tmp_path: Path, at_home: RunReader
):
    site.worker(SLOWER)
    site.worker(SLOWER)
    site.await_workers(2)
    write(tmp_path, PROTOCOL)
    process = begun(tmp_path, "run", "protocol.toml", "--executor", site.address)
    await_trials(tmp_path, 1)
    os.kill(process.pid, signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, out + err
    run = find_run(tmp_path / "results").stem
    campaign(tmp_path, "resume", run, "--executor", site.address)
    assert_equal(tmp_path, at_home)


def await_trials(folder: Path, count: int) -> None:
    deadline = time.monotonic() + 60.0
    while len(list((folder / "results").glob("*.partial/*.trial"))) < count:
        assert time.monotonic() < deadline
        time.sleep(0.02)


def test_a_processor_with_other_samples_is_refused(site: Site, tmp_path: Path):
    site.worker(
        "from llvmlite import binding\n"
        "binding.get_host_cpu_name = lambda: 'another'\n"
        "from campaign.execution import dask_executor\n"
        "dask_executor.samples_digest = lambda backend, trial: 'others'\n"
    )
    site.await_workers(1)
    write(tmp_path, PROTOCOL)
    done = campaign(tmp_path, "run", "protocol.toml", "--executor", site.address, code=2)
    assert "a trial has other samples" in " ".join(done.err.split())
    assert not list((tmp_path / "results").glob("*"))


def test_what_cannot_be_is_refused_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    write(tmp_path, SEA)
    for arguments, why in (
        (("--executor", "slurm"), "is neither 'dask' nor dask://HOST:PORT"),
        (("--executor", "dask://cluster.example:8786"), "anyone who reaches a scheduler"),
        (("--executor", "dask://c.example:1", "--executor-tls", "."), "there is no such file"),
        (("--executor-tls", "."), "is for --executor"),
        (("--executor", "dask", "--backend", "serial", "--port", "x"), "leave --executor out"),
    ):
        done = campaign(tmp_path, "run", "protocol.toml", *arguments, code=2)
        assert why in " ".join(done.err.split())
    assert not (tmp_path / "results").exists()
    monkeypatch.setattr(dask_executor, "CONNECTING", 0.5)
    assert _scheduler("dask://[::1]:1", None) == ("tcp://[::1]:1", None)
    with pytest.raises(UsageError, match="neither"):
        _scheduler("dask://a b:1", None)
