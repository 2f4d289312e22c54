"""One attempt at one or more trials in a worker thread, each trial into its own file."""

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
from campaign.execution.writer import Begins
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.recording import Ending, Outcome, SafeState
from campaign.stopwatch import Work
from campaign.trial import Trial


@dataclass(frozen=True)
class AttemptEnd:
    """End of an attempt.

    Attributes:
        bug: an exception that a backend must not raise.
        gave_up: whether the backend cannot execute another trial.
        remarks: remarks on its channels, for the operator.
        unmeasured: why the expected metrics of the recording are missing.
    """

    ending: Ending
    bug: BaseException | None = None
    gave_up: bool = False
    remarks: tuple[str, ...] = ()
    unmeasured: str = ""


@dataclass(frozen=True)
class Conditions:
    """Conditions common to all attempts of a run.

    Attributes:
        halted: whether the run is to end.
        measure: computes the metrics of a recording; None for no metrics.
        keeping: which trials' samples are archived.
    """

    backend: Backend
    writer: Begins
    halted: Callable[[], bool]
    supervision: Supervision
    measure: Measure | None = None
    keeping: SampleRetention = KEEP_ALL


def execute_once(trial: Trial, conditions: Conditions) -> AttemptEnd:
    """Execute `trial` once and archive it, however it ends. Raises only errors of the archive."""
    supervision = conditions.supervision
    with supervision.timing.span(Work.SAMPLES):  # less the spans of other kinds of work
        attempt = _Attempt(trial, conditions)
        if not supervision.live:
            return attempt.archive(attempt.concluded(attempt.execute()))
        with HEARTBEAT.expected():
            executed = _attended(attempt, supervision)
        return attempt.archive(executed)


def execute_together(
    trials: Sequence[Trial],
    conditions: Conditions,
    on_end: Callable[[Trial, AttemptEnd], None],
) -> None:
    """Execute `trials` once, together; call `on_end` for each after it is archived.

    For backends that move nothing and are `ExecutesTogether`. Raises only errors of the archive.
    """
    backend = conditions.backend
    if not isinstance(backend, ExecutesTogether):
        raise TypeError("this backend executes one trial at a time")
    with conditions.supervision.timing.span(Work.SAMPLES):
        attempts = dict(enumerate(_Attempt(trial, conditions) for trial in trials))

        def end(place: int, executed: AttemptEnd) -> None:
            attempt = attempts.pop(place)
            on_end(attempt.trial, attempt.archive(attempt.concluded(executed)))

        recorders = [attempt.recorder for attempt in attempts.values()]
        stops = [attempt.stop for attempt in attempts.values()]
        unreported = Ending(
            Outcome.FAULT, "the backend did not say how it ended", SafeState.NOT_CONFIRMED
        )
        left = AttemptEnd(unreported, gave_up=True)
        try:
            for place, ending in calls.called(
                backend, "execute_together", trials, recorders, stops
            ):
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
    """One trial under execution, with its recorder, stop flag and file."""

    def __init__(self, trial: Trial, conditions: Conditions) -> None:
        """Open the trial's file."""
        self.trial, self.backend = trial, conditions.backend
        self._file = conditions.writer.begin(trial, conditions.keeping)
        self.stop = TrialStop(conditions.halted)
        self.recorder = SupervisingRecorder(trial, self._file, self.stop, conditions.supervision)
        self._measure = conditions.measure
        self._started = utc_now()

    def execute(self) -> AttemptEnd:
        """Execute on the backend, and return its ending. Raises errors of the archive."""
        try:
            return AttemptEnd(calls.execute(self.backend, self.trial, self.recorder, self.stop))
        except Exception as error:  # noqa: BLE001 - a bug in a backend must not cost the archive
            return _failed(error)

    def concluded(self, executed: AttemptEnd, *, forced: bool = False) -> AttemptEnd:
        """The end with the recorder's verdict."""
        ending = self.recorder.conclude(executed.ending, forced=forced)
        return replace(executed, ending=ending)

    def archive(self, executed: AttemptEnd) -> AttemptEnd:
        """Archive the trial, then its metrics. Raises errors of the archive."""
        executed = replace(executed, remarks=self.recorder.remarks)
        self._file.finish(executed.ending, self._started, utc_now())
        if self._measure is None:
            return executed
        return replace(executed, unmeasured=self._file.measure(self._measure))

    def abandoned(self, safe_state: SafeState) -> AttemptEnd:
        """The end of a trial that did not return in spite of `make_safe`."""
        ending = Ending(Outcome.FAULT, "it did not come back from the trial", safe_state)
        return AttemptEnd(self.recorder.conclude(ending, forced=True), gave_up=True)


def _failed(error: BaseException) -> AttemptEnd:
    """The end for an error of the backend, bug or not. Re-raises an ArchiveError."""
    if isinstance(error, ArchiveError):
        raise error  # from the recorder: the archive cannot be written
    bug = None if isinstance(error, CampaignError) else error
    reason = str(error) if bug is None else f"internal error: {describe(error)}"
    ending = Ending(Outcome.FAULT, reason, SafeState.NOT_CONFIRMED)
    return AttemptEnd(ending, bug=bug, gave_up=True)


def _attended(attempt: _Attempt, supervision: Supervision) -> AttemptEnd:
    """Execute on a live bench with a watchdog.

    The backend runs in its own thread. If it does not end a trial that is over, this thread makes
    the bench safe, and finally abandons the backend's thread.
    """
    patience, clock = supervision.patience, supervision.clock
    recorder = attempt.recorder
    silence = SilenceWatch(patience.asleep, clock())
    call = Call(attempt.execute, "bench")
    ended_at: float | None = None  # clock time of the verdict
    given_up: float | None = None  # clock time of abandoning; set with the call of make_safe
    safe_state = SafeState.NOT_CONFIRMED
    while not call.has_ended(patience.tick):
        HEARTBEAT.beat()
        silent = silence.look(clock(), recorder.heard)
        if recorder.verdict is None and silent > _allowed(attempt, supervision):
            recorder.silent(silent)
        if recorder.verdict is None:
            continue
        ended_at = clock() if ended_at is None else ended_at
        waited = 0.0 if recorder.verdict.kind == "silence" else patience.grace
        if given_up is None and clock() - ended_at >= waited:
            given_up = clock() + patience.giving_up
            safe_state = _made_safe(attempt.backend)
            given_up = max(given_up, clock() + patience.grace)
        elif given_up is not None and clock() > given_up:
            return attempt.abandoned(safe_state)
    executed = attempt.concluded(call.answer(), forced=given_up is not None)
    if recorder.verdict is None:
        if executed.ending.safe_state is not SafeState.CONFIRMED:
            # Measuring and archiving take time. The ending stays as the backend reported it: the
            # runner calls make_safe again and journals the answer.
            _made_safe(attempt.backend)
        return executed
    safe_state = _made_safe(attempt.backend)
    return replace(executed, ending=replace(executed.ending, safe_state=safe_state))


def _allowed(attempt: _Attempt, supervision: Supervision) -> float:
    """Permitted silence (s) in the present phase of the trial."""
    patience = supervision.patience
    if attempt.stop.halted or attempt.recorder.is_complete:
        return patience.closing
    return patience.first if attempt.recorder.heard is None else patience.silence


def _made_safe(backend: Backend) -> SafeState:
    try:
        return calls.make_safe(backend)
    except Exception:  # noqa: BLE001 - not confirmed; the runner calls again, and reports the reason
        return SafeState.NOT_CONFIRMED
