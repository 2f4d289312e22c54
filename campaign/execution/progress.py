"""Progress of a run as data; a display is a function of it."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from campaign.execution.forecast import Forecast, worth
from campaign.recording import Array, ChannelInfo, Ending, Outcome
from campaign.trial import Trial


@dataclass(frozen=True)
class Progress:
    """The state of a run at one moment.

    Attributes:
        total: trials that are known by now: those of the plan, and what has followed from them.
        done, failed, interrupted: trials that completed, that did not, and that somebody stopped.
        running: trials being executed, in plan order.
        started: when the run began, on `time.monotonic` (s).
        elapsed: wall-clock time since then (s).
        bench_time: of the trials that have ended, and so far of those that run (s).
        bench_time_left: of all the others, and the rest of those (s).
        ended: the trial that has just ended, and how.
        remark: what the run has just decided, for people.
        closing: whether all trials have ended and the archive is being closed.
        under_way: how much of the running trials is done, in trials.
        time_left: wall-clock time to the end (s); None before it can be told.
    """

    total: int
    done: int
    failed: int
    interrupted: int
    running: tuple[Trial, ...]
    started: float
    elapsed: float
    bench_time: float
    bench_time_left: float
    ended: tuple[Trial, Ending] | None = None
    remark: str = ""
    closing: bool = False
    under_way: float = 0.0
    time_left: float | None = None

    @property
    def left(self) -> int:
        """Trials that have not ended."""
        return self.total - self.done - self.failed - self.interrupted


Display = Callable[[Progress], None]


class Ledger:
    """Counts what a run has done and tells its display. Used from one thread, but for `reached`.

    A trial counts once, by how its last attempt ended. `finished` are trials of an earlier session:
    they count as done, and say nothing about today's pace. `computed`: the backend computes its
    samples, and no bench takes its time.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        display: Display,
        finished: Mapping[int, Outcome],
        *,
        computed: bool = False,
    ) -> None:
        waiting = [trial for trial in trials if trial.number not in finished]
        self._total = len(trials)
        self._bench_time_left = sum(trial.task.duration for trial in waiting)
        self._bench_time = 0.0
        self._worth = partial(worth, computed=computed)
        self._worth_left = sum(map(self._worth, waiting))
        self._worth_done = 0.0
        self._forecast = Forecast(uneven=any(trial.recording for trial in waiting))
        self._display = display
        self._running: dict[int, Trial] = {}
        self._reached: dict[int, float] = {}
        self._told = 0.0
        self._outcomes: dict[Outcome, int] = dict(Counter(finished.values()))
        self._started = time.monotonic()

    @property
    def outcomes(self) -> dict[Outcome, int]:
        """How many trials ended how."""
        return dict(self._outcomes)

    @property
    def left(self) -> int:
        """Trials that have not ended."""
        return self._total - sum(self._outcomes.values())

    def add(self, trials: Sequence[Trial]) -> None:
        """Further trials follow from what was found."""
        self._total += len(trials)
        self._bench_time_left += sum(trial.task.duration for trial in trials)
        self._worth_left += sum(map(self._worth, trials))

    def begin(self, *trials: Trial) -> None:
        """Trials are about to be executed together."""
        for trial in trials:
            self._running[trial.number] = trial
            self._reached[trial.number] = 0.0
        self._tell(None)

    def reached(
        self, trial: Trial, channels: tuple[ChannelInfo, ...], time: Array, block: Array
    ) -> None:
        """A `Subscriber`: samples of a running trial have come. From any thread."""
        if len(time):
            self._reached[trial.number] = min(float(time[-1]), trial.task.duration)

    def look(self) -> None:
        """Tell how far the running trials are, when they are any further."""
        if self._running and self._of_running() > self._told:
            self._tell(None)

    def end(self, trial: Trial, ending: Ending) -> None:
        """A trial has ended and is archived."""
        self._running.pop(trial.number, None)
        self._reached.pop(trial.number, None)
        self._outcomes[ending.outcome] = self._outcomes.get(ending.outcome, 0) + 1
        self._bench_time += trial.task.duration
        self._bench_time_left -= trial.task.duration
        self._worth_done += self._worth(trial)
        self._worth_left -= self._worth(trial)
        self._tell((trial, ending))

    def take_back(self, trial: Trial) -> None:
        """A trial that completed is executed once more, and counts when it has ended again."""
        self._outcomes[Outcome.COMPLETED] -= 1
        self._bench_time -= trial.task.duration
        self._bench_time_left += trial.task.duration
        self._worth_done -= self._worth(trial)
        self._worth_left += self._worth(trial)

    def repeat(self, trial: Trial, ending: Ending) -> None:
        """An attempt has ended, and the trial will be executed again."""
        self._running.pop(trial.number, None)
        self._reached.pop(trial.number, None)
        self._tell((trial, ending))

    def remark(self, text: str) -> None:
        """The run has decided something."""
        self._tell(None, remark=text)

    def close(self) -> None:
        """All trials have ended; the archive is being closed."""
        self._tell(None, closing=True)

    def _tell(
        self, ended: tuple[Trial, Ending] | None, remark: str = "", *, closing: bool = False
    ) -> None:
        self._told = running = self._of_running()
        shares = {
            number: self._reached.get(number, 0.0) / trial.task.duration
            for number, trial in self._running.items()
        }
        begun = sum(share * self._worth(self._running[n]) for n, share in shares.items())
        now = time.monotonic()
        self._display(
            Progress(
                total=self._total,
                done=self._outcomes.get(Outcome.COMPLETED, 0),
                failed=sum(n for outcome, n in self._outcomes.items() if outcome.failed),
                interrupted=self._outcomes.get(Outcome.INTERRUPTED, 0),
                running=tuple(self._running[number] for number in sorted(self._running)),
                started=self._started,
                elapsed=now - self._started,
                bench_time=self._bench_time + running,
                bench_time_left=max(0.0, self._bench_time_left - running),
                ended=ended,
                remark=remark,
                closing=closing,
                under_way=sum(shares.values()),
                time_left=self._forecast.time_left(
                    now, self._worth_done + begun, max(0.0, self._worth_left - begun)
                ),
            )
        )

    def _of_running(self) -> float:
        """Bench time (s) that the running trials have behind them."""
        return sum(self._reached.get(number, 0.0) for number in self._running)
