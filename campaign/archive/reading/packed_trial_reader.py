"""Reading the file of one trial without trusting its contents."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

from campaign.archive.layout.checksums import text_digest
from campaign.archive.layout.names import SEALED
from campaign.archive.layout.packed_trial import MAGIC, POINTER, PackedSeries, PackedTrial
from campaign.archive.layout.record import Trees, TrialRecord, parse_trees, series_of
from campaign.archive.layout.run_folder import first_line
from campaign.archive.reading import safe_hdf5
from campaign.archive.reading.series import layout_of, series_at
from campaign.errors import ArchiveError


def read_packed(path: Path, entry: str) -> PackedTrial:
    """Read a trial's own file; older programs wrote an HDF5 file with the group `entry`.

    Raises ArchiveError.
    """
    return packed_entry(path, entry) if path.suffix == SEALED else _read(path)


def _read(path: Path) -> PackedTrial:
    if not path.is_file():
        raise ArchiveError(f"{path}: there is no such file")
    with safe_hdf5.guarded(path), path.open("rb") as file:
        end = file.seek(0, os.SEEK_END) - POINTER
        file.seek(0)
        if file.read(len(MAGIC)) != MAGIC or end < len(MAGIC):
            raise ArchiveError(f"{path}: is not the file of a trial, or its beginning is damaged")
        file.seek(end)
        start = int.from_bytes(file.read(POINTER), "little")
        if not len(MAGIC) <= start <= end:
            raise ArchiveError(f"{path}: its end is damaged")
        file.seek(start)
        trial = PackedTrial.model_validate_json(file.read(end - start))
    _check_places(path, trial, start)
    return trial


def _check_places(path: Path, trial: PackedTrial, end: int) -> None:
    """Raise ArchiveError if chunks overlap, or are not between the file's beginning and `end`."""
    places = sorted(
        place for series in trial.groups.values() for each in series for place in each.chunks
    )
    for (offset, size), (following, _) in pairwise([*places, (end, 0)]):
        if offset < len(MAGIC) or offset + size > following:
            raise ArchiveError(f"{path}: its chunks lie where they cannot")


def packed_entry(path: Path, entry: str) -> PackedTrial:
    """Read a trial of an HDF5 file: of a sealed run, or a trial's own. Raises ArchiveError."""
    with safe_hdf5.open_file(path) as file, safe_hdf5.guarded(path, f"/{entry}"):
        group_of_entry = safe_hdf5.inner_group(file, entry)
        kept = safe_hdf5.inner_group(group_of_entry, "record")
        trees = safe_hdf5.unchecked_text_at(kept, "trees")
        text = safe_hdf5.unchecked_text_at(kept, "json")
        if "not_kept" in kept:
            not_kept = safe_hdf5.text_at(kept, "not_kept")
            return PackedTrial(record=text, trees=trees, not_kept=not_kept)
        groups: dict[str, tuple[PackedSeries, ...]] = {}
        for group, name, length, _ in series_of(parse_record(path, f"/{entry}/record", text)):
            data = safe_hdf5.inner_group(group_of_entry, group)
            dataset, series = series_at(data, name, length)
            packed_series = PackedSeries(
                name=name,
                chunk=series.chunk,
                shuffled=series.shuffled,
                chunks=layout_of(dataset),
            )
            groups[group] = (*groups.get(group, ()), packed_series)
        return PackedTrial(record=text, trees=trees, groups=groups)


def packed_record(
    path: Path, entry: str, packed: PackedTrial, digest: str
) -> tuple[TrialRecord, Trees]:
    """Parse record and trees of a trial. Raises ArchiveError if the record lacks the digest."""
    if text_digest(packed.record) != digest:
        raise ArchiveError(f"{path}: /{entry}/record/json: {safe_hdf5.MISMATCH}")
    record = parse_record(path, f"/{entry}/record", packed.record)
    try:
        trees: Trees = parse_trees(packed.trees)
    except ValueError as error:
        raise ArchiveError(f"{path}: /{entry}/record/trees: {error}") from None
    if not record.tree_names <= trees.keys():
        raise ArchiveError(f"{path}: /{entry}/record/trees: its bench or its options are missing")
    return record, trees


def parse_record(path: Path, place: str, text: str | bytes) -> TrialRecord:
    """A record from its text. Raises ArchiveError."""
    try:
        return TrialRecord.model_validate_json(text)
    except ValueError as error:
        raise ArchiveError(f"{path}: {place}: {first_line(error)}") from None
