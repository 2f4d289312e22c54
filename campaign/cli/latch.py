"""A latched bench: its stop, and the release by an operator."""

from __future__ import annotations

import sys
from collections.abc import Callable

from campaign.backends import calls
from campaign.backends.interface import Backend, SupportsExternalStop
from campaign.cli.ask import has_terminal, read_line
from campaign.cli.output import print_note
from campaign.errors import BackendError, CampaignError, ExitCode
from campaign.recording import PanicStop
from campaign.text import clock


class StillStoppedError(CampaignError):
    """The bench is stopped and the stop is not cleared; nothing has moved."""

    exit_code = ExitCode.LIMIT_OR_FAULT


def clear_stop(backend: Backend, seen: int | None, stop: Callable[[], bool]) -> str:
    """Clear a panic stop of `backend` after confirmation by an operator.

    Returns text on the cleared stop, for the record; empty without a stop.

    Args:
        backend: connected.
        seen: count of the stop that the operator has seen (`--clear-stop`); None: prompt at the
            terminal, also with `--yes`.
        stop: whether the program is to end.

    Raises StillStoppedError, with advice, if the stop is not cleared.
    """
    if not isinstance(backend, SupportsExternalStop):
        return ""
    latch = calls.panic_stop(backend)
    if latch is None:
        if seen is not None:
            print_note(f"--clear-stop {seen}: the bench is not stopped")
        return ""
    print_note(f"PANIC STOP: {latch_text(latch)}", "bold red")
    how = "at the terminal" if seen is None else f"by --clear-stop {seen}"
    if seen is None:
        _ask(latch, stop)
        seen = latch.count
    if seen != latch.count:
        raise StillStoppedError(
            f"--clear-stop {seen}: not the latest stop; the bench was {latch_text(latch)}; "
            "nothing was moved"
        )
    try:
        calls.called(backend, "clear_stop", seen)
    except BackendError as error:  # e.g. after another stop
        raise StillStoppedError(f"{error}; nothing was moved") from None
    print_note(f"stop {seen} is cleared; the bench may move")
    return f"{latch_text(latch)}, was cleared {how}"


def latch_text(stop: PanicStop) -> str:
    """Text on a stop: who, when, and the count that clears it."""
    when = "at an unknown time" if stop.age is None else f"{clock(stop.age)} ago"
    return f"stopped by {stop.by}, {when} (stop {stop.count})"


def _ask(found: PanicStop, stop: Callable[[], bool]) -> None:
    if not has_terminal():
        raise StillStoppedError(
            f"the bench was {latch_text(found)}; nothing was moved. Find its reason, then add "
            f"--clear-stop {found.count}"
        )
    print_note("The drive stays off until the stop is cleared. Check the bench first.")
    print_note("Type clear when it may move again: ")
    sys.stderr.flush()
    line = read_line(stop)
    if line is None or line.strip().lower() != "clear":
        raise StillStoppedError("the stop was not cleared; nothing was moved")
