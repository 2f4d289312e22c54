"""Contents of an imported file: named columns on clocks.

Nothing is converted or guessed: units are text, numbers are as written.
"""

from __future__ import annotations

import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from io import BufferedReader
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from campaign.errors import Problem, UsageError
from campaign.text import nearest

Array = NDArray[np.float64]
HEAD = 1 << 16
"""Number of bytes from which format and encoding are recognized."""
ROWS = 65_536
"""Maximum number of rows of a block: memory does not grow with a recording."""

LARGEST_PART = 1 << 28
"""Maximum unpacked size (bytes) of data that is read at once."""
MOST_UNPACKED = 1 << 33
"""Maximum unpacked size (bytes) of a file."""

LISTED = 5000
"""Maximum number of files in a folder to search for a similar name."""


class RecordingError(UsageError):
    """A file that cannot be read as recordings: all its problems with their places."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    @classmethod
    def of(cls, path: Path, message: str, line: int = 0, column: int = 1) -> RecordingError:
        """An error with one problem of a file, or of a line of it (from 1)."""
        return cls([Problem(path, line, column if line else 0, message)])


@contextmanager
def read_by(package: str, path: Path, what: str, extra: str = "") -> Iterator[None]:
    """Convert any error of a library that reads the file within the block to RecordingError.

    Args:
        what: kind of file, for the message.
        extra: extra of this program that installs the library.
    """
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - libraries raise errors of any type
        if extra and isinstance(error, ImportError):
            message = f"reading it needs {package}: pip install 'campaign[{extra}]'"
            raise RecordingError.of(path, message) from None
        why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise RecordingError.of(path, f"this {what} cannot be read ({why[:300]})") from None


@contextmanager
def regular(path: Path) -> Iterator[BufferedReader]:
    """An open regular file; raises RecordingError for unreadable files and other kinds.

    A pipe or a device is not opened: it may have no end.
    """
    try:
        mode = path.stat().st_mode
        if not stat.S_ISREG(mode):
            other = "a pipe, a device or the like, and no regular file"
            what = "a folder" if stat.S_ISDIR(mode) else other
            raise RecordingError.of(path, f"it cannot be opened: it is {what}")
        with path.open("rb") as file:
            yield file
    except (OSError, ValueError) as error:
        cause = getattr(error, "strerror", None) or str(error)
        names = []
        if isinstance(error, FileNotFoundError):
            with suppress(OSError):
                names = [each.name for each in islice(path.parent.iterdir(), LISTED)]
        message = f"it cannot be opened: {cause}{nearest(path.name, names)}"
        raise RecordingError.of(path, message) from None


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        name: exactly as in the file; two columns may have the same name.
        unit: as the file states it; "" if it states none.
        place: place in the file, for messages: `column 3`, `rec1.Y(2)`.
        numeric: whether its cells are numbers; only such columns can be read.
    """

    name: str
    unit: str = ""
    place: str = ""
    numeric: bool = True


@dataclass(frozen=True)
class Clock:
    """Times that a file states instead of storing them: sample k is at start + k step (s)."""

    step: float
    start: float = 0.0


@dataclass(frozen=True)
class Table:
    """Columns of one length that were sampled together.

    Attributes:
        name: of the part of the file; "" if the file has only one.
        clock: None if time is a column or not stated.
        doubts: other possible readings of the file, in words.
        read: blocks of at most `ROWS` rows of the columns at the given places (from 0), in order:
            shape (k, len(places)), NaN for an empty cell. Raises RecordingError.
    """

    name: str
    columns: tuple[Column, ...]
    read: Callable[[Sequence[int]], Iterator[Array]] = field(repr=False)
    clock: Clock | None = None
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordingFormat:
    """A format of recordings, registered by its name.

    Attributes:
        endings: file name extensions, lower case: `.csv`.
        recognises: whether a file has the format, by its first 64 KiB; never raises.
        tables: the tables of a file. Raises RecordingError if it cannot be read.
    """

    name: str
    summary: str
    endings: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    tables: Callable[[Path], Sequence[Table]]
