"""The interface of a hull motion device next to the controller.

The thesis puts the platform on a six-degree-of-freedom table. This module defines the interface of
such a table, and its substitute for the controller emulator, which emulates the hull motion itself.
"""

from __future__ import annotations

from typing import Protocol

from campaign.recording import SafeState
from campaign.signals import Signal


class BaseMotion(Protocol):
    """A device that moves the hull; its true motion is recorded by the controller's sensors."""

    def load(self, acceleration: Signal, duration: float) -> None:
        """Prepare an angular acceleration (rad/s^2) over `duration` (s). Raises BackendError."""

    def trigger(self) -> None:
        """Begin the motion, and with it the trial."""

    def stop(self) -> None:
        """Come to rest, if it moves."""

    def make_safe(self) -> SafeState:
        """Come to rest; whether that is confirmed."""


class EmulatedMotion:
    """Motion that the controller emulator receives with the trial's configuration."""

    def load(self, acceleration: Signal, duration: float) -> None:
        """Nothing to load."""

    def trigger(self) -> None:
        """The controller's START is the trigger."""

    def stop(self) -> None:
        """Nothing to do: the emulated hull rests at the end of the trial."""

    def make_safe(self) -> SafeState:
        """Confirm: nothing moves."""
        return SafeState.CONFIRMED
