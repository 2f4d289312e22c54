"""The header of a run: facts known before its first trial, and its final status."""

from __future__ import annotations

import re
from datetime import datetime
from enum import StrEnum
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from campaign.trial import Role, Tree, Trial

FORMAT = 3
"""Version of the archive format (`docs/developers/archive-format.md`); the only readable one."""

SEALED = ".nxs"
PARTIAL = ".partial"


class RunStatus(StrEnum):
    """Status of a run. Sealing writes every status except `INCOMPLETE`."""

    COMPLETE = "complete"  # every planned trial completed
    FAILED_TRIALS = "failed trials"  # the plan was executed; some trials did not complete
    INTERRUPTED = "interrupted"  # an operator stopped it
    FAULT = "fault"  # the backend, the bench or the archive failed
    INCOMPLETE = "incomplete"  # in progress, or killed: no end is recorded


def _run_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,199}", name):
        raise ValueError(f"{name!r} is not a run's name: letters, digits, '.', '_', '+' and '-'")
    return name


def _timestamp(text: str) -> str:
    if datetime.fromisoformat(text).tzinfo is None:
        raise ValueError(f"{text!r} has no time zone; timestamps are ISO 8601 in UTC")
    return text


Timestamp = Annotated[str, AfterValidator(_timestamp)]


class _Record(BaseModel):
    """Frozen, and tolerant of fields that a later program added."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Truth(_Record):
    """What was simulated in place of the stated benches; nothing that an analysis is given."""

    option: str = ""
    """The file that `--truth` named, absolute; empty where tests name theirs."""
    sources: dict[str, str] = {}
    """Verbatim text of every truth, by its name as written."""
    plants: dict[str, Tree] = {}
    """What a trial's samples were simulated with, by the digest that is the trial's `truth`: a
    bench without controller, compensation and limits, SI."""


class RunHeader(_Record):
    """What is known about a run before its first trial. All of it is archived."""

    name: Annotated[str, AfterValidator(_run_name)]
    """The run's name, unique in its results folder: see `naming`."""
    created: Timestamp
    """When the run began, ISO 8601 with a time zone."""
    title: str = ""
    description: str = ""
    protocol_name: str = ""
    """What people call the protocol, e.g. `quickstart`."""
    protocol_path: str = ""
    """The protocol's file, absolute: from there a resume makes the plan again."""
    sources: dict[str, str] = {}
    """Protocol, included protocols and benches, verbatim, by the path the protocol names them."""
    truth: Truth = Truth()
    """What was simulated in place of the stated benches, where that is something else."""
    normalised: Tree = {}
    """The protocol after validation: SI, defaults filled in, includes and benches resolved."""
    tests: tuple[Tree, ...] = ()
    """Per test: name, kind, title, description, what it reproduces, normalised options ..."""
    trials: int = Field(default=0, ge=0)
    """How many trials are planned."""
    versions: dict[str, str] = {}
    """Python, this program and the libraries that made the samples."""
    plugins: tuple[Tree, ...] = ()
    """Per kind of an installed package: room, name, distribution, version, entry_point, sha256."""
    host: dict[str, str] = {}
    """The machine: name, system, processor."""
    command: tuple[str, ...] = ()
    """The command line."""
    operator: str = ""
    notes: str = ""
    tags: tuple[str, ...] = ()
    backend: str = ""
    source: str = ""
    """Where the backend's samples come from: `simulation`, `hardware` or `recording`."""
    backend_options: Tree = {}
    overrides: dict[str, str] = {}
    """What `--set` changed, dotted path to value as written."""
    only: tuple[str, ...] = ()
    """The tests that `--only` chose; empty for all."""
    git_revision: str = ""
    """Revision of the working tree the protocol lies in, where there is one."""
    seed: int | None = None
    """From which the tests without a seed of their own got theirs."""
    fingerprint: str = ""
    """SHA-256 of the normalised protocol in canonical JSON."""


class PlannedTrial(_Record):
    """A trial of the plan, whether or not it was executed."""

    number: int = Field(ge=1)
    test: str
    kind: str
    role: Role = Role.MEASUREMENT
    label: str
    fingerprint: str

    @classmethod
    def of(cls, trial: Trial) -> Self:
        return cls(
            number=trial.number,
            test=trial.test,
            kind=trial.kind,
            role=trial.role,
            label=trial.label,
            fingerprint=trial.fingerprint,
        )
