"""Formats of recordings, one file each or an installed plug-in: which one a file has."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from campaign.importing.interface import HEAD, RecordingError, RecordingFormat, Table, regular
from campaign.plugins import Kinds

TEXT = "text"
"""What any text may be; all other formats are asked before."""


@cache
def recording_formats() -> Kinds[RecordingFormat]:
    """Every format, by name."""
    return Kinds("recording format", __name__, "FORMAT", RecordingFormat)


def open_recordings(path: Path) -> tuple[RecordingFormat, Sequence[Table]]:
    """A file's format, by its first bytes, and its tables; its name decides where several fit.

    Raises RecordingError with everything that is wrong, also when it is in no format there is.
    """
    with regular(path) as file:
        head = file.read(HEAD)
    if not head.strip():
        raise RecordingError.of(path, "it is empty")
    formats = [each for _, each in recording_formats().described() if not isinstance(each, str)]
    fitting = [each for each in formats if each.recognises(head)]
    fitting.sort(key=lambda each: (each.name == TEXT, path.suffix.lower() not in each.endings))
    if not fitting:
        known = ", ".join(sorted(each.name for each in formats))
        raise RecordingError.of(path, f"it is in none of the formats {known}")
    return fitting[0], fitting[0].tables(path)
