"""The journal of a run in progress: one line for each finished step.

One JSON object per line, appended and synced before the step is reported. A kill can truncate only
the last line; a truncated line was never reported, so a reader skips it.
"""

from __future__ import annotations

import json
import os
import threading
from datetime import UTC, datetime
from itertools import accumulate
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter, field_serializer

from campaign.archive.layout.files import why
from campaign.archive.layout.header import PlannedTrial
from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ArchiveError
from campaign.estimate import Estimate
from campaign.recording import Outcome, SafeState
from campaign.trial import Tree, canonical_json

_ESTIMATE = TypeAdapter(Estimate)


class _Line(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    def model_post_init(self, context: object) -> None:
        """Clear the set of given fields: it is not used, and takes half of the memory."""
        self.__pydantic_fields_set__.clear()


class RunStarted(_Line):
    """The first line."""

    event: Literal["run started"] = "run started"
    at: str
    run: str
    format: int
    trials: int


class RunResumed(_Line):
    """Resume of an interrupted or killed run; later lines belong to it.

    `changes`: accepted differences from the conditions at the start of the run.
    """

    event: Literal["run resumed"] = "run resumed"
    at: str
    host: dict[str, str] = {}
    versions: dict[str, str] = {}
    command: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()


class OperatorStep(_Line):
    """Manual step of the operator at the bench, and the answer."""

    event: Literal["operator step"] = "operator step"
    at: str
    trial: int = Field(ge=1)
    step: str
    answer: str


class Decision(_Line):
    """Deviation from the plan: a retry, a skipped trial, an abort, a rest ..."""

    event: Literal["decision"] = "decision"
    at: str
    trial: int | None = None
    decision: str = Field(pattern=r"^[a-z -]{1,40}$")
    reason: str


class FollowedTrial(PlannedTrial):
    """A trial of a stage: its line of the plan, and its tree as in `plan-trials.jsonl`."""

    trial: Tree


class TrialRefused(_Line):
    """A trial of a stage that must not be executed, and the reason."""

    label: str
    why: str


class TrialsFollowed(_Line):
    """Trials of a stage of a test, at one point of its matrix.

    Attributes:
        stage: its number; the planned trials are stage 1.
        trials: accepted trials, numbered after all earlier ones.
        trees: benches and options that they name, by digest.
        reason: reason for no trials, if the stage itself failed.
    """

    event: Literal["trials followed"] = "trials followed"
    at: str
    test: str
    stage: int = Field(ge=2)
    name: str
    point: Tree = {}
    reason: str = ""
    trials: tuple[FollowedTrial, ...] = ()
    trees: dict[str, Tree] = {}
    refused: tuple[TrialRefused, ...] = ()

    @property
    def title(self) -> str:
        """Display text: `sweep at compensation = none, stage 2 (refinement)`."""
        point = ", ".join(f"{path} = {value}" for path, value in self.point.items())
        return f"{self.test}{f' at {point}' if point else ''}, stage {self.stage} ({self.name})"


class TrialFinished(_Line):
    """A trial ended, with any outcome, and its file is on the disk under its final name.

    `record` is the digest of the trial's record.
    """

    event: Literal["trial finished"] = "trial finished"
    at: str
    trial: int = Field(ge=1)
    attempt: int = Field(default=1, ge=1)
    file: str = Field(pattern=r"^trial-[0-9]{5,10}(-[0-9]{1,6})?\.(?:trial|nxs)$")
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    record: str = Field(pattern=r"^[0-9a-f]{64}$")
    bytes: int = Field(ge=0)
    outcome: Outcome
    reason: str
    safe_state: SafeState


class TrialMeasured(_Line):
    """Metrics of a recording, computed after its trial was written to the disk.

    Attributes:
        record: digest of the trial's record, which identifies the measured samples.
        by: code that computed the metrics, with its version.
        estimates: finite, with different names.
    """

    event: Literal["trial measured"] = "trial measured"
    at: str
    trial: int = Field(ge=1)
    attempt: int = Field(default=1, ge=1)
    record: str = Field(pattern=r"^[0-9a-f]{64}$")
    by: str
    estimates: tuple[Estimate, ...]

    @field_serializer("estimates")
    def _as_in_a_record(self, estimates: tuple[Estimate, ...]) -> list[Tree]:
        """Leave out fields that have their default."""
        return [_ESTIMATE.dump_python(e, mode="json", exclude_defaults=True) for e in estimates]


class TrialAbandoned(_Line):
    """A trial was started and nothing of it is kept."""

    event: Literal["trial abandoned"] = "trial abandoned"
    at: str
    trial: int = Field(ge=1)
    reason: str


class RunEnded(_Line):
    """The run is closed, and sealed now or soon; only a resume may follow."""

    event: Literal["run ended"] = "run ended"
    at: str
    status: RunStatus
    reason: str
    safe_state: SafeState


Entry = Annotated[
    RunStarted
    | RunResumed
    | OperatorStep
    | Decision
    | TrialsFollowed
    | TrialFinished
    | TrialMeasured
    | TrialAbandoned
    | RunEnded,
    Field(discriminator="event"),
]
ENTRY: TypeAdapter[Entry] = TypeAdapter(Entry)


def utc_now() -> str:
    """The wall clock in the form of the journal: ISO 8601, UTC, resolution 1 ms."""
    return datetime.now(UTC).isoformat(timespec="milliseconds")


class Journal:
    """Writer of a journal; each line is on the disk when `append` returns. Thread-safe."""

    def __init__(self, path: Path, *, whole: int | None = None) -> None:
        """`whole`: size of the complete lines (bytes); the rest, left by a crash, is removed."""
        self._path = path
        self._lock = threading.Lock()
        self._descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
        if whole is not None:
            os.ftruncate(self._descriptor, whole)
            os.fsync(self._descriptor)

    def append(self, *entries: Entry) -> list[int]:
        """Add a line for each entry; return their offsets, for `entry`.

        Raises ArchiveError if the write fails; the journal then stays unchanged.
        """
        texts = [f"{canonical_json(each.model_dump(mode='json'))}\n".encode() for each in entries]
        lines = b"".join(texts)
        with self._lock:
            before = os.fstat(self._descriptor).st_size
            try:
                written = os.write(self._descriptor, lines)
                if written < len(lines):
                    raise OSError("no space for whole lines")
                os.fsync(self._descriptor)
            except OSError as error:
                os.ftruncate(self._descriptor, before)
                raise ArchiveError(f"{self._path}: cannot be written: {why(error)}") from None
        return list(accumulate(map(len, texts), initial=before))[:-1]

    def entry(self, place: int) -> Entry:
        """The line at an offset. Raises ArchiveError."""
        try:
            with self._path.open("rb") as file:
                file.seek(place)
                return ENTRY.validate_python(json.loads(file.readline()))
        except (OSError, ValueError) as error:
            raise ArchiveError(f"{self._path}: cannot be read: {why(error)}") from None

    def close(self) -> None:
        with self._lock:
            if self._descriptor >= 0:
                os.close(self._descriptor)
                self._descriptor = -1
