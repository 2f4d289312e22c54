"""Formats of recordings, one module or plug-in each, and their detection."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path

from campaign.importing.interface import HEAD, RecordingError, RecordingFormat, Table, regular
from campaign.plugins import Kinds

TEXT = "text"
"""The format that fits any text; all others have precedence."""


@cache
def recording_formats() -> Kinds[RecordingFormat]:
    """Every format, by name."""
    return Kinds("recording format", __name__, "FORMAT", RecordingFormat)


def open_recordings(path: Path) -> tuple[RecordingFormat, Sequence[Table]]:
    """A file's format, by its first bytes, and its tables; if several fit, the extension decides.

    Raises RecordingError with all problems of the file, and for an unknown format.
    """
    with regular(path) as file:
        head = file.read(HEAD)
    if not head.strip():
        raise RecordingError.of(path, "it is empty")
    formats = [each for _, each in recording_formats().described() if not isinstance(each, str)]
    matches = [each for each in formats if each.recognises(head)]
    matches.sort(key=lambda each: (each.name == TEXT, path.suffix.lower() not in each.endings))
    if not matches:
        known = ", ".join(sorted(each.name for each in formats))
        raise RecordingError.of(path, f"it is in none of the formats {known}")
    return matches[0], matches[0].tables(path)
