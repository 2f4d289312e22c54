"""A program that moves a bench goes on as the child of its guardian."""

from __future__ import annotations

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from campaign import interrupts
from campaign.backends.interface import BackendKind
from campaign.errors import UsageError
from campaign.execution.guardian import VARIABLE


@dataclass(frozen=True)
class GuardianPipes:
    """The ends that the guardian has given us.

    Attributes:
        come, back: of one pipe: signals to this program, also those that it writes itself.
        tell: to the guardian.
    """

    come: int
    back: int
    tell: int


def under_guardian(kind: BackendKind) -> GuardianPipes | None:
    """Begin anew as the child of a guardian, where `kind` moves a bench and there is none yet.

    To be called before anything is begun or said. None where no guardian is needed, and in a
    program that only uses this one as a library. Raises UsageError on a system without any.
    """
    if not kind.live:
        return None
    if given := os.environ.pop(VARIABLE, ""):
        pipes = GuardianPipes(*map(int, given.split(",")))
        for end in (pipes.come, pipes.back, pipes.tell):
            os.set_inheritable(end, False)
        os.set_blocking(pipes.tell, False)
        return pipes
    if interrupts.is_program():
        _begin_anew(kind)
    return None


def _begin_anew(kind: BackendKind) -> NoReturn:
    if os.name != "posix":
        raise UsageError(
            f"the backend {kind.name!r} moves a bench: run it on Linux or macOS; on this system no "
            "other process can watch the program"
        )
    sys.stdout.flush()
    sys.stderr.flush()
    guardian = str(Path(__file__).with_name("guardian.py"))
    # -I, -S: nothing in the user's folder can stand in for a module of the library.
    command = [sys.executable, "-I", "-S", guardian, sys.executable, *sys.orig_argv[1:]]
    os.execv(sys.executable, command)  # noqa: S606 - our own program, no shell
