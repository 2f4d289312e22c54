"""Opening an interrupted, killed or faulted run to continue it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from campaign.archive.layout.files import PART, read_errors, sha256_of, why
from campaign.archive.layout.journal import Journal
from campaign.archive.layout.journal_summary import Lines, read_journal
from campaign.archive.layout.names import JOURNAL, PARTIAL, SEALED
from campaign.archive.layout.run_folder import read_header
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.layout.signature_file import set_aside_signature
from campaign.archive.reading.open_run import read_sealed
from campaign.archive.writing.remnants import clear_beginning, is_own
from campaign.archive.writing.run_lock import RunLock
from campaign.errors import ArchiveError, UsageError

RESUMABLE = (RunStatus.INCOMPLETE, RunStatus.INTERRUPTED, RunStatus.FAULT)
"""Statuses of a run that can be resumed."""


def reopen(path: Path) -> tuple[Path, Lines, Journal, RunLock]:
    """The folder of the run at `path`, the content of its journal, the journal, and the lock.

    A folder of a process killed during sealing may be reopened with any status.

    Raises:
        UsageError: the run cannot be resumed, or another process writes it.
        ArchiveError: the run is damaged, or its folder cannot be written; nothing was changed.
    """
    folder, sealed = path.with_suffix(PARTIAL), path.with_suffix(SEALED)
    if path.suffix not in (PARTIAL, SEALED) or not path.exists():
        raise UsageError(f"{path}: is no run")
    with _locked(folder) as lock:
        clear_beginning(folder.parent, folder.stem)
        if sealed.is_file():
            try:
                _check_sealed(sealed)
            except ArchiveError as error:
                raise ArchiveError(f"{error}; it is as it was") from None
            from campaign.archive.writing.unseal_run import unseal

            unseal(sealed)
        set_aside_signature(sealed)  # also one that a crash left without its file
        story = _read_folder(folder)
        journal = Journal(folder / JOURNAL, whole=story.size)
        return folder, story, journal, lock


@contextmanager
def _locked(folder: Path) -> Iterator[RunLock]:
    """Acquire the run's lock; release it if the block fails."""
    try:
        lock = RunLock.acquire(folder.parent, folder.stem)
    except OSError as error:
        raise ArchiveError(f"{folder}: cannot be gone on with: {why(error)}") from None
    try:
        yield lock
    except OSError as error:
        lock.release()
        raise ArchiveError(f"{folder}: cannot be gone on with: {why(error)}") from None
    except BaseException:
        lock.release()
        raise


def _check_sealed(sealed: Path) -> None:
    run = read_sealed(sealed)
    if run.status not in RESUMABLE:
        raise UsageError(
            f"{sealed}: the run has ended ({run.status}); there is nothing to go on with"
        )


def _read_folder(folder: Path) -> Lines:
    """Check the files of the folder and read its journal. Raises ArchiveError with the file."""
    read_header(folder)  # raises if the format is another
    story = read_journal(folder / JOURNAL)
    for finished in story.attempts:
        path = folder / finished.file
        with read_errors(path):
            digest = sha256_of(path)
        if digest != finished.sha256:
            raise ArchiveError(f"{path}: is not what the journal says was written")
    for part in folder.glob(f"*{PART}"):
        if is_own(part.name):
            part.unlink()
    return story
