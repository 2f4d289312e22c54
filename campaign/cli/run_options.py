"""Options of a run: workers, cluster, prompts, report, signature, display."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from campaign.backends.interface import Backend, BackendKind
from campaign.cli.output import print_note, print_warning
from campaign.errors import UsageError
from campaign.execution.executors import (
    FEWEST_FOR_PROCESSES,
    PRELOADED,
    OpenExecutor,
    process_executor,
)
from campaign.processes import start_preloading
from campaign.trial import Trial


@dataclass(frozen=True)
class RunOptions:
    """Options of `run` and `resume`, as typed; `parameters.py` describes each.

    With `watch`, trials are executed in this process.
    """

    workers: int | None = None
    executor: str = ""
    tls: Path | None = None
    report: bool = False
    yes: bool = False
    clear_stop: int | None = None
    sign: Path | None = None
    watch: bool = False

    def check_watch(self) -> None:
        """Raise UsageError if `--watch` cannot draw."""
        if self.watch and importlib.util.find_spec("plotext") is None:
            raise UsageError("--watch needs plotext: pip install 'campaign[watch]'")
        if self.watch and self.executor:
            raise UsageError("--watch shows only trials of this process; leave --executor out")

    def parallel(self, kind: BackendKind, trials: int) -> int | None:
        """Count of parallel trials; for a cluster, the requested count of processes or None.

        Raises UsageError for options that do not suit the backend.
        """
        if not self.executor:
            if self.tls is not None:
                raise UsageError("--executor-tls is for --executor dask://HOST:PORT")
            return choose_workers(kind, trials, self.workers)
        if not kind.picklable:
            raise UsageError(
                f"--executor: a cluster executes only simulated trials, not those of the backend "
                f"{kind.name!r}; leave --executor out"
            )
        return self.workers

    @contextmanager
    def opened(
        self, kind: BackendKind, backend: Backend, trials: Sequence[Trial], workers: int | None
    ) -> Iterator[tuple[int, OpenExecutor | None]]:
        """Count of parallel trials, and their executor; None for threads of this process."""
        if not self.executor:
            count, executor = workers or 1, None
            if in_processes(kind, count, len(trials)) and not self.watch:
                executor = partial(process_executor, count=count)
            yield count, executor
            return
        from campaign.execution.dask_executor import cluster

        with cluster(self.executor, workers, backend, trials, self.tls) as dask:
            for why in dask.refused.values():
                print_warning(why)
            print_note(f"{self.executor}: {dask.threads} parallel trials or blocks of trials")
            yield dask.threads, dask.executor


DEFAULTS = RunOptions()


def choose_workers(kind: BackendKind, trials: int, wanted: int | None) -> int:
    """Count of parallel trials: as requested, else as backend and machine allow.

    For worker processes, starts the import of their modules. Raises UsageError for several workers
    on a backend that executes one trial at a time.
    """
    if not kind.several:
        if wanted is not None and wanted > 1:
            raise UsageError(
                f"the backend {kind.name!r} executes one trial at a time; "
                f"leave --workers {wanted} out"
            )
        return 1
    workers = min(wanted or os.cpu_count() or 1, max(1, trials))
    if in_processes(kind, workers, trials):
        start_preloading(PRELOADED)
    return workers


def in_processes(kind: BackendKind, workers: int, trials: int) -> bool:
    """Whether the workers are processes: for enough trials to outweigh the start of a process."""
    return kind.picklable and workers > 1 and trials >= FEWEST_FOR_PROCESSES
