"""Panic stop from a controller's latch."""

from __future__ import annotations

from campaign.plain_text import printable
from campaign.recording import PanicStop
from campaign.wire.codes import LatchCause
from campaign.wire.messages import Latch

NOBODY = "an unnamed host"
FORGETFUL = "unknown: the controller restarted and has no record of stops"


def panic_stop_of(latch: Latch) -> PanicStop | None:
    """The stop reported by a latch; None if it is not latched."""
    if not latch.latched:
        return None
    forgetful = latch.cause is LatchCause.NO_MEMORY
    by = printable(latch.by) or (FORGETFUL if forgetful else NOBODY)
    return PanicStop(latch.count, by, latch.age)
