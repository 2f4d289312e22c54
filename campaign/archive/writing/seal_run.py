"""Conversion of the folder of a run to its sealed file.

The file is written in the folder during the trials (`Sealer`), so that a long campaign does not end
with a long wait. Until it is complete, checked and renamed, it is only a copy of the folder's trial
files and journal, from which it can be made again at any time.
"""

from __future__ import annotations

import contextlib
import shutil
from pathlib import Path

from campaign.archive.layout.files import publish, why
from campaign.archive.layout.journal import TrialFinished
from campaign.archive.layout.journal_summary import read_journal
from campaign.archive.layout.names import JOURNAL, SEALED, SEALING, entry_name, entry_names
from campaign.archive.layout.run_folder import read_header
from campaign.archive.writing.remnants import remove_folder
from campaign.archive.writing.sealed_file import SealedFile, check_sealed
from campaign.errors import ArchiveError
from campaign.recording import Outcome

_FREE = 1 << 28  # bytes of disk that stay free for the trials during copying
_FAILURES = (OSError, RuntimeError, ValueError, ArchiveError)


def seal_folder(folder: Path, begun: SealedFile | None = None) -> Path:
    """Make one file of a run's folder, check it, and only then remove the folder.

    The folder's journal lists the trials. `begun` has the copies of some of them. Raises
    ArchiveError if a trial differs from the journal or the disk is full; the folder then stays
    unchanged, without a sealed file.
    """
    sealed, part = folder.with_suffix(SEALED), folder / SEALING
    try:
        story = read_journal(folder / JOURNAL)
        if story.ended is None:
            raise ArchiveError(f"{folder / JOURNAL}: the run has not ended")
        wanted = entry_names(story.attempts)
        if begun is not None and not begun.is_part_of(wanted):
            begun.discard()
            begun = None
        file = begun or SealedFile(part)
        try:
            for entry, finished in wanted.items():
                if entry not in file.copied:
                    file.copy(folder, finished, entry)
            file.finish(folder, read_header(folder), story, story.ended)
        except BaseException:
            file.discard()
            raise
        check_sealed(part, file)
        file.put_hash()
        publish(part, sealed)
    except _FAILURES as error:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
        raise ArchiveError(
            f"{sealed}: could not be sealed: {why(error)}; every finished trial is in {folder}"
        ) from None
    with contextlib.suppress(OSError):  # a remnant is harmless: readers prefer the sealed file
        remove_folder(folder)
    return sealed


class Sealer:
    """Copies trials into the sealed file during execution, one for each call of `advance`.

    One thread calls it. A thread of its own would only wait for h5py's single lock.

    Trials are copied in the order of the plan, so that equal runs give equal files, independent of
    the load of the machine: a trial waits for those before it. A trial that did not complete at the
    first attempt, and may be repeated, is copied at the end. An error here costs only time: `seal`
    then starts again.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._file: SealedFile | None = None
        self._first: dict[int, TrialFinished] = {}
        self._next = 1
        self._gave_up = False

    def add(self, finished: TrialFinished) -> None:
        """Register a trial whose file is on the disk and whose line is in the journal."""
        self._first.setdefault(finished.trial, finished)

    def advance(self, fewest: int = 1) -> bool:
        """Copy the next trial if it has finished and at least `fewest` finished trials wait.

        Errors end copying. Returns whether a copy was tried.
        """
        if self._gave_up or self._next not in self._first or len(self._first) < fewest:
            return False
        try:
            self._copy(self._first.pop(self._next))
            self._next += 1
        except BaseException as error:
            self.discard()
            if not isinstance(error, _FAILURES):
                raise
        return True

    def seal(self) -> Path:
        """Complete the file: `seal_folder`."""
        begun, self._file = self._file, None
        self._gave_up = True
        return seal_folder(self._folder, begun)

    def discard(self) -> None:
        """Remove the file; nothing is copied any more."""
        self._gave_up = True
        if self._file is not None:
            self._file.discard()
            self._file = None

    def _copy(self, first: TrialFinished) -> None:
        if first.outcome is not Outcome.COMPLETED or first.attempt != 1:
            return
        if shutil.disk_usage(self._folder).free < _FREE + 2 * first.bytes:
            raise ArchiveError("the room that is left is for the trials")
        if self._file is None:
            self._file = SealedFile(self._folder / SEALING)
        self._file.copy(self._folder, first, entry_name(first.trial))
