"""Reading in a separate process, for libraries that crash on broken files.

One process lists the tables of a file. Each reading of a table is another process, which writes
its blocks to a pipe. Memory does not grow with the file, and no copy of it is made.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np

from campaign.importing.interface import Array, Clock, Column, RecordingError, Table

REFUSED = 3
"""Exit code of a process that reported the error; any other nonzero code is a crash."""
PATIENCE = 600.0
"""Longest wait for output (s); after that the library is in an endless loop."""
_LENGTH = 8
"""Bytes of the row count before each block; the count 0 ends the data."""


def tables_streamed(module: str, path: Path) -> list[Table]:
    """The tables of a file by `module.tables`, read in other processes. Raises RecordingError."""
    with _process(module, path, "tell") as read:
        listing = read()
    tables = []
    for number, each in enumerate(json.loads(listing)):
        each["columns"] = tuple(Column(**column) for column in each["columns"])
        each["clock"] = each["clock"] and Clock(**each["clock"])
        each["doubts"] = tuple(each["doubts"])
        tables.append(Table(**{**each, "read": partial(_read, module, path, number)}))
    return tables


def _read(module: str, path: Path, number: int, places: Sequence[int]) -> Iterator[Array]:
    wanted = list(places)
    with _process(module, path, "pour", number, *wanted) as read:
        while rows := int.from_bytes(read(_LENGTH), "little"):
            raw = read(8 * rows * len(wanted))
            yield np.frombuffer(raw, dtype="<f8").reshape(rows, len(wanted)).astype(np.float64)


class _EndedEarlyError(Exception):
    """The output of the process ended early; its exit code gives the cause."""


@contextmanager
def _process(module: str, path: Path, *task: object) -> Iterator[Callable[..., bytes]]:
    """A process that reads a file; it ends with the block, or after `PATIENCE` without output.

    Yields a function that reads the given number of bytes of its output, or all; it raises
    _EndedEarlyError if there are fewer.

    Raises RecordingError if the process reports an error, crashes, or has no output for too long.
    """
    code = f"from {module} import tables; from {__name__} import answer; answer(tables)"
    # -P: modules in the current folder are not imported.
    command = [sys.executable, "-P", "-c", code, str(path), *map(str, task)]
    with (
        tempfile.TemporaryFile() as errors,
        subprocess.Popen(  # noqa: S603 - this interpreter, and paths as arguments
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=errors
        ) as process,
    ):
        late = threading.Event()

        def end_it() -> None:
            late.set()
            process.kill()

        def read(size: int = -1) -> bytes:
            # Only during a read: the caller may take any time to process a block.
            watch = threading.Timer(PATIENCE, end_it)
            watch.daemon = True
            watch.start()
            try:
                data = process.stdout.read(size) if process.stdout else b""
            finally:
                watch.cancel()
            if len(data) < size:
                raise _EndedEarlyError
            return data

        try:
            yield read
        except _EndedEarlyError:
            pass
        except BaseException:
            process.kill()  # the caller does not need the rest
            raise
        end = process.wait()
        if late.is_set():
            message = f"reading it did not go on for {PATIENCE:g} s"
            raise RecordingError.of(path, message)
        if end == REFUSED:
            errors.seek(0)
            raise RecordingError.of(path, errors.read().decode("utf-8", "replace"))
        if end:
            message = "it is so broken that the library that reads such files fell over it"
            raise RecordingError.of(path, message)


def answer(tables: Callable[[Path], Sequence[Table]]) -> None:
    """In the process: list the tables of a file, or write some columns of one to the pipe."""
    path, task, *numbers = sys.argv[1:]
    output = sys.stdout.buffer
    try:
        all_tables = tables(Path(path))
        if task == "tell":
            listing = [{**vars(table), "read": None} for table in all_tables]
            output.write(json.dumps(listing, default=vars).encode())
        else:
            number, *places = map(int, numbers)
            for block in all_tables[number].read(places):
                if len(block):
                    output.write(len(block).to_bytes(_LENGTH, "little"))
                    output.write(np.ascontiguousarray(block, dtype="<f8").tobytes())
            output.write(bytes(_LENGTH))
        output.flush()
    except RecordingError as error:
        output.flush()
        sys.stderr.write("; ".join(problem.message for problem in error.problems))
        sys.exit(REFUSED)
