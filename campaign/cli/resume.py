"""`campaign resume`: continue an interrupted, killed or faulted run."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.journal import RunResumed, utc_now
from campaign.archive.layout.names import PARTIAL
from campaign.archive.layout.signature_file import has_signature
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_list import find_run
from campaign.archive.reading.run_reader import RunReader
from campaign.archive.writing.writer import RunWriter
from campaign.backends.interface import BackendKind
from campaign.cli.ask import allow_motion, say_by_hand
from campaign.cli.compile_engine import compiling_meanwhile, wait_until_compiled
from campaign.cli.damage import say_damaged
from campaign.cli.output import print_note, print_warning
from campaign.cli.plan import print_warnings
from campaign.cli.prepare import Request, find_backend, open_backend, prepare
from campaign.cli.run_options import RunOptions
from campaign.cli.session import Session, conduct
from campaign.cli.sign import rehearse_signing
from campaign.cli.step_check import is_checked
from campaign.errors import ExitCode, UsageError, worst_exit_code
from campaign.execution import provenance
from campaign.execution.resume import (
    check_resumable,
    differences,
    followed,
    listed,
    not_repeated,
    same_list,
    stages_of,
    trial_differences,
)
from campaign.execution.stop import under_guardian
from campaign.options import Options
from campaign.policy import Policy
from campaign.protocol import PlannedStage, PlannedTest, check_limits, check_loops
from campaign.protocol.further_files import names_file
from campaign.trial import Tree, Trial


@dataclass(frozen=True)
class Remade:
    """The present plan, and its differences from the archived one.

    It has the trials of the first stage; those of later stages are in the archive.
    """

    kind: BackendKind
    options: Options
    trials: tuple[Trial, ...]
    tests: tuple[PlannedTest, ...]
    policy: Policy
    changes: tuple[str, ...]
    stages: tuple[PlannedStage, ...]
    truths: Mapping[str, Tree]


def resume_run(
    name: str,
    results: Path,
    given: RunOptions,
    *,
    accept_changes: bool = False,
    port: str | None = None,
) -> ExitCode:
    """Execute the remaining trials of a run; the archive's path is the last line of output.

    port: present port of the bench; no change that needs acceptance.
    """
    given.check_watch()
    path = find_run(results, name)
    run = open_run(path)
    guardian = under_guardian(find_backend(run.header.backend))
    read = say_damaged(path, run.damaged)
    check_resumable(run)
    if run.first_stage:
        run.full_plan.trial(1)  # the sealed file needs it: do not execute a damaged plan
    with compiling_meanwhile(run.header.backend) as compiling:
        remade = remake(run, port)
        _check_truth(run, remade.trials)
        _check_changes(run, remade.changes, accepted=accept_changes)
        finished = not_repeated(run)
        trials = (*remade.trials, *followed(run, remade.trials, finished))
        left = [trial for trial in trials if trial.number not in finished]
        workers = given.parallel(remade.kind, len(left))
        if given.sign is not None:
            rehearse_signing(given.sign)
        backend = open_backend(remade.kind, remade.options, left, remade.truths)
        wait_until_compiled(compiling, backend, left)
    print_note(f"{run.name}: {len(finished)} trials are done, {len(left)} remain")
    if remade.kind.by_hand:
        say_by_hand(remade.options)
    allow_motion(remade.kind, left, remade.tests, yes=given.yes)

    def open_archive() -> RunWriter:
        signed = run.sealed and has_signature(run.path)
        resumed = RunResumed(
            at=utc_now(),
            host=provenance.host(),
            versions=provenance.versions(),
            command=provenance.command(),
            changes=remade.changes,
        )
        writer = RunWriter.resume(path, resumed)
        if signed:
            print_warning(
                f"{run.name}: was signed; the run changes, so the old signature is renamed"
            )
        return writer

    with given.opened(remade.kind, backend, left, workers) as (at_once, executor):
        session = Session(
            remade.kind,
            backend,
            trials,
            remade.policy,
            at_once,
            path.with_name(f"{run.name}{PARTIAL}"),
            given,
            finished,
            checks_step=is_checked(remade.options),
            stages=remade.stages,
            asked=run.stages,
            guardian=guardian,
            executor=executor,
        )
        code = conduct(session, open_archive)
    return worst_exit_code([code, read])


def remake(run: RunReader, port: str | None = None) -> Remade:
    """Plan again from the protocol's file, or from the archive if that is missing."""
    if port is not None:
        run = _at_port(run, port)
    protocol, truth = Path(run.header.protocol_path), run.header.truth.option
    if names_file(truth) and not Path(truth).exists():
        print_warning(f"the truth {truth} does not exist: continuing with the archived plan")
        return _from_archive(run)
    if run.header.protocol_path and protocol.exists():
        return _from_protocol(run, protocol)
    where = f"no protocol {protocol}" if run.header.protocol_path else "no protocol file"
    print_warning(f"{where}: continuing with the archived plan")
    return _from_archive(run)


def _at_port(run: RunReader, port: str) -> RunReader:
    """Run with the bench at `port` in its header. Raises UsageError for a backend without port."""
    if "port" not in run.header.backend_options:
        raise UsageError(f"the backend {run.header.backend!r} has no port; leave --port out")
    header = run.header.model_copy(
        update={
            "backend_options": run.header.backend_options | {"port": port},
            "overrides": run.header.overrides | {"backend.port": json.dumps(port)},
        }
    )
    return replace(run, header=header)


def _from_protocol(run: RunReader, protocol: Path) -> Remade:
    header = run.header
    request = Request(
        str(protocol),
        only=header.only,
        changes=tuple(f"{path}={value}" for path, value in header.overrides.items()),
        backend=header.backend,
        allow_large=True,
        seed=header.seed,
        truth=header.truth.option,
    )
    prepared = prepare(request)
    plan = prepared.plan
    kind, options, truths = prepared.kind, prepared.options, plan.truths
    changes = _changes(header, plan.normalised, options, plan.trials, truths)
    if not same_list(run.first_stage, plan.trials):
        why = f":\n{listed(changes)}" if changes else ""
        raise UsageError(
            f"{run.name}: its {len(run.first_stage)} trials differ from the present ones of "
            f"{protocol} ({len(plan.trials)}){why}\nstart a new run"
        )
    check_limits(plan)
    check_loops(plan)
    print_warnings(plan)
    changes = changes or tuple(trial_differences(run.first_stage, plan.trials))
    tests, policy = plan.tests, plan.protocol.policy
    return Remade(kind, options, plan.trials, tests, policy, changes, plan.stages, truths)


def _from_archive(run: RunReader) -> Remade:
    header = run.header
    kind = find_backend(header.backend)
    options = kind.options.model_validate(header.backend_options, context={"si": True})
    policy = Policy.model_validate(header.normalised.get("policy", {}), context={"si": True})
    trials = tuple(run.full_plan.trial(planned.number) for planned in run.first_stage)
    truths = header.truth.plants
    changes = _changes(header, header.normalised, options, trials, truths)
    return Remade(kind, options, trials, (), policy, changes, stages_of(header), truths)


def _changes(
    header: RunHeader,
    normalised: Tree,
    options: Options,
    trials: Sequence[Trial],
    truths: Mapping[str, Tree],
) -> tuple[str, ...]:
    """Differences of the present conditions from those at the start of the run."""
    now = header.model_copy(
        update={
            "normalised": normalised,
            "backend_options": options.model_dump(mode="json"),
            "versions": provenance.versions(),
            "plugins": provenance.plug_ins(trials, header.backend, truths.values()),
        }
    )
    return tuple(differences(header, now))


def _check_truth(run: RunReader, trials: Sequence[Trial]) -> None:
    """Raise UsageError if the truth differs from the one archived at the start of the run."""
    truths = {trial.truth for trial in trials} - {""}
    had = run.header.truth.plants.keys()
    if truths <= had and bool(truths) == bool(had):
        return
    what = "has no truth now" if not truths else "was started with another truth, or none"
    raise UsageError(
        f"{run.name}: {what}: its trials would differ, also with --accept-changes; start a new "
        "run, or restore the truth"
    )


def _check_changes(run: RunReader, changes: Sequence[str], *, accepted: bool) -> None:
    if not changes:
        return
    text = f"{run.name}: changed since the start of the run (SI units):\n{listed(changes)}"
    if not accepted:
        raise UsageError(
            f"{text}\n--accept-changes continues with the new values, and archives the changes"
        )
    print_warning(text)
