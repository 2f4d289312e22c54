"""`campaign run`: prepare, check, execute, seal, and report if asked."""

from __future__ import annotations

import os
from datetime import UTC, datetime
from pathlib import Path

from campaign.archive import RunHeader, RunWriter, new_run_name
from campaign.cli.output import error_console, print_line, print_note
from campaign.cli.prepare import Prepared, Request, prepare
from campaign.errors import CampaignError, ExitCode, UsageError, worst_exit_code
from campaign.execution import provenance
from campaign.execution.display import clock, progress_display
from campaign.execution.outcome import RunOutcome
from campaign.execution.runner import run_plan
from campaign.execution.stop import StopSwitch
from campaign.protocol import as_tree, check_limits
from campaign.trial import Outcome


def run_protocol(request: Request, results: Path, *, workers: int | None, report: bool) -> ExitCode:
    """Execute a protocol; the archive's path is the last line of standard output."""
    prepared = prepare(request)
    check_limits(prepared.plan)
    workers = choose_workers(prepared, workers)
    began = datetime.now(UTC)
    # Signals first: from the moment that the bench is connected, a stop has to be an orderly one.
    with StopSwitch().on_signals() as stop, prepared.open_backend() as backend:
        header = run_header(prepared, request, results, began)
        writer = RunWriter.create(results, header, prepared.plan.trials)
        with progress_display(error_console()) as display:
            outcome = run_plan(
                prepared.plan.trials,
                backend,
                writer,
                workers=workers,
                display=display,
                stop=stop,
            )
    _say(outcome, (datetime.now(UTC) - began).total_seconds())
    code = outcome.exit_code
    try:
        if report:
            code = worst_exit_code([code, _report(outcome)])
    finally:
        print_line(str(outcome.archive))
    return code


def choose_workers(prepared: Prepared, wanted: int | None) -> int:
    """How many trials at once: what was asked for, else what backend and machine allow."""
    if not prepared.kind.parallel:
        if wanted is not None and wanted > 1:
            raise UsageError(
                f"the backend {prepared.kind.name!r} executes one trial at a time; "
                f"leave --workers {wanted} out"
            )
        return 1
    return min(wanted or os.cpu_count() or 1, max(1, len(prepared.plan.trials)))


def run_header(prepared: Prepared, request: Request, results: Path, began: datetime) -> RunHeader:
    """Everything the archive keeps about the run before its first trial."""
    plan = prepared.plan
    return RunHeader(
        name=new_run_name(results, prepared.path.stem, began),
        created=began.isoformat(timespec="milliseconds"),
        title=plan.title,
        description=plan.description,
        protocol_name=prepared.path.stem,
        sources=dict(plan.sources),
        normalised={**plan.normalised, "published": plan.published},
        tests=tuple(as_tree(plan)["tests"]),
        versions=provenance.versions(),
        host=provenance.host(),
        command=provenance.command(),
        operator=plan.operator,
        notes=plan.notes,
        tags=plan.tags,
        backend=prepared.kind.name,
        backend_options=prepared.options.model_dump(mode="json"),
        overrides={path: value for path, _, value in map(_parted, request.changes)},
        only=plan.only,
        git_revision=provenance.git_revision(prepared.path),
        fingerprint=plan.fingerprint,
    )


def _parted(change: str) -> tuple[str, str, str]:
    return change.partition("=")


def _report(outcome: RunOutcome) -> ExitCode:
    """Build the report; what goes wrong with it is said, and must not hide how the run ended.

    Raises:
        Exception: a bug, after a run that has nothing worse to say.
    """
    try:
        _build_report(outcome)
    except CampaignError as error:
        print_note(f"no report: {error}", "yellow")
        return error.exit_code
    except KeyboardInterrupt:
        print_note("no report: interrupted")
        return ExitCode.INTERRUPTED
    except Exception as error:
        if outcome.exit_code is ExitCode.DONE:
            raise
        print_note(
            f"no report: internal error: {type(error).__name__}: {error}\n"
            f"This is a bug; campaign report {outcome.archive} shows it again.",
            "yellow",
        )
    return ExitCode.DONE


def _build_report(outcome: RunOutcome) -> None:
    from campaign.cli.report import report_run

    if outcome.exit_code is ExitCode.INTERRUPTED:
        print_note(f"no report of an interrupted run; campaign report {outcome.archive} makes one")
        return
    page = report_run(str(outcome.archive), outcome.archive.parent, None, None, open_it=False)
    print_note(f"report: {page}")


def _say(outcome: RunOutcome, elapsed: float) -> None:
    done = outcome.outcomes.get(Outcome.COMPLETED, 0)
    failed = {o.value: n for o, n in outcome.outcomes.items() if o is not Outcome.COMPLETED}
    counts = ", ".join([f"{done} trials done", *(f"{n} {word}" for word, n in failed.items())])
    reason = f" ({outcome.reason})" if outcome.reason else ""
    print_note(f"{outcome.status.value}{reason}: {counts}, in {clock(elapsed)}")
    if outcome.exit_code is ExitCode.NOT_SAFE:
        print_note("SAFE STATE NOT CONFIRMED: look at the bench before anything else", "bold red")
