"""Errors of a session; each becomes an Ending."""

from __future__ import annotations

from campaign.recording import Fault, PanicStop
from campaign.wire.codes import NakCode


class LinkFaultError(Exception):
    """The session cannot continue.

    Attributes:
        fault: kind of the fault, in the terms of a protocol.
    """

    fault = Fault.OTHER


class SilenceError(LinkFaultError):
    """No message, or no answer, from the controller."""

    fault = Fault.LOST_CONNECTION


class ResetError(LinkFaultError):
    """The controller has restarted and lost its state."""

    fault = Fault.RESET


class RefusedError(LinkFaultError):
    """The controller refused a command.

    Attributes:
        code: of its answer; None if the host refuses in its place.
    """

    fault = Fault.REFUSED

    def __init__(self, text: str, code: NakCode | None = None) -> None:
        super().__init__(text)
        self.code = code


class StoppedError(LinkFaultError):
    """The controller is latched by a panic stop, and does not arm before it is cleared.

    Attributes:
        stop: the stop that the controller reports.
    """

    def __init__(self, stop: PanicStop) -> None:
        super().__init__(str(stop))
        self.stop = stop


class HeldError(LinkFaultError):
    """Another host holds the controller; the text names it."""

    fault = Fault.REFUSED


class ViolationError(LinkFaultError):
    """The controller broke the protocol."""
