"""Facts of the backend under test, and failed checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign.backends.interface import Backend
from campaign.trial import Trial


class CheckFailedError(AssertionError):
    """Behavior of the backend that violates the interface."""


@dataclass(frozen=True)
class BackendUnderTest:
    """A backend and the trials to check it with.

    Attributes:
        open: creates a new backend, not yet entered.
        possible: an executable trial without `stop_rate`; several seconds of bench time, so that
            a stop can interrupt it.
        impossible: a trial that the backend must refuse.
        names: field that the refusal must name, such as `base_acceleration`.
        most_blocks: maximum number of blocks after a stop request.
        failing: creates a backend whose bench fails during `possible`; None if not available.
        live: whether the bench moves in wall-clock time, as declared by its `BackendKind`;
            `possible` must then take its stated duration.
        stop_outside: stops the bench from outside the program, e.g. by `campaign stop`, and
            returns after the confirmation; only for a `SupportsExternalStop`.
    """

    open: Callable[[], Backend]
    possible: Trial
    impossible: Trial
    names: str
    most_blocks: int = 3
    failing: Callable[[], Backend] | None = None
    live: bool = False
    stop_outside: Callable[[], None] | None = None


Check = Callable[[BackendUnderTest], None]
"""Raises CheckFailedError."""


def require(condition: object, message: str) -> None:
    """Fail the check with `message` unless `condition` is true."""
    if not condition:
        raise CheckFailedError(message)
