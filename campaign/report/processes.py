"""Analysis and drawing of tests in several processes.

The results are identical, to the byte, to those of one process. If a process dies or cannot start,
the calling process does its work, which takes more time.

This module imports little, so that processes start while the caller still imports the rest.
"""

from __future__ import annotations

import gc
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from campaign import processes
from campaign.archive.reading.global_heap_check import Looked, add_known_heaps, known_heaps
from campaign.archive.reading.run_reader import RunReader
from campaign.trial import Tree

if TYPE_CHECKING:
    from campaign.api.analysis import TestAnalysis
    from campaign.report.drawing.drawing_files import DrawingFiles
    from campaign.report.page.drawings import Drawable, Key

WORTHWHILE = 200
"""Number of trials above which several processes save more time than their start takes."""
PRELOADED = ("campaign.report.preload",)
"""Modules for every process, imported only once."""
LARGE = 50_000_000
"""Bytes above which a sealed run probably has `WORTHWHILE` trials."""


def choose_processes(run: RunReader) -> int:
    """Number of useful processes for a run on this machine."""
    many = len(run.trials) >= WORTHWHILE
    return min(os.cpu_count() or 1, len(run.header.tests)) if many else 1


def begin_early(path: Path) -> None:
    """Start the imports of processes while the run is opened, if the run is large.

    A wrong guess only takes some time of another core; with a single core nothing is started.
    """
    large = path.is_file() and path.stat().st_size >= LARGE
    if large and (os.cpu_count() or 1) > 1:
        processes.start_preloading(PRELOADED)


@dataclass
class Workers:
    """Pool of processes with an open run; without a pool, the caller does the work.

    `measure_anew`: as for `analyse_run`.
    """

    run: RunReader
    pool: ProcessPoolExecutor | None = None
    measure_anew: bool = False

    @cached_property
    def found(self) -> Mapping[str, TestAnalysis]:
        """Analysis of each test, by test; access to an item waits for it.

        The first access starts the analyses. They use the experiments of this installation only,
        because a process cannot receive other experiment objects.
        """
        tests = {str(test.get("name", "")): test for test in self.run.header.tests}
        # Tests with most trials first, so that no process ends with a long one.
        names = sorted(tests, key=lambda name: -len(self.run.trials_of(name)))
        return _Awaited(
            self._begun({name: (_find, tests[name], self.measure_anew) for name in names})
        )

    def draw(self, drawings: Mapping[Key, Drawable]) -> Callable[[Key], DrawingFiles | None]:
        """Start the drawings; the returned function waits for one, and returns None on failure."""
        longest_first = sorted(drawings.items(), key=lambda item: -item[1].work)
        begun = self._begun({key: (_draw, drawing) for key, drawing in longest_first})
        return lambda key: _result(begun[key]) if key in begun else None

    def _begun(self, work: Mapping[Any, tuple[Any, ...]]) -> dict[Any, Future[Any]]:
        """Submit functions with their arguments; stop when a process has died."""
        begun: dict[Any, Future[Any]] = {}
        if self.pool is not None:
            with suppress(BrokenProcessPool):
                for key, call in work.items():
                    begun[key] = self.pool.submit(*call)
        return begun


@dataclass(frozen=True, eq=False)
class _Awaited(Mapping[str, "TestAnalysis"]):
    """Analyses of the processes; those of a process that died are missing."""

    begun: Mapping[str, Future[Any]]

    def __getitem__(self, name: str) -> TestAnalysis:
        analysis: TestAnalysis | None = _result(self.begun[name])
        if analysis is None:
            raise KeyError(name)
        return analysis

    def __iter__(self) -> Iterator[str]:
        return (name for name, future in self.begun.items() if _result(future) is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _result(future: Future[Any]) -> Any:
    """Result of a process; None if it died."""
    try:
        return future.result()
    except BrokenProcessPool:
        return None


@contextmanager
def workers(run: RunReader, count: int, *, measure_anew: bool = False) -> Iterator[Workers]:
    """Pool of `count` processes for the block, or no pool for fewer than two.

    The analyses start at once.
    """
    if count < 2:
        yield Workers(run, measure_anew=measure_anew)
        return
    # The processes receive the data read and checked here; another read takes ten times as long.
    handed = run, known_heaps(run.path)
    with processes.process_pool(count, PRELOADED, _begin, handed) as pool:
        at_work = Workers(run, pool, measure_anew)
        _ = at_work.found
        yield at_work


_run: RunReader | None = None
"""Run of a process of the pool."""


def _begin(handed: tuple[RunReader, Mapping[Looked, bool]]) -> None:
    global _run
    _run, heaps = handed
    add_known_heaps(heaps)
    gc.freeze()


def _find(test: Tree, measure_anew: bool) -> TestAnalysis:
    from campaign.api.analysis import find
    from campaign.experiments import experiments

    if _run is None:
        raise RuntimeError("the process has no run to work on")
    return find(_run, test, experiments(), measure_anew=measure_anew)


def _draw(drawing: Drawable) -> DrawingFiles | None:
    try:
        return drawing.made()
    except Exception:  # noqa: BLE001 - the caller draws it again and reports the error
        return None
