"""How far a run is, as data. A display is any function that takes a Progress."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from campaign.trial import Ending, Outcome, Trial


@dataclass(frozen=True)
class Progress:
    """The state of a run at one moment.

    Attributes:
        total: trials of the plan.
        done, failed: trials that completed, and that ended in any other way.
        running: trials being executed, in plan order.
        started: when the run began, on `time.monotonic` (s).
        elapsed: wall-clock time since then (s).
        bench_time: of the trials that have ended (s).
        bench_time_left: of all the others (s).
        ended: the trial that has just ended, and how.
    """

    total: int
    done: int
    failed: int
    running: tuple[Trial, ...]
    started: float
    elapsed: float
    bench_time: float
    bench_time_left: float
    ended: tuple[Trial, Ending] | None = None

    @property
    def left(self) -> int:
        """Trials that have not ended."""
        return self.total - self.done - self.failed

    @property
    def time_left(self) -> float | None:
        """Wall-clock time to the end (s) at the pace so far; None before a trial has ended."""
        if self.bench_time <= 0:
            return None
        return self.elapsed * self.bench_time_left / self.bench_time


Display = Callable[[Progress], None]


class Ledger:
    """Counts what a run has done and tells its display. Used from one thread only."""

    def __init__(self, trials: Sequence[Trial], display: Display) -> None:
        self._total = len(trials)
        self._bench_time_total = sum(trial.task.duration for trial in trials)
        self._bench_time = 0.0
        self._display = display
        self._running: dict[int, Trial] = {}
        self._outcomes: dict[Outcome, int] = {}
        self._started = time.monotonic()

    @property
    def outcomes(self) -> dict[Outcome, int]:
        """How many trials ended how."""
        return dict(self._outcomes)

    @property
    def left(self) -> int:
        """Trials that have not ended."""
        return self._total - sum(self._outcomes.values())

    def begin(self, trial: Trial) -> None:
        """A trial is about to be executed."""
        self._running[trial.number] = trial
        self._tell(None)

    def end(self, trial: Trial, ending: Ending) -> None:
        """A trial has ended and is archived."""
        self._running.pop(trial.number, None)
        self._outcomes[ending.outcome] = self._outcomes.get(ending.outcome, 0) + 1
        self._bench_time += trial.task.duration
        self._tell((trial, ending))

    def _tell(self, ended: tuple[Trial, Ending] | None) -> None:
        done = self._outcomes.get(Outcome.COMPLETED, 0)
        self._display(
            Progress(
                total=self._total,
                done=done,
                failed=sum(self._outcomes.values()) - done,
                running=tuple(self._running[number] for number in sorted(self._running)),
                started=self._started,
                elapsed=time.monotonic() - self._started,
                bench_time=self._bench_time,
                bench_time_left=max(0.0, self._bench_time_total - self._bench_time),
                ended=ended,
            )
        )
