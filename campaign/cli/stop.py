"""`campaign stop`: the panic stop, independent of the program that holds the port."""

from __future__ import annotations

import random
import time
from dataclasses import dataclass

from campaign.cli.output import print_line, print_note
from campaign.errors import ExitCode, UsageError
from campaign.link.identity import identity, new_session
from campaign.link.port import Port, open_port
from campaign.link.safe import SafeWatch
from campaign.wire.messages import Safe, framed

INTERVAL = 0.02
"""Seconds between two SAFE messages."""
REOPEN = 0.1
"""Seconds before a lost line is opened again."""
LATCHING = 1.0
"""Seconds after which a safe controller that reports no latch is assumed to have none."""
CONFIRMED = "safe state confirmed"
NOT_LATCHED = "safe now, not latched"
NOT_CONFIRMED = "SAFE STATE NOT CONFIRMED"


@dataclass
class Attempt:
    """One panic stop, over any count of line openings.

    Attributes:
        safe_at: start of the confirmed safe state (steady clock, s); None while not confirmed.
    """

    deadline: float
    safe_at: float | None = None

    def __post_init__(self) -> None:
        self._sequence = random.SystemRandom().randrange(2**16)
        self._frame = framed(Safe(new_session(), identity("campaign stop")), self._sequence)
        self.watch = SafeWatch(self._sequence)

    def insist(self, line: Port) -> None:
        """Send SAFE repeatedly until the end. Raises OSError when the line is lost."""
        while not self.is_over():
            line.write(self._frame)
            again = time.monotonic() + INTERVAL
            while not self.is_over() and time.monotonic() < again:
                self.watch.feed(line.read())

    def is_over(self) -> bool:
        """Whether the stop is complete, or the deadline has passed."""
        now = time.monotonic()
        safe = self.watch.confirmed.is_set()
        if not safe:
            self.safe_at = None
        elif self.safe_at is None:
            self.safe_at = now
        if safe and (self.latched or now - (self.safe_at or now) > LATCHING):
            return True
        return now >= self.deadline

    @property
    def latched(self) -> bool:
        """Whether the controller has reported a latched stop."""
        return self.watch.latch is not None and self.watch.latch.latched


def stop_bench(port: str, baud: int, patience: float) -> ExitCode:
    """Send SAFE until the controller reports a latched safe state: at rest, drive off.

    Independent of sessions and other processes, which may hang or read the same port. `patience`
    in s. A port that cannot be opened results in "not confirmed" at once.
    """
    attempt, trouble = Attempt(time.monotonic() + patience), ""
    try:
        line = open_port(port, baud, exclusive=False)
    except UsageError as error:
        return _not_confirmed(str(error))
    while True:
        try:
            attempt.insist(line)
        except OSError as error:
            trouble = error.strerror or str(error)
        line.close()
        if attempt.is_over():
            break
        time.sleep(REOPEN)
        try:
            line = open_port(port, baud, exclusive=False)
        except UsageError as error:
            trouble = str(error)
    if attempt.safe_at is None:
        return _not_confirmed(f"{_why(attempt.watch, patience)}{f'; {trouble}' if trouble else ''}")
    if not attempt.latched:
        print_line(NOT_LATCHED)
        print_note(
            "Old firmware: the program that runs the controller can switch the drive on again. "
            "End that program, or cut the drive's power.",
            "bold red",
        )
        return ExitCode.DONE
    print_line(CONFIRMED)
    return ExitCode.DONE


def _not_confirmed(why: str) -> ExitCode:
    print_line(NOT_CONFIRMED)
    print_note(why, "bold red")
    print_note("Switch the drive off by hand: use the emergency stop.", "bold red")
    return ExitCode.NOT_SAFE


def _why(watch: SafeWatch, patience: float) -> str:
    status = watch.last
    if status is None:
        return f"no message from the controller for {patience:g} s"
    rest = "at rest" if status.at_rest else "moving"
    drive = "on" if status.drive_on else "off"
    return f"the controller reports: {status.state.text}, {rest}, drive {drive}"
