"""Executing one trial once, in a worker thread, into its own file of the archive."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from campaign.backends.interface import Backend
from campaign.errors import BackendError, CampaignError
from campaign.execution.recorder import SupervisingRecorder
from campaign.execution.safety import describe
from campaign.execution.supervision import SilenceWatch, Supervision, TrialStop
from campaign.execution.writer import PlanWriter
from campaign.trial import Ending, Outcome, SafeState, Trial


@dataclass(frozen=True)
class Executed:
    """How an attempt ended.

    Attributes:
        bug: an exception that no backend should raise.
        gave_up: whether the backend cannot execute any other trial.
        unwatched: limits of the bench that no recorded channel tells of.
    """

    ending: Ending
    bug: Exception | None = None
    gave_up: bool = False
    unwatched: tuple[str, ...] = ()


def execute_once(
    trial: Trial,
    backend: Backend,
    writer: PlanWriter,
    halted: Callable[[], bool],
    supervision: Supervision,
) -> Executed:
    """One attempt at `trial`, archived however it ends. Raises only what the archive raises."""
    started = utc_now()
    file = writer.begin(trial)
    stop = TrialStop(halted)
    recorder = SupervisingRecorder(trial, file, stop, supervision)
    attempt = _Attempt(trial, backend, recorder, stop)
    if supervision.live:
        executed = _attended(attempt, supervision)
    else:
        attempt.run()
        executed = attempt.concluded()
    file.finish(executed.ending, started, utc_now())
    return replace(executed, unwatched=recorder.unwatched)


class _Attempt:
    """One call of a backend's `execute`, and what came of it."""

    def __init__(
        self, trial: Trial, backend: Backend, recorder: SupervisingRecorder, stop: TrialStop
    ) -> None:
        self.trial, self.backend, self.recorder, self.stop = trial, backend, recorder, stop
        self.over = threading.Event()
        self._executed: Executed | None = None
        self._error: BaseException | None = None

    def run(self) -> None:
        """Execute; raises nothing."""
        try:
            self._executed = self._execute()
        except BaseException as error:  # noqa: BLE001 - from the archive, for whoever waits
            self._error = error
        finally:
            self.over.set()

    def concluded(self, *, forced: bool = False) -> Executed:
        """What came of it, once it is over. Raises what the archive raised."""
        if self._error is not None:
            raise self._error
        if self._executed is None:
            raise RuntimeError("not over yet")
        ending = self.recorder.conclude(self._executed.ending, forced=forced)
        return replace(self._executed, ending=ending)

    def abandoned(self, safe_state: SafeState) -> Executed:
        """It did not come back, although the bench was made safe over its head."""
        ending = Ending(Outcome.FAULT, "it did not come back from the trial", safe_state)
        return Executed(self.recorder.conclude(ending, forced=True), gave_up=True)

    def _execute(self) -> Executed:
        try:
            return Executed(self.backend.execute(self.trial, self.recorder, self.stop))
        except BackendError as error:
            ending = Ending(Outcome.FAULT, str(error), SafeState.NOT_CONFIRMED)
            return Executed(ending, gave_up=True)
        except CampaignError:
            raise  # from the recorder: the archive cannot be written
        except Exception as error:  # noqa: BLE001 - a bug in a backend must not cost the archive
            reason = f"internal error: {describe(error)}"
            ending = Ending(Outcome.FAULT, reason, SafeState.NOT_CONFIRMED)
            return Executed(ending, bug=error, gave_up=True)


def _attended(attempt: _Attempt, supervision: Supervision) -> Executed:
    """Execute on a bench that really moves: somebody looks at the clock all the while.

    The backend has a thread of its own, which this one does not depend on: when it does not end a
    trial that is over, the bench is made safe from here, and it is left behind at last.
    """
    patience, clock = supervision.patience, supervision.clock
    recorder = attempt.recorder
    thread = threading.Thread(target=attempt.run, name="bench", daemon=True)
    silence = SilenceWatch(patience.asleep, clock())
    thread.start()
    found: float | None = None  # when the trial turned out to be over
    forced: float | None = None  # when the bench had been made safe over the backend's head
    safe_state = SafeState.NOT_CONFIRMED
    while not attempt.over.wait(patience.tick):
        silent = silence.look(clock(), recorder.heard)
        if recorder.verdict is None and silent > _allowed(attempt, supervision):
            recorder.silent(silent)
        if recorder.verdict is None:
            continue
        found = clock() if found is None else found
        waited = 0.0 if recorder.verdict.kind == "silence" else patience.grace
        if forced is None and clock() - found >= waited:
            safe_state = _made_safe(attempt.backend)
            forced = clock()
        elif forced is not None and clock() - forced > patience.giving_up:
            return attempt.abandoned(safe_state)
    executed = attempt.concluded(forced=forced is not None)
    if recorder.verdict is None:
        return executed
    safe_state = _made_safe(attempt.backend)
    return replace(executed, ending=replace(executed.ending, safe_state=safe_state))


def _allowed(attempt: _Attempt, supervision: Supervision) -> float:
    """How long (s) nothing may be heard now."""
    patience = supervision.patience
    if attempt.stop.halted or attempt.recorder.is_complete:
        return patience.closing
    return patience.first if attempt.recorder.heard is None else patience.silence


def _made_safe(backend: Backend) -> SafeState:
    try:
        return backend.make_safe()
    except Exception:  # noqa: BLE001 - not seen safe; the runner asks again, and says why
        return SafeState.NOT_CONFIRMED


def utc_now() -> str:
    """The wall clock as archives keep it: ISO 8601, UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")
