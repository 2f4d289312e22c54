"""Files of recordings by what is in them: which format one has, and its tables."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from campaign.importing.formats import recording_formats
from campaign.importing.interface import HEAD, RecordingError, RecordingFormat, Table, check_regular

TEXT = "text"
"""What any text may be; all other formats are asked before."""


def format_of(path: Path) -> RecordingFormat:
    """The format of a file, by its first bytes; its name only decides between several that fit.

    Raises RecordingError when it is in no format that there is, or cannot be opened.
    """
    check_regular(path)
    try:
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        why = error.strerror or str(error)
        raise RecordingError.of(path, f"it cannot be opened: {why}") from None
    if not head.strip():
        raise RecordingError.of(path, "it is empty")
    formats = [each for _, each in recording_formats().described() if not isinstance(each, str)]
    fitting = [each for each in formats if each.recognises(head)]
    fitting.sort(key=lambda each: (each.name == TEXT, path.suffix.lower() not in each.endings))
    if not fitting:
        known = ", ".join(sorted(each.name for each in formats))
        raise RecordingError.of(path, f"it is in none of the formats {known}")
    return fitting[0]


def open_recordings(path: Path) -> tuple[RecordingFormat, Sequence[Table]]:
    """A file's format and its tables. Raises RecordingError with everything that is wrong."""
    found = format_of(path)
    return found, found.tables(path)
