"""The interface of a hull motion device beside the controller.

The thesis puts the platform on a six-degree-of-freedom table. Here is what such a table has to do,
and the one of a rehearsal, whose motion the rehearsal controller emulates together with the bench.
"""

from __future__ import annotations

from typing import Protocol

from campaign.recording import SafeState
from campaign.signals import Signal


class BaseMotion(Protocol):
    """A device that moves the hull; its true motion is recorded by the controller's sensors."""

    def load(self, acceleration: Signal, duration: float) -> None:
        """Get ready for an angular acceleration (rad/s^2) over `duration` (s). BackendError."""

    def trigger(self) -> None:
        """Begin now; the trial begins with it."""

    def stop(self) -> None:
        """Come to rest; nothing to do when it is."""

    def make_safe(self) -> SafeState:
        """Come to rest and say whether that was seen."""


class EmulatedMotion:
    """What it would do goes to the rehearsal controller with the rest of the trial."""

    def load(self, acceleration: Signal, duration: float) -> None:
        """Nothing to load."""

    def trigger(self) -> None:
        """The controller's START is the trigger."""

    def stop(self) -> None:
        """The emulated hull rests when the trial has ended."""

    def make_safe(self) -> SafeState:
        """Nothing moves."""
        return SafeState.CONFIRMED
