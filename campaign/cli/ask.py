"""Questions to a person: before the first motion of a real bench, and at operator steps."""

from __future__ import annotations

import os
import select
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from campaign.backends.interface import BackendKind
from campaign.cli.output import print_note
from campaign.errors import CampaignError, ExitCode, UsageError
from campaign.execution.display import Shown, clock
from campaign.execution.operator_prompts import UNATTENDED, Attendance, wait_unless
from campaign.options import Options
from campaign.plain_text import storable
from campaign.protocol import PlannedTest
from campaign.protocol.limit_check import sought_instability
from campaign.protocol.stages import most_of
from campaign.trial import Trial

GLANCE = 0.2
"""s between two looks at the stop switch while nobody types."""

ASSUMED = "assumed done (--yes)"
ON_ITS_PAGE = "described on the page of the trial"


class NotStartedError(CampaignError):
    """Somebody was asked and said no: nothing has moved."""

    exit_code = ExitCode.INTERRUPTED


def allow_motion(
    kind: BackendKind, trials: Sequence[Trial], tests: Sequence[PlannedTest], *, yes: bool
) -> None:
    """Show in short what `trials` will do to a live bench, and ask whether they may.

    Args:
        tests: with the limits they come close to; may be empty. Whether a loop may be made
            unstable is a question of its own, and the first.

    Raises UsageError when there is nobody to ask, and NotStartedError when they may not.
    """
    if not kind.live or not trials:
        return
    if not yes and not has_terminal():
        raise UsageError(
            f"the backend {kind.name!r} moves a real bench, and there is no terminal to ask "
            "whether it may; --yes says so"
        )
    names = {trial.test for trial in trials}
    unstable = list(sought_instability([test for test in tests if test.name in names]))
    for line in unstable:
        print_note(line, "yellow")
    if unstable and not yes:
        _must_agree("It will shake, or run into a limit. Type yes if it may: ")
    for line in motion_summary(kind.name, trials, tests):
        print_note(line)
    if not yes:
        _must_agree("Is the bench clear, and may it move? Type yes to begin: ")


def say_by_hand(options: Options) -> None:
    """Where the person at the rig reads what to do, of a backend whose trials are handed out."""
    folder = getattr(options, "folder", "")
    if folder:
        print_note(f"for the person at the rig: {Path(folder) / 'index.html'}")


def _must_agree(question: str) -> None:
    print_note(question)
    if sys.stdin.readline().strip().lower() not in ("yes", "y"):
        raise NotStartedError("not started: nothing has moved and nothing was written")


def motion_summary(
    backend: str, trials: Sequence[Trial], tests: Sequence[PlannedTest]
) -> list[str]:
    """What is about to move, how long, how close to which limits, and what people have to do."""
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
            lines.append(f"  {test.name}: {after} from what it finds")
    steps = dict.fromkeys(step for trial in trials for step in trial.setup)
    return [*lines, *(f"  you will be asked to: {step}" for step in steps)]


def attendance_of(kind: BackendKind, display: Shown, *, yes: bool) -> Attendance:
    """Who is asked during a run on this backend, and whether its pauses are waited for."""
    if not (kind.live or kind.by_hand):
        return UNATTENDED
    if yes:
        return Attendance(AbsentOperator(ASSUMED), wait_unless)
    if kind.by_hand and not has_terminal():
        return Attendance(AbsentOperator(ON_ITS_PAGE, shows=False), wait_unless)
    return Attendance(ConsoleOperator(display.hidden), wait_unless)


@dataclass(frozen=True)
class AbsentOperator:
    """Nobody is asked: a script said `--yes`, or the person reads the steps elsewhere.

    Attributes:
        answer: for the record.
        shows: whether the steps are printed.
    """

    answer: str
    shows: bool = True

    def confirm(self, trial: Trial, step: str, stop: Callable[[], bool]) -> str | None:
        """Takes the step for done; the record has the answer."""
        if self.shows:
            print_note(f"before {trial.name}: {step}: {self.answer}")
        return self.answer


class ConsoleOperator:
    """A person at the terminal."""

    def __init__(self, hidden: Callable[[], AbstractContextManager[None]]) -> None:
        self._hidden = hidden

    def confirm(self, trial: Trial, step: str, stop: Callable[[], bool]) -> str | None:
        """Ask until there is an answer, the run is stopped, or nobody is there any more."""
        with self._hidden():
            print_note(f"before {trial.name} ({trial.label}):\n  {step}", "bold")
            while True:
                print_note("Enter when it is done, or stop to end the run: ")
                line = read_line(stop)
                if line is None or line.strip().lower() == "stop":
                    return None
                answer = storable(line.strip()) or "done"
                if answer.lower() not in ("no", "n"):
                    return answer


def read_line(stop: Callable[[], bool]) -> str | None:
    """A line from standard input; None when `stop()` or when there will be none."""
    if os.name != "posix":  # where a terminal cannot be waited for with a time limit
        line = sys.stdin.readline()
        return None if stop() or not line else line
    while not stop():
        ready, _, _ = select.select([sys.stdin], [], [], GLANCE)
        if ready:
            return sys.stdin.readline() or None
    return None


def has_terminal() -> bool:
    """Whether there is a terminal to ask."""
    return sys.stdin is not None and sys.stdin.isatty()
