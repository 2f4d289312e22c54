"""A run of one trial through the archive and back."""

from __future__ import annotations

import tempfile
from contextlib import closing
from pathlib import Path

import numpy as np

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.open_run import open_run
from campaign.archive.writing.writer import RunWriter
from campaign.errors import CampaignError
from campaign.recording import ChannelInfo, Recording, SafeState
from campaign.testing.backend_under_test import CheckFailedError, require
from campaign.trial import Trial

_AT = "2000-01-01T00:00:00Z"


def archived_as_recorded(
    trial: Trial, channels: tuple[ChannelInfo, ...], recording: Recording
) -> None:
    """Archive, seal and read back the recording. Raises CheckFailedError if they differ."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            path = _sealed(Path(folder), trial, channels, recording)
            run = open_run(path)
            (archived,) = run.trials
            again = archived.recording()
        except (CampaignError, ValueError) as error:
            raise CheckFailedError(f"the recording cannot be archived: {error}") from error
        require(archived.trial.fingerprint == trial.fingerprint, "the trial itself was changed")
        require(list(again.channels) == list(recording.channels), "the channels were changed")
        require(np.array_equal(again.time, recording.time), "the times were changed")
        for name in recording.channels:
            same = np.array_equal(again[name], recording[name], equal_nan=True)
            require(same, f"the samples of {name} were changed")
        require(again.events == recording.events, "the events were changed")
        require(archived.ending == recording.ending, "the ending was changed")


def _sealed(
    folder: Path, trial: Trial, channels: tuple[ChannelInfo, ...], recording: Recording
) -> Path:
    header = RunHeader(name="conformance", created=_AT, trials=1)
    with closing(RunWriter.create(folder, header, [trial])) as writer:
        file = writer.begin(trial)
        file.start(channels)
        file.append(recording.time, np.stack([recording[info.name] for info in channels]))
        for event in recording.events:
            file.event(event)
        file.finish(recording.ending, _AT, _AT)
        return writer.seal(RunStatus.COMPLETE, "", SafeState.CONFIRMED, ended=_AT)
