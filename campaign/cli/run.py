"""`campaign run`: prepare, check, prompt, execute, seal."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from campaign.archive.layout.header import RunHeader, Truth
from campaign.archive.layout.names import PARTIAL
from campaign.archive.writing.run_names import reserved_name
from campaign.archive.writing.writer import RunWriter
from campaign.cli.ask import allow_motion, say_by_hand
from campaign.cli.compile_engine import compiling_meanwhile, wait_until_compiled
from campaign.cli.plan import print_warnings
from campaign.cli.prepare import PreparedRun, Request, find_backend, prepare
from campaign.cli.profile import print_profile
from campaign.cli.run_options import RunOptions
from campaign.cli.session import Session, conduct
from campaign.cli.sign import rehearse_signing
from campaign.cli.step_check import is_checked
from campaign.errors import ExitCode
from campaign.execution import provenance
from campaign.execution.stop import under_guardian
from campaign.protocol import as_tree, check_limits, check_loops
from campaign.protocol.further_files import names_file
from campaign.stopwatch import UNTIMED, Stopwatch, Work


@dataclass(frozen=True)
class Remarks:
    """Additions of the command line to the record.

    Attributes:
        operator: replaces the protocol's, when not empty.
        note, tags: added to the protocol's.
    """

    operator: str = ""
    note: str = ""
    tags: tuple[str, ...] = ()


def run_protocol(
    request: Request,
    results: Path,
    given: RunOptions,
    *,
    remarks: Remarks | None = None,
    stopwatch: Stopwatch | None = None,
) -> ExitCode:
    """Execute a protocol; the archive's path is the last line of standard output.

    stopwatch: if given, its times are printed at the end.
    """
    given.check_watch()
    guardian = under_guardian(find_backend(request.backend))
    timing = stopwatch or UNTIMED
    with compiling_meanwhile(request.backend) as compiling:
        with timing.span(Work.PREPARING):
            prepared = prepare(request)
            plan = prepared.plan
            check_limits(plan)
            check_loops(plan)
            print_warnings(plan)
            workers = given.parallel(prepared.kind, len(plan.trials))
            if given.sign is not None:
                rehearse_signing(given.sign)
            backend = prepared.open_backend()
        with timing.span(Work.COMPILING):
            wait_until_compiled(compiling, backend, plan.trials)
        timing.add(Work.COMPILING, compiling.processor if compiling else 0.0)
    if prepared.kind.by_hand:
        say_by_hand(prepared.options)
    allow_motion(prepared.kind, plan.trials, plan.tests, yes=given.yes)
    began = datetime.now(UTC)
    with (
        given.opened(prepared.kind, backend, plan.trials, workers) as (at_once, executor),
        reserved_name(results, prepared.path.stem, began) as lock,
    ):

        def open_archive() -> RunWriter:
            header = run_header(prepared, request, lock.name, began, remarks or Remarks())
            return RunWriter.create(results, header, plan.trials, lock)

        session = Session(
            prepared.kind,
            backend,
            plan.trials,
            plan.protocol.policy,
            at_once,
            results / f"{lock.name}{PARTIAL}",
            given,
            checks_step=is_checked(prepared.options),
            timing=timing,
            stages=plan.stages,
            guardian=guardian,
            executor=executor,
        )
        code = conduct(session, open_archive)
    if stopwatch is not None:
        print_profile(stopwatch, at_once)
    return code


def run_header(
    prepared: PreparedRun, request: Request, name: str, began: datetime, remarks: Remarks
) -> RunHeader:
    """Header of the archive: all data on the run from before its first trial."""
    plan, asked = prepared.plan, prepared.plan.protocol
    policy = asked.policy.model_dump(mode="json")
    changes = (change.partition("=") for change in request.changes)
    return RunHeader(
        name=name,
        created=began.isoformat(timespec="milliseconds"),
        title=asked.title,
        description=asked.description,
        protocol_name=prepared.path.stem,
        protocol_path=str(prepared.path.resolve()),
        sources=dict(asked.sources),
        truth=Truth(
            option=_absolute(request.truth),
            sources=dict(asked.truth_sources),
            plants=dict(plan.truths),
        ),
        normalised={**plan.normalised, "published": asked.published, "policy": policy},
        tests=tuple(as_tree(plan)["tests"]),
        seed=plan.seed,
        versions=provenance.versions(),
        plugins=provenance.plug_ins(plan.trials, prepared.kind.name, plan.truths.values()),
        host=provenance.host(),
        command=provenance.command(),
        operator=remarks.operator or asked.operator,
        notes="\n".join(filter(None, (asked.notes, remarks.note))),
        tags=tuple(dict.fromkeys((*asked.tags, *remarks.tags))),
        backend=prepared.kind.name,
        source=prepared.kind.source.value,
        backend_options=prepared.options.model_dump(mode="json"),
        overrides={path: value for path, _, value in changes},
        only=plan.only,
        git_revision=provenance.git_revision(prepared.path),
        fingerprint=plan.fingerprint,
    )


def _absolute(truth: str) -> str:
    return str(Path(truth).resolve()) if names_file(truth) else truth
