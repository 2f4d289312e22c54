"""The sequence of a run: trials, retries, rests, operator steps, stops.

One thread makes all decisions, between trials; executors execute the trials (`executors.py`). Each
decision is journaled before it takes effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from queue import Empty, SimpleQueue

from campaign.archive.layout.journal import Entry
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import Backend
from campaign.execution.attempt import AttemptEnd
from campaign.execution.batches import Batches
from campaign.execution.decisions import Responses, Rests, extremes
from campaign.execution.executors import BatchExecutor, WorkerLostError
from campaign.execution.external_stop import OutsideWatch
from campaign.execution.operator_prompts import Attendance, SetUp
from campaign.execution.progress import Ledger
from campaign.execution.safety import EarlyEnd, make_safe
from campaign.execution.stages import Stages
from campaign.execution.stop import StopSwitch
from campaign.policy import Policy
from campaign.recording import Ending, Outcome, PanicStop, SafeState
from campaign.trial import Trial

LOOK = 0.25
"""s between two updates of the display; longest delay of a stop request to the executor."""
MOST_WAITING = 100
"""Number of ended trials of a simulation from which a copy comes before the next results."""
AT_REST = 2
"""Copies between two trials of a bench; more than one, so that a resumed run catches up."""
ENDING = 10.0
"""s that the other trials may take to end when the run cannot continue."""
MOST_LOST = 3
"""Worker losses before the run ends: the trials themselves may be the cause."""
_Ended = tuple[Trial, AttemptEnd, Sequence[Entry]]


@dataclass(eq=False)
class TrialSequence:
    """Executes trials until none are left or the run must end.

    Attributes:
        trials: all of the run.
        batches: the trials to execute.
        live: whether a bench moves.
        outside: detects a panic stop.
    """

    trials: Sequence[Trial]
    batches: Batches
    backend: Backend
    writer: RunWriter
    ledger: Ledger
    ended: EarlyEnd
    stop: StopSwitch
    policy: Policy
    attendance: Attendance
    stages: Stages
    live: bool

    def __post_init__(self) -> None:
        self._running: dict[Future[None], Sequence[Trial]] = {}
        self._under_way: dict[int, Trial] = {}
        self._news: SimpleQueue[_Ended | Future[None]] = SimpleQueue()  # trials that ended, batches
        self.outside = OutsideWatch(self.backend, self.stop, self._stopped_outside)
        self._kept_extremes = False
        self._responses = Responses(self.policy)
        self._rests = Rests(self.policy.rest)
        self._set_up = SetUp(self.attendance.operator, self.writer)
        self._said: set[tuple[str, str]] = set()

    def execute(self, executor: BatchExecutor) -> None:
        """Keep all workers busy. Raises errors of the archive, and KeyboardInterrupt."""
        try:
            while True:
                if self.live and not (self._running or self.halted()):  # the bench is at rest
                    for _ in range(AT_REST):
                        self.writer.seal_next()
                while len(self._running) < executor.most_pending and (batch := self._next()):
                    self.ledger.begin(*batch)
                    self._under_way |= {trial.number: trial for trial in batch}
                    future = executor.submit(batch, lambda *ended: self._news.put(ended))
                    self._running[future] = batch
                    future.add_done_callback(self._news.put)
                if not self._running:
                    break
                self._hear(executor)
                if self.halted():
                    executor.stop()
        except BaseException as error:
            self._fail("the run cannot go on")  # lets the other trials end
            if not isinstance(error, KeyboardInterrupt):
                wait(self._running, timeout=ENDING)
            raise

    def _hear(self, executor: BatchExecutor) -> None:
        """Process all ended trials and batches. If there are none, copy an ended trial of a
        simulation into the sealed file, or wait.
        """
        copied = not (self.live or self.halted()) and self.writer.seal_next(
            1 if self._news.empty() else MOST_WAITING
        )
        try:
            news = [self._news.get(timeout=0.0 if copied else LOOK)]
        except Empty:
            self.ledger.look()
            executor.look()
            return
        while not self._news.empty():
            news.append(self._news.get())
        ended = [each for each in news if isinstance(each, tuple)]
        ended.sort(key=lambda each: each[0].number)
        if entries := [entry for each in ended for entry in each[2]]:
            self.writer.note(*entries)  # before any report
        for trial, executed, _ in ended:
            self._settle(trial, executed)
        for each in news:
            if isinstance(each, Future):
                batch = self._running.pop(each)
                if isinstance(error := each.exception(), WorkerLostError):
                    self._repeat(batch, error)
                else:
                    each.result()  # raises its exception

    def _repeat(self, batch: Sequence[Trial], error: WorkerLostError) -> None:
        """Put the trials of a lost batch first, except those that have ended."""
        lost = [t for t in batch if self._under_way.pop(t.number, None) is not None]
        text = f"{error}; trials to repeat: {', '.join(trial.name for trial in lost) or 'none'}"
        self.writer.decision("worker lost", text)
        self.ledger.remark(text)
        if error.times > MOST_LOST:
            self._fail(f"{error}; the memory may be too small: try `--workers 1`")
        self.batches.insert(lost)

    def halted(self) -> bool:
        """Whether the run is to end."""
        return self.stop() or bool(self.ended.fault)

    def _fail(self, reason: str) -> None:
        self.ended.fault = self.ended.fault or reason

    def _next(self) -> Sequence[Trial]:
        """The trials to begin now; empty if none are left, or if others must end first."""
        self._follow()
        self._keep_extremes()
        trial = self.batches.first
        if trial is None or self._is_over():
            return ()
        under_way = sum(each.task.duration for each in self._under_way.values())
        if self._rests.left <= under_way or self._set_up.is_due(trial):
            if self._running:
                return ()  # a rest or an operator step requires that no trial is running
            self._rest()
            due = not self._is_over() and self._set_up.is_due(trial)
            if due and not self._set_up.confirm(trial, self.outside):
                self.stop.request("the operator")
        if self._is_over():
            return ()
        return self.batches.take(self._rests.left - under_way, self._set_up.is_due)

    def _follow(self) -> None:
        """Evaluate every stage whose trials have ended; its trials are the next ones.

        No stage is evaluated after the end of the run: a resume may repeat some of its trials.
        """
        while self.stages.is_due and not self._is_over():
            trials, remarks = self.stages.ask()
            self.batches.insert(trials)
            self.ledger.add(trials)
            for remark in remarks:
                self.ledger.remark(remark)

    def _keep_extremes(self) -> None:
        """After all trials: repeat the trials with extreme metrics to keep their samples."""
        waits = self.batches.first is not None or self._running or self._is_over()
        if self.policy.keep != "extremes" or waits or self._kept_extremes:
            return
        self._kept_extremes = True
        reasons = extremes(self.trials, self.writer.metrics())
        again = [trial for trial in self.trials if trial.number in reasons]
        again = [trial for trial in again if self.writer.attempt(trial) == 2]
        for trial in again:
            self.writer.decision("keep samples", reasons[trial.number], trial.number)
            self.ledger.take_back(trial)
        self.batches.insert(again)

    def _is_over(self) -> bool:
        """Whether the run is to end; between trials this also polls the bench."""
        return self.halted() if self._running else self.outside() or self.halted()

    def _stopped_outside(self, stop: PanicStop) -> None:
        reason = f"by {stop.by}, stop number {stop.count}"
        self.writer.decision("panic stop", reason)
        self.ledger.remark(f"PANIC STOP by {stop.by}: the bench stays off until that is cleared")

    def _rest(self) -> None:
        rest = self.policy.rest
        if rest is None or self._rests.left > 0.0:
            return
        self.writer.decision("rest", f"{rest.pause:g} s after {rest.every:g} s of bench time")
        self.ledger.remark(f"the bench rests for {rest.pause:g} s")
        self.attendance.wait(rest.pause, self.outside)
        self._rests.taken()

    def _settle(self, trial: Trial, executed: AttemptEnd) -> None:
        """Process a trial's end: make the bench safe, retry, or end the run."""
        ending = executed.ending
        self._under_way.pop(trial.number, None)
        self._rests.worked(trial.task.duration)
        self._say_remarks(trial, executed)
        self._say_unmeasured(trial, executed)
        if executed.gave_up:
            self.ended.bug = self.ended.bug or executed.bug
            self._fail(ending.reason)
        elif ending.outcome is Outcome.INTERRUPTED and not self.halted():
            self.outside.look()
            self.stop.request(ending.reason or "the bench")  # a person at the bench stopped it
        elif ending.safe_state is not SafeState.CONFIRMED and not self.halted():
            self._make_safe(trial)
        if self._is_final(trial, ending):
            self.ledger.end(trial, ending)
            self.stages.ended(trial)

    def _say_remarks(self, trial: Trial, executed: AttemptEnd) -> None:
        """Report each remark once per test."""
        for remark in executed.remarks:
            if (trial.test, remark) not in self._said:
                self._said.add((trial.test, remark))
                self.ledger.remark(f"{trial.test}: {remark}")

    def _say_unmeasured(self, trial: Trial, executed: AttemptEnd) -> None:
        if executed.unmeasured:
            self.writer.decision("no metrics", executed.unmeasured, trial.number)
            self.ledger.remark(f"{trial.name}: no metrics are archived: {executed.unmeasured}")

    def _make_safe(self, trial: Trial) -> None:
        """Make the bench safe after an unconfirmed trial; end the run if it is not confirmed."""
        make_safe(self.backend, self.ended)
        state = f"now {self.ended.safe_state}"
        self.writer.decision(
            "make safe", f"the safe state was not confirmed; {state}", trial.number
        )
        self.ledger.remark(f"{trial.name}: the safe state was not confirmed; {state}")
        if self.ended.unsafe:
            self._fail(f"{self.ended.unsafe} after {trial.name}")

    def _is_final(self, trial: Trial, ending: Ending) -> bool:
        """Apply the policy; False if the trial will be executed again."""
        if not ending.outcome.failed or self.ended.fault:
            return True
        choice = self._responses.choose(trial, ending)
        self.writer.decision(choice.do, choice.reason, trial.number)
        if choice.do == "abort":
            self._fail(f"aborted after {trial.name}: {choice.reason}")
        if choice.do != "retry":
            return True
        self.ledger.attempt_ended(trial, ending)
        pause = f" in {choice.pause:g} s" if choice.pause else ""
        self.ledger.remark(f"{trial.name} is executed again{pause}")
        self.attendance.wait(choice.pause, self.outside)
        self.batches.insert([trial])  # after a stop it remains for a resume
        return False
