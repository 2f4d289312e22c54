"""Reading `RUN-results.nxs`: complete and of the run beside it, or not at all.

The file may be truncated, changed or exchanged. Nothing of it is used before the hash of the whole
file is verified. The caller then judges its program version and its run.
"""

from __future__ import annotations

from pathlib import Path

import h5py
from pydantic import ValidationError

from campaign.archive.layout.results import ENTRY, FORMAT, HASH, RECORD, RunResults
from campaign.archive.layout.results_text import from_text
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.series import series_at
from campaign.errors import ArchiveError
from campaign.result import Array


def is_results_file(path: Path) -> bool:
    """Whether a file holds results of this program, of any run, damaged or not."""
    try:
        with safe_hdf5.open_file(path) as file:
            run = safe_hdf5.inner_group(safe_hdf5.inner_group(file, ENTRY), "run")
            return safe_hdf5.attribute(file, "creator") == "campaign" and "format" in run
    except ArchiveError:
        return False


class OtherLayoutError(ArchiveError):
    """Undamaged results in the layout of another version of this program."""


def holds_results(path: Path) -> bool | None:
    """Whether a file holds results (True) or a run (False), of any version; None if unclear.

    Reads only the names of its top level.
    """
    try:
        with safe_hdf5.open_file(path) as file:
            names = safe_hdf5.names(file)
    except ArchiveError:
        return None
    if "run" in names:
        return False
    return True if ENTRY in names else None


def read_results(path: Path, root: str) -> RunResults:
    """The results in a file, of the run with the seal digest `root`.

    Raises ArchiveError with the reason in one line: the file holds no results, is incomplete, was
    changed, has another layout, or is of another run.
    """
    results = read_any_results(path)
    if results.root != root:
        raise ArchiveError(
            f"{path}: holds the results of another run, or of this one before it was gone on with: "
            f"of {results.run}, {results.root[:12]}…, and this is {root[:12]}…"
        )
    return results


def read_any_results(path: Path) -> RunResults:
    """The results in a file, of any run.

    Raises ArchiveError in one line: the file holds no results, is incomplete, was changed, or has
    another layout (OtherLayoutError).
    """
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, f"/{ENTRY}"):
        if ENTRY not in safe_hdf5.names(file):
            raise ArchiveError(f"{path}: holds no results")
        entry = safe_hdf5.inner_group(file, ENTRY)
        safe_hdf5.check_file_hash(entry, HASH)
        _check_format(path, entry)
        return _record(path, entry)


def _check_format(path: Path, entry: h5py.Group) -> None:
    version = safe_hdf5.integer_at(safe_hdf5.inner_group(entry, "run"), "format")
    if version != FORMAT:
        raise OtherLayoutError(
            f"{path}: has results of layout {version}; this program reads {FORMAT}"
        )


def _record(path: Path, entry: h5py.Group) -> RunResults:
    text = safe_hdf5.text_at(safe_hdf5.inner_group(entry, RECORD), "data")
    known: dict[str, Array] = {}

    def array(place: str) -> Array:
        where, *cut = place.split(":")
        if where not in known:
            *groups, name = where.split("/")
            parent = entry
            for group in groups:
                parent = safe_hdf5.inner_group(parent, group)
            known[where] = series_at(parent, name)[1].read()
        values = known[where]
        return values[slice(*map(int, cut))].copy() if cut else values.copy()

    try:
        return from_text(text, array)
    except ValidationError as error:
        raise ArchiveError(f"{path}: /{ENTRY}/{RECORD}: {first_line(error)}") from None
