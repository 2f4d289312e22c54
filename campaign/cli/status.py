"""`campaign status`: state of a controller, its holder, its latch."""

from __future__ import annotations

import math
import time
from typing import Any

from campaign.cli.latch import latch_text
from campaign.cli.output import print_json, print_line
from campaign.errors import BackendError, ExitCode
from campaign.link.panic import panic_stop_of
from campaign.link.port import Port, open_port
from campaign.link.safe import SafeWatch
from campaign.plain_text import printable
from campaign.text import clock
from campaign.wire.messages import Holder, Latch, Nak, Query, Status, framed

INTERVAL = 0.1
"""Seconds between two queries."""


ANSWERS = (Status, Latch, Holder)
"""Messages that answer a query."""


def show_status(port: str, baud: int, patience: float, *, as_json: bool) -> ExitCode:
    """Query and print, without disturbing the holder. Raises BackendError without an answer."""
    line = open_port(port, baud, exclusive=False)
    try:
        newest = _newest(line, time.monotonic() + patience)
    except OSError as error:
        raise BackendError(f"{port}: the line was lost: {error.strerror or error}") from None
    finally:
        line.close()
    if not newest.keys() >= set(ANSWERS):
        older = "its firmware is too old for this query" if Nak in newest else ""
        raise BackendError(
            f"{port}: {older or f'no answer from a controller for {patience:g} s'}; check "
            "port and baud rate, and whether the firmware has this program's version"
        )
    _show(newest[Status], newest[Latch], newest[Holder], as_json=as_json)
    return ExitCode.DONE


def _newest(line: Port, deadline: float) -> dict[type, Any]:
    """Newest message of each type, until all `ANSWERS` have arrived or the deadline has passed."""
    newest: dict[type, Any] = {}
    watch = SafeWatch(told=lambda message: newest.update({type(message): message}))
    again = -math.inf
    while (now := time.monotonic()) < deadline and not newest.keys() >= set(ANSWERS):
        if now >= again:
            line.write(framed(Query()))
            again = time.monotonic() + INTERVAL
        watch.feed(line.read())
    return newest


def _show(status: Status, latch: Latch, holder: Holder, *, as_json: bool) -> None:
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
