"""Processes that read a file, as forks of one that has imported the libraries that read files.

Each is a process of its own as in `campaign.importing.subprocess_reader`, which starts Python for
it: half a second of a core to import what is the same every time.
"""

from __future__ import annotations

import atexit
import os
import signal
import subprocess
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import IO, Self

from tests.forks import Forks

IMPORTS = """
import importlib, os, sys, types
sys.path[:] = [os.path.abspath(each) for each in sys.path]
for each in ("scipy.io", "h5py", "nptdms", "asammdf", "openpyxl", "pandas", "campaign.units"):
    try:
        importlib.import_module(each)
    except ImportError:
        pass
from campaign.importing.formats import excel, hdf5, mat, mdf, tdms
from campaign.importing.subprocess_reader import answer

def read():
    answer(importlib.import_module(sys.argv.pop(1)).tables)

sys.modules["campaign.__main__"] = types.SimpleNamespace(main=read)
"""
DEVNULL, PIPE = subprocess.DEVNULL, subprocess.PIPE
_ASKING = threading.Lock()


@cache
def _forks() -> Forks:
    made = Forks(os.environ, IMPORTS)
    atexit.register(made.close)
    return made


class Popen:
    """As much of `subprocess.Popen` as readers of files need."""

    def __init__(self, command: Sequence[str], stdin: int, stdout: int, stderr: IO[bytes]) -> None:
        assert (stdin, stdout) == (DEVNULL, PIPE)
        code, *task = command[command.index("-c") + 1 :]
        ours, theirs = os.pipe()
        ends = [f"/proc/{os.getpid()}/fd/{each}" for each in (theirs, stderr.fileno())]
        with _ASKING:
            module = code.split()[1]
            self.pid = _forks().fork(Path.cwd(), [module, *task], [os.devnull, *ends])
        os.close(theirs)
        self.stdout = os.fdopen(ours, "rb")
        self.returncode: int | None = None

    def wait(self) -> int:
        """Its exit code, once it has ended."""
        if self.returncode is None:
            with _ASKING:
                self.returncode = _forks().ended(self.pid)
        return self.returncode

    def kill(self) -> None:
        """At once, unless it has ended."""
        if self.returncode is None:
            os.kill(self.pid, signal.SIGKILL)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.stdout.close()
        self.wait()
