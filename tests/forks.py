"""Commands in forks of a process that has imported the program: each is a process, none starts one.

A start of Python with all that the program imports takes 1 to 2 s of a core, a fork 0.1 s. What a
command does, prints and leaves is that of `python -m campaign`, its exit included.
"""

from __future__ import annotations

import atexit
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

TIMEOUT = 600
"""s after which the system ends a command: the first one may compile the engine."""

PROGRAM = """
import importlib, pkgutil
import matplotlib.pyplot
import campaign
for found in pkgutil.walk_packages(campaign.__path__, "campaign."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)
"""
LIBRARIES = """
import h5py, numba, numpy, pandas, scipy.linalg, scipy.optimize, scipy.signal, scipy.stats
"""
"""What imports nothing of the program, and looks for no plug-in of anything."""
SERVER = """
import gc, json, os, signal, sys
gc.freeze()  # a collection in a fork would copy every page
for line in sys.stdin:
    arguments, folder, out, err, environment = json.loads(line)
    child = os.fork()
    if not child:
        break
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
else:
    sys.exit()
signal.alarm({timeout})
for number, name, flags in (
    (0, os.devnull, os.O_RDONLY),
    (1, out, os.O_WRONLY | os.O_CREAT),
    (2, err, os.O_WRONLY | os.O_CREAT),
):
    opened = os.open(name, flags, 0o600)
    os.dup2(opened, number)
    os.close(opened)
os.chdir(folder)
if environment is not None:
    os.environ.clear()
    os.environ.update(environment)
    sys.path[1:1] = filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))
    sys.dont_write_bytecode = bool(environment.get("PYTHONDONTWRITEBYTECODE"))
sys.argv = ["campaign", *arguments]
sys.orig_argv = [sys.executable, "-m", "campaign", *arguments]
from campaign.__main__ import main
main()
"""


class Forks:
    """A process that imports by `imports` and forks for each command; one at a time.

    Args:
        environment: variables of all its commands.
        imports: Python text that imports what a command need not import again.
    """

    def __init__(self, environment: Mapping[str, str], imports: str = PROGRAM) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._process = subprocess.Popen(
            [sys.executable, "-c", imports + SERVER.format(timeout=TIMEOUT)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def run(
        self, folder: Path, *arguments: str, environment: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """`campaign` with these arguments in `folder`; its output must be UTF-8.

        `environment`: variables of this command alone, which count for what it has yet to import.
        """
        paths = [Path(self._folder.name, name) for name in ("out", "err")]
        assert self._process.stdin
        assert self._process.stdout
        words = [*map(str, arguments)]
        request = [words, str(folder.absolute()), *map(str, paths), environment]
        print(json.dumps(request), file=self._process.stdin, flush=True)
        code = int(self._process.stdout.readline())
        out, err = (path.read_bytes().decode("utf-8") for path in paths)
        for path in paths:
            path.unlink()  # what a command has begun may still write into its own
        return subprocess.CompletedProcess([*arguments], code, out, err)

    def close(self) -> None:
        """End the process that forks."""
        for stream in (self._process.stdin, self._process.stdout):
            assert stream
            stream.close()
        self._process.wait()
        self._folder.cleanup()


@cache
def forks_of_libraries() -> Forks:
    """The one of this process for commands that differ in what is installed."""
    made = Forks(os.environ, LIBRARIES)
    atexit.register(made.close)
    return made
