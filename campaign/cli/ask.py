"""Prompts for the operator: before the first motion of a real bench, and at operator steps."""

from __future__ import annotations

import os
import select
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path

from campaign.backends.interface import BackendKind
from campaign.cli.output import print_note, print_warning
from campaign.errors import CampaignError, ExitCode, UsageError
from campaign.execution.display import Shown
from campaign.execution.operator_prompts import UNATTENDED, AbsentOperator, Attendance, wait_unless
from campaign.options import Options
from campaign.plain_text import storable
from campaign.protocol import PlannedTest
from campaign.protocol.limit_check import sought_instability
from campaign.protocol.stages import most_of
from campaign.text import clock
from campaign.trial import Trial

GLANCE = 0.2
"""Seconds between two checks of the stop switch during a prompt."""

ASSUMED = "assumed done (--yes)"
ON_ITS_PAGE = "described on the page of the trial"


class NotStartedError(CampaignError):
    """The operator declined; nothing has moved."""

    exit_code = ExitCode.INTERRUPTED


def allow_motion(
    kind: BackendKind, trials: Sequence[Trial], tests: Sequence[PlannedTest], *, yes: bool
) -> None:
    """Print a summary of `trials` on a live bench, and prompt for permission.

    Args:
        tests: with their closest limits; may be empty. A test that may make a loop unstable has a
            prompt of its own, which comes first.

    Raises UsageError without a terminal, and NotStartedError without permission.
    """
    if not kind.live or not trials:
        return
    if not yes and not has_terminal():
        raise UsageError(
            f"the backend {kind.name!r} moves a real bench, and there is no terminal for the "
            "prompt; --yes permits the motion"
        )
    names = {trial.test for trial in trials}
    unstable = list(sought_instability([test for test in tests if test.name in names]))
    for line in unstable:
        print_warning(line)
    if unstable and not yes:
        _must_agree("The bench will shake or reach a limit. Type yes to permit this: ")
    for line in motion_summary(kind.name, trials, tests):
        print_note(line)
    if not yes:
        _must_agree("Is the bench clear for motion? Type yes to begin: ")


def say_by_hand(options: Options) -> None:
    """Print the page with instructions for the operator, if the backend hands trials out."""
    folder = getattr(options, "folder", "")
    if folder:
        print_note(f"instructions for the operator: {Path(folder) / 'index.html'}")


def _must_agree(question: str) -> None:
    print_note(question)
    if sys.stdin.readline().strip().lower() not in ("yes", "y"):
        raise NotStartedError("not started: nothing has moved and nothing was written")


def motion_summary(
    backend: str, trials: Sequence[Trial], tests: Sequence[PlannedTest]
) -> list[str]:
    """Lines on the planned motion: trials, bench time, closest limits, stages, operator steps."""
    duration = clock(sum(trial.task.duration for trial in trials))
    lines = [f"{backend}: {len(trials)} trials, {duration} of bench time"]
    limits = {test.name: test.closest for test in tests}
    for name, count in Counter(trial.test for trial in trials).items():
        worst = max(limits.get(name, ()), key=lambda use: use.margin.fraction, default=None)
        share = f", {worst.margin.fraction:.0%} of the {worst.margin.called} limit" if worst else ""
        lines.append(f"  {name}: {count} trials{share}")
    for test in tests:
        if test.stages and test.name in {trial.test for trial in trials}:
            most = most_of(test.stages)
            after = f"at most {most.trials} more trials, {clock(most.duration)}, may follow"
            lines.append(f"  {test.name}: {after} from its results")
    steps = dict.fromkeys(step for trial in trials for step in trial.setup)
    return [*lines, *(f"  you will be asked to: {step}" for step in steps)]


def attendance_of(kind: BackendKind, display: Shown, *, yes: bool) -> Attendance:
    """Prompts and pauses for a run on this backend."""
    if not (kind.live or kind.by_hand):
        return UNATTENDED
    if yes:
        return Attendance(AbsentOperator(ASSUMED, print_note), wait_unless)
    if kind.by_hand and not has_terminal():
        return Attendance(AbsentOperator(ON_ITS_PAGE), wait_unless)
    return Attendance(ConsoleOperator(display.hidden), wait_unless)


class ConsoleOperator:
    """An operator at the terminal."""

    def __init__(self, hidden: Callable[[], AbstractContextManager[None]]) -> None:
        self._hidden = hidden

    def confirm(self, trial: Trial, step: str, stop: Callable[[], bool]) -> str | None:
        """Prompt until there is an answer; None if the run is stopped or the input ends."""
        with self._hidden():
            print_note(f"before {trial.name} ({trial.label}):\n  {step}", "bold")
            while True:
                print_note("Press Enter after this step, or type stop to end the run: ")
                line = read_line(stop)
                if line is None or line.strip().lower() == "stop":
                    return None
                answer = storable(line.strip()) or "done"
                if answer.lower() not in ("no", "n"):
                    return answer


def read_line(stop: Callable[[], bool]) -> str | None:
    """A line from standard input; None after `stop()` or at the end of the input."""
    if os.name != "posix":  # no wait with a time limit on a terminal
        line = sys.stdin.readline()
        return None if stop() or not line else line
    while not stop():
        ready, _, _ = select.select([sys.stdin], [], [], GLANCE)
        if ready:
            return sys.stdin.readline() or None
    return None


def has_terminal() -> bool:
    """Whether standard input is a terminal."""
    return sys.stdin is not None and sys.stdin.isatty()
