"""Common part of `run` and `resume`: execute, seal, summarize, report."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import chdir, closing, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path

from rich.console import Console

from campaign.archive.layout.journal import TrialsFollowed
from campaign.archive.layout.names import SEALED
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.backends import calls
from campaign.backends.interface import Backend, BackendKind, SupportsHolder, SupportsTiming
from campaign.cli.ask import attendance_of
from campaign.cli.damage import archive_of, note_damaged, say_damaged
from campaign.cli.latch import clear_stop
from campaign.cli.output import error_console, print_line, print_note, print_warning
from campaign.cli.prepare import check_connected
from campaign.cli.run_options import DEFAULTS, RunOptions
from campaign.cli.sign import sign_new_run
from campaign.cli.step_check import say_step_check
from campaign.errors import BackendError, CampaignError, ExitCode, worst_exit_code
from campaign.execution.display import Shown, progress_display
from campaign.execution.executors import OpenExecutor
from campaign.execution.outcome import RunOutcome
from campaign.execution.run_reference import finished_trials, reference, typed
from campaign.execution.runner import run_plan
from campaign.execution.safety import (
    NOT_SAFE,
    AbortedError,
    NotSafeError,
    connected,
    safe_at_once,
    safe_when_broken_off,
)
from campaign.execution.stages import Stages, refusal_of
from campaign.execution.stop import NOTHING_BEGUN, GuardianPipes, StopSwitch
from campaign.execution.supervision import Supervision
from campaign.execution.trial_metrics import TrialMeasurement
from campaign.execution.watch_display import WatchDisplay
from campaign.experiments import experiments
from campaign.interrupts import unwinding
from campaign.policy import Policy
from campaign.protocol import PlannedStage
from campaign.recording import Outcome
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.text import clock, count
from campaign.trial import Trial


@dataclass(frozen=True)
class Session:
    """Trials, and the backend that accepts them, not yet connected; the others as in `run_plan`.

    Attributes:
        folder: present or future folder of the run in progress.
        checks_step: whether the effect of half the step is reported afterwards.
        repeats: run of a repeated trial; for a replay, the backend states the run itself.
        timing: timing sink.
        asked: stages that were evaluated before, from the journal.
        guardian: of a program that moves a bench.
    """

    kind: BackendKind
    backend: Backend
    trials: Sequence[Trial]
    policy: Policy
    workers: int
    folder: Path
    given: RunOptions = DEFAULTS
    finished: Mapping[int, Outcome] = field(default_factory=dict)
    checks_step: bool = False
    repeats: RunReader | None = None
    timing: Timing = UNTIMED
    stages: tuple[PlannedStage, ...] = ()
    asked: tuple[TrialsFollowed, ...] = ()
    guardian: GuardianPipes | None = None
    executor: OpenExecutor | None = None

    @property
    def source(self) -> RunReader | None:
        """Archived run that is the source of this one, if any."""
        return self.repeats or archive_of(self.backend)


def conduct(session: Session, open_archive: Callable[[], RunWriter]) -> ExitCode:
    """Execute a session; the archive's path is the last line of standard output.

    `open_archive` is called after the bench is connected: without a bench there is no run. The
    sealed run is signed after any ending.
    """
    began = time.monotonic()
    outcome, code = execute(session, open_archive)
    codes = [code]
    with suppress(OSError):  # the terminal is closed; the archive has the outcome
        say_outcome(outcome, time.monotonic() - began)
    try:
        if session.checks_step:
            say_step_check(outcome.archive)
        if session.given.sign is not None:
            codes.append(sign_new_run(outcome.archive, session.given.sign))
        if session.given.report:
            with unwinding(), session.timing.span(Work.REPORT):
                codes.append(_report(outcome))
    finally:
        print_line(str(outcome.archive))
    return worst_exit_code(codes)


def execute(session: Session, open_archive: Callable[[], RunWriter]) -> tuple[RunOutcome, ExitCode]:
    """Connect, execute, seal and disconnect; return the outcome and the exit code.

    Raises UsageError, before any motion and without an archive, if the connected bench refuses a
    trial or does not record a required channel.
    """
    outcome: RunOutcome | None = None
    source = session.source
    read = say_damaged(source.path, source.damaged) if source else ExitCode.DONE
    here = Path.cwd()
    if isinstance(session.backend, SupportsHolder):
        calls.called(session.backend, "introduce", session.folder.stem)
    if isinstance(session.backend, SupportsTiming):
        session.backend.timing = session.timing
    try:
        # Signals first: once the bench is connected, a stop must be orderly.
        with (
            chdir(here),  # a plug-in may change the folder
            StopSwitch(session.guardian).on_signals() as stop,
        ):
            stop.make_safe = partial(safe_at_once, session.backend)
            keep = partial(
                stop.kept,
                partial(_what_is_kept, session.folder),
                moves=session.kind.live,
                stopper=calls.stop_command(session.backend),
            )
            keep()  # the bench may move from here on
            with connected(session.backend, print_warning) as backend:
                os.chdir(here)
                with safe_when_broken_off(backend):
                    left = [t for t in session.trials if t.number not in session.finished]
                    check_connected(session.kind, backend, left)
                    cleared = clear_stop(backend, session.given.clear_stop, stop)
                    writer = open_archive()
                    writer.timing = session.timing
                    if cleared:
                        writer.decision("stop cleared", cleared)
                    if source:
                        note_damaged(writer, source)
                keep()
                with closing(writer), _saying_what_is_kept(writer.folder):
                    outcome = _execute(session, backend, writer, stop)
    except BackendError as error:
        if outcome is None:
            raise
        print_warning(str(error))
        return outcome, worst_exit_code([outcome.exit_code, error.exit_code, read])
    return outcome, worst_exit_code([outcome.exit_code, read])


def _what_is_kept(folder: Path) -> str:
    """Message at an immediate exit: folder of the run, or its sealed archive."""
    sealed = folder.with_suffix(SEALED)
    if sealed.is_file():
        return f"stopped at once; the run is in {sealed}"
    if not folder.exists():
        return NOTHING_BEGUN
    return f"stopped at once; {finished_trials(folder)}"


@contextmanager
def _saying_what_is_kept(folder: Path) -> Iterator[None]:
    """For a run that fails without an outcome: print its place and how to continue."""
    try:
        yield
    except (AbortedError, NotSafeError):
        raise  # their messages include it, after more important text
    except Exception:
        existing = (path for path in (folder, folder.with_suffix(SEALED)) if path.exists())
        if kept := next(existing, None):
            print_warning(finished_trials(kept))
        raise


def _execute(session: Session, backend: Backend, writer: RunWriter, stop: StopSwitch) -> RunOutcome:
    measuring = TrialMeasurement(experiments(), session.timing)
    supervision = Supervision(session.kind.source, session.kind.live, timing=session.timing)
    showing = watching if session.given.watch else progress_display
    with showing(error_console()) as display:
        if isinstance(display, WatchDisplay):
            supervision = replace(supervision, subscribers=(display.seen,))
        return run_plan(
            session.trials,
            backend,
            writer,
            workers=session.workers,
            display=display,
            stop=stop,
            policy=session.policy,
            attendance=attendance_of(session.kind, display, yes=session.given.yes),
            supervision=supervision,
            measure=measuring,
            finished=session.finished,
            executor=session.executor,
            stages=Stages(
                session.stages,
                session.trials,
                writer,
                experiments(),
                refusal_of(backend),
                measure=measuring,
                finished=session.finished,
                asked=session.asked,
            ),
        )


def say_outcome(outcome: RunOutcome, elapsed: float) -> None:
    """Print the outcome of the run, and how to continue."""
    done = outcome.outcomes.get(Outcome.COMPLETED, 0)
    failed = {o.value: n for o, n in outcome.outcomes.items() if o is not Outcome.COMPLETED}
    counts = ", ".join(
        [f"{count(done, 'trial')} done", *(f"{n} {word}" for word, n in failed.items())]
    )
    reason = f" ({outcome.reason})" if outcome.reason else ""
    go_on = ""
    if outcome.status in (RunStatus.INTERRUPTED, RunStatus.FAULT):
        go_on = f"; to continue:\n{typed('resume', reference(outcome.archive))}"
    print_note(f"{outcome.status.value}{reason}: {counts}, in {clock(elapsed)}{go_on}")
    if outcome.exit_code is ExitCode.NOT_SAFE:
        print_note(NOT_SAFE, "bold red")


def _report(outcome: RunOutcome) -> ExitCode:
    """Build the report; its failure is printed and must not hide the outcome of the run.

    Raises:
        Exception: a bug, after a run with exit code DONE.
    """
    archive: Path = outcome.archive
    if outcome.exit_code is ExitCode.INTERRUPTED:
        command = typed("report", reference(archive))
        print_note(f"no report of an interrupted run; to make one:\n{command}")
        return ExitCode.DONE
    try:
        from campaign.cli.report import report_run

        page, code = report_run(str(archive), archive.parent, None, None)
        print_note(f"report: {page}")
        return code
    except CampaignError as error:
        print_warning(f"no report: {error}")
        return error.exit_code
    except KeyboardInterrupt:
        print_note("no report: interrupted")
        return ExitCode.INTERRUPTED
    except Exception as error:
        if outcome.exit_code is ExitCode.DONE:
            raise
        what = f"{type(error).__name__}: {error}"
        again = f"campaign report {reference(archive)} shows it again"
        print_warning(f"no report: internal error: {what}\n{again}")
    return ExitCode.DONE


@contextmanager
def watching(console: Console) -> Iterator[Shown]:
    """Display of the running trial's channels inside the block; on a plain terminal, progress."""
    if not console.is_terminal or console.is_dumb_terminal:
        print_note("--watch: this terminal cannot show pictures; progress is printed in lines")
        with progress_display(console) as usual:
            yield usual
        return
    display = WatchDisplay(os.dup(console.file.fileno()))
    try:
        yield display
    finally:
        display.end()
