"""A latched bench: who stopped it, and its release by a person."""

from __future__ import annotations

import sys
from collections.abc import Callable

from campaign.backends import calls
from campaign.backends.interface import Backend, SupportsExternalStop
from campaign.cli.ask import has_terminal, read_line
from campaign.cli.output import print_note
from campaign.errors import BackendError, CampaignError, ExitCode
from campaign.execution.display import clock
from campaign.recording import PanicStop


class StillStoppedError(CampaignError):
    """The bench was stopped and nobody has cleared that: nothing has moved."""

    exit_code = ExitCode.LIMIT_OR_FAULT


def clear_stop(backend: Backend, seen: int | None, stop: Callable[[], bool]) -> str:
    """See that `backend` may move: where it was stopped, a person has to have seen that.

    Returns what was cleared and how, for the record; empty when there was nothing to clear.

    Args:
        backend: connected.
        seen: the count of the stop that a person has seen (`--clear-stop`), or None: then whoever
            sits at the terminal is asked. `--yes` is no answer to that.
        stop: whether the program is to end.

    Raises StillStoppedError when it stays off, with what to do.
    """
    if not isinstance(backend, SupportsExternalStop):
        return ""
    found = calls.panic_stop(backend)
    if found is None:
        if seen is not None:
            print_note(f"--clear-stop {seen}: the bench is not stopped")
        return ""
    print_note(f"PANIC STOP: {latch_text(found)}", "bold red")
    how = "at the terminal" if seen is None else f"by --clear-stop {seen}"
    if seen is None:
        _ask(found, stop)
        seen = found.count
    if seen != found.count:
        raise StillStoppedError(
            f"--clear-stop {seen}: that is not the latest stop; the bench was {latch_text(found)}; "
            "nothing was moved"
        )
    try:
        calls.called(backend, "clear_stop", seen)
    except BackendError as error:  # another stop has come meanwhile, say
        raise StillStoppedError(f"{error}; nothing was moved") from None
    print_note(f"stop {seen} is cleared; the bench may move")
    return f"{latch_text(found)}, was cleared {how}"


def latch_text(stop: PanicStop) -> str:
    """When, by whom, and the count that clears it."""
    when = "at a time that is not known" if stop.age is None else f"{clock(stop.age)} ago"
    return f"stopped by {stop.by}, {when} (stop {stop.count})"


def _ask(found: PanicStop, stop: Callable[[], bool]) -> None:
    if not has_terminal():
        raise StillStoppedError(
            f"the bench was {latch_text(found)}; nothing was moved. See why it was stopped, then "
            f"add --clear-stop {found.count}"
        )
    print_note("It stays off until that is cleared. Look at the bench first.")
    print_note("Type clear when it may move again: ")
    sys.stderr.flush()
    line = read_line(stop)
    if line is None or line.strip().lower() != "clear":
        raise StillStoppedError("the stop was not cleared; nothing was moved")
