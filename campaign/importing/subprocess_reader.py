"""Reading in a process of its own, for libraries that broken files crash.

One process says which tables a file has; each reading of one is another, which pours its blocks
into a pipe. Nothing is kept: memory does not grow with a file, and no copy of it is made.
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
"""How the process ends that has said what is wrong; any other end is the library's."""
PATIENCE = 600.0
"""s; a file that is silent for longer has sent its library round in circles."""
_LENGTH = 8
"""Bytes before a block that say how many rows it has; after the last there are none."""


def tables_streamed(module: str, path: Path) -> list[Table]:
    """What `module.tables` finds in a file, asked in other processes. Raises RecordingError."""
    with _process(module, path, "tell") as read:
        told = read()
    found = []
    for number, each in enumerate(json.loads(told)):
        each["columns"] = tuple(Column(**column) for column in each["columns"])
        each["clock"] = each["clock"] and Clock(**each["clock"])
        each["doubts"] = tuple(each["doubts"])
        found.append(Table(**{**each, "read": partial(_read, module, path, number)}))
    return found


def _read(module: str, path: Path, number: int, places: Sequence[int]) -> Iterator[Array]:
    wanted = list(places)
    with _process(module, path, "pour", number, *wanted) as read:
        while rows := int.from_bytes(read(_LENGTH), "little"):
            raw = read(8 * rows * len(wanted))
            yield np.frombuffer(raw, dtype="<f8").reshape(rows, len(wanted)).astype(np.float64)


class _EndedEarlyError(Exception):
    """The process says no more; how it ended tells why."""


@contextmanager
def _process(module: str, path: Path, *task: object) -> Iterator[Callable[..., bytes]]:
    """A process that answers about a file; it ends with the block, and is ended when it is silent.

    What is handed on reads so many bytes of what it says, or all; it raises _EndedEarlyError for
    fewer.

    Raises RecordingError where it says what is wrong, falls, or is silent for too long.
    """
    code = f"from {module} import tables; from {__name__} import answer; answer(tables)"
    # -P: what lies in the folder where somebody happens to be is not imported.
    command = [sys.executable, "-P", "-c", code, str(path), *map(str, task)]
    with (
        tempfile.TemporaryFile() as said,
        subprocess.Popen(  # noqa: S603 - this interpreter, and paths as arguments
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said
        ) as process,
    ):
        late = threading.Event()

        def end_it() -> None:
            late.set()
            process.kill()

        def read(size: int = -1) -> bytes:
            # Only while somebody waits: what becomes of a block may take its time.
            watch = threading.Timer(PATIENCE, end_it)
            watch.daemon = True
            watch.start()
            try:
                found = process.stdout.read(size) if process.stdout else b""
            finally:
                watch.cancel()
            if len(found) < size:
                raise _EndedEarlyError
            return found

        try:
            yield read
        except _EndedEarlyError:
            pass
        except BaseException:
            process.kill()  # nobody wants the rest
            raise
        end = process.wait()
        if late.is_set():
            message = f"reading it did not go on for {PATIENCE:g} s"
            raise RecordingError.of(path, message)
        if end == REFUSED:
            said.seek(0)
            raise RecordingError.of(path, said.read().decode("utf-8", "replace"))
        if end:
            message = "it is so broken that the library that reads such files fell over it"
            raise RecordingError.of(path, message)


def answer(tables: Callable[[Path], Sequence[Table]]) -> None:
    """In the process: say what tables a file has, or pour some columns of one."""
    path, task, *numbers = sys.argv[1:]
    output = sys.stdout.buffer
    try:
        found = tables(Path(path))
        if task == "tell":
            told = [{**vars(table), "read": None} for table in found]
            output.write(json.dumps(told, default=vars).encode())
        else:
            number, *places = map(int, numbers)
            for block in found[number].read(places):
                if len(block):
                    output.write(len(block).to_bytes(_LENGTH, "little"))
                    output.write(np.ascontiguousarray(block, dtype="<f8").tobytes())
            output.write(bytes(_LENGTH))
        output.flush()
    except RecordingError as error:
        output.flush()
        sys.stderr.write("; ".join(problem.message for problem in error.problems))
        sys.exit(REFUSED)
