"""The backend of imported recordings: served from their files (`campaign import`).

Each trial describes the source of its samples; this backend reads them. A file that has changed
since the plan was made ends its trial as a fault.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack

from campaign.backends.interface import BackendKind, Source, StopFlag
from campaign.importing.description import RecordingDescription
from campaign.importing.interface import RecordingError
from campaign.importing.open_files import OpenedFiles
from campaign.importing.reader import RecordingReader, paths_unchanged
from campaign.options import Options
from campaign.recording import Ending, Event, Fault, Outcome, Recorder, SafeState, record
from campaign.trial import Trial


class ImportOptions(Options):
    """The import has no options: each trial states the source of its samples."""


class ImportBackend:
    """Serves trials whose `recording` describes files."""

    def __init__(self) -> None:
        self._stack = ExitStack()
        # One file may contain several trials; each thread opens and reads it once.
        self._kept = threading.local()

    def __enter__(self) -> ImportBackend:
        return self

    def __exit__(self, *exception: object) -> None:
        self._stack.close()

    def refuses(self, trial: Trial) -> str | None:
        """Why `trial` has no recording; None if it has one."""
        return None if trial.recording else "nothing was recorded elsewhere for it"

    def channels(self, trial: Trial) -> frozenset[str]:
        """Channels in its files, and channels derived from them."""
        return frozenset(each.name for each in _described(trial).channels)

    def execute(self, trial: Trial, recorder: Recorder, stop: StopFlag) -> Ending:
        """Copy the samples of the trial's files according to its description."""
        described = _described(trial)
        try:
            reader = RecordingReader(described, self._opened(described))
            recorder.start(tuple(each.info for each in described.channels))
            for remark in described.remarks:
                recorder.event(Event(0.0, remark))
            for time, samples, lost in reader.blocks():
                if stop():
                    return Ending(Outcome.INTERRUPTED, "stopped by the operator")
                record(recorder, time, samples, lost)
        except RecordingError as error:
            return Ending(Outcome.FAULT, str(error), fault=Fault.OTHER)
        return Ending(Outcome.COMPLETED)

    def make_safe(self) -> SafeState:
        """Confirm: this backend moves nothing."""
        return SafeState.CONFIRMED

    def _opened(self, described: RecordingDescription) -> OpenedFiles:
        key = (described.files, described.table, described.channels, described.clock)
        if getattr(self._kept, "key", None) != key:
            opened = OpenedFiles(paths_unchanged(described))
            self._stack.push(opened)
            self._kept.key, self._kept.opened = key, opened
        opened_files: OpenedFiles = self._kept.opened
        return opened_files


def _described(trial: Trial) -> RecordingDescription:
    return RecordingDescription.model_validate(trial.recording, context={"si": True})


BACKEND = BackendKind(
    name="import",
    summary="existing recordings, described by a mapping",
    options=ImportOptions,
    open=lambda options: ImportBackend(),
    source=Source.RECORDING,
    several=True,
)
