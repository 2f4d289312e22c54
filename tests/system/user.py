"""Running the program the way a user does: as a process, in a folder of their own."""

from __future__ import annotations

import atexit
import os
import subprocess
import sys
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.forks import TIMEOUT, Begun, Forks

ROOT = Path(__file__).parents[2]

SEA = """\
title = "A short sea"

[[test]]
name = "sea"
kind = "stabilization"
bench = "simulink"
cycles = 1
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre"]
"""


def environment() -> dict[str, str]:
    """This process's, with the program importable from any folder and a plain terminal."""
    dropped = ("COLUMNS", "FORCE_COLOR", "PYTEST_CURRENT_TEST")
    kept = {k: v for k, v in os.environ.items() if k not in dropped}
    return {**kept, "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "error", "TERM": "dumb"}


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "campaign", *arguments]


@dataclass(frozen=True)
class Done:
    """What a command printed and its exit code."""

    code: int
    out: str
    err: str

    @property
    def last_line(self) -> str:
        return self.out.splitlines()[-1]


USUAL = environment()
"""Before any test has changed a variable."""


@cache
def forks() -> Forks:
    """The one of this process."""
    made = Forks(USUAL)
    atexit.register(made.close)
    return made


def completed(
    folder: Path, *arguments: str, start: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run `campaign` in `folder`, whatever comes of it.

    Args:
        folder: the current one of the command.
        arguments: what is typed after `campaign`.
        start: in a Python of its own, as also with variables that the test has changed: they may
            count when something is imported.
    """
    if not start and sys.platform == "linux" and environment() == USUAL:
        return forks().run(folder, *arguments)
    return subprocess.run(
        command(*arguments),
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=TIMEOUT,
        stdin=subprocess.DEVNULL,
        check=False,
    )


def campaign(folder: Path, *arguments: str, code: int = 0, start: bool = False) -> Done:
    """As `completed`; the exit code must be `code`, and no traceback is shown."""
    process = completed(folder, *arguments, start=start)
    assert "Traceback" not in process.stderr, process.stderr
    assert process.returncode == code, process.stdout + process.stderr
    return Done(process.returncode, process.stdout, process.stderr)


Process = Begun | subprocess.Popen[str]


def begun(folder: Path, *arguments: str, stdin: int = -1) -> Process:
    """`campaign` in `folder`, which goes on while the test does something to it.

    `stdin`: a descriptor; nothing to read without one.
    """
    if sys.platform == "linux" and environment() == USUAL:
        return Begun(forks(), folder, *arguments, stdin=stdin)
    return subprocess.Popen(
        command(*arguments),
        cwd=folder,
        env=environment(),
        stdin=subprocess.DEVNULL if stdin < 0 else stdin,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def write(folder: Path, text: str, name: str = "protocol.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def children(pid: int) -> list[int]:
    """Processes that `pid` has begun."""
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def program_of(process: Process) -> int:
    """The program that moves a bench: what was begun is its guardian."""
    (program,) = children(process.pid)
    return program
