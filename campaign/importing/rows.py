"""Rows of a text table as numbers: a fast path, and cell by cell.

A row unlike the others is refused with its line and column; it is never padded, and never shifts
cells. Memory holds one block, however long the file is.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import StringIO
from itertools import islice
from pathlib import Path

import numpy as np

from campaign.importing.cells import is_number, value_of
from campaign.importing.dialect import Dialect, encoding_of
from campaign.importing.interface import HEAD, ROWS, Array, Column, RecordingError

LONGEST = 1 << 20
"""Maximum number of characters of a line; a longer line is no table."""
WHOLE = 1 << 23
"""Number of characters after which a block ends: the lines of wide tables are long."""
SAMPLE = 1 << 21
"""Maximum number of characters in the sample of a file."""
FEW = 10
"""Maximum number of reported problems of a file."""


def encoding_of_file(path: Path) -> str:
    """A codec for a text file, by its first bytes."""
    with path.open("rb") as raw:
        head = raw.read(HEAD)
        return encoding_of(head, whole=not raw.read(1))


def lines_of(path: Path) -> Iterator[str]:
    """Lines of a file. Raises RecordingError for too long lines and for files that are no text."""
    number = 0
    with path.open(encoding=encoding_of_file(path)) as file:
        try:
            while line := file.readline(LONGEST):
                number += 1
                if len(line) == LONGEST:
                    message = f"a line of over {LONGEST} characters: no table"
                    raise RecordingError.of(path, message, number)
                if "\0" in line:
                    at = line.index("\0") + 1
                    raise RecordingError.of(path, "a zero byte: this is no text", number, at)
                yield line
        except UnicodeDecodeError as error:
            message = f"the text is not {error.encoding}: {error.reason}"
            raise RecordingError.of(path, message, number + 1, 0) from None


def beginning(path: Path, count: int) -> list[str]:
    """The first lines of a file, fewer if they are long. Raises RecordingError as `lines_of`."""
    return _up_to(lines_of(path), count, SAMPLE)


def _up_to(lines: Iterator[str], count: int, size: int) -> list[str]:
    """The next lines: at most `count`, and none after they have `size` characters."""
    block: list[str] = []
    for line in islice(lines, count):
        block.append(line)
        size -= len(line)
        if size <= 0:
            break
    return block


def columns_of(dialect: Dialect) -> tuple[Column, ...]:
    """The columns of a text table; a column without a name is named by its place."""
    names = dialect.names or [""] * len(dialect.numeric)
    headings = zip(names, dialect.units, dialect.numeric, strict=True)
    return tuple(
        Column(name or dialect.place(k), unit, dialect.place(k), numeric)
        for k, (name, unit, numeric) in enumerate(headings)
    )


def blocks(
    path: Path,
    dialect: Dialect,
    places: Sequence[int],
    rows: int | None = None,
    among: Sequence[int] | None = None,
) -> Iterator[Array]:
    """The columns at `places` of a table, shape (k, len(places)).

    Args:
        rows: maximum number of rows.
        among: columns of the file in the table; None: all.
    """
    places = places if among is None else [among[place] for place in places]
    last = None if rows is None else dialect.first - 1 + rows
    lines = islice(lines_of(path), dialect.first - 1, last)
    yield from blocks_of(lines, path, dialect, places)


def blocks_of(
    lines: Iterator[str], path: Path, dialect: Dialect, places: Sequence[int]
) -> Iterator[Array]:
    """Blocks from lines that begin with the first row of the table."""
    number = dialect.first
    while block := _up_to(lines, ROWS, WHOLE):
        values = _quickly(block, dialect, places)
        if values is None:
            values = _row_by_row(path, block, number, dialect, places, lines)
        if len(values):
            yield values
        number += len(block)


def _quickly(lines: Sequence[str], dialect: Dialect, places: Sequence[int]) -> Array | None:
    """Values by numpy; None if any row differs from the expected form."""
    text = "".join(lines)
    separator = None if dialect.separator == " " else dialect.separator
    if separator is None:
        cells = [len(line.split()) for line in lines]
    else:
        cells = [line.count(separator) + 1 for line in lines]
    # numpy would drop extra cells and would not notice missing ones.
    odd = min(cells) < dialect.width or (max(cells) > dialect.width and not dialect.comments)
    # Points may group thousands if the decimal sign is a comma.
    if odd or '"' in text or (dialect.decimal == "," and "." in text):
        return None
    try:
        values = np.loadtxt(
            StringIO(text.replace(",", ".") if dialect.decimal == "," else text),
            delimiter=separator,
            usecols=places,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        return None
    return values if np.isfinite(values).all() and len(values) == len(lines) else None


def _row_by_row(
    path: Path,
    lines: Sequence[str],
    number: int,
    dialect: Dialect,
    places: Sequence[int],
    further: Iterator[str],
) -> Array:
    """Values of rows that `_quickly` refuses: cells without a number. Problems have their place."""
    values: list[list[float]] = []
    problems = []
    for offset, line in enumerate(lines):
        if not line.strip():
            continue
        cells = dialect.split(line)
        if dialect.comments:
            cells = cells[: dialect.width]
        if len(cells) != dialect.width:
            after = (each.strip() for rest in (lines[offset + 1 :], further) for each in rest)
            if not any(is_number(cell, dialect.decimal) for cell in cells) and not any(after):
                break  # an end mark
            message = f"{len(cells)} cells where the rows above have {dialect.width}"
            problems.append(dialect.problem(path, number + offset, message))
            continue
        values.append([])
        for place in places:
            try:
                values[-1].append(value_of(cells[place], dialect.decimal))
            except ValueError:
                message = f"{cells[place][:100]!r} is no number, as the rest of its column is"
                problems.append(dialect.problem(path, number + offset, message, line, place))
                break
        if len(problems) >= FEW:
            break
    if problems:
        raise RecordingError(problems)
    return np.array(values, dtype=np.float64).reshape(-1, len(places))
