"""Running the program the way a user does: as a process, in a folder of their own."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

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
    kept = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "FORCE_COLOR")}
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


def campaign(folder: Path, *arguments: str, code: int = 0) -> Done:
    """Run `campaign` in `folder`; the exit code must be `code`, and no traceback is shown."""
    process = subprocess.run(
        command(*arguments),
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=600,  # the first one compiles the engine
        stdin=subprocess.DEVNULL,
    )
    assert "Traceback" not in process.stderr, process.stderr
    assert process.returncode == code, process.stdout + process.stderr
    return Done(process.returncode, process.stdout, process.stderr)


def write(folder: Path, text: str, name: str = "protocol.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def children(pid: int) -> list[int]:
    """Processes that `pid` has begun."""
    return [int(text) for text in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def program_of(process: subprocess.Popen[str]) -> int:
    """The program that moves a bench: what was begun is its guardian."""
    (program,) = children(process.pid)
    return program
