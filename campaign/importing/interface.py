"""Contents of an imported file: named columns on clocks.

Nothing is converted here and nothing is guessed: a unit is text, a number what was written.
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
"""Bytes by which a format is recognised, and an encoding judged."""
ROWS = 65_536
"""Most rows of a block: memory does not grow with a recording."""

LARGEST_PART = 1 << 28
"""Bytes that what is read at once may unpack to, however small it is packed."""
MOST_UNPACKED = 1 << 33
"""Bytes that a file may unpack to."""

LISTED = 5000
"""Files of a folder among which a name that is not there is looked for."""


class RecordingError(UsageError):
    """A file that cannot be read as recordings: all that is wrong with it, placed."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))

    @classmethod
    def of(cls, path: Path, message: str, line: int = 0, column: int = 1) -> RecordingError:
        """One thing that is wrong with a file, or with a line of it (from 1)."""
        return cls([Problem(path, line, column if line else 0, message)])


@contextmanager
def read_by(package: str, path: Path, what: str, extra: str = "") -> Iterator[None]:
    """A library reads the file; whatever a broken one leads it to becomes a RecordingError.

    Args:
        what: kind of file, for the message.
        extra: of this program, by which the library is installed where it is missing.
    """
    try:
        yield
    except RecordingError:
        raise
    except Exception as error:  # noqa: BLE001 - libraries raise all there is
        if extra and isinstance(error, ImportError):
            message = f"reading it needs {package}: pip install 'campaign[{extra}]'"
            raise RecordingError.of(path, message) from None
        why = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
        raise RecordingError.of(path, f"this {what} cannot be read ({why[:300]})") from None


@contextmanager
def regular(path: Path) -> Iterator[BufferedReader]:
    """A regular file, open; raises RecordingError where it cannot be read, and for any other.

    A pipe or a device is not opened: it has no end.
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
        told = getattr(error, "strerror", None) or str(error)
        names = []
        if isinstance(error, FileNotFoundError):
            with suppress(OSError):
                names = [each.name for each in islice(path.parent.iterdir(), LISTED)]
        message = f"it cannot be opened: {told}{nearest(path.name, names)}"
        raise RecordingError.of(path, message) from None


@dataclass(frozen=True)
class Column:
    """One column of a table.

    Attributes:
        name: as the file has it, nothing added; two columns may have one name.
        unit: as the file states it; "" where it states none.
        place: where in the file, for people: `column 3`, `rec1.Y(2)`.
        numeric: whether its cells are numbers; others may only be looked at.
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
        name: of the part of the file; "" where the file has only one.
        clock: None where time is a column, or is not told.
        doubts: how else the file could be read, in words.
        read: blocks of at most `ROWS` rows of the columns at the given places (from 0), in order:
            shape (k, len(places)), NaN where a cell is empty. Raises RecordingError.
    """

    name: str
    columns: tuple[Column, ...]
    read: Callable[[Sequence[int]], Iterator[Array]] = field(repr=False)
    clock: Clock | None = None
    doubts: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordingFormat:
    """A format of recordings, as it is found by its name.

    Attributes:
        endings: of its files, lower case: `.csv`.
        recognises: whether a file is one, from its first 64 KiB at most; never raises.
        tables: what is in a file. Raises RecordingError where it cannot be read.
    """

    name: str
    summary: str
    endings: tuple[str, ...]
    recognises: Callable[[bytes], bool]
    tables: Callable[[Path], Sequence[Table]]
