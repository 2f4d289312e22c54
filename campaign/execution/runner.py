"""Executing a plan on a backend, trial by trial, into an archive.

A trial that fails is recorded and the campaign goes on. It ends early when somebody stops it, when
the backend gives up, and when a trial leaves the bench in a state that nobody has seen to be safe.
However it ends, the bench is brought to rest last, and the archive says what happened.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from campaign.archive.header import RunStatus
from campaign.backends.interface import Backend
from campaign.errors import BackendError, CampaignError, ExitCode
from campaign.execution.outcome import RunOutcome
from campaign.execution.progress import Display, Ledger
from campaign.execution.stop import StopSwitch
from campaign.execution.writer import PlanWriter
from campaign.trial import Ending, Outcome, SafeState, Trial


class AbortedError(CampaignError):
    """The run was stopped at once, by force: what it had finished is kept, unsealed."""

    exit_code = ExitCode.INTERRUPTED


class NotSafeError(CampaignError):
    """The run broke off and nobody saw the bench safe: that comes before why it broke off."""

    exit_code = ExitCode.NOT_SAFE


def run_plan(
    trials: Sequence[Trial],
    backend: Backend,
    writer: PlanWriter,
    *,
    workers: int,
    display: Display,
    stop: StopSwitch,
) -> RunOutcome:
    """Execute `trials` in order on a connected backend and seal the archive.

    Args:
        workers: trials executed at once; more than one only where the backend is parallel.
        display: told whenever a trial begins or ends, from this thread.
        stop: asked before every trial, and by the backend during one.

    Raises:
        NotSafeError: in place of any of the others, when the bench was not seen safe either.
        AbortedError: a second Ctrl-C; nothing is sealed.
        CampaignError: the archive cannot be written any more; nothing is sealed.
        Exception: a bug in a backend, after the archive has been sealed as a fault.
    """
    ledger = Ledger(trials, display)
    ended = _Ended(kept=writer.folder)
    with _unsafe_first(ended):
        with _safe_afterwards(backend, ended):
            _execute_all(trials, backend, writer, ledger, ended, workers, stop)
        status, reason = _verdict(ledger, ended, stop)
        ended.kept = writer.seal(status, reason, ended.safe_state, ended=utc_now())
        if ended.bug:
            raise ended.bug
    return RunOutcome(status, reason, ended.safe_state, ledger.outcomes, ended.kept)


def _verdict(ledger: Ledger, ended: _Ended, stop: StopSwitch) -> tuple[RunStatus, str]:
    """How the run stands, and every reason there is for it."""
    interrupted = stop() and (ledger.left or Outcome.INTERRUPTED in ledger.outcomes)
    if interrupted:
        status = RunStatus.INTERRUPTED
    elif ended.fault:
        status = RunStatus.FAULT
    elif ledger.outcomes.keys() - {Outcome.COMPLETED}:
        status = RunStatus.FAILED_TRIALS
    else:
        status = RunStatus.COMPLETE
    reasons = (f"stopped by {stop.reason}" if interrupted else "", ended.fault, ended.unsafe)
    return status, "; ".join(filter(None, reasons))


@dataclass
class _Ended:
    """What ended the run early, and how the bench was left.

    Attributes:
        kept: where the finished trials are: the open run, and once it is sealed the archive.
        fault: why the run cannot go on, or empty.
        bug: an exception that no backend should raise.
        unsafe: why the safe state could not be confirmed, or empty.
    """

    kept: Path
    fault: str = ""
    bug: Exception | None = None
    safe_state: SafeState = SafeState.NOT_CONFIRMED
    unsafe: str = ""


@dataclass(frozen=True)
class _Executed:
    ending: Ending
    bug: Exception | None = None
    backend_failed: bool = False

    @property
    def fault(self) -> str:
        """Why no further trial may be executed, or the empty text."""
        if self.backend_failed or self.bug:
            return self.ending.reason
        if self.ending.safe_state is not SafeState.CONFIRMED:
            return self.ending.reason or "the bench was not seen at rest after a trial"
        return ""


@contextmanager
def _unsafe_first(ended: _Ended) -> Iterator[None]:
    """Whatever ends the block: a bench not known to be safe is said first, with its own code."""
    try:
        yield
    except BaseException as error:
        if ended.unsafe:
            raise NotSafeError(
                "SAFE STATE NOT CONFIRMED: look at the bench before anything else; "
                f"{ended.unsafe}; and {_why(error)}; the finished trials are in {ended.kept}"
            ) from error
        raise


def _why(error: BaseException) -> str:
    if isinstance(error, KeyboardInterrupt):
        return "the run was stopped at once"
    return str(error) if isinstance(error, CampaignError) else f"internal error: {_describe(error)}"


@contextmanager
def _safe_afterwards(backend: Backend, ended: _Ended) -> Iterator[None]:
    """Bring the bench to rest however the block ends, and note whether that was seen."""
    try:
        yield
    except KeyboardInterrupt:
        _make_safe(backend, ended)
        raise AbortedError(f"stopped at once; the finished trials are in {ended.kept}") from None
    except BaseException:
        _make_safe(backend, ended)
        raise
    else:
        _make_safe(backend, ended)


def _make_safe(backend: Backend, ended: _Ended) -> None:
    ended.unsafe = "making the bench safe did not end"  # until it has, whatever breaks it off
    try:
        ended.safe_state = backend.make_safe()
    except KeyboardInterrupt:
        ended.unsafe = "making the bench safe was interrupted"
        raise
    except Exception as error:  # noqa: BLE001 - nothing may hide that the bench is not safe
        ended.unsafe = f"making the bench safe failed: {_describe(error)}"
    else:
        safe = ended.safe_state is SafeState.CONFIRMED
        ended.unsafe = "" if safe else "the bench was not seen at rest with its drive off"


def _execute_all(
    trials: Sequence[Trial],
    backend: Backend,
    writer: PlanWriter,
    ledger: Ledger,
    ended: _Ended,
    workers: int,
    stop: StopSwitch,
) -> None:
    """Keep `workers` trials going until there are none left or the run has to end."""

    def halted() -> bool:
        return stop() or bool(ended.fault)

    waiting = iter(trials)
    running: dict[Future[_Executed], Trial] = {}
    pool = ThreadPoolExecutor(max_workers=workers, thread_name_prefix="trial")
    try:
        while True:
            while len(running) < workers and not halted():
                trial = next(waiting, None)
                if trial is None:
                    break
                ledger.begin(trial)
                running[pool.submit(_execute, trial, backend, writer, halted)] = trial
            if not running:
                break
            finished, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in sorted(finished, key=lambda future: running[future].number):
                trial, executed = running.pop(future), future.result()
                if executed.ending.outcome is Outcome.INTERRUPTED and not halted():
                    stop.request(executed.ending.reason or "the bench")  # somebody stands there
                ended.fault = ended.fault or executed.fault
                ended.bug = ended.bug or executed.bug
                ledger.end(trial, executed.ending)
    except KeyboardInterrupt:
        pool.shutdown(wait=False, cancel_futures=True)
        raise
    except BaseException:
        ended.fault = ended.fault or "the run cannot go on"  # lets the other trials end
        pool.shutdown(wait=True, cancel_futures=True)
        raise
    pool.shutdown(wait=True)


def _execute(
    trial: Trial, backend: Backend, writer: PlanWriter, halted: Callable[[], bool]
) -> _Executed:
    """One trial, in a worker thread. Raises only what the archive raises."""
    started = utc_now()
    recorder = writer.begin(trial)
    try:
        executed = _Executed(backend.execute(trial, recorder, halted))
    except BackendError as error:
        ending = Ending(Outcome.FAULT, str(error), SafeState.NOT_CONFIRMED)
        executed = _Executed(ending, backend_failed=True)
    except CampaignError:
        raise  # from the recorder: the archive cannot be written
    except Exception as error:  # noqa: BLE001 - a bug in a backend must not cost the archive
        reason = f"internal error: {_describe(error)}"
        executed = _Executed(Ending(Outcome.FAULT, reason, SafeState.NOT_CONFIRMED), bug=error)
    recorder.finish(executed.ending, started, utc_now())
    return executed


def utc_now() -> str:
    """The wall clock as archives keep it: ISO 8601, UTC, to the millisecond."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


def _describe(error: BaseException) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
