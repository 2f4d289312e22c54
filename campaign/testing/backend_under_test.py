"""Facts of the backend under test, and failed checks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign.backends.interface import Backend
from campaign.trial import Trial


class CheckFailedError(AssertionError):
    """What the backend did, and what the interface asks for."""


@dataclass(frozen=True)
class BackendUnderTest:
    """A backend and what it is tried with.

    Attributes:
        open: makes a new one, not yet entered.
        possible: a trial that it executes to its end; several seconds of bench time, so that a stop
            finds it under way, and no `stop_rate`.
        impossible: a trial that it has to refuse.
        names: what the refusal has to name: the field, such as `base_acceleration`.
        most_blocks: how many blocks of samples may still come once a stop was asked for.
        failing: makes a backend whose bench fails during `possible`; None when that cannot be had.
        live: whether it moves something in the time of the wall clock, as its `BackendKind` says;
            `possible` then has to take as long as it says.
        stop_outside: stops the bench as a person beside the program would, e.g. by
            `campaign stop`, and returns once that is confirmed; of a `SupportsExternalStop` only.
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
