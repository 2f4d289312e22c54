"""The header of a run: facts known before its first trial, and its final status."""

from __future__ import annotations

import re
from datetime import datetime
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from campaign.trial import Role, Tree, Trial

FORMAT = 3
"""Version of the archive format (`docs/developers/archive-format.md`); the only readable one."""


def _run_name(name: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._+-]{0,199}", name):
        raise ValueError(f"{name!r} is not a run's name: letters, digits, '.', '_', '+' and '-'")
    return name


def _timestamp(text: str) -> str:
    if datetime.fromisoformat(text).tzinfo is None:
        raise ValueError(f"{text!r} has no time zone; timestamps are ISO 8601 in UTC")
    return text


Timestamp = Annotated[str, AfterValidator(_timestamp)]


class ArchivedModel(BaseModel):
    """Frozen, and tolerant of fields that a later program added."""

    model_config = ConfigDict(extra="ignore", frozen=True)


class Truth(ArchivedModel):
    """Plants simulated in place of the stated benches; analyses do not receive them."""

    option: str = ""
    """File of `--truth`, absolute; empty if tests name their own."""
    sources: dict[str, str] = {}
    """Verbatim text of each truth, by its name as written."""
    plants: dict[str, Tree] = {}
    """Simulated plants by digest, which is the `truth` of a trial: benches without controller,
    compensation and limits, SI."""


class RunHeader(ArchivedModel):
    """Facts of a run, known before its first trial. All are archived."""

    name: Annotated[str, AfterValidator(_run_name)]
    """The run's name, unique in its results folder: see `naming`."""
    created: Timestamp
    """Start of the run, ISO 8601 with a time zone."""
    title: str = ""
    description: str = ""
    protocol_name: str = ""
    """Name of the protocol, e.g. `quickstart`."""
    protocol_path: str = ""
    """The protocol's file, absolute: a resume makes the plan from it again."""
    sources: dict[str, str] = {}
    """Protocol, included protocols and benches, verbatim, by their path in the protocol."""
    truth: Truth = Truth()
    """Plants simulated in place of the stated benches, if any."""
    normalised: Tree = {}
    """The protocol after validation: SI, defaults filled in, includes and benches resolved."""
    tests: tuple[Tree, ...] = ()
    """Per test: name, kind, title, description, `reproduces`, normalized options ..."""
    trials: int = Field(default=0, ge=0)
    """Number of planned trials."""
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
    """Source of the backend's samples: `simulation`, `hardware` or `recording`."""
    backend_options: Tree = {}
    overrides: dict[str, str] = {}
    """Changes by `--set`, dotted path to value as written."""
    only: tuple[str, ...] = ()
    """Tests selected by `--only`; empty for all."""
    git_revision: str = ""
    """Revision of the protocol's working tree, if any."""
    seed: int | None = None
    """Run seed; tests without a seed of their own derive theirs from it."""
    fingerprint: str = ""
    """SHA-256 of the normalized protocol in canonical JSON."""


class PlannedTrial(ArchivedModel):
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
