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
        total: number of trials of the plan and of evaluated stages.
        done, failed, interrupted: number of completed, failed and stopped trials.
        running: trials being executed, in plan order.
        ended: the trial that has just ended, and its ending.
        remark: latest decision of the run, as text.
        closing: whether all trials have ended and the archive is being closed.
        under_way: completed part of the running trials, in trials.
        time_left: remaining wall-clock time (s); None without a forecast.
    """

    total: int
    done: int
    failed: int
    interrupted: int
    running: tuple[Trial, ...]
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
    """Counts the trials of a run and updates its display. Used from one thread, except `reached`.

    A trial counts once, by the outcome of its last attempt. `finished`: trials of an earlier
    session; they count as done, but not for the forecast. `computed`: the backend computes its
    samples, without a bench.
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
        self._worth = partial(worth, computed=computed)
        self._worth_left = sum(map(self._worth, waiting))
        self._worth_done = 0.0
        self._forecast = Forecast(uneven=any(trial.recording for trial in waiting))
        self._display = display
        self._running: dict[int, Trial] = {}
        self._reached: dict[int, float] = {}
        self._last_report = 0.0
        self._outcomes = Counter(finished.values())

    @property
    def outcomes(self) -> dict[Outcome, int]:
        """Number of trials by outcome."""
        return dict(self._outcomes)

    @property
    def left(self) -> int:
        """Trials that have not ended."""
        return self._total - self._outcomes.total()

    def add(self, trials: Sequence[Trial]) -> None:
        """Add the trials of a stage."""
        self._total += len(trials)
        self._worth_left += sum(map(self._worth, trials))

    def begin(self, *trials: Trial) -> None:
        """Note the begin of trials that are executed together."""
        for trial in trials:
            self._running[trial.number] = trial
            self._reached[trial.number] = 0.0
        self._report()

    def reached(
        self, trial: Trial, channels: tuple[ChannelInfo, ...], time: Array, block: Array
    ) -> None:
        """Note new samples of a running trial; a `Subscriber`. From any thread."""
        if len(time):
            self._reached[trial.number] = min(float(time[-1]), trial.task.duration)

    def look(self) -> None:
        """Update the display if the running trials have progressed."""
        if self._running and self._of_running() > self._last_report:
            self._report()

    def end(self, trial: Trial, ending: Ending) -> None:
        """Count a trial that has ended and is archived."""
        self._outcomes[ending.outcome] += 1
        self._worth_done += self._worth(trial)
        self._worth_left -= self._worth(trial)
        self.attempt_ended(trial, ending)

    def take_back(self, trial: Trial) -> None:
        """Uncount a completed trial that is executed again."""
        self._outcomes[Outcome.COMPLETED] -= 1
        self._worth_done -= self._worth(trial)
        self._worth_left += self._worth(trial)

    def attempt_ended(self, trial: Trial, ending: Ending) -> None:
        """Note the end of an attempt, the last one or not."""
        self._running.pop(trial.number, None)
        self._reached.pop(trial.number, None)
        self._report((trial, ending))

    def remark(self, text: str) -> None:
        """Display a decision of the run."""
        self._report(remark=text)

    def close(self) -> None:
        """Display that the archive is being closed, after all trials."""
        self._report(closing=True)

    def _report(
        self, ended: tuple[Trial, Ending] | None = None, remark: str = "", *, closing: bool = False
    ) -> None:
        self._last_report = self._of_running()
        shares = {
            number: self._reached.get(number, 0.0) / trial.task.duration
            for number, trial in self._running.items()
        }
        begun = sum(share * self._worth(self._running[n]) for n, share in shares.items())
        self._display(
            Progress(
                total=self._total,
                done=self._outcomes[Outcome.COMPLETED],
                failed=sum(n for outcome, n in self._outcomes.items() if outcome.failed),
                interrupted=self._outcomes[Outcome.INTERRUPTED],
                running=tuple(self._running[number] for number in sorted(self._running)),
                ended=ended,
                remark=remark,
                closing=closing,
                under_way=sum(shares.values()),
                time_left=self._forecast.time_left(
                    time.monotonic(),
                    self._worth_done + begun,
                    max(0.0, self._worth_left - begun),
                ),
            )
        )

    def _of_running(self) -> float:
        """Bench time (s) that the running trials have completed."""
        return sum(self._reached.get(number, 0.0) for number in self._running)
