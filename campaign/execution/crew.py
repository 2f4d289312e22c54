"""Who executes trials: threads of this process, or processes that decide nothing of the run.

A thread puts each trial into the journal itself. A process writes the trials' files and measures
them; the lines for the journal come back with how they ended, and are kept by whoever decides.
"""

from __future__ import annotations

import multiprocessing
import pickle
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing.synchronize import Event
from pathlib import Path
from queue import SimpleQueue
from typing import Protocol

from campaign import processes
from campaign.archive.layout.journal import Entry
from campaign.archive.reading.measured import Measure
from campaign.archive.writing.trial_writer import FolderWriter
from campaign.backends.interface import Backend, Timed
from campaign.execution.attempt import Conditions, Executed, execute_once, execute_together
from campaign.execution.measuring import Measuring
from campaign.execution.safety import describe
from campaign.execution.supervision import Supervision
from campaign.execution.writer import PlanWriter
from campaign.experiments import experiments
from campaign.stopwatch import UNTIMED, Spent, Stopwatch, Work
from campaign.trial import Trial

WORTHWHILE = 300
"""Trials from which on processes take less time than they cost to begin."""
PRELOADED = (
    "campaign.archive.writing.trial_file",
    "campaign.backends.sim",
    "campaign.execution.crew",
    "campaign.experiments",
    "campaign.physics.simulate",
)
"""What every process needs, imported once for all of them."""
Tell = Callable[[Trial, Executed, Sequence[Entry]], None]
"""Is told how a trial has ended, and what the journal is to say of it; from any thread."""


class Crew(Protocol):
    """Executes batches, several at a time; a batch is trials that are executed together.

    Attributes:
        at_once: batches that should be begun before others have ended.
    """

    at_once: int

    def begin(self, batch: Sequence[Trial], tell: Tell) -> Future[None]:
        """Execute a batch; the future has what the archive raised, or LostProcessError."""

    def halt(self) -> None:
        """The run is to end: what is under way ends as soon as it can."""


class LostProcessError(Exception):
    """A process died; of its trials those that nobody was told of are to be executed again.

    Attributes:
        times: how often that has happened in this run.
    """

    def __init__(self, times: int) -> None:
        super().__init__(f"a process that executes trials has died, {times} times in this run")
        self.times = times


@dataclass
class Threads:
    """Threads of this process, none of which keeps the program from ending."""

    at_once: int
    conditions: Conditions
    _waiting: SimpleQueue[Callable[[], None] | None]

    def begin(self, batch: Sequence[Trial], tell: Tell) -> Future[None]:
        """See `Crew`."""
        future: Future[None] = Future()

        def work() -> None:
            try:
                execute(batch, self.conditions, lambda trial, done: tell(trial, done, ()))
            except BaseException as error:  # noqa: BLE001 - from the archive, for whoever waits
                future.set_exception(error)
            else:
                future.set_result(None)

        self._waiting.put(work)
        return future

    def halt(self) -> None:
        """Nothing to do: they look themselves."""


@contextmanager
def threads(count: int, conditions: Conditions) -> Iterator[Threads]:
    """So many threads."""
    waiting: SimpleQueue[Callable[[], None] | None] = SimpleQueue()

    def serve() -> None:
        while (work := waiting.get()) is not None:
            work()

    begun = [threading.Thread(target=serve, name="trial", daemon=True) for _ in range(count)]
    for thread in begun:
        thread.start()
    try:
        yield Threads(count, conditions, waiting)
    finally:
        for _ in begun:
            waiting.put(None)
    for thread in begun:
        thread.join()  # nothing hangs: all trials have ended


def execute(
    batch: Sequence[Trial], conditions: Conditions, tell: Callable[[Trial, Executed], None]
) -> None:
    """Each trial is told of as soon as it is archived. Raises what the archive raises."""
    if len(batch) == 1:
        tell(batch[0], execute_once(batch[0], conditions))
    else:
        execute_together(batch, conditions, tell)


# Processes


@dataclass(frozen=True)
class _Job:
    """What a process is told of the run when it begins."""

    backend: Backend
    folder: Path
    supervision: Supervision
    measures: bool
    is_timed: bool


@dataclass(frozen=True)
class _Done:
    """What became of a batch.

    Attributes:
        told: of each trial that was archived: its number, how it ended, the journal's lines.
        error: what the archive raised instead of going on.
        spent: on what, where somebody wants to know.
    """

    told: tuple[tuple[int, Executed, tuple[Entry, ...]], ...]
    error: BaseException | None
    spent: Mapping[Work, Spent]


class Processes:
    """Processes of this machine. One that dies takes the others with it; new ones are begun."""

    def __init__(self, count: int, conditions: Conditions, writer: PlanWriter) -> None:
        self.at_once = count + 1  # none waits while the last one is journalled
        self._count = count
        self._conditions = conditions
        self._writer = writer
        self._context = processes.context(PRELOADED)
        self._halted = self._context.Event()
        self._pool: ProcessPoolExecutor | None = None
        self._losing = threading.Lock()
        self._times = 0  # that it was lost
        self._others = set(multiprocessing.active_children())

    def begin(self, batch: Sequence[Trial], tell: Tell) -> Future[None]:
        """See `Crew`."""
        future: Future[None] = Future()
        attempts = {trial.number: self._writer.attempt(trial) for trial in batch}
        pool = self._pool = self._pool or self._begun()
        try:
            done = pool.submit(_execute, batch, attempts)
        except BrokenProcessPool:
            self._lose(pool, future)
        else:
            done.add_done_callback(partial(self._ended, pool, batch, tell, future))
        return future

    def halt(self) -> None:
        """See `Crew`."""
        self._halted.set()

    def end(self, *, at_once: bool) -> None:
        """Wait for what is under way, or do not."""
        if self._pool is None:
            return
        if at_once:
            self.halt()
            for process in set(multiprocessing.active_children()) - self._others:
                process.terminate()
        self._pool.shutdown(cancel_futures=at_once)

    def _begun(self) -> ProcessPoolExecutor:
        conditions = self._conditions
        supervision, timing = conditions.supervision, conditions.supervision.timing
        job = _Job(
            conditions.backend,
            self._writer.folder.absolute(),
            replace(supervision, subscribers=(), timing=UNTIMED),
            measures=conditions.measure is not None,
            is_timed=timing is not UNTIMED,
        )
        told = pickle.dumps(job, pickle.HIGHEST_PROTOCOL), self._halted
        return ProcessPoolExecutor(self._count, self._context, _begin, told)

    def _ended(
        self,
        pool: ProcessPoolExecutor,
        batch: Sequence[Trial],
        tell: Tell,
        future: Future[None],
        done: Future[_Done],
    ) -> None:
        """In a thread of the pool."""
        try:
            found = done.result()
        except BrokenProcessPool:
            self._lose(pool, future)
            return
        except BaseException as error:  # noqa: BLE001 - a bug, for whoever waits
            future.set_exception(error)
            return
        trials = {trial.number: trial for trial in batch}
        for number, executed, entries in found.told:
            tell(trials[number], executed, entries)
        self._conditions.supervision.timing.spent_elsewhere(found.spent)
        if found.error is None:
            future.set_result(None)
        else:
            future.set_exception(found.error)

    def _lose(self, pool: ProcessPoolExecutor, future: Future[None]) -> None:
        """The death of one process ends the pool, and all that it has been given."""
        with self._losing:
            if self._pool is pool:
                self._pool = None
                self._times += 1
            times = self._times
        future.set_exception(LostProcessError(times))


@contextmanager
def apart(count: int, conditions: Conditions, writer: PlanWriter) -> Iterator[Processes]:
    """So many processes, begun with the first batch; none of them is left behind."""
    crew = Processes(count, conditions, writer)
    try:
        yield crew
    except BaseException:
        crew.end(at_once=True)
        raise
    crew.end(at_once=False)


_job: _Job | None = None
_halted: Event | None = None
_measure: Measure | None = None
_watch: Stopwatch | None = None
"""Of a process: what it works on."""


def _begin(told: bytes, halted: Event) -> None:
    global _job, _halted, _measure, _watch
    processes.begin_here()
    job: _Job = pickle.loads(told)  # noqa: S301 - from the process that began this one
    _job, _halted = job, halted
    _watch = Stopwatch() if job.is_timed else None
    timing = _watch or UNTIMED
    _measure = Measuring(experiments(), timing) if job.measures else None
    if isinstance(job.backend, Timed):
        job.backend.timing = timing


def _execute(batch: Sequence[Trial], attempts: Mapping[int, int]) -> _Done:
    """In a process: execute a batch, and tell all of it at its end."""
    if _job is None or _halted is None:
        raise RuntimeError("the process was not told what it works on")
    timing = _watch or UNTIMED
    writer = FolderWriter(_job.folder, attempts, timing)
    supervision = replace(_job.supervision, timing=timing)
    conditions = Conditions(_job.backend, writer, _halted.is_set, supervision, _measure)
    told: list[tuple[int, Executed, tuple[Entry, ...]]] = []
    error: BaseException | None = None
    try:
        execute(
            batch,
            conditions,
            lambda trial, done: told.append((trial.number, _portable(done), writer.taken())),
        )
    except BaseException as raised:  # noqa: BLE001 - trials that ended before are told
        error = _as_portable(raised)
    return _Done(tuple(told), error, _watch.taken() if _watch else {})


def _portable(done: Executed) -> Executed:
    return done if done.bug is None else replace(done, bug=_as_portable(done.bug))


def _as_portable(error: BaseException) -> BaseException:
    """The same, or what there is to say of it where another process could not be told."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - made in this line
    except Exception:  # noqa: BLE001 - anybody's exception
        return RuntimeError(describe(error))
    return error
