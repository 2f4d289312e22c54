"""Errors of a session; each becomes an Ending."""

from __future__ import annotations

from campaign.recording import Fault, PanicStop
from campaign.wire.messages import Nak


class LinkFaultError(Exception):
    """The session cannot go on as it was.

    Attributes:
        fault: what failed, in the words of a protocol.
    """

    fault = Fault.OTHER


class SilenceError(LinkFaultError):
    """No word, or no answer, from the controller."""

    fault = Fault.LOST_CONNECTION


class ResetError(LinkFaultError):
    """The controller has started anew and knows nothing of what was."""

    fault = Fault.RESET


class RefusedError(LinkFaultError):
    """The controller refused a command.

    Attributes:
        nak: its answer, None when the host refuses in its place.
    """

    fault = Fault.REFUSED

    def __init__(self, text: str, nak: Nak | None = None) -> None:
        super().__init__(text)
        self.nak = nak


class StoppedError(LinkFaultError):
    """Somebody stopped the controller from outside, and it does not arm before that is cleared.

    Attributes:
        stop: as the controller tells of it.
    """

    def __init__(self, stop: PanicStop) -> None:
        super().__init__(str(stop))
        self.stop = stop


class HeldError(LinkFaultError):
    """Another host holds the controller; the text says who."""

    fault = Fault.REFUSED


class ViolationError(LinkFaultError):
    """The controller broke the protocol."""
