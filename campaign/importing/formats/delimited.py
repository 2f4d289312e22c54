"""CSV, TSV and any other table of text: separator, decimal sign and heading are found."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from campaign.importing.dialect import SEPARATORS, dialect_of, encoding_of
from campaign.importing.interface import HEAD, RecordingError, RecordingFormat, Table
from campaign.importing.rows import beginning, blocks, columns_of
from campaign.importing.stacked import stacked

SAMPLE = 400
"""Lines by which the table is."""


def tables(path: Path) -> Sequence[Table]:
    """The table of a text file, or those below each other. Raises RecordingError."""
    sample = beginning(path, SAMPLE)
    dialect = dialect_of(sample)
    if dialect is None:
        separators = ", ".join(SEPARATORS.values())
        message = f"no table of numbers, separated by {separators}, was found in it"
        raise RecordingError.of(path, message)
    found = stacked(path, dialect, sample)
    return tuple(
        Table(
            f"block {number}" if len(found) > 1 else "",
            columns_of(each.dialect),
            partial(blocks, path, each.dialect, rows=each.lines),
            rows=each.rows,
            said=each.dialect.said,
            doubts=dialect.doubts,
            below=len(found) > 1,
        )
        for number, each in enumerate(found, start=1)
    )


def _recognises(head: bytes) -> bool:
    text = head.decode(encoding_of(head, whole=len(head) < HEAD), "ignore")
    return "\0" not in text


FORMAT = RecordingFormat(
    "text",
    "a table of text: CSV, TSV, or separated by anything usual",
    (".csv", ".tsv", ".txt", ".dat", ".asc"),
    _recognises,
    tables,
)
