"""`campaign stop`: the panic stop. It opens the port itself, whoever has it, and sends SAFE."""

from __future__ import annotations

import time

from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode, UsageError
from campaign.link.port import Port, open_port
from campaign.link.safe import SafeWatch, safe_frame

INTERVAL = 0.02
"""s between two SAFE."""
REOPEN = 0.1
"""s until a line that was lost is tried again."""
CONFIRMED = "safe state confirmed"
NOT_CONFIRMED = "SAFE STATE NOT CONFIRMED"


def stop_bench(port: str, baud: int, patience: float) -> ExitCode:
    """Send SAFE until the controller says that it is at rest with its drive off.

    Needs no session and no other process: another one may hang, or read the same port beside us.
    `patience` in s. A port that cannot be opened is said at once, as what it is: not confirmed.
    """
    deadline = time.monotonic() + patience
    watch, trouble = SafeWatch(), ""
    try:
        line = open_port(port, baud, exclusive=False)
    except UsageError as error:
        return _not_confirmed(str(error))
    while not watch.confirmed.is_set() and time.monotonic() < deadline:
        try:
            _insist(line, watch, deadline)
        except OSError as error:
            trouble = error.strerror or str(error)
        if watch.confirmed.is_set():
            break
        line.close()
        time.sleep(REOPEN)
        try:
            line = open_port(port, baud, exclusive=False)
        except UsageError as error:
            trouble = str(error)
    line.close()
    if watch.confirmed.is_set():
        print_line(CONFIRMED)
        return ExitCode.DONE
    return _not_confirmed(f"{_why(watch, patience)}{f'; {trouble}' if trouble else ''}")


def _not_confirmed(why: str) -> ExitCode:
    print_line(NOT_CONFIRMED)
    print_note(why, "bold red")
    print_note("Switch the drive off by hand: use the emergency stop.", "bold red")
    return ExitCode.NOT_SAFE


def _insist(line: Port, watch: SafeWatch, deadline: float) -> None:
    """SAFE again and again until confirmed. Raises OSError when the line is lost."""
    while not watch.confirmed.is_set() and time.monotonic() < deadline:
        line.write(safe_frame())
        again = time.monotonic() + INTERVAL
        while not watch.confirmed.is_set() and time.monotonic() < again:
            watch.feed(line.read())


def _why(watch: SafeWatch, patience: float) -> str:
    status = watch.last
    if status is None:
        return f"no word from the controller for {patience:g} s"
    rest = "at rest" if status.at_rest else "moving"
    drive = "on" if status.drive_on else "off"
    return f"the controller says: {status.state.text}, {rest}, drive {drive}"
