"""Commands in forks of a process that has imported the program: each is a process, none starts one.

A start of Python with all that the program imports takes 1 to 2 s of a core, a fork 0.05 s. What a
command does, prints and leaves is that of `python -m campaign`, its exit included. A command that
moves a bench has its guardian, whose program is a fork, too.
"""

from __future__ import annotations

import atexit
import json
import os
import select
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Self

ROOT = str(Path(__file__).parents[1])
TIMEOUT = 600
"""s after which the system ends a command: the first one may compile the engine."""

MODULES = """
import importlib, pkgutil
import matplotlib.pyplot
import campaign
for found in pkgutil.walk_packages(campaign.__path__, "campaign."):
    if not found.name.endswith(("__main__", "report.preload")):  # the latter looks for plug-ins
        importlib.import_module(found.name)
import functools, typer.main
from campaign.cli.main import app
typer.main.get_command = functools.cache(typer.main.get_command)
typer.main.get_command(app)  # what can be typed, of all commands
"""
PROGRAM = f"""{MODULES}
from campaign.device.warm_up import warm_up
from campaign.protocol.bench_file import simulable
warm_up(simulable("simulink"))  # the engine is loaded, or compiled
"""
LIBRARIES = """
import h5py, numba, numpy, pandas, scipy.linalg, scipy.optimize, scipy.signal, scipy.stats
import jinja2, matplotlib.backends.backend_svg, matplotlib.figure, rich.console, rich.progress
import rich.table, scipy.interpolate, scipy.ndimage, scipy.special, scipy.spatial, tomlkit, typer
numba.cfunc("float64(float64)")(lambda x: x)  # the compiler is ready
"""
"""Imports nothing of the program, and looks for no plug-in of anything."""
SERVER = """
import atexit, contextlib, gc, importlib, json, os, signal, subprocess, sys, threading, time, types
gc.freeze()  # a collection in a fork would copy every page
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # not ignored, also where the tests are under nohup
begun = set()
for line in sys.stdin:
    ended, arguments, folder, streams, environment, limit = json.loads(line)
    if ended:  # it is, or is waited for
        begun.remove(ended)
        print(os.waitstatus_to_exitcode(os.waitpid(ended, 0)[1]), flush=True)
        continue
    flags = (os.O_RDONLY, *2 * [os.O_WRONLY | os.O_CREAT])
    opened = [os.open(name, flag | os.O_NOCTTY, 0o600) for name, flag in zip(streams, flags)]
    child = os.fork()
    if not child:
        break
    for each in opened:
        os.close(each)
    begun.add(child)
    print(child, flush=True)
else:
    for child in begun:  # nobody is left who could end them
        os.kill(child, signal.SIGKILL)
    sys.exit()
signal.alarm(limit)
for number, each in enumerate(opened):
    os.dup2(each, number)
    os.close(each)
os.chdir(folder)
if environment is not None:
    os.environ.clear()
    os.environ.update(environment)
    sys.path[1:1] = filter(None, environment.get("PYTHONPATH", "").split(os.pathsep))
    sys.dont_write_bytecode = bool(environment.get("PYTHONDONTWRITEBYTECODE"))
    if "campaign" in sys.modules:  # as if it were imported now, with these packages
        campaign.entry_points.installed.cache_clear()
        campaign.physics.compilation._IMPORTED_AT = time.time()
sys.argv = ["campaign", *arguments]
sys.orig_argv = [sys.executable, "-m", "campaign", *arguments]
def run():
    code = 0
    try:
        if sys.argv[1:2] == ["-c"]:  # as `python -c`
            del sys.argv[0]
            exec(sys.argv.pop(1), {"__name__": "__main__"})
            leave(0)
        if hook := os.environ.pop("BEFORE_THE_COMMAND", ""):  # a module that changes what it meets
            importlib.import_module(hook)
        from campaign.__main__ import main
        main()
    except SystemExit as leaving:
        code = leaving.code
        if isinstance(code, str):
            print(code, file=sys.stderr)
            code = 1
    leave(code or 0)
def leave(code):
    # All of an end but that a million objects are taken apart one by one, each on its own page.
    threading._shutdown()
    atexit._run_exitfuncs()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
def afresh(*kept):  # as after an exec
    signal.set_wakeup_fd(-1)
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):
            signal.signal(number, signal.SIG_DFL)
    for name in os.listdir("/proc/self/fd"):
        if int(name) > 2 and int(name) not in kept:
            with contextlib.suppress(OSError):
                os.close(int(name))
    sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
class Program:  # what a guardian starts, as one more fork
    returncode = None
    def __init__(self, command, pass_fds, env):
        self.pid = os.fork()
        if not self.pid:
            afresh(*pass_fds)
            os.environ.clear()
            os.environ.update(env)
            run()
    def poll(self):
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            self.returncode = os.waitstatus_to_exitcode(status) if pid else None
        return self.returncode
    def wait(self, timeout):
        ends = time.monotonic() + timeout
        while self.poll() is None:
            if time.monotonic() > ends:
                raise subprocess.TimeoutExpired("campaign", timeout)
            time.sleep(0.01)
    def send_signal(self, number):
        if self.poll() is None:
            os.kill(self.pid, number)
    def kill(self):
        self.send_signal(signal.SIGKILL)
def guard(path, command):  # for `os.execv`, by which a program that moves a bench gets its guardian
    from campaign.execution import guardian
    afresh()
    guardian.subprocess = types.SimpleNamespace(**{**vars(subprocess), "Popen": Program})
    leave(guardian.main(command[4:]))
os.execv = guard
run()
"""


class Forks:
    """A process that imports by `imports` and forks for each command; one at a time.

    Args:
        environment: variables of all its commands.
        imports: Python text that imports what a command need not import again.
    """

    def __init__(self, environment: Mapping[str, str], imports: str = PROGRAM) -> None:
        self._folder = tempfile.TemporaryDirectory()
        self._asking = threading.Lock()
        self._process = subprocess.Popen(
            [sys.executable, "-c", imports + SERVER],
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
        `BEFORE_THE_COMMAND` of them names a module that is imported just before it begins.
        """
        paths = [Path(self._folder.name, name) for name in ("out", "err")]
        streams = [os.devnull, *map(str, paths)]
        pid = self.fork(folder, arguments, streams, environment, TIMEOUT)
        code = self.ended(pid)
        out, err = (path.read_bytes().decode("utf-8") for path in paths)
        for path in paths:
            path.unlink()  # what a command has begun may still write into its own
        return subprocess.CompletedProcess([*arguments], code, out, err)

    def fork(
        self,
        folder: Path,
        arguments: Sequence[str],
        streams: Sequence[str],
        environment: Mapping[str, str] | None = None,
        limit: int = 0,
    ) -> int:
        """Begin a command; its pid. `streams`: the paths of all three; `limit`: s, 0 for none."""
        words = [*map(str, arguments)]
        return self._answer(0, words, str(folder.absolute()), streams, environment, limit)

    def ended(self, pid: int) -> int:
        """The exit code of a command that was begun, once it has ended."""
        return self._answer(pid, [], "", [], None, 0)

    def _answer(self, *request: object) -> int:
        assert self._process.stdin
        assert self._process.stdout
        with self._asking:  # of several threads each has its own answer
            print(json.dumps(request), file=self._process.stdin, flush=True)
            return int(self._process.stdout.readline())

    def close(self) -> None:
        """End the process that forks."""
        for stream in (self._process.stdin, self._process.stdout):
            assert stream
            stream.close()
        self._process.wait()
        self._folder.cleanup()


class Begun:
    """A command in a fork that goes on beside the test; used as a `subprocess.Popen` is.

    It is no child of this process: its end is seen on a descriptor, its exit code is asked for.
    """

    def __init__(
        self,
        forks: Forks,
        folder: Path,
        *arguments: str,
        stdin: int = -1,
        stderr: int = -1,
        environment: Mapping[str, str] | None = None,
    ) -> None:
        """`stdin`, `stderr`: descriptors; nothing to read, and a pipe, without them.

        `environment`: as of `Forks.run`.
        """
        pipes = [os.pipe() for _ in range(2)]
        ends = [os.devnull if stdin < 0 else f"/proc/{os.getpid()}/fd/{stdin}"]
        ends += [f"/proc/{os.getpid()}/fd/{theirs}" for _, theirs in pipes]
        if stderr >= 0:
            ends[2] = f"/proc/{os.getpid()}/fd/{stderr}"
        self.pid = forks.fork(folder, arguments, ends, environment)
        for _, theirs in pipes:
            os.close(theirs)
        self.stdout, self.stderr = (os.fdopen(ours, encoding="utf-8") for ours, _ in pipes)
        self.returncode: int | None = None
        self._forks, self._end = forks, os.pidfd_open(self.pid)

    def poll(self) -> int | None:
        """The exit code, once it has ended."""
        if self.returncode is None and select.select([self._end], [], [], 0)[0]:
            self.returncode = self._forks.ended(self.pid)
            os.close(self._end)
        return self.returncode

    def wait(self, timeout: float = TIMEOUT) -> None:
        """Until it has ended; kills one that does not."""
        if self.returncode is None and not select.select([self._end], [], [], timeout)[0]:
            self.kill()
            raise TimeoutError(f"no end in {timeout:g} s")
        self.poll()

    def communicate(self, timeout: float = TIMEOUT) -> tuple[str, str]:
        """All that it and what it began have yet to say, when it has ended."""
        with ThreadPoolExecutor(2) as pool, self.stdout, self.stderr:
            texts = [pool.submit(stream.read) for stream in (self.stdout, self.stderr)]
            self.wait(timeout)
            out, err = (text.result() for text in texts)
        return out, err

    def send_signal(self, number: int) -> None:
        """To it alone, unless it has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """At once."""
        self.send_signal(signal.SIGKILL)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.stdout.close()
        self.stderr.close()
        self.wait()


@cache
def forks_of(imports: str) -> Forks:
    """The one of this process for commands that differ in what is installed."""
    made = Forks(os.environ | {"PYTHONPATH": ROOT}, imports)
    atexit.register(made.close)
    return made


def python(imports: str, program: str, *arguments: object) -> Begun | subprocess.Popen[str]:
    """A Python program that goes on beside the test, with its arguments; it begins with `imports`.

    On Linux a fork of a process that has imported them.
    """
    words = ["-c", f"{imports}\n{program}", *map(str, arguments)]
    if sys.platform == "linux":
        return Begun(forks_of(imports), Path.cwd(), *words)
    return subprocess.Popen(
        [sys.executable, *words],
        env=os.environ | {"PYTHONPATH": ROOT},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
