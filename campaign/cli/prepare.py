"""Plan and backend from the command line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.archive.reading.run_list import find_run
from campaign.backends import backends, calls
from campaign.backends.interface import Backend, BackendKind, SimulatesTruth, Source
from campaign.channels import explained
from campaign.cli.damage import archive_of
from campaign.cli.output import print_note
from campaign.errors import ArchiveError, ProtocolError, UsageError
from campaign.experiments import experiments
from campaign.options import Options
from campaign.protocol import Plan, load_protocol, make_plan
from campaign.protocol.missing_values import check_benches
from campaign.protocol.overrides import parse_overrides
from campaign.protocol.problems import find_faults
from campaign.protocol.schema import Protocol, replaced
from campaign.resources import protocols_folder, shipped_protocol, shipped_protocols
from campaign.text import nearest
from campaign.trial import Tree, Trial

IMPORT = "import"
"""Backend for recordings of other programs."""


@dataclass(frozen=True)
class Request:
    """Common arguments of `plan` and `run`, as typed.

    Attributes:
        changes: every `--set`, those of the backend included.
        seed: for tests without their own; drawn when None.
        truth: bench to simulate in place of each test's; empty: as the tests state.
    """

    protocol: str
    only: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    backend: str = "sim"
    allow_large: bool = False
    seed: int | None = None
    truth: str = ""


@dataclass(frozen=True)
class PreparedRun:
    """A plan and its backend, not yet connected."""

    path: Path
    plan: Plan
    kind: BackendKind
    options: Options

    def open_backend(self) -> Backend:
        """Open the backend. Raises UsageError if it refuses a trial of the plan."""
        return open_backend(self.kind, self.options, self.plan.trials, self.plan.truths)


def prepare(request: Request) -> PreparedRun:
    """Load, validate and expand. Raises ProtocolError or UsageError."""
    path = find_protocol(request.protocol)
    kind = find_backend(request.backend)
    ours = tuple(text for text in request.changes if text.lstrip().startswith("backend."))
    overrides = tuple(text for text in request.changes if text not in ours)
    options = backend_options(kind, ours)
    protocol = load_protocol(
        path,
        experiments(),
        overrides=overrides,
        shipped=protocols_folder(),
        truth=request.truth,
    )
    _check_recordings(protocol, kind)  # before the requirements of a simulation
    check_benches(protocol, kind.needs, f"the backend {kind.name!r}", request.only)
    options = _with_mapping(options, protocol)
    with _as_executed(protocol, kind) as protocol:
        plan = make_plan(
            protocol, only=request.only, allow_large=request.allow_large, seed=request.seed
        )
    _check_keep(plan, kind)
    return PreparedRun(path, plan, kind, options)


def _check_keep(plan: Plan, kind: BackendKind) -> None:
    """Raise UsageError if samples are needed that the protocol does not keep."""
    keep = plan.protocol.policy.keep
    if keep == "all":
        return
    if kind.source is not Source.SIMULATION:
        raise UsageError(
            f"keep = {keep!r}: only a simulated trial can be executed again with the same samples; "
            f"with the backend {kind.name!r} leave 'keep' out"
        )
    for trial in {trial.test: trial for trial in plan.trials}.values():
        experiment = experiments().get(trial.kind)
        if experiment is None or experiment.needs_samples:
            raise UsageError(
                f"keep = {keep!r}: the analysis of {trial.kind!r} (test {trial.test!r}) needs "
                "samples; leave 'keep' out, or that test (--only)"
            )
    if plan.stages:
        raise UsageError(
            f"keep = {keep!r}: later stages of {plan.stages[0].test!r} need samples; "
            "leave 'keep' out"
        )


def _with_mapping(options: Options, protocol: Protocol) -> Options:
    """Options with the protocol as mapping, for a backend that needs one and names none."""
    if protocol.columns and getattr(options, "mapping", None) == "":
        return options.model_copy(update={"mapping": str(protocol.path.resolve())})
    return options


def _as_executed(protocol: Protocol, kind: BackendKind) -> AbstractContextManager[Protocol]:
    """Protocol with the recordings of its tests in place of trials, for the backend `import`."""
    if kind.name == IMPORT:
        from campaign.importing.recorded_tests import with_recordings

        return with_recordings(protocol)
    return nullcontext(protocol)


def _check_recordings(protocol: Protocol, kind: BackendKind) -> None:
    """Raise ProtocolError if a test has recordings and the backend executes trials."""
    if kind.name == IMPORT:
        return
    for test in protocol.tests:
        if test.entry.recording:
            message = (
                f"the test '{test.entry.name}' has recordings: `campaign import {protocol.path}` "
                f"archives them, `campaign plan {protocol.path} --backend {IMPORT}` shows them"
            )
            raise ProtocolError([test.origin.problem(("recording",), "key", message)])


def open_backend(
    kind: BackendKind,
    options: Options,
    trials: Sequence[Trial],
    truths: Mapping[str, Tree] | None = None,
) -> Backend:
    """Open a backend that accepts all `trials`, without connecting it.

    `truths`: the plants that the trials name, for a backend that simulates them.

    Raises UsageError if it refuses a trial (ArchiveError if the run that it replays is damaged), or
    is known not to record a required channel.
    """
    backend = calls.opened(kind, options)
    if isinstance(backend, SimulatesTruth):
        backend.simulate_instead(truths or {})
    elif kind.source is not Source.RECORDING and (named := [t for t in trials if t.truth]):
        raise UsageError(
            f"the test {named[0].test!r} states a truth, which only a simulation can use: remove "
            f"it, or use another backend than {kind.name!r}"
        )
    if kind.source is not Source.RECORDING and (named := [t for t in trials if t.recording]):
        raise UsageError(
            f"{named[0].name} ({named[0].label}) is imported and cannot be repeated: "
            "`campaign import` reads its files again, `--backend replay` its archive"
        )
    source = archive_of(backend)
    refusal = ArchiveError if source is not None and source.damaged else UsageError
    for trial in trials:
        if why := _refused(kind, backend, trial):
            raise refusal(why)
    check_channels(kind, backend, trials)
    return backend


def check_connected(kind: BackendKind, backend: Backend, trials: Sequence[Trial]) -> None:
    """Check a connected backend again, with data from its bench, before anything moves.

    Raises UsageError if it refuses one of `trials` or does not record a required channel. Refusals
    are checked for live backends only: for others, a later refusal costs only time.
    """
    for trial in trials if kind.live else ():
        if why := _refused(kind, backend, trial):
            raise UsageError(f"{why}; nothing was moved")
    check_channels(kind, backend, trials)


def _refused(kind: BackendKind, backend: Backend, trial: Trial) -> str:
    if not (why := calls.refusal(backend, trial)):
        return ""
    return f"the backend {kind.name!r} cannot execute {trial.name} ({trial.label}): {why}"


def check_channels(kind: BackendKind, backend: Backend, trials: Iterable[Trial]) -> None:
    """Raise UsageError if the backend is known not to record a channel that a trial requires.

    `check_connected` repeats the check when the backend is connected.
    """
    messages: dict[tuple[str, tuple[str, ...]], str] = {}  # the first of several equal trials
    for trial in trials:
        names = calls.unrecorded(backend, trial, trial.requires)
        if names and (trial.test, names) not in messages:
            messages[trial.test, names] = _not_recorded(kind, trial, names)
    if messages:
        raise UsageError("\n".join(messages.values()))


def _not_recorded(kind: BackendKind, trial: Trial, names: Sequence[str]) -> str:
    experiment = experiments().get(trial.kind)
    purposes = experiment.requires if experiment is not None else {}
    what = "; ".join(
        f"{explained(name)}{f', for {purposes[name]}' if name in purposes else ''}"
        for name in names
    )
    if kind.name == IMPORT:
        from campaign.importing.description import RecordingDescription

        described = RecordingDescription.model_validate(trial.recording, context={"si": True})
        recorded = ", ".join(each.name for each in described.channels)
        tables = ", ".join(f"[columns.NAME.{name}]" for name in names)
        return (
            f"{trial.name} ({trial.label}): the experiment {trial.kind!r} requires {what}\n"
            f"its mapping has {recorded}: assign a column by {tables}"
        )
    return (
        f"{trial.name} ({trial.label}): the experiment {trial.kind!r} requires {what}; "
        f"the backend {kind.name!r} does not record it\n"
        f"record it, use another backend, or leave out the test {trial.test!r}; nothing was moved"
    )


def lacking(backend: Backend, trials: Iterable[Trial]) -> dict[str, tuple[str, ...]]:
    """Channels by test that its analysis can use but the backend is known not to record."""
    by_test: dict[str, dict[str, None]] = {}
    for trial in trials:
        if names := calls.unrecorded(backend, trial, trial.can_use):
            by_test.setdefault(trial.test, {}).update(dict.fromkeys(names))
    return {test: tuple(names) for test, names in by_test.items()}


def short_settings(
    port: str | None, source: str | None, results: Path, handover: Path | None = None
) -> tuple[str, ...]:
    """Settings (`--set`) that `--port`, `--from` and `--handover` stand for.

    `results`: folder of a named run. A folder becomes an absolute path, which stays valid at a
    resume.
    """
    settings = {
        "port": port,
        "run": str(find_run(results, source)) if source else None,
        "folder": str(handover.resolve()) if handover else None,
    }
    return tuple(
        f"backend.{name}={json.dumps(value, ensure_ascii=False)}"  # a TOML string, too
        for name, value in settings.items()
        if value is not None
    )


def find_protocol(text: str) -> Path:
    """Path of a protocol: the file `text`, else that name in `protocols/`, else a shipped one.

    Prints one found by name on standard error. Raises UsageError without a match.
    """
    path, name = Path(text), text.removesuffix(".toml")
    if path.exists() and not path.is_dir():
        return path
    if path.name == text:
        own = Path("protocols", f"{name}.toml")
        if found := own if own.is_file() else shipped_protocol(name):
            print_note(f"protocol: {found}")
            return found
    if path.exists():
        return path  # a folder: the reader reports it
    if path.suffix not in ("", ".toml"):
        raise UsageError(f"{text}: no such file")
    names = shipped_protocols()
    hint = nearest(path.stem, names) or f"; shipped are {', '.join(names)}"
    raise UsageError(f"{text}: no such file, and no protocol of that name{hint}")


def find_backend(name: str) -> BackendKind:
    """Backend of that name. Raises UsageError, with the existing names, for an unknown one."""
    kinds = backends()
    if name not in kinds:
        raise UsageError(f"there is no backend {name!r}; there are {', '.join(kinds)}")
    return kinds[name]


def backend_options(kind: BackendKind, changes: tuple[str, ...]) -> Options:
    """Options of the backend with every `backend.OPTION=VALUE`. Raises UsageError if invalid."""
    overrides, problems = parse_overrides(changes)
    if problems:
        raise UsageError("\n".join(str(problem) for problem in problems))
    tree: dict[str, Any] = {}
    for override in overrides:
        tree = replaced(tree, override.keys[1:], override.value)
    options = find_faults(kind.options, tree)
    if isinstance(options, list):
        wrong = ((".".join(map(str, ("backend", *keys))), message) for keys, _, message in options)
        more = f"`campaign kinds {kind.name}` lists the options"
        raise UsageError("\n".join(f"--set {path}: {message}; {more}" for path, message in wrong))
    return options
