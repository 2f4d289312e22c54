"""Prompts to the operator at the bench, and the time they take."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

from campaign.archive.writing.writer import RunWriter
from campaign.trial import Trial

Stop = Callable[[], bool]
"""Whether the run is to stop."""
GLANCE = 0.1
"""s between two checks of the stop switch during a pause."""


class Operator(Protocol):
    """A person, or a substitute."""

    def confirm(self, trial: Trial, step: str, stop: Stop) -> str | None:
        """Show the operator step before `trial`, and wait for its confirmation.

        Returns the answer for the record, or None if the run is to stop instead. `stop()` is polled
        to detect a bench that is switched off during the prompt.
        """


@dataclass(frozen=True)
class AbsentOperator:
    """Confirms every step immediately, without a prompt.

    Attributes:
        answer: for the record.
        say: called with a line on each step.
    """

    answer: str = "simulated"
    say: Callable[[str], None] = lambda line: None

    def confirm(self, trial: Trial, step: str, stop: Stop) -> str | None:
        """Assume that the step is done."""
        self.say(f"before {trial.name}: {step}: {self.answer}")
        return self.answer


def wait_unless(seconds: float, stop: Stop) -> None:
    """Pause in wall-clock time (s) that ends immediately at a stop."""
    end = time.monotonic() + seconds
    while not stop() and (left := end - time.monotonic()) > 0:
        time.sleep(min(left, GLANCE))


@dataclass(frozen=True)
class Attendance:
    """Operator and pauses of a run.

    Attributes:
        wait: waits the given time (s), or less at a stop.
    """

    operator: Operator
    wait: Callable[[float, Stop], None]


UNATTENDED = Attendance(AbsentOperator(), lambda seconds, stop: None)
"""No operator, and no pauses: a simulation has no thermal effects."""


class SetUp:
    """Confirmed setup of the bench, to avoid repeated prompts."""

    def __init__(self, operator: Operator, writer: RunWriter) -> None:
        self._operator = operator
        self._writer = writer
        self._confirmed: tuple[str, ...] = ()

    def is_due(self, trial: Trial) -> bool:
        """Whether `trial` has setup steps that differ from the confirmed ones."""
        return bool(trial.setup) and trial.setup != self._confirmed

    def confirm(self, trial: Trial, stop: Stop) -> bool:
        """Prompt for every step, in order; False if the run is to stop instead."""
        for step in trial.setup:
            answer = self._operator.confirm(trial, step, stop)
            self._writer.operator_step(trial.number, step, "stop" if answer is None else answer)
            if answer is None:
                return False
        self._confirmed = trial.setup
        return True
