"""Worker processes archive what threads archive, also after a stop, a kill or a lost worker."""

from __future__ import annotations

import multiprocessing
import os
import pickle
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import closing, suppress
from functools import partial
from pathlib import Path

import pytest

from campaign import processes
from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import Decision
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import SimBackend, SimOptions
from campaign.errors import ArchiveError
from campaign.execution import dask_executor, executors
from campaign.execution.attempt import Conditions
from campaign.execution.executors import ProcessExecutor, WorkerSetup, process_executor
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Progress
from campaign.execution.runner import run_plan
from campaign.execution.stop import StopSwitch
from campaign.execution.supervision import Supervision
from campaign.execution.trial_metrics import TrialMeasurement
from campaign.experiments import experiments
from campaign.policy import KEEP_ALL
from campaign.protocol import Plan
from campaign.recording import Outcome
from campaign.stopwatch import UNTIMED, Stopwatch, Timing, Work
from tests import archives
from tests.archives import plan_of
from tests.system.user import environment

PROTOCOL = archives.PROTOCOL.replace("cycles = 3", "cycles = 1\nrepeat = 12").replace(
    '["none", "static"]', '["none", "lugre", "static"]'
)
TRIALS = 36


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> Plan:
    return plan_of(tmp_path_factory.mktemp("plan"), PROTOCOL)


def run(
    plan: Plan,
    folder: Path,
    *,
    in_processes: bool = True,
    display: Callable[[Progress], object] = lambda progress: None,
    stop: StopSwitch | None = None,
    writer: RunWriter | None = None,
    timing: Timing = UNTIMED,
) -> RunOutcome:
    header = RunHeader(name="run", created="2026-11-21T09:36:58Z", trials=len(plan.trials))
    writer = writer or RunWriter.create(folder, header, plan.trials)
    with closing(writer), SimBackend(SimOptions()) as backend:
        return run_plan(
            plan.trials, backend, writer, workers=2, display=display, stop=stop or StopSwitch(),
            measure=TrialMeasurement(experiments()),
            finished={n: o for n, o in writer.finished.items() if o is Outcome.COMPLETED},
            supervision=Supervision(timing=timing),
            executor=partial(process_executor, count=2) if in_processes else None,
        )  # fmt: skip


@pytest.fixture(scope="module")
def by_threads(plan: Plan, tmp_path_factory: pytest.TempPathFactory) -> RunReader:
    return open_run(run(plan, tmp_path_factory.mktemp("threads"), in_processes=False).archive)


def told(trial: ArchivedTrial) -> object:
    """All that an archive has of a trial but when it was executed."""
    samples = {name: c.samples.tobytes() for name, c in trial.recording().channels.items()}
    return trial.trial.fingerprint, trial.ending, samples, trial.estimates, trial.measured_by


def assert_same(archive: Path, expected: RunReader) -> None:
    found = open_run(archive)
    assert [told(trial) for trial in found.trials] == [told(trial) for trial in expected.trials]
    assert not found.damaged


@pytest.mark.slow
def test_processes_archive_what_threads_archive(
    plan: Plan, by_threads: RunReader, tmp_path: Path
) -> None:
    """Nobody is told of a trial before the journal has it."""
    assert by_threads.trials[0].estimates
    journal = tmp_path / "run.partial" / JOURNAL

    def display(progress: Progress) -> None:
        if not progress.closing:
            lines = journal.read_text(encoding="utf-8").splitlines()
            assert progress.done <= sum('"trial finished"' in line for line in lines)

    stopwatch = Stopwatch()
    outcome = run(plan, tmp_path, display=display, timing=stopwatch)
    assert outcome.status is RunStatus.COMPLETE
    assert_same(outcome.archive, by_threads)
    assert not multiprocessing.active_children()
    spent = stopwatch.spent()
    for work in (Work.ENGINE, Work.TRIAL_FILES, Work.MEASURING):
        assert spent[work].others > 0.0
        assert spent[work].processor > 0.01


@pytest.mark.slow
def test_a_stop_ends_the_trials_of_processes_and_the_run_goes_on(
    plan: Plan, by_threads: RunReader, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop_it, stops = ProcessExecutor.stop, []
    monkeypatch.setattr(ProcessExecutor, "stop", lambda executor: stops.append(stop_it(executor)))
    stop = StopSwitch()

    def display(progress: Progress) -> None:
        if progress.done:
            stop.request("somebody")

    outcome = run(plan, tmp_path, display=display, stop=stop)
    assert outcome.status is RunStatus.INTERRUPTED
    assert stops
    assert len(open_run(outcome.archive).trials) < TRIALS
    writer = RunWriter.resume(
        outcome.archive, at="2026-11-21T10:00:00Z", host={}, versions={}, command=()
    )
    outcome = run(plan, tmp_path, writer=writer, in_processes=False)
    assert_same(outcome.archive, by_threads)


def test_what_is_under_way_in_processes_ends_when_the_executor_is_stopped(
    plan: Plan, tmp_path: Path
) -> None:
    header = RunHeader(name="run", created="2026-11-21T09:36:58Z", trials=len(plan.trials))
    told: list[Outcome] = []
    with closing(RunWriter.create(tmp_path, header, plan.trials)) as writer:
        conditions = Conditions(SimBackend(SimOptions()), writer, lambda: False, Supervision())
        with process_executor(conditions, writer, count=1) as executor:
            executor.stop()
            executor.submit(
                plan.trials[:1], lambda trial, done, _: told.append(done.ending.outcome)
            ).result()
    assert told == [Outcome.INTERRUPTED]


def kill_workers() -> bool:
    """Whether there were any."""
    children = multiprocessing.active_children()
    for child in children:
        with suppress(ProcessLookupError):  # it has ended since
            os.kill(child.pid or 0, signal.SIGKILL)
    return bool(children)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_trials_of_workers_that_are_killed_are_repeated(
    plan: Plan, by_threads: RunReader, tmp_path: Path
) -> None:
    killed: list[bool] = []

    def display(progress: Progress) -> None:
        if progress.done and not any(killed):
            killed.append(kill_workers())

    outcome = run(plan, tmp_path, display=display)
    assert outcome.status is RunStatus.COMPLETE
    assert_same(outcome.archive, by_threads)
    decisions = open_run(outcome.archive).story.all(Decision)
    assert {each.decision for each in decisions} == {"worker lost"}
    assert all("(1 in this run)" in each.reason for each in decisions)  # of one pool


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_workers_that_always_die_end_the_run(plan: Plan, tmp_path: Path) -> None:
    outcome = run(plan, tmp_path, display=lambda progress: kill_workers())
    assert outcome.status is RunStatus.FAULT
    assert "the memory may be too small" in outcome.reason


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
@pytest.mark.parametrize("all_forgotten", [False, True])
def test_a_batch_that_a_broken_pool_forgets_is_repeated(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, all_forgotten: bool
) -> None:
    """As of CPython 3.11, where a process dies as its pool is given work."""
    real = ProcessPoolExecutor.submit
    forgotten: list[Future[object]] = []

    def submit(self: ProcessPoolExecutor, *call: object) -> Future[object]:
        begun = real(self, *call)  # type: ignore[arg-type]
        if len(forgotten) >= (3 if all_forgotten else 1):
            return begun
        forgotten.append(Future())
        kill_workers()
        return forgotten[-1]

    monkeypatch.setattr(executors, "FORGOTTEN", 0.5)
    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    outcome = run(plan, tmp_path)
    assert outcome.status is RunStatus.COMPLETE
    assert len(forgotten) == (3 if all_forgotten else 1)
    decisions = open_run(outcome.archive).story.all(Decision)
    assert "worker lost" in {each.decision for each in decisions}


@pytest.mark.parametrize("error", [BrokenProcessPool("broken"), OSError("handle is closed")])
def test_a_batch_that_a_broken_pool_refuses_is_repeated(
    plan: Plan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    real = ProcessPoolExecutor.submit
    refused: list[Exception] = []

    def submit(self: ProcessPoolExecutor, *call: object) -> Future[object]:
        if not refused:
            refused.append(error)
            raise error
        return real(self, *call)  # type: ignore[arg-type]

    monkeypatch.setattr(ProcessPoolExecutor, "submit", submit)
    outcome = run(plan, tmp_path)
    assert outcome.status is RunStatus.COMPLETE
    decisions = open_run(outcome.archive).story.all(Decision)
    assert [each.decision for each in decisions] == ["worker lost"]


def test_a_folder_that_is_taken_away_ends_the_run(plan: Plan, tmp_path: Path) -> None:
    def display(progress: Progress) -> None:
        if progress.done:
            shutil.rmtree(tmp_path / "results", ignore_errors=True)

    with pytest.raises(ArchiveError, match="is gone"):
        run(plan, tmp_path / "results", display=display)
    assert not multiprocessing.active_children()


ALONE = """
import sys
from pathlib import Path
from tests import archives
from tests.archives import plan_of
from tests.execution.test_executors import PROTOCOL, run

def display(progress):
    if progress.done:
        print("under way", flush=True)

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    run(plan_of(folder, PROTOCOL), folder / "results", display=display)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_processes_end_with_a_run_that_is_killed_and_it_goes_on(
    plan: Plan, by_threads: RunReader, tmp_path: Path
) -> None:
    (tmp_path / "alone.py").write_text(ALONE, encoding="utf-8")
    command = [sys.executable, str(tmp_path / "alone.py"), str(tmp_path)]
    root = str(Path(__file__).parents[2])
    path = os.pathsep.join(filter(None, [root, os.environ.get("PYTHONPATH")]))
    with subprocess.Popen(
        command, env=environment() | {"PYTHONPATH": path}, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout
        assert process.stdout.readline()
        process.kill()
        process.stdout.read()  # to its end: nobody has it open any more
    [folder] = (tmp_path / "results").glob("*.partial")
    writer = RunWriter.resume(folder, at="2026-11-21T10:00:00Z", host={}, versions={}, command=())
    outcome = run(plan, tmp_path, writer=writer, in_processes=False)
    assert_same(outcome.archive, by_threads)


def test_a_worker_of_a_cluster_keeps_memory_as_one_at_home(plan: Plan, monkeypatch) -> None:
    """Dask's own settings return it at once: a trial without samples took half as long again."""
    tuned: list[int] = []
    monkeypatch.setattr(processes, "tune_memory", lambda: tuned.append(1))
    monkeypatch.setattr(dask_executor, "_workers", {})
    backend = SimBackend(SimOptions())
    setup = WorkerSetup(backend, Supervision(), KEEP_ALL, is_measured=False, is_timed=False)
    for trial in plan.trials[:2]:
        arguments = pickle.dumps(setup), [trial], {trial.number: 1}
        assert dask_executor.execute_remotely("run", *arguments).error is None
    assert tuned == [1]
