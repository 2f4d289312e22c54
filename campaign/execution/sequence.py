"""The order of things during a run: trials, retries, rests, steps of the operator, stops.

Decisions are made in one thread, between trials; only the trials themselves have threads of their
own. Each decision is in the journal before it is acted upon.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait

from campaign.backends.interface import Backend
from campaign.execution.attempt import Executed, execute_once
from campaign.execution.attendance import Attendance, SetUp
from campaign.execution.decisions import Responses, Rests
from campaign.execution.outside import OutsideWatch
from campaign.execution.progress import Ledger
from campaign.execution.safety import Ended, make_safe
from campaign.execution.stop import StopSwitch
from campaign.execution.writer import PlanWriter
from campaign.policy import Policy
from campaign.trial import Ending, Outcome, PanicStop, SafeState, Trial


class TrialSequence:
    """Executes trials until there are none left or the run has to end.

    Attributes:
        outside: knows of a panic stop.
    """

    def __init__(
        self,
        trials: Sequence[Trial],
        backend: Backend,
        writer: PlanWriter,
        ledger: Ledger,
        ended: Ended,
        stop: StopSwitch,
        policy: Policy,
        attendance: Attendance,
    ) -> None:
        self._queue = deque(trials)
        self._running: dict[Future[Executed], Trial] = {}
        self._backend = backend
        self._writer = writer
        self._ledger = ledger
        self._ended = ended
        self._stop = stop
        self.outside = OutsideWatch(backend, stop, self._stopped_outside)
        self._attendance = attendance
        self._responses = Responses(policy)
        self._rests = Rests(policy.rest)
        self._set_up = SetUp(attendance.operator, writer)

    def execute(self, workers: int) -> None:
        """Keep `workers` trials going. Raises what the archive raises, and KeyboardInterrupt."""
        pool = ThreadPoolExecutor(max_workers=workers, thread_name_prefix="trial")
        try:
            while True:
                while len(self._running) < workers and (trial := self._next()) is not None:
                    self._ledger.begin(trial)
                    future = pool.submit(
                        execute_once, trial, self._backend, self._writer, self._halted
                    )
                    self._running[future] = trial
                if not self._running:
                    break
                finished, _ = wait(self._running, return_when=FIRST_COMPLETED)
                for future in sorted(finished, key=lambda future: self._running[future].number):
                    self._settle(self._running.pop(future), future.result())
        except KeyboardInterrupt:
            pool.shutdown(wait=False)
            raise
        except BaseException:
            self._fail("the run cannot go on")  # lets the other trials end
            pool.shutdown()
            raise
        pool.shutdown()

    def _halted(self) -> bool:
        return self._stop() or bool(self._ended.fault)

    def _fail(self, reason: str) -> None:
        self._ended.fault = self._ended.fault or reason

    def _next(self) -> Trial | None:
        """The trial to begin now; None when there is none, or not before others have ended."""
        if not self._queue or self._is_over():
            return None
        trial = self._queue[0]
        if self._rests.due is not None or self._set_up.is_due(trial):
            if self._running:
                return None  # neither a rest nor a person's hands go with a trial that moves
            self._rest()
            due = not self._is_over() and self._set_up.is_due(trial)
            if due and not self._set_up.confirm(trial, self.outside):
                self._stop.request("the operator")
        return None if self._is_over() else self._queue.popleft()

    def _is_over(self) -> bool:
        """As `_halted`, between trials, when the bench can be asked as well."""
        return self._halted() if self._running else self.outside() or self._halted()

    def _stopped_outside(self, stop: PanicStop) -> None:
        reason = f"by {stop.by}, stop number {stop.count}"
        self._writer.decision("panic stop", reason)
        self._ledger.remark(f"PANIC STOP by {stop.by}: the bench stays off until that is cleared")

    def _rest(self) -> None:
        rest = self._rests.due
        if rest is None:
            return
        self._writer.decision("rest", f"{rest.pause:g} s after {rest.every:g} s of bench time")
        self._ledger.remark(f"the bench rests for {rest.pause:g} s")
        self._attendance.wait(rest.pause, self.outside)
        self._rests.taken()

    def _settle(self, trial: Trial, executed: Executed) -> None:
        """What follows from a trial's end: is the bench safe, is it tried again, does it go on."""
        ending = executed.ending
        self._rests.worked(trial.task.duration)
        if executed.gave_up:
            self._ended.bug = self._ended.bug or executed.bug
            self._fail(ending.reason)
        elif ending.outcome is Outcome.INTERRUPTED and not self._halted():
            self.outside.look()
            self._stop.request(ending.reason or "the bench")  # somebody stands there
        elif ending.safe_state is not SafeState.CONFIRMED and not self._halted():
            self._make_safe(trial)
        if self._is_final(trial, ending):
            self._ledger.end(trial, ending)

    def _make_safe(self, trial: Trial) -> None:
        """Nothing moves again after an unconfirmed trial before the bench was seen at rest."""
        make_safe(self._backend, self._ended)
        found = f"now {self._ended.safe_state}"
        self._writer.decision(
            "make safe", f"the safe state was not confirmed; {found}", trial.number
        )
        self._ledger.remark(f"{trial.name}: the safe state was not confirmed; {found}")
        if self._ended.unsafe:
            self._fail(f"{self._ended.unsafe} after {trial.name}")

    def _is_final(self, trial: Trial, ending: Ending) -> bool:
        """Apply the policy; False when the trial will be executed again."""
        if ending.outcome in (Outcome.COMPLETED, Outcome.INTERRUPTED) or self._ended.fault:
            return True
        choice = self._responses.choose(trial, ending)
        self._writer.decision(choice.do, choice.reason, trial.number)
        if choice.do == "abort":
            self._fail(f"aborted after {trial.name}: {choice.reason}")
        if choice.do != "retry":
            return True
        self._ledger.repeat(trial, ending)
        pause = f" in {choice.pause:g} s" if choice.pause else ""
        self._ledger.remark(f"{trial.name} is executed again{pause}")
        self._attendance.wait(choice.pause, self.outside)
        self._queue.appendleft(trial)  # when the run is stopped, it is left for who resumes it
        return False
