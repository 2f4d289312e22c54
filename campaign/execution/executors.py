"""Executors of batches: threads, or processes for large simulated runs.

A worker thread writes journal entries itself. A worker process writes trial files and measures
them; it returns the journal entries with each trial's end, and the parent writes them.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import multiprocessing.process
import pickle
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Protocol, Self

from campaign import processes
from campaign.archive.layout.journal import Entry
from campaign.archive.writing.trial_writer import FolderWriter
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import Backend, SupportsTiming
from campaign.errors import ArchiveError
from campaign.execution.attempt import AttemptEnd, Conditions, execute_once, execute_together
from campaign.execution.safety import describe
from campaign.execution.supervision import Supervision
from campaign.execution.trial_metrics import TrialMeasurement
from campaign.experiments import experiments
from campaign.policy import SampleRetention
from campaign.stopwatch import UNTIMED, Spent, Stopwatch, Timing, Work
from campaign.trial import Trial

FORGOTTEN = 5.0
"""s after the death of a worker process until the pool must have reported each of its batches."""
FEWEST_FOR_PROCESSES = 300
"""Least number of trials for which processes save more time than their start costs."""
PRELOADED = (
    "campaign.archive.writing.trial_file",
    "campaign.backends.sim",
    "campaign.execution.executors",
    "campaign.experiments",
    "campaign.physics.simulate",
)
"""Modules that the fork server imports once for all worker processes."""
OnEnd = Callable[[Trial, AttemptEnd, Sequence[Entry]], None]
"""Receives a trial's end and the journal entries to be written; called from any thread."""


class BatchExecutor(Protocol):
    """Executes batches in parallel; a batch is a group of trials that are executed together.

    Attributes:
        most_pending: maximum number of submitted batches that have not ended.
    """

    most_pending: int

    def submit(self, batch: Sequence[Trial], on_end: OnEnd) -> Future[None]:
        """Execute a batch. The future raises errors of the archive, or WorkerLostError."""

    def stop(self) -> None:
        """End the trials that are being executed, as soon as possible."""

    def look(self) -> None:
        """Check the workers; called while no batch reports."""


OpenExecutor = Callable[[Conditions, RunWriter], AbstractContextManager[BatchExecutor]]
"""Opens an executor of batches under these conditions, for the writer of the run."""


class WorkerLostError(Exception):
    """A worker process died; trials of the batch that have not been reported must be repeated.

    Attributes:
        times: number of losses in this run.
    """

    def __init__(self, times: int) -> None:
        super().__init__(f"a worker process ended unexpectedly ({times} in this run)")
        self.times = times


@dataclass
class ThreadExecutor:
    """Executor with daemon threads, which do not prevent the exit of the program."""

    most_pending: int
    conditions: Conditions
    _tasks: SimpleQueue[Callable[[], None] | None]

    def submit(self, batch: Sequence[Trial], on_end: OnEnd) -> Future[None]:
        """See `BatchExecutor`."""
        future: Future[None] = Future()

        def task() -> None:
            try:
                execute(batch, self.conditions, lambda trial, executed: on_end(trial, executed, ()))
            except BaseException as error:  # noqa: BLE001 - an error of the archive, raised by the future
                future.set_exception(error)
            else:
                future.set_result(None)

        self._tasks.put(task)
        return future

    def look(self) -> None:
        """See `BatchExecutor`; a thread does not die."""

    def stop(self) -> None:
        """Nothing to do: threads poll whether the run is to end."""


@contextmanager
def thread_executor(count: int, conditions: Conditions) -> Iterator[ThreadExecutor]:
    """An executor with `count` threads."""
    tasks: SimpleQueue[Callable[[], None] | None] = SimpleQueue()

    def serve() -> None:
        while (task := tasks.get()) is not None:
            task()

    threads = [threading.Thread(target=serve, name="trial", daemon=True) for _ in range(count)]
    for thread in threads:
        thread.start()
    try:
        yield ThreadExecutor(count, conditions, tasks)
    finally:
        for _ in threads:
            tasks.put(None)
    for thread in threads:
        thread.join()  # immediate: all trials have ended


def execute(
    batch: Sequence[Trial], conditions: Conditions, on_end: Callable[[Trial, AttemptEnd], None]
) -> None:
    """Execute a batch; report each archived trial. Raises errors of the archive."""
    if len(batch) == 1:
        on_end(batch[0], execute_once(batch[0], conditions))
    else:
        execute_together(batch, conditions, on_end)


@dataclass(frozen=True)
class WorkerSetup:
    """Data that another process needs to execute batches."""

    backend: Backend
    supervision: Supervision
    keeping: SampleRetention
    is_measured: bool
    is_timed: bool

    @classmethod
    def of(cls, conditions: Conditions) -> Self:
        """The same conditions, without subscribers and timing of this process."""
        supervision = conditions.supervision
        return cls(
            conditions.backend,
            replace(supervision, subscribers=(), timing=UNTIMED),
            conditions.keeping,
            is_measured=conditions.measure is not None,
            is_timed=supervision.timing is not UNTIMED,
        )


@dataclass(frozen=True)
class BatchResult:
    """Result of a batch from another process.

    Attributes:
        ended: (number, end, journal entries) of each archived trial.
        error: exception of the archive; later trials of the batch are then missing.
        spent: time by kind of work; empty if not measured.
        files: content of trial files by name, from a process without access to the run's folder.
    """

    ended: tuple[tuple[int, AttemptEnd, tuple[Entry, ...]], ...]
    error: BaseException | None
    spent: Mapping[Work, Spent]
    files: Mapping[str, bytes] = field(default_factory=dict)

    def report(
        self, batch: Sequence[Trial], on_end: OnEnd, timing: Timing, future: Future[None]
    ) -> None:
        """Report its trials to `on_end`, then the end of the batch to `future`."""
        trials = {trial.number: trial for trial in batch}
        for number, executed, entries in self.ended:
            on_end(trials[number], executed, entries)
        timing.add_worker(self.spent)
        if self.error is None:
            future.set_result(None)
        else:
            future.set_exception(self.error)


class BatchWorker:
    """Executes batches in a process without the run's journal."""

    def __init__(self, setup: WorkerSetup, stopped: Callable[[], bool]) -> None:
        self._setup, self._stopped = setup, stopped
        self._stopwatch = Stopwatch() if setup.is_timed else None
        self._timing = timing = self._stopwatch or UNTIMED
        measure = TrialMeasurement(experiments(), timing, only_plug_ins=True)
        self._measure = measure if setup.is_measured else None
        if isinstance(setup.backend, SupportsTiming):
            setup.backend.timing = timing

    def execute(
        self, batch: Sequence[Trial], attempts: Mapping[int, int], folder: Path, *, remote: bool
    ) -> BatchResult:
        """Execute a batch; trial files stay in `folder`, or are returned to a `remote` parent."""
        writer = FolderWriter(folder, attempts, self._timing)
        supervision = replace(self._setup.supervision, timing=self._timing)
        backend, keeping = self._setup.backend, self._setup.keeping
        conditions = Conditions(backend, writer, self._stopped, supervision, self._measure, keeping)
        ended: list[tuple[int, AttemptEnd, tuple[Entry, ...]]] = []

        def on_end(trial: Trial, executed: AttemptEnd) -> None:
            if executed.bug is not None:
                executed = replace(executed, bug=_picklable(executed.bug))
            ended.append((trial.number, executed, writer.take_entries()))

        error: BaseException | None = None
        files: Mapping[str, bytes] = {}
        try:
            execute(batch, conditions, on_end)
        except BaseException as raised:  # noqa: BLE001 - trials that ended before are reported
            error = _picklable(raised)
        try:
            if remote:
                files = writer.take_files()
            else:
                writer.publish()
        except ArchiveError as raised:
            ended, error = [], error or raised
        spent = self._stopwatch.take() if self._stopwatch else {}
        return BatchResult(tuple(ended), error, spent, files)


class ProcessExecutor:
    """A pool of local processes. After the death of one, a new pool takes the next batches."""

    def __init__(self, count: int, conditions: Conditions, writer: RunWriter) -> None:
        self.most_pending = count + 1  # no worker waits while the parent writes the journal
        self._count = count
        self._writer = writer
        self._timing = conditions.supervision.timing
        setup = WorkerSetup.of(conditions), writer.folder.absolute()
        self._setup = pickle.dumps(setup, pickle.HIGHEST_PROTOCOL)
        self._context = processes.process_context(PRELOADED)
        # No Event: a worker that dies while it reads an Event would hold its lock forever.
        self._stopped = self._context.RawValue(ctypes.c_bool, False)
        self._pool: ProcessPoolExecutor | None = None
        self._pending: dict[Future[None], ProcessPoolExecutor] = {}
        self._workers: set[multiprocessing.process.BaseProcess] = set()  # of the pool
        self._died: float | None = None
        self._lock = threading.Lock()
        self._lost = 0  # pools
        self._others = set(multiprocessing.active_children())

    def submit(self, batch: Sequence[Trial], on_end: OnEnd) -> Future[None]:
        """See `BatchExecutor`."""
        future: Future[None] = Future()
        attempts = {trial.number: self._writer.attempt(trial) for trial in batch}
        pool = self._pool = self._pool or self._new_pool()
        self._pending[future] = pool
        try:
            result = pool.submit(_execute_batch, batch, attempts)
        except (BrokenProcessPool, OSError):  # OSError: the pool breaks during the call
            self._on_loss(pool, future)
        else:
            result.add_done_callback(partial(self._on_result, pool, batch, on_end, future))
        self._workers |= set(multiprocessing.active_children()) - self._before
        return future

    def look(self) -> None:
        """See `BatchExecutor`. A pool that breaks during a submission may lose the batch."""
        alive = set(multiprocessing.active_children())
        broken = not self._workers <= alive
        pending = list(self._pending.items())  # a copy: a thread of the pool removes items
        lost = [(f, pool) for f, pool in pending if broken or pool is not self._pool]
        if not lost:
            self._died = None
            return
        self._died = self._died or time.monotonic()
        if time.monotonic() - self._died < FORGOTTEN:
            return
        for process in self._workers & alive if broken else ():
            process.kill()
        for future, pool in lost:
            self._on_loss(pool, future)

    def stop(self) -> None:
        """See `BatchExecutor`."""
        self._stopped.value = True

    def close(self, *, at_once: bool) -> None:
        """Wait for the running batches, or kill their processes."""
        if self._pool is None:
            return
        if at_once:
            for process in set(multiprocessing.active_children()) - self._others:
                process.kill()
        self._pool.shutdown(cancel_futures=at_once)

    def _new_pool(self) -> ProcessPoolExecutor:
        self._before = set(multiprocessing.active_children())
        self._workers, self._died = set(), None
        arguments = self._setup, self._stopped
        return processes.new_pool(self._count, self._context, _initialize, arguments)

    def _on_result(
        self,
        pool: ProcessPoolExecutor,
        batch: Sequence[Trial],
        on_end: OnEnd,
        future: Future[None],
        result: Future[BatchResult],
    ) -> None:
        """Called in a thread of the pool."""
        try:
            returned = result.result()
        except BrokenProcessPool:
            self._on_loss(pool, future)
            return
        except BaseException as error:  # noqa: BLE001 - a bug, raised by the future
            if self._pending.pop(future, None) is not None:
                future.set_exception(error)
            return
        if self._pending.pop(future, None) is None:  # already treated as lost
            return
        returned.report(batch, on_end, self._timing, future)

    def _on_loss(self, pool: ProcessPoolExecutor, future: Future[None]) -> None:
        """The death of one process ends its pool and every batch submitted to it."""
        with self._lock:
            if self._pool is pool:
                self._pool = None
                self._lost += 1
            error = WorkerLostError(self._lost)
            if self._pending.pop(future, None) is None:  # already lost
                return
        future.set_exception(error)


@contextmanager
def process_executor(
    conditions: Conditions, writer: RunWriter, *, count: int
) -> Iterator[ProcessExecutor]:
    """Executor with `count` processes, which start with the first batch."""
    executor = ProcessExecutor(count, conditions, writer)
    try:
        yield executor
    except BaseException:
        executor.close(at_once=True)
        raise
    executor.close(at_once=False)


# State of a worker process

_worker: BatchWorker | None = None
_folder: Path | None = None


def _initialize(pickled: bytes, stopped: ctypes.c_bool) -> None:
    global _worker, _folder
    processes.initialize_worker()
    setup, _folder = pickle.loads(pickled)  # noqa: S301 - from the parent process
    _worker = BatchWorker(setup, lambda: bool(stopped.value))


def _execute_batch(batch: Sequence[Trial], attempts: Mapping[int, int]) -> BatchResult:
    """Execute a batch in a worker process."""
    if _worker is None or _folder is None:
        raise RuntimeError("the worker process was not initialized")
    return _worker.execute(batch, attempts, _folder, remote=False)


def _picklable(error: BaseException) -> BaseException:
    """The exception, or a RuntimeError with its description."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - made in this line
    except Exception:  # noqa: BLE001 - an exception of a plug-in
        return RuntimeError(describe(error))
    return error
