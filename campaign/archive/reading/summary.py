"""Summary of a run without its trials."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from campaign.archive.layout.run_status import RunStatus


@dataclass(frozen=True)
class RunSummary:
    """One line of `campaign list`.

    Attributes:
        created, ended: ISO 8601; `ended` is empty while the run is in progress.
        title, operator: from the header.
        tests: names, in the protocol's order.
        benches: names, each once, in the order of the tests.
        trials: number of finished trials, incomplete ones included.
        planned: number of trials of the plan.
        failed, interrupted: number of trials that failed, and number that an operator stopped.
        untold: number of planned trials missing in a damaged journal; they may have been executed.
        problem: reason why the run is unreadable; all but name, path and bytes are then empty.
    """

    name: str
    path: Path
    bytes: int
    created: str = ""
    ended: str = ""
    status: RunStatus | None = None
    title: str = ""
    protocol: str = ""
    backend: str = ""
    operator: str = ""
    tests: tuple[str, ...] = ()
    benches: tuple[str, ...] = ()
    tags: tuple[str, ...] = ()
    planned: int = 0
    trials: int = 0
    failed: int = 0
    interrupted: int = 0
    untold: int = 0
    problem: str = ""
