"""Time of a run by kind of work.

The executing code receives a `Stopwatch`, or `UNTIMED`, which costs almost nothing. Nested work
counts only as its own kind, so each second of a thread counts once.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import TypeVar

T = TypeVar("T")


class Work(StrEnum):
    """Kinds of work of a run, in the order of the output."""

    IMPORTING = "importing"
    PREPARING = "preparing the plan"
    COMPILING = "compiling the engine"
    SETTING_UP = "setting trials up"
    ENGINE = "engine"
    SAMPLES = "samples and limits"
    TRIAL_FILES = "trial files and journal"
    MEASURING = "metrics of recordings"
    WAITING = "waiting for trials"
    SEALING = "sealed file"
    REPORT = "report"


@dataclass
class Spent:
    """Time in s: wall clock in the main thread, in all other threads, and processor time."""

    main: float = 0.0
    others: float = 0.0
    processor: float = 0.0


class Timing:
    """A stopwatch that measures nothing; see `Stopwatch`."""

    def span(self, work: Work) -> AbstractContextManager[None]:
        """Count the time of this thread inside the block as `work`."""
        return _NOTHING

    def each(self, work: Work, items: Iterable[T]) -> Iterable[T]:
        """The same items; the time to get each of them counts as `work`."""
        return items

    def add(self, work: Work, processor: float) -> None:
        """Add processor time (s) of `work` outside all spans."""

    def add_worker(self, spent: Mapping[Work, Spent]) -> None:
        """Add the time of a worker process of this run."""


_NOTHING = nullcontext()
UNTIMED = Timing()


class Stopwatch(Timing):
    """Measures the time by kind of work. Any thread may use it."""

    def __init__(self) -> None:
        self._began = time.perf_counter(), time.process_time()
        self._thread = threading.local()
        self._lock = threading.Lock()
        self._spent: dict[Work, Spent] = {}
        self._of_workers = 0.0

    @contextmanager
    def span(self, work: Work) -> Iterator[None]:
        outer: Work | None = getattr(self._thread, "work", None)
        self._begin(work)
        try:
            yield
        finally:
            self._begin(outer)

    def each(self, work: Work, items: Iterable[T]) -> Iterator[T]:
        iterator = iter(items)
        while True:
            with self.span(work):
                try:
                    item = next(iterator)
                except StopIteration:
                    return
            yield item

    def add(self, work: Work, processor: float) -> None:
        with self._lock:
            self._spent.setdefault(work, Spent()).processor += processor

    def add_worker(self, spent: Mapping[Work, Spent]) -> None:
        with self._lock:
            for work, each in spent.items():
                own = self._spent.setdefault(work, Spent())
                own.others += each.main + each.others
                own.processor += each.processor
                self._of_workers += each.processor

    def take(self) -> dict[Work, Spent]:
        """Time since the last call, of this thread and of all ended work in others; resets it."""
        self._begin(getattr(self._thread, "work", None))
        with self._lock:
            spent, self._spent = self._spent, {}
        return spent

    def elapsed(self) -> tuple[float, float]:
        """Seconds since its creation: wall clock, and processor time of this run."""
        used = time.process_time() - self._began[1] + self._of_workers
        return time.perf_counter() - self._began[0], used

    def spent(self) -> dict[Work, Spent]:
        """Time so far; for running work only its ended or interrupted parts."""
        with self._lock:
            return {work: Spent(**vars(self._spent[work])) for work in Work if work in self._spent}

    def _begin(self, work: Work | None) -> None:
        """Count the previous work of this thread, and start `work`."""
        now, used = time.perf_counter(), time.thread_time()
        before: Work | None = getattr(self._thread, "work", None)
        if before is not None:
            clock = now - self._thread.now
            with self._lock:
                spent = self._spent.setdefault(before, Spent())
                if threading.current_thread() is threading.main_thread():
                    spent.main += clock
                else:
                    spent.others += clock
                spent.processor += used - self._thread.used
        self._thread.work, self._thread.now, self._thread.used = work, now, used
