"""The `files` backend: exports trials as files, imports recordings as files.

A person executes the files of a trial on any controller and puts the recording into the folder. The
backend reads it by the layout of a mapping and compares it with the trial. It refuses the recording
with a reason, or records it like other hardware. See `docs/handover.md`.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from pydantic import Field, JsonValue, field_validator

from campaign.backends.handover import checks
from campaign.backends.handover.acceptance import (
    RefusedRecording,
    accepted_recording,
    not_completed,
)
from campaign.backends.handover.columns import first_mapping, layout_of, read_layouts
from campaign.backends.handover.excitation import excitation, facts_of, write_csv, write_mat
from campaign.backends.handover.handover_folder import (
    MANIFEST,
    PAGE,
    RETURNED,
    Attempt,
    Came,
    Places,
    Verdict,
    came_by,
    new_folder,
    read_json,
    write_text,
)
from campaign.backends.handover.pages import Row, attempt_page, columns_file, first_page, manifest
from campaign.backends.handover.returned_recording import (
    ColumnsError,
    OtherRateError,
    ReturnedRecording,
    read_returned,
)
from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.errors import ProtocolError, UsageError
from campaign.importing.derived_channels import sufficient
from campaign.importing.description import file_used
from campaign.importing.interface import RecordingError
from campaign.importing.mapping import Layout, MappingError
from campaign.link.refusal import Refusal
from campaign.options import Options
from campaign.physics.limit_watch import WATCHED
from campaign.plain_text import json_text
from campaign.recording import Ending, Event, Fault, Outcome, Recorder, SafeState, record
from campaign.trial import Trial, canonical_json
from campaign.units import Time

GLANCE = 0.2
"""s between two polls of a folder."""
BLOCK = 1000
"""samples that are recorded between two checks of the stop flag."""
WEEK = 604800.0
CLIPPING = "clipping"
"""Word of a layout that accepts a clipped channel."""
DEFECTS = {"sign": "wrong sign", "factor": "wrong scale", CLIPPING: "clipped"}
"""Reason of refusal by the defect that the reader reports."""
NOT_IN_PROGRESS = "The run is not in progress now: what is handed in is read when it is resumed."


class FilesOptions(Options):
    """Options of a hand-over."""

    folder: str = ""
    """Folder for trials and their recordings; `--handover` sets it too."""
    mapping: str = ""
    """File with `[columns.NAME]`, which describe the columns of recordings. Absent: those of the
    protocol, or else `columns.toml` in the folder; the run writes its first version."""
    columns: str = ""
    """NAME of the columns for all recordings; absent: the only one, or the one named as the test,
    or as the mode of the task."""
    wait: Time = Field(default=WEEK, ge=0)
    """Longest wait for a recording. Then the run ends as interrupted; with 0 s it ends at once.
    `campaign resume` continues it when the recording is available."""
    ahead: int = Field(default=100, ge=0, le=100_000)
    """Number of trials to hand out beyond the one that is due."""
    settle: Time = Field(default=5.0, gt=0, le=3600)
    """A recording without the mark `done` is complete after this time without a change."""
    motion: Literal["none", "table"] = "none"
    """Source of hull motion: none, or a table that plays the column `base_acceleration`."""

    @field_validator("folder", "mapping")
    @classmethod
    def _absolute(cls, path: str) -> str:
        return str(Path(path).resolve()) if path else ""


class FilesBackend:
    """Exports trials and imports their recordings, one trial at a time."""

    def __init__(self, options: FilesOptions) -> None:
        self._options = options
        self._folder = Path(options.folder)
        self._places = Places(self._folder)
        self._refusal = Refusal(
            base_motion=options.motion == "table",
            remedy="`--set backend.motion=table` says that a table does as the files say",
        )
        self._trials: dict[int, Trial] = {}
        self._came: dict[str, Came] = {}
        self._run = ""
        self._begun = False

    def introduce(self, run: str) -> None:
        """Set the run that owns the folder."""
        self._run = run

    def __enter__(self) -> FilesBackend:
        if not self._options.folder:
            raise UsageError("the backend 'files' needs a folder: --handover FOLDER")
        self._places.check_owner(self._run)
        if self._mapping.exists() or self._options.mapping:
            read_layouts(self._mapping)
        return self

    def __exit__(self, *exception: object) -> None:
        if self._begun:
            self._list("", NOT_IN_PROGRESS)

    def refuses(self, trial: Trial) -> str | None:
        """Why no rig could execute `trial`, or None."""
        why = self._refusal(trial)
        if why is None:
            self._trials[trial.number] = trial
        return why

    def channels(self, trial: Trial) -> frozenset[str] | None:
        """Channels of the layout, and channels derived from them; None without a layout."""
        if not self._options.mapping and not (self._options.folder and self._mapping.exists()):
            return None
        try:
            known = read_layouts(self._mapping)
            layout = layout_of(trial, known, self._options.columns, self._mapping)
        except ProtocolError:
            return None  # reported on entering
        return sufficient(layout.channels, facts_of(trial))

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Export `trial`, wait for its recording, compare it with the trial, record it."""
        self._trials.setdefault(trial.number, trial)
        self._begin()
        attempt = self._hand_out(trial)
        self._hand_out_ahead(trial)
        self._list(trial.name, f"Waiting for the recording of {attempt.name}.")
        files = self._wait_for(attempt, stop)
        if isinstance(files, Ending):
            return files
        used = _digests(files)
        telemetry: dict[str, JsonValue] = {
            "handed_in": ", ".join(used),
            "handover_attempt": attempt.number,
            "safe_state_by": "whoever handed it in",
        }
        try:
            layout = layout_of(
                trial, read_layouts(self._mapping), self._options.columns, self._mapping
            )
            tree = layout.model_dump(mode="json", exclude_defaults=True)
            read_by = hashlib.sha256(canonical_json(tree).encode()).hexdigest()
            self._check_whose(trial, attempt, used, read_by)
            recording = self._taken(trial, files, layout)
        except (ProtocolError, MappingError, ColumnsError) as error:
            reason = f"the hand-over: the recording of {attempt.name} is not understood: {error}"
            return Ending(Outcome.INTERRUPTED, reason, telemetry=telemetry)
        except RefusedRecording as refused:
            reason = str(refused.found)
            self._judge(attempt, Verdict(reason, used, read_by))
            if refused.recording is not None:
                _record(refused.recording, recorder, lambda: False)  # as evidence
            return Ending(Outcome.FAULT, reason, fault=Fault.RECORDING, telemetry=telemetry)
        self._judge(attempt, Verdict(not_completed(trial, recording), used, read_by))
        if not _record(recording, recorder, stop):
            return Ending(Outcome.INTERRUPTED, "stopped by the operator", telemetry=telemetry)
        return Ending(Outcome.COMPLETED, telemetry=telemetry)

    def make_safe(self) -> SafeState:
        """Confirm: the program moves nothing. The person who returns a recording confirms rest."""
        return SafeState.CONFIRMED

    # Handing out

    @property
    def _mapping(self) -> Path:
        return Path(self._options.mapping) if self._options.mapping else self._places.columns

    def _begin(self) -> None:
        if self._begun:
            return
        self._places.claim(self._run)
        if not self._mapping.exists() and not self._options.mapping:
            write_text(self._mapping, first_mapping(list(self._trials.values())))
        self._came = self._places.came()
        self._begun = True

    def _hand_out_ahead(self, trial: Trial) -> None:
        later = sorted(number for number in self._trials if number > trial.number)
        for number in later[: self._options.ahead]:
            if not self._places.attempts(number):
                self._hand_out(self._trials[number])

    def _hand_out(self, trial: Trial) -> Attempt:
        """The due attempt; its files are written if they do not exist."""
        attempt, is_out = self._places.next_attempt(trial)
        if is_out:
            return attempt
        series = excitation(trial)
        verdicts = [each.verdict for each in self._places.attempts(trial.number)]
        before = [verdict.reason for verdict in verdicts if verdict and verdict.reason]
        mapping = columns_file(self._mapping, self._folder)
        with new_folder(attempt.folder) as folder:
            write_csv(series, folder / "excitation.csv")
            write_mat(series, trial, attempt.number, folder / "excitation.mat")
            tree = manifest(trial, attempt, self._run, series, before)
            write_text(folder / MANIFEST, json_text(tree) + "\n")
            write_text(folder / PAGE, attempt_page(trial, attempt, series, before, mapping))
            (folder / RETURNED).mkdir()
        return attempt

    def _list(self, due: str, state: str) -> None:
        """Write the page of all trials with their present state."""
        rows = []
        for number in sorted({*self._trials, *self._places.trials()}):
            attempts = self._places.attempts(number)
            known = self._trials.get(number)
            rows.append(Row.of_trial(known, attempts) if known else Row.of_manifest(attempts))
        mapping = columns_file(self._mapping, self._folder)
        write_text(self._folder / PAGE, first_page(self._run, rows, due, state, mapping))

    # Waiting

    def _wait_for(self, attempt: Attempt, stop: StopFlag) -> list[Path] | Ending:
        """Files of the complete recording, or the ending if the wait is over."""
        began = time.monotonic()
        seen: list[tuple[str, int, int]] = []
        since = began
        while not stop():
            files, now = attempt.files, time.monotonic()
            if files and attempt.is_marked:
                return attempt.files  # the mark is written last: list all files again
            state = _state(files)
            if state != seen:
                seen, since = state, now
            if files and now - since >= self._options.settle:
                return files
            if not files and now - began >= self._options.wait:
                where = attempt.returned.relative_to(self._folder).as_posix()
                return Ending(Outcome.INTERRUPTED, f"the hand-over: nothing is back yet in {where}")
            time.sleep(min(GLANCE, self._options.settle))
        return Ending(Outcome.INTERRUPTED, "stopped by the operator while the rig had the trial")

    # Taking in

    def _taken(self, trial: Trial, files: Sequence[Path], layout: Layout) -> ReturnedRecording:
        """Read the recording and check it against the trial.

        Raises RefusedRecording, and errors of reading.
        """
        wanted = {*trial.requires, *trial.can_use, *(each.channel for each in WATCHED)}
        others = [each for number, each in sorted(self._trials.items()) if number != trial.number]
        accepted = {n for n, column in layout.channels.items() if CLIPPING in column.accept}
        try:
            recording = read_returned(trial, files, layout, wanted)
        except OtherRateError as error:
            raise RefusedRecording(checks.RecordingProblem("another rate", str(error))) from None
        except RecordingError as error:
            raise RefusedRecording(checks.RecordingProblem("unreadable", str(error))) from None
        except MappingError as error:
            if error.of_columns and not error.defect:
                raise
            name = DEFECTS.get(error.defect, error.defect or "no even clock")
            raise RefusedRecording(checks.RecordingProblem(name, str(error))) from None
        return accepted_recording(trial, recording, others, accepted)

    def _check_whose(
        self, trial: Trial, attempt: Attempt, used: Mapping[str, str], read_by: str
    ) -> None:
        """Raise RefusedRecording for files that were returned for another attempt.

        A refused file may be returned again for its own trial after a correction of the columns:
        the rig need not repeat the trial.
        """
        for name, digest in used.items():
            came = self._came.get(digest)
            if came is None or came.attempt == attempt.name:
                continue
            if came.trial == trial.number and came.columns != read_by:
                continue
            reason = f"{name} is, to the last byte, what came back for {came.attempt}"
            raise RefusedRecording(checks.RecordingProblem("the same file", reason))
        returned_manifest = read_json(attempt.returned / MANIFEST)
        if (
            returned_manifest is not None
            and returned_manifest.get("fingerprint") != trial.fingerprint
        ):
            reason = f"the manifest beside it is that of {returned_manifest.get('name')}"
            raise RefusedRecording(checks.RecordingProblem("another trial", reason))

    def _judge(self, attempt: Attempt, verdict: Verdict) -> None:
        attempt.judge(verdict)
        self._came |= came_by(attempt, verdict)


def _record(recording: ReturnedRecording, recorder: Recorder, stop: StopFlag) -> bool:
    """Record all samples; False after a stop. The file remains for a resume."""
    recorder.start(recording.channels)
    for remark in recording.remarks:
        recorder.event(Event(0.0, remark))
    for first in range(0, len(recording.time), BLOCK):
        if stop():
            return False
        block = slice(first, first + BLOCK)
        record(recorder, recording.time[block], recording.samples[:, block], recording.lost[block])
    return True


def _digests(files: Sequence[Path]) -> dict[str, str]:
    """SHA-256 by file name; empty for an unreadable file, which is reported on opening."""
    digests = {}
    for path in files:
        try:
            digests[path.name] = file_used(path, path.name).sha256
        except RecordingError:
            digests[path.name] = ""
    return digests


def _state(files: Sequence[Path]) -> list[tuple[str, int, int]]:
    """Name, size and modification time of each file, to detect changes."""
    state = []
    for path in files:
        try:
            about = path.stat()
        except OSError:
            continue
        state.append((path.name, about.st_size, about.st_mtime_ns))
    return state


BACKEND = BackendKind(
    name="files",
    summary="any rig, by hand: exchange of trial and recording files",
    options=FilesOptions,
    open=FilesBackend,
    source=Source.HARDWARE,
    by_hand=True,
    needs=("limits",),
)
