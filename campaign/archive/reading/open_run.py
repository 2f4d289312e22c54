"""Opening a run: a sealed file, or the folder of a run in progress or of a killed run."""

from __future__ import annotations

from pathlib import Path

from campaign.archive.layout.files import PART, why
from campaign.archive.layout.header import SEALED
from campaign.archive.layout.results import ENDING, ENTRY
from campaign.archive.layout.run_folder import check_format
from campaign.archive.reading.folder import open_folder
from campaign.archive.reading.run_reader import Glance, RunReader
from campaign.errors import ArchiveError

IMPORT = "; `campaign import` makes one of what other programs recorded"


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

    check_sealed(path)
    return sealed_run.read_sealed(path)


def read_glance(path: Path) -> Glance:
    """Summary of a sealed file, without its trials. Raises ArchiveError."""
    from campaign.archive.reading import sealed_run

    check_sealed(path)
    return sealed_run.read_glance(path)


def check_sealed(path: Path) -> None:
    """Raise ArchiveError if a file is not a sealed run in a format that this program reads."""
    from campaign.archive.reading import safe_hdf5

    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, "/run/provenance/format"):
        if ENTRY in file and "run" not in file:
            run_path = path.with_name(path.name.removesuffix(ENDING) + SEALED)
            hint = f"; name the run, {run_path}" if run_path.is_file() else ""
            raise ArchiveError(f"{path}: holds no run but what was found in one{hint}")
        run = safe_hdf5.member(file, "run")
        provenance = safe_hdf5.member(run, "provenance") if run is not None else None
        if provenance is None:
            raise ArchiveError(f"{path}: /run: is not the archive of a run{IMPORT}")
        version = safe_hdf5.integer_at(provenance, "format")
    check_format(path, version)
