"""Errors for the user, each with its exit code.

The codes are part of the public interface (`docs/commands.md`):

====  =======================================================================
code  meaning
====  =======================================================================
0     done
1     some trials failed
6     trials completed, and a test has no result, or nothing could be identified
2     bad usage, protocol or bench file, or no such run
3     a fault of a backend or of another plug-in, or a limit (also a plan that breaks one)
4     an unreadable or damaged archive, or one without the signature it should have
5     safe state NOT confirmed
130   interrupted
====  =======================================================================
"""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path


class ExitCode(IntEnum):
    """Exit status of a command. If several apply, the worst one: see `worst_exit_code`."""

    DONE = 0
    TRIALS_FAILED = 1
    USAGE = 2
    LIMIT_OR_FAULT = 3
    ARCHIVE = 4
    NOT_SAFE = 5
    NO_RESULT = 6
    INTERRUPTED = 130


PRECEDENCE = (
    ExitCode.NOT_SAFE,
    ExitCode.INTERRUPTED,
    ExitCode.LIMIT_OR_FAULT,
    ExitCode.ARCHIVE,
    ExitCode.USAGE,
    ExitCode.NO_RESULT,
    ExitCode.TRIALS_FAILED,
    ExitCode.DONE,
)


def worst_exit_code(codes: Sequence[ExitCode]) -> ExitCode:
    """The first of `codes` in the documented precedence; DONE without any."""
    return next((code for code in PRECEDENCE if code in codes), ExitCode.DONE)


DEBUG = "CAMPAIGN_DEBUG"
"""Environment variable that enables tracebacks."""


def explain_in_debug() -> None:
    """Print the traceback of the handled error if `DEBUG` is set."""
    if os.environ.get(DEBUG):
        traceback.print_exc()


class CampaignError(Exception):
    """An error with one clear message for the user: what, where, what to do."""

    exit_code: ExitCode = ExitCode.USAGE


class UsageError(CampaignError):
    """A command, option, name or file that cannot be used as given."""


@contextmanager
def writing(what: object) -> Iterator[None]:
    """Convert an OSError of writing in the block to a UsageError that names `what`."""
    try:
        yield
    except OSError as error:
        raise UsageError(f"{what}: cannot be written: {error.strerror or error}") from None


class NoResultError(CampaignError):
    """Trials completed, but no requested result could be determined."""

    exit_code = ExitCode.NO_RESULT


@dataclass(frozen=True)
class Problem:
    """One mistake in a text file.

    Attributes:
        file: the file as the user named it.
        line, column: position from 1; 0 if the mistake has no position.
        message: the given text, what is allowed, and the nearest valid name for a typo.
    """

    file: Path
    line: int
    column: int
    message: str

    def __str__(self) -> str:
        place = f"{self.file}:{self.line}:{self.column}" if self.line else str(self.file)
        return f"{place}: {self.message}"


class ProtocolError(UsageError):
    """All mistakes in a protocol, its includes and its benches."""

    def __init__(self, problems: Sequence[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


class LimitError(CampaignError):
    """A planned trial would exceed a limit of its bench; nothing was moved."""

    exit_code = ExitCode.LIMIT_OR_FAULT


class BackendError(CampaignError):
    """A failure of a backend that is not the outcome of one trial."""

    exit_code = ExitCode.LIMIT_OR_FAULT


class ArchiveError(CampaignError):
    """An archive that cannot be read, or fails its own checks."""

    exit_code = ExitCode.ARCHIVE


class ArchiveWarning(UserWarning):
    """A part of an archive is damaged, missing, or differs from the sealed state.

    The intact parts are used. With `strict=True` an ArchiveError is raised instead.
    """
