"""Writing trials into the folder of a run, in a process without its journal."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from campaign.archive.layout.files import publish_all
from campaign.archive.layout.journal import Entry
from campaign.policy import KEEP_ALL, SampleRetention
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Trial

if TYPE_CHECKING:
    from campaign.archive.writing.trial_writer import TrialWriter


class FolderWriter:
    """Writer of trials into the folder of a run, for a process without the journal.

    Finished trials become valid when `publish` puts them on the disk together.

    Args:
        folder: folder of the run.
        attempts: number of this attempt at each trial, by trial number.
    """

    def __init__(self, folder: Path, attempts: Mapping[int, int], timing: Timing = UNTIMED) -> None:
        self._folder = folder
        self._attempts = attempts
        self._timing = timing
        self._entries: list[Entry] = []
        self._files: list[tuple[Path, Path]] = []

    def begin(self, trial: Trial, keeping: SampleRetention = KEEP_ALL) -> TrialWriter:
        """As `RunWriter.begin`."""
        from campaign.archive.writing.trial_writer import TrialWriter

        note, attempt = self._entries.append, self._attempts[trial.number]

        def publish(part: Path, final: Path) -> Path:
            self._files.append((part, final))
            return part

        not_kept = keeping.rule(trial, attempt)
        return TrialWriter(self._folder, trial, attempt, note, self._timing, not_kept, publish)

    def publish(self) -> None:
        """Put the finished trials on the disk. If it raises ArchiveError, none is valid."""
        from campaign.archive.writing.trial_writer import lost_trial

        files, self._files = self._files, []
        try:
            with self._timing.span(Work.TRIAL_FILES):
                publish_all(files)
        except OSError as error:
            for part, _ in files:
                with contextlib.suppress(OSError):
                    part.unlink(missing_ok=True)
            raise lost_trial(files[0][0], error, count=len(files)) from None

    def take_files(self) -> dict[str, bytes]:
        """Contents of the finished trials, by file name; the files are removed from the folder."""
        files, self._files = self._files, []
        contents = {final.name: part.read_bytes() for part, final in files}
        for part, _ in files:
            part.unlink()
        return contents

    def take_entries(self) -> tuple[Entry, ...]:
        """The journal entries since the last call."""
        taken = tuple(self._entries)
        self._entries.clear()
        return taken
