"""`--executor`: trials on a Dask cluster."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from campaign.backends.interface import Backend, BackendKind
from campaign.cli.output import print_note
from campaign.cli.session import choose_workers
from campaign.errors import UsageError
from campaign.execution.executors import OpenExecutor
from campaign.trial import Trial


@dataclass(frozen=True)
class ExecutorChoice:
    """Executor of trials, as typed.

    Attributes:
        executor: empty for this machine's own threads and processes.
        tls: folder with the certificates of a cluster.
    """

    executor: str = ""
    tls: Path | None = None

    def check(self, kind: BackendKind, trials: Sequence[Trial], workers: int | None) -> int | None:
        """Count of parallel trials; for a cluster, the requested count of processes or None.

        Raises UsageError for options that do not suit the backend.
        """
        if not self.executor:
            if self.tls is not None:
                raise UsageError("--executor-tls is for --executor dask://HOST:PORT")
            return choose_workers(kind, len(trials), workers)
        if not kind.picklable:
            raise UsageError(
                f"--executor: a cluster executes only simulated trials, not those of the backend "
                f"{kind.name!r}; leave --executor out"
            )
        return workers

    @contextmanager
    def opened(
        self, backend: Backend, trials: Sequence[Trial], workers: int | None
    ) -> Iterator[tuple[int, OpenExecutor | None]]:
        """Count of parallel trials, and their executor; None for this machine."""
        if not self.executor:
            yield workers or 1, None
            return
        from campaign.execution.dask_executor import cluster

        with cluster(self.executor, workers, backend, trials, self.tls) as dask:
            for why in dask.refused.values():
                print_note(why, style="yellow")
            print_note(f"{self.executor}: {dask.threads} parallel trials or blocks of trials")
            yield dask.threads, dask.executor


HERE = ExecutorChoice()
