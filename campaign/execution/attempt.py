"""One attempt at trials, in a worker thread, each into its own file."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from campaign.archive.layout.journal import utc_now
from campaign.archive.reading.archived_metrics import Measure
from campaign.backends import calls
from campaign.backends.calls import HEARTBEAT, Call
from campaign.backends.interface import Backend, ExecutesTogether
from campaign.errors import ArchiveError, CampaignError
from campaign.execution.recorder import SupervisingRecorder
from campaign.execution.safety import describe
from campaign.execution.supervision import SilenceWatch, Supervision, TrialStop
from campaign.execution.writer import Begins, TrialWriter
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Ending, Outcome, SafeState
from campaign.stopwatch import Work
from campaign.trial import Trial


@dataclass(frozen=True)
class AttemptEnd:
    """How an attempt ended.

    Attributes:
        bug: an exception that no backend should raise.
        gave_up: whether the backend cannot execute any other trial.
        remarks: what somebody at the screen should know of its channels.
        unmeasured: why nothing was measured in its recording, where something should have been.
    """

    ending: Ending
    bug: BaseException | None = None
    gave_up: bool = False
    remarks: tuple[str, ...] = ()
    unmeasured: str = ""


@dataclass(frozen=True)
class Conditions:
    """What is the same for every attempt of a run.

    Attributes:
        halted: whether the run is to end.
        measure: what a recording says by itself; None: nobody looks.
        keeping: whose samples are archived.
    """

    backend: Backend
    writer: Begins
    halted: Callable[[], bool]
    supervision: Supervision
    measure: Measure | None = None
    keeping: SampleRetention = KEEP_ALL


def execute_once(trial: Trial, conditions: Conditions) -> AttemptEnd:
    """One attempt at `trial`, archived however it ends. Raises only what the archive raises."""
    supervision = conditions.supervision
    with supervision.timing.span(Work.SAMPLES):  # less what is told to be something else
        attempt = _Attempt.begin(trial, conditions)
        if not supervision.live:
            return attempt.archive(attempt.concluded(attempt.execute()))
        with HEARTBEAT.expected():
            executed = _attended(attempt, supervision)
        return attempt.archive(executed)


def execute_together(
    trials: Sequence[Trial],
    conditions: Conditions,
    tell: Callable[[Trial, AttemptEnd], None],
) -> None:
    """One attempt at each of `trials`, together; `tell` is told of each once it is archived.

    For backends that move nothing and are `ExecutesTogether`. Raises only what the archive raises.
    """
    backend = conditions.backend
    if not isinstance(backend, ExecutesTogether):
        raise TypeError("this backend executes one trial at a time")
    with conditions.supervision.timing.span(Work.SAMPLES):
        _execute_together(trials, backend, conditions, tell)


def _execute_together(
    trials: Sequence[Trial],
    backend: ExecutesTogether,
    conditions: Conditions,
    tell: Callable[[Trial, AttemptEnd], None],
) -> None:
    attempts = dict(enumerate(_Attempt.begin(trial, conditions) for trial in trials))

    def end(place: int, executed: AttemptEnd) -> None:
        attempt = attempts.pop(place)
        tell(attempt.trial, attempt.archive(attempt.concluded(executed)))

    recorders = [attempt.recorder for attempt in attempts.values()]
    stops = [attempt.stop for attempt in attempts.values()]
    untold = Ending(Outcome.FAULT, "the backend did not say how it ended", SafeState.NOT_CONFIRMED)
    left = AttemptEnd(untold, gave_up=True)
    try:
        for place, ending in calls.called(backend, "execute_together", trials, recorders, stops):
            if place not in attempts:
                raise LookupError(f"no trial is at place {place!r}, or it has ended")
            end(place, AttemptEnd(calls.checked_ending(ending, backend)))
            if not attempts:
                break
    except BaseException as error:  # noqa: BLE001 - a bug in a backend must not cost the archive
        left = _failed(calls.as_fault(error, backend, "execute_together"))
    for place in tuple(attempts):
        end(place, left)


class _Attempt:
    """One trial that is being executed, and what came of it."""

    def __init__(
        self,
        trial: Trial,
        backend: Backend,
        file: TrialWriter,
        recorder: SupervisingRecorder,
        stop: TrialStop,
        measure: Measure | None,
    ) -> None:
        self.trial, self.backend, self.recorder, self.stop = trial, backend, recorder, stop
        self._file = file
        self._measure = measure
        self._started = utc_now()

    @classmethod
    def begin(cls, trial: Trial, conditions: Conditions) -> _Attempt:
        """Open the trial's file."""
        file = conditions.writer.begin(trial, conditions.keeping)
        stop = TrialStop(conditions.halted)
        recorder = SupervisingRecorder(trial, file, stop, conditions.supervision)
        return cls(trial, conditions.backend, file, recorder, stop, conditions.measure)

    def execute(self) -> AttemptEnd:
        """What the backend says of it. Raises what the archive raises."""
        try:
            return AttemptEnd(calls.execute(self.backend, self.trial, self.recorder, self.stop))
        except Exception as error:  # noqa: BLE001 - likewise
            return _failed(error)

    def concluded(self, executed: AttemptEnd, *, forced: bool = False) -> AttemptEnd:
        """How it ended as the recorder has seen it."""
        ending = self.recorder.conclude(executed.ending, forced=forced)
        return replace(executed, ending=ending)

    def archive(self, executed: AttemptEnd) -> AttemptEnd:
        """Keep the trial, then what its recording says. Raises what the archive raises."""
        executed = replace(executed, remarks=self.recorder.remarks)
        self._file.finish(executed.ending, self._started, utc_now())
        if self._measure is None:
            return executed
        return replace(executed, unmeasured=self._file.measure(self._measure))

    def abandoned(self, safe_state: SafeState) -> AttemptEnd:
        """It did not come back, although the bench was made safe over its head."""
        ending = Ending(Outcome.FAULT, "it did not come back from the trial", safe_state)
        return AttemptEnd(self.recorder.conclude(ending, forced=True), gave_up=True)


def _failed(error: BaseException) -> AttemptEnd:
    """A backend that cannot go on, or has a bug. Raises what the recorder raised."""
    if isinstance(error, ArchiveError):
        raise error  # from the recorder: the archive cannot be written
    bug = None if isinstance(error, CampaignError) else error
    reason = str(error) if bug is None else f"internal error: {describe(error)}"
    ending = Ending(Outcome.FAULT, reason, SafeState.NOT_CONFIRMED)
    return AttemptEnd(ending, bug=bug, gave_up=True)


def _attended(attempt: _Attempt, supervision: Supervision) -> AttemptEnd:
    """Execute on a bench that really moves: somebody looks at the clock all the while.

    The backend has a thread of its own, which this one does not depend on: when it does not end a
    trial that is over, the bench is made safe from here, and it is left behind at last.
    """
    patience, clock = supervision.patience, supervision.clock
    recorder = attempt.recorder
    silence = SilenceWatch(patience.asleep, clock())
    call = Call(attempt.execute, "bench")
    found: float | None = None  # when the trial turned out to be over
    given_up: float | None = None  # when it is left behind: make_safe was called over its head
    safe_state = SafeState.NOT_CONFIRMED
    while not call.has_ended(patience.tick):
        HEARTBEAT.beat()
        silent = silence.look(clock(), recorder.heard)
        if recorder.verdict is None and silent > _allowed(attempt, supervision):
            recorder.silent(silent)
        if recorder.verdict is None:
            continue
        found = clock() if found is None else found
        waited = 0.0 if recorder.verdict.kind == "silence" else patience.grace
        if given_up is None and clock() - found >= waited:
            given_up = clock() + patience.giving_up
            safe_state = _made_safe(attempt.backend)
            given_up = max(given_up, clock() + patience.grace)
        elif given_up is not None and clock() > given_up:
            return attempt.abandoned(safe_state)
    executed = attempt.concluded(call.answer(), forced=given_up is not None)
    if recorder.verdict is None:
        if executed.ending.safe_state is not SafeState.CONFIRMED:
            # Measuring and archiving take their time. The ending stays as the backend told it:
            # the runner asks once more, and keeps the answer in the journal.
            _made_safe(attempt.backend)
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
        return calls.make_safe(backend)
    except Exception:  # noqa: BLE001 - not seen safe; the runner asks again, and says why
        return SafeState.NOT_CONFIRMED
