"""Analysis and drawing of tests in several processes.

What comes back is what one process would have made, to the byte. A process that dies, or that
cannot be begun, costs time: what it should have done is then done here.

Little is imported here: processes are at work while whoever begins them still imports the rest.
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
from campaign.archive import RunReader
from campaign.archive.reading.global_heap_check import Looked, add_known_heaps, known_heaps
from campaign.trial import Tree

if TYPE_CHECKING:
    from campaign.api.analysis import TestAnalysis
    from campaign.report.drawing.drawing_files import DrawingFiles
    from campaign.report.page.drawings import Drawable, Key

WORTHWHILE = 200
"""Trials from which on more processes than one take less time than they cost to begin."""
PRELOADED = ("campaign.report.preload",)
"""What every process needs, imported once for all of them."""
LARGE = 50_000_000
"""Bytes of a sealed run from which on it probably has as many trials."""


def choose_processes(run: RunReader) -> int:
    """How many processes are worth while for a run on this machine."""
    many = len(run.trials) >= WORTHWHILE
    return min(os.cpu_count() or 1, len(run.header.tests)) if many else 1


def begin_early(path: Path) -> None:
    """Have what processes need imported while the run is opened, where it looks worth their while.

    A guess that was wrong costs a moment of another core, and none where there is but one.
    """
    large = path.is_file() and path.stat().st_size >= LARGE
    if large and (os.cpu_count() or 1) > 1:
        processes.start_preloading(PRELOADED)


@dataclass
class Workers:
    """Processes that have a run open; none of them, and all is done where it is needed.

    `measure_anew`: as for `analyse_run`.
    """

    run: RunReader
    pool: ProcessPoolExecutor | None = None
    measure_anew: bool = False

    @cached_property
    def found(self) -> Mapping[str, TestAnalysis]:
        """What the analysis of each test finds, by test; it is waited for where it is asked for.

        Analysing begins when this is first asked for. Only with the experiments of this
        installation: an object that somebody made cannot be told to another process.
        """
        tests = {str(test.get("name", "")): test for test in self.run.header.tests}
        # The most trials first, so that none is left with a long one at the end.
        names = sorted(tests, key=lambda name: -len(self.run.trials_of(name)))
        return _Awaited(
            self._begun({name: (_find, tests[name], self.measure_anew) for name in names})
        )

    def draw(self, drawings: Mapping[Key, Drawable]) -> Callable[[Key], DrawingFiles | None]:
        """Begin to draw; what is returned waits for a drawing, and has none that cannot be made."""
        longest_first = sorted(drawings.items(), key=lambda item: -item[1].work)
        begun = self._begun({key: (_draw, drawing) for key, drawing in longest_first})
        return lambda key: _result(begun[key]) if key in begun else None

    def _begun(self, work: Mapping[Any, tuple[Any, ...]]) -> dict[Any, Future[Any]]:
        """Each function with its arguments; nothing once a process has died."""
        begun: dict[Any, Future[Any]] = {}
        if self.pool is not None:
            with suppress(BrokenProcessPool):
                for key, call in work.items():
                    begun[key] = self.pool.submit(*call)
        return begun


@dataclass(frozen=True, eq=False)
class _Awaited(Mapping[str, "TestAnalysis"]):
    """What processes find; what one died of is missing."""

    begun: Mapping[str, Future[Any]]

    def __getitem__(self, name: str) -> TestAnalysis:
        found: TestAnalysis | None = _result(self.begun[name])
        if found is None:
            raise KeyError(name)
        return found

    def __iter__(self) -> Iterator[str]:
        return (name for name, future in self.begun.items() if _result(future) is not None)

    def __len__(self) -> int:
        return sum(1 for _ in self)


def _result(future: Future[Any]) -> Any:
    """What a process made; None when it died of it."""
    try:
        return future.result()
    except BrokenProcessPool:
        return None


@contextmanager
def workers(run: RunReader, count: int, *, measure_anew: bool = False) -> Iterator[Workers]:
    """So many processes, for as long as the block lasts; fewer than two are none.

    They begin to analyse at once.
    """
    if count < 2:
        yield Workers(run, measure_anew=measure_anew)
        return
    # What was read and checked here is handed over: reading it again takes ten times as long.
    handed = run, known_heaps()
    with processes.process_pool(count, PRELOADED, _begin, handed) as pool:
        at_work = Workers(run, pool, measure_anew)
        _ = at_work.found
        yield at_work


_run: RunReader | None = None
"""Of a process of the pool: the run that it works on."""


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
    except Exception:  # noqa: BLE001 - it is drawn again where that is told
        return None
