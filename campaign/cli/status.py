"""`campaign status`: state of a controller, its holder, its latch."""

from __future__ import annotations

import time
from dataclasses import dataclass, field

from campaign.cli.latch import latch_text
from campaign.cli.output import print_json, print_line
from campaign.errors import BackendError, ExitCode
from campaign.execution.display import clock
from campaign.link.panic import panic_stop_of
from campaign.link.port import Port, open_port
from campaign.link.safe import SafeWatch
from campaign.plain_text import printable
from campaign.wire.messages import Holder, Latch, Message, Nak, Query, Status, framed

INTERVAL = 0.1
"""Seconds between two queries."""


@dataclass
class Answers:
    """Newest received message of each kind."""

    status: Status | None = None
    latch: Latch | None = None
    holder: Holder | None = None
    refused: bool = field(default=False)

    def take(self, message: Message) -> None:
        """Store one message of the controller."""
        match message:
            case Status():
                self.status = message
            case Latch():
                self.latch = message
            case Holder():
                self.holder = message
            case Nak():
                self.refused = True

    @property
    def whole(self) -> bool:
        """Whether all messages have arrived."""
        return self.status is not None and self.latch is not None and self.holder is not None


def show_status(port: str, baud: int, patience: float, *, as_json: bool) -> ExitCode:
    """Query and print, without disturbing the holder. Raises BackendError without an answer."""
    answers = Answers()
    line = open_port(port, baud, exclusive=False)
    try:
        _listen(line, answers, time.monotonic() + patience)
    except OSError as error:
        raise BackendError(f"{port}: the line was lost: {error.strerror or error}") from None
    finally:
        line.close()
    if not answers.whole:
        older = "its firmware is too old for this query" if answers.refused else ""
        raise BackendError(
            f"{port}: {older or f'no answer from a controller for {patience:g} s'}; check "
            "port and baud rate, and whether the firmware has this program's version"
        )
    _show(answers, as_json=as_json)
    return ExitCode.DONE


def _listen(line: Port, answers: Answers, deadline: float) -> None:
    watch = SafeWatch(told=answers.take)
    while not answers.whole and time.monotonic() < deadline:
        line.write(framed(Query()))
        again = time.monotonic() + INTERVAL
        while not answers.whole and time.monotonic() < again:
            watch.feed(line.read())


def _show(answers: Answers, *, as_json: bool) -> None:
    status, latch, holder = answers.status, answers.latch, answers.holder
    if status is None or latch is None or holder is None:
        return
    stop, host = panic_stop_of(latch), printable(holder.host)
    if as_json:
        tree = {
            "state": status.state.text,
            "drive_on": status.drive_on,
            "at_rest": status.at_rest,
            "held": holder.held,
            "host": host,
            "heard_s_ago": holder.age,
            "latched": latch.latched,
            "stop": None if stop is None else vars(stop),
        }
        print_json(tree)
        return
    drive, rest = ("on" if status.drive_on else "off"), ("at rest" if status.at_rest else "moving")
    print_line(f"state:  {status.state.text}, drive {drive}, {rest}")
    print_line(f"held:   {_held(holder, host)}")
    print_line(f"latch:  {'not stopped' if stop is None else latch_text(stop)}")


def _held(holder: Holder, host: str) -> str:
    name = host or "an unnamed host"
    if holder.held:
        return f"by {name}"
    if holder.age is None:
        return f"no; the last host was {name}" if host else "no"
    return f"no; {name} was heard {clock(holder.age)} ago"
