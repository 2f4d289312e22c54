"""Opening a run: a sealed file, or the folder of a run in progress or of a killed run."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.layout.files import PART, why
from campaign.archive.layout.names import SEALED
from campaign.archive.reading.folder import open_folder
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError


def open_run(path: Path) -> RunReader:
    """Open a sealed run, or the folder of a run in progress.

    Damaged items are left out and listed in `damaged`. Raises ArchiveError with file and place if
    it is not a run, or if its identity or its ending is unreadable.
    """
    if path.is_dir():
        return _open_folder(path)
    if path.suffix == PART:
        raise ArchiveError(f"{path}: was never finished; what was is in the run's folder")
    return read_sealed(path)


def _open_folder(folder: Path) -> RunReader:
    """Read a folder, or its sealed file if the run is sealed during the reading."""
    sealed = folder.with_suffix(SEALED)
    try:
        run = open_folder(folder)
    except (ArchiveError, OSError) as error:
        if sealed.is_file():
            return read_sealed(sealed)
        if isinstance(error, OSError):
            raise ArchiveError(f"{folder}: cannot be read: {why(error)}") from None
        raise
    return read_sealed(sealed) if run.damaged and sealed.is_file() else run


def read_sealed(path: Path) -> RunReader:
    """Read a sealed file of any name."""
    from campaign.archive.reading import sealed_run

    return sealed_run.read_sealed(path)
