"""From the command line to a plan and a backend."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign.archive import find_run
from campaign.backends import backends, calls
from campaign.backends.interface import Backend, BackendKind, SimulatesTruth, Source
from campaign.channels import explained, missing
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
"""The backend that serves what was recorded elsewhere."""


@dataclass(frozen=True)
class Request:
    """What `plan` and `run` have in common, as typed.

    Attributes:
        changes: every `--set`, those of the backend included.
        seed: for tests without their own; drawn when None.
        truth: a bench that is simulated in place of each test's; empty: what the tests say.
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
    """A plan and the backend that is to execute it, not yet connected."""

    path: Path
    plan: Plan
    kind: BackendKind
    options: Options

    def open_backend(self) -> Backend:
        """A backend that accepts every trial of the plan. Raises UsageError when it does not."""
        return open_backend(self.kind, self.options, self.plan.trials, self.plan.truths)


def prepare(request: Request) -> PreparedRun:
    """Load, validate and expand. Raises ProtocolError or UsageError."""
    path = find_protocol(request.protocol)
    kind = find_backend(request.backend)
    ours = tuple(text for text in request.changes if _is_backend_setting(text))
    theirs = tuple(text for text in request.changes if text not in ours)
    options = backend_options(kind, ours)
    protocol = load_protocol(
        path,
        experiments(),
        overrides=theirs,
        shipped=protocols_folder(),
        truth=request.truth,
    )
    _check_recordings(protocol, kind)  # before what only a simulation asks for
    check_benches(protocol, kind.needs, f"the backend {kind.name!r}", request.only)
    options = _with_mapping(options, protocol)
    with _as_executed(protocol, kind) as protocol:
        plan = make_plan(
            protocol, only=request.only, allow_large=request.allow_large, seed=request.seed
        )
    _check_keep(plan, kind)
    return PreparedRun(path, plan, kind, options)


def _check_keep(plan: Plan, kind: BackendKind) -> None:
    """Raise UsageError where samples that are not kept would be missed."""
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
                f"keep = {keep!r}: {trial.kind!r} (test {trial.test!r}) is analysed from samples, "
                "not from metrics alone; leave 'keep' out, or that test (--only)"
            )
    if plan.stages:
        raise UsageError(
            f"keep = {keep!r}: trials of {plan.stages[0].test!r} follow from samples of others; "
            "leave 'keep' out"
        )


def _with_mapping(options: Options, protocol: Protocol) -> Options:
    """A backend that reads files by a mapping has that of the protocol, unless it names one."""
    if protocol.columns and getattr(options, "mapping", None) == "":
        return options.model_copy(update={"mapping": str(protocol.path.resolve())})
    return options


def _as_executed(protocol: Protocol, kind: BackendKind) -> AbstractContextManager[Protocol]:
    """The protocol with the recordings that its tests have in place of trials, if they have any."""
    if kind.name == IMPORT:
        from campaign.importing.recorded_tests import with_recordings

        return with_recordings(protocol)
    return nullcontext(protocol)


def _check_recordings(protocol: Protocol, kind: BackendKind) -> None:
    """Raise ProtocolError where a test has recordings and the backend executes trials."""
    if kind.name == IMPORT:
        return
    for test in protocol.tests:
        if test.entry.recording:
            message = (
                f"the test '{test.entry.name}' was executed elsewhere: `campaign import "
                f"{protocol.path}` makes a run of it, `campaign plan {protocol.path} --backend "
                f"{IMPORT}` shows it"
            )
            raise ProtocolError([test.origin.problem(("recording",), "key", message)])


def open_backend(
    kind: BackendKind,
    options: Options,
    trials: Sequence[Trial],
    truths: Mapping[str, Tree] | None = None,
) -> Backend:
    """A backend that accepts every one of `trials`, not yet connected.

    `truths`: the plants that the trials name, for a backend that simulates them.

    Raises UsageError when it does not, or is known not to record what one of them requires;
    ArchiveError when it does not and the run that it serves is damaged.
    """
    backend = calls.opened(kind, options)
    if isinstance(backend, SimulatesTruth):
        backend.simulate_instead(truths or {})
    elif kind.source is not Source.RECORDING and (named := [t for t in trials if t.truth]):
        raise UsageError(
            f"the test {named[0].test!r} has a truth, and only a simulation can have one that is "
            f"chosen: leave it out, or take another backend than {kind.name!r}"
        )
    if kind.source is not Source.RECORDING and (named := [t for t in trials if t.recording]):
        raise UsageError(
            f"{named[0].name} ({named[0].label}) was executed elsewhere, and nothing here can "
            "repeat it: `campaign import` reads its files again, `--backend replay` its archive"
        )
    source = archive_of(backend)
    refusal = ArchiveError if source is not None and source.damaged else UsageError
    for trial in trials:
        if why := _refused(kind, backend, trial):
            raise refusal(why)
    check_channels(kind, backend, trials)
    return backend


def check_connected(kind: BackendKind, backend: Backend, trials: Iterable[Trial]) -> None:
    """Ask a connected backend again what it could not know before, while nothing has moved.

    Raises UsageError when it refuses one of `trials` now, by what its bench has said of itself, or
    does not record what one requires. Only who moves something is asked for refusals again: for
    the others a trial that is refused later costs nothing but time.
    """
    trials = tuple(trials)
    for trial in trials if kind.live else ():
        if why := _refused(kind, backend, trial):
            raise UsageError(f"{why}; nothing was moved")
    check_channels(kind, backend, trials)


def _refused(kind: BackendKind, backend: Backend, trial: Trial) -> str:
    if not (why := calls.refusal(backend, trial)):
        return ""
    return f"the backend {kind.name!r} cannot execute {trial.name} ({trial.label}): {why}"


def check_channels(kind: BackendKind, backend: Backend, trials: Iterable[Trial]) -> None:
    """Raises UsageError when the backend is known not to record what one of `trials` requires.

    What it cannot know before it is connected is asked again when it is.
    """
    told: dict[tuple[str, tuple[str, ...]], str] = {}  # of several trials alike the first
    for trial in trials:
        known = calls.channels(backend, trial) if trial.requires else None
        names = () if known is None else tuple(missing(trial.requires, known))
        if names and (trial.test, names) not in told:
            told[trial.test, names] = _not_recorded(kind, trial, names)
    if told:
        raise UsageError("\n".join(told.values()))


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
        there = ", ".join(each.name for each in described.channels)
        tables = ", ".join(f"[columns.NAME.{name}]" for name in names)
        return (
            f"{trial.name} ({trial.label}): the experiment {trial.kind!r} requires {what}\n"
            f"its mapping makes {there}: say by {tables} which column it is"
        )
    return (
        f"{trial.name} ({trial.label}): the experiment {trial.kind!r} requires {what}; "
        f"the backend {kind.name!r} does not record it\n"
        f"record it, take another backend, or leave out the test {trial.test!r}; nothing was moved"
    )


def lacking(backend: Backend, trials: Iterable[Trial]) -> dict[str, tuple[str, ...]]:
    """By test, the channels that its analysis can use and that are known not to be recorded."""
    found: dict[str, dict[str, None]] = {}
    for trial in trials:
        known = calls.channels(backend, trial) if trial.can_use else None
        if known is not None and (names := missing(trial.can_use, known)):
            found.setdefault(trial.test, {}).update(dict.fromkeys(names))
    return {test: tuple(names) for test, names in found.items()}


def short_settings(
    port: str | None, source: str | None, results: Path, handover: Path | None = None
) -> tuple[str, ...]:
    """`--port`, `--from`, `--handover` as the `--set` they are short for.

    A run is looked for in `results`; a folder is where it is from here, also at a resume.
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
    """The file `text`; else, of that name, the one in `protocols/` here or the shipped one.

    Which of these two it is stands on standard error. Raises UsageError where there is none.
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
        return path  # a folder: whoever reads it says so
    if path.suffix not in ("", ".toml"):
        raise UsageError(f"{text}: no such file")
    names = shipped_protocols()
    hint = nearest(path.stem, names) or f"; shipped are {', '.join(names)}"
    raise UsageError(f"{text}: no such file, and no protocol of that name{hint}")


def find_backend(name: str) -> BackendKind:
    """The backend of that name. Raises UsageError naming those there are."""
    kinds = backends()
    if name not in kinds:
        raise UsageError(f"there is no backend {name!r}; there are {', '.join(kinds)}")
    return kinds[name]


def backend_options(kind: BackendKind, changes: tuple[str, ...]) -> Options:
    """The backend's options with every `backend.OPTION=VALUE` in its place."""
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


def _is_backend_setting(text: str) -> bool:
    return text.lstrip().startswith("backend.")
