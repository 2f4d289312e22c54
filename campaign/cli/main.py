"""Execution of a command; conversion of errors into messages and exit codes."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import NoReturn

from campaign.cli.bench_commands import app  # with all commands
from campaign.cli.output import plain_streams, print_note
from campaign.entry_points import blamed, one_line
from campaign.errors import (
    DEBUG,
    CampaignError,
    ExitCode,
    ProtocolError,
    UsageError,
    explain_in_debug,
)
from campaign.plain_text import printable

PLUG_IN_FAULT = ExitCode.LIMIT_OR_FAULT
INTERNAL_ERROR = 70  # EX_SOFTWARE of sysexits.h: a bug, not a documented code


def main() -> None:
    """Run the command line and exit with its documented code."""
    # Matrices are small, and each trial has its own thread: threads of BLAS would only block each
    # other (8 ms for an exponential that takes 15 us). numpy reads the variable at import.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with plain_streams():
        _run()


def _run() -> None:
    try:
        _check_texts()
        app(prog_name="campaign")
    except SystemExit as leaving:
        if _by_interrupt(leaving):
            _leave("campaign: interrupted", ExitCode.INTERRUPTED)
        if plug_in := blamed(leaving):
            _leave(f"campaign: {plug_in.package} failed: {one_line(leaving)}", PLUG_IN_FAULT)
        raise
    except ProtocolError as error:  # unchanged text: editors jump to file:line:column
        explain_in_debug()
        _leave(str(error), error.exit_code)
    except CampaignError as error:
        explain_in_debug()
        _leave(f"campaign: {error}", error.exit_code)
    except KeyboardInterrupt:
        _leave("campaign: interrupted", ExitCode.INTERRUPTED)
    except Exception as error:  # noqa: BLE001 - a bug: traceback on request only
        explain_in_debug()
        again = f"Set {DEBUG}=1 and run the command again for its traceback."
        if plug_in := blamed(error):
            _leave(f"campaign: {plug_in.package} failed: {one_line(error)}\n{again}", PLUG_IN_FAULT)
        what = f"{type(error).__name__}: {error}"
        _leave(f"campaign: internal error: {what}\nThis is a bug. {again}", INTERNAL_ERROR)


def _check_texts() -> None:
    """Raise UsageError for a name that is not valid UTF-8, the encoding of archives and pages."""
    try:
        here = str(Path.cwd())
    except FileNotFoundError:
        raise UsageError("the current folder was removed; change into another one") from None
    for text in (*sys.argv[1:], here):
        try:
            text.encode()
        except UnicodeEncodeError:
            raise UsageError(
                f"{printable(text)}: this name is not valid UTF-8; rename the file or folder"
            ) from None


def _by_interrupt(leaving: SystemExit) -> bool:
    """Whether typer has converted a KeyboardInterrupt into this SystemExit."""
    return isinstance(getattr(leaving.__context__, "__cause__", None), KeyboardInterrupt)


def _leave(message: str, code: int) -> NoReturn:
    print_note(message)
    sys.exit(code)
