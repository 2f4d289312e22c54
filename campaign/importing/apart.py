"""Reading in a process of its own, for libraries that a broken file can bring down.

The process reads the whole file and leaves its tables in a folder, columns of numbers as they are
in memory; this one maps them. If the process dies, the file is refused like any other broken one.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import weakref
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from campaign.errors import Problem
from campaign.importing.interface import ROWS, Array, Clock, Column, RecordingError, Table

TABLES = "tables.json"
REFUSED = 3
"""How the process ends that has said what is wrong; any other end is the library's."""
PATIENCE = 600.0
"""s; a file that takes longer has sent its library round in circles."""


class _Folder:
    """A folder that is gone when nobody has this any more, or when the program ends."""

    def __init__(self) -> None:
        self.path = Path(tempfile.mkdtemp(prefix="campaign-recording-"))
        weakref.finalize(self, shutil.rmtree, self.path, ignore_errors=True)


def tables_apart(module: str, path: Path) -> list[Table]:
    """What `module.tables` finds in a file, asked in another process. Raises RecordingError."""
    folder = _Folder()
    code = f"import sys; from {module} import tables; from {__name__} import leave; leave(tables)"
    # -P: what lies in the folder where somebody happens to be is not imported.
    command = [sys.executable, "-P", "-c", code, str(path), str(folder.path)]
    try:
        done = subprocess.run(  # noqa: S603 - this interpreter, and paths as arguments
            command, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        message = f"reading it did not end within {PATIENCE:g} s"
        raise RecordingError([Problem(path, 0, 0, message)]) from None
    if done.returncode == 0:
        told = json.loads((folder.path / TABLES).read_text("utf-8"))
        return [_mapped(folder, number, each) for number, each in enumerate(told)]
    message = done.stderr.decode("utf-8", "replace").strip() if done.returncode == REFUSED else ""
    message = message or "it is so broken that the library that reads such files fell over it"
    raise RecordingError([Problem(path, 0, 0, message)])


def leave(tables: Callable[[Path], Sequence[Table]]) -> None:
    """In the process: read `sys.argv[1]` and leave what is there in the folder `sys.argv[2]`."""
    path, folder = map(Path, sys.argv[1:])
    try:
        found = tables(path)
        told = []
        for number, table in enumerate(found):
            np.save(folder / f"{number}.npy", table.whole())
            told.append(
                {
                    "name": table.name,
                    "columns": [asdict(column) for column in table.columns],
                    "clock": None if table.clock is None else asdict(table.clock),
                    "said": dict(table.said),
                }
            )
        (folder / TABLES).write_text(json.dumps(told), "utf-8")
    except RecordingError as error:
        sys.stderr.write("; ".join(problem.message for problem in error.problems))
        sys.exit(REFUSED)


def _mapped(folder: _Folder, number: int, told: Any) -> Table:
    columns = tuple(Column(**each) for each in told["columns"])
    clock = None if told["clock"] is None else Clock(**told["clock"])
    values = np.load(folder.path / f"{number}.npy", mmap_mode="r")
    read = partial(_read, folder, values)
    return Table(told["name"], columns, read, clock, len(values), told["said"])


def _read(folder: _Folder, values: Array, places: Sequence[int]) -> Iterator[Array]:
    """`folder` is there as long as somebody may read from it."""
    for start in range(0, len(values), ROWS):
        yield np.array(values[start : start + ROWS, list(places)])
