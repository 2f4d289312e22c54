"""Prompts to the operator at the bench, and the time they take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from campaign.execution.writer import PlanWriter
from campaign.trial import Trial

Stop = Callable[[], bool]
"""Whether the run is to stop."""
GLANCE = 0.1
"""s between two looks at the stop switch during a pause."""


class Operator(Protocol):
    """A person, or what stands in for one."""

    def confirm(self, trial: Trial, step: str, stop: Stop) -> str | None:
        """Show what has to be done to the bench before `trial`, and wait until it is.

        Returns the answer for the record, or None when the run is to stop instead, also because
        `stop()`: it is asked again and again, for whoever has switched the bench off meanwhile.
        """


class SimulatedOperator:
    """Does everything at once; for benches that nobody can touch."""

    def confirm(self, trial: Trial, step: str, stop: Stop) -> str | None:
        """Nobody is asked."""
        return "simulated"


def no_wait(seconds: float, stop: Stop) -> None:
    """The pause of a bench that does not get warm."""


def wait_unless(seconds: float, stop: Stop) -> None:
    """A pause on the wall clock (s) that ends at once when the run is stopped."""
    end = time.monotonic() + seconds
    while not stop() and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, GLANCE))


@dataclass(frozen=True)
class Attendance:
    """What differs between a bench with a person beside it and one without.

    Attributes:
        wait: lets the given time (s) pass, or less when the run is to stop.
    """

    operator: Operator
    wait: Callable[[float, Stop], None]


UNATTENDED = Attendance(SimulatedOperator(), no_wait)


class SetUp:
    """What has been confirmed of the bench's state, so that nothing is asked twice."""

    def __init__(self, operator: Operator, writer: PlanWriter) -> None:
        self._operator = operator
        self._writer = writer
        self._confirmed: tuple[str, ...] = ()

    def is_due(self, trial: Trial) -> bool:
        """Whether somebody has to do something before `trial`; one that asks for nothing may
        find the bench as it is.
        """
        return bool(trial.setup) and trial.setup != self._confirmed

    def confirm(self, trial: Trial, stop: Stop) -> bool:
        """Ask for every step, in order; False when the run is to stop instead."""
        for step in trial.setup:
            answer = self._operator.confirm(trial, step, stop)
            self._writer.operator_step(trial.number, step, "stop" if answer is None else answer)
            if answer is None:
                return False
        self._confirmed = trial.setup
        return True
