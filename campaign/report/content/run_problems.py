"""Problems of a run as sentences."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from campaign.api.analysis import NOT_EXECUTED, AnalysedTest
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import hidden_trials, lost_trials
from campaign.archive.reading.run_reader import RunReader
from campaign.experiments.shared.common import method
from campaign.recording import Outcome, SafeState
from campaign.text import count

WORDS = {
    Outcome.LIMIT: "ended at a limit",
    Outcome.DIVERGED: "diverged",
    Outcome.FAULT: "failed by a fault",
}
ENDED = {
    RunStatus.INTERRUPTED: "The run was interrupted",
    RunStatus.FAULT: "The run ended early, by a fault",
    RunStatus.INCOMPLETE: "The archive has no end of the run: it is in progress, or it was killed",
}
SOUGHT = (Outcome.LIMIT, Outcome.DIVERGED)
"""Outcomes of a trial with an unstable loop."""
LONGEST = 200
"""Maximum number of characters of a reason."""
METHOD = "compensation"
"""Path of the method in a matrix."""
_NUMBER = re.compile(r"[-+\d.]+")


def wrong_with(
    run: RunReader, tests: Sequence[AnalysedTest], damaged: Sequence[Damage]
) -> Iterator[str]:
    """Sentences on the run's end, safety, trials, methods, damage, analyses."""
    yield from _end(run)
    yield from _safety(run)
    yield from _not_executed(run)
    yield from _failed(run, tests)
    yield from _never_ran(run, tests)
    yield from _damage(damaged)
    without = [test.title for test in tests if test.problem and test.trials]
    if without:
        names = ", ".join(without)
        yield f"No result of {len(without)} of {count(len(tests), 'test')}: {names}."


def without_trials(run: RunReader, tests: Sequence[AnalysedTest]) -> Iterator[str]:
    """One line on tests without any executed trial, after the end of the run as the cause."""
    names = [test.name for test in tests if test.problem == NOT_EXECUTED]
    if names:
        sentence = f"No trial of {count(len(names), 'test')} was executed: {', '.join(names)}."
        yield " ".join((*_end(run), sentence))


def _end(run: RunReader) -> Iterator[str]:
    if run.status in ENDED:
        known = run.reason and run.status is not RunStatus.INCOMPLETE  # it would repeat ENDED
        yield ENDED[run.status] + (f": {_short(run.reason)}." if known else ".")


def _safety(run: RunReader) -> Iterator[str]:
    """Sentences on a safe state that is not confirmed; also for a run without an end."""
    unsafe = [t for t in run.trials if t.ending.safe_state is SafeState.NOT_CONFIRMED]
    if run.safe_state is SafeState.NOT_CONFIRMED:
        yield "Safe state NOT confirmed: the bench was not seen at rest, its drive off, at the end."
    if unsafe:
        trials = count(len(unsafe), "trial")
        yield f"After {trials} the bench was not seen at rest with its drive off."


def _not_executed(run: RunReader) -> Iterator[str]:
    lost = len(lost_trials(run))
    hidden = hidden_trials(run)
    missing = len(run.plan) - len(run.trials) - lost - hidden
    planned = count(len(run.plan), "trial")
    if hidden:
        they = "it was" if hidden == 1 else "they were"
        yield (
            f"{hidden} of {planned} cannot be read, and the archive does not say any more whether "
            f"{they} executed."
        )
    if missing > 0:
        yield f"{missing} of {planned} {'was' if missing == 1 else 'were'} not executed."
    if lost:
        yield f"{count(lost, 'trial was', 'trials were')} executed and cannot be read."


def _failed(run: RunReader, tests: Sequence[AnalysedTest]) -> Iterator[str]:
    """Count of incomplete trials with the most frequent reason; sought instability separately."""
    seekers = {t.name: t.title for t in tests if t.experiment and t.experiment.seeks_instability}
    failed = [t for t in run.trials if t.ending.outcome is not Outcome.COMPLETED]
    is_sought = [t.trial.test in seekers and t.ending.outcome in SOUGHT for t in failed]
    sought = [trial for trial, yes in zip(failed, is_sought, strict=True) if yes]
    others = [trial for trial, yes in zip(failed, is_sought, strict=True) if not yes]
    if others:
        yield (
            f"{len(others)} of {count(len(run.trials), 'executed trial')} did not complete"
            f" ({_by_outcome(others)}); {_commonest(others)}."
        )
    for name, title in seekers.items():
        own = sum(each.trial.test == name for each in sought)
        if own:
            yield (
                f"{count(own, 'trial')} of {title} ended early, at a limit or undefined: it goes to"
                " where a loop becomes unstable, and such an end is a result."
            )


def _never_ran(run: RunReader, tests: Sequence[AnalysedTest]) -> Iterator[str]:
    """Planned methods of a test without a completed trial, if other methods have one."""
    planned = {str(each.get("name", "")): each.get("matrix") for each in run.header.tests}
    for test in tests:
        matrix = planned.get(test.name)
        methods = matrix.get(METHOD) if isinstance(matrix, Mapping) else None
        failed = {each.trial.number for each in test.failed}
        ran = {t.trial.point.get(METHOD) for t in test.trials if t.trial.number not in failed}
        if not ran or not isinstance(methods, list | tuple):
            continue
        for name in dict.fromkeys(methods):
            if name not in ran:
                words = "without compensation" if name == "none" else f"with {method(name)}"
                yield (
                    f"No trial {words} completed in {test.title}: it was planned, and is in none "
                    "of its numbers."
                )


def _by_outcome(failed: Sequence[ArchivedTrial]) -> str:
    counts = Counter(each.ending.outcome for each in failed)
    return ", ".join(f"{n} {_ended(outcome, n)}" for outcome, n in counts.most_common())


def _ended(way: Outcome, trials: int) -> str:
    if way is Outcome.INTERRUPTED:
        return "was interrupted" if trials == 1 else "were interrupted"
    return WORDS.get(way, str(way))


def _commonest(failed: Sequence[ArchivedTrial]) -> str:
    """Most frequent reason, numbers ignored, in the words of its first trial."""
    kinds: dict[str, list[str]] = {}
    for each in failed:
        reason = each.ending.reason or "no reason is archived"
        kinds.setdefault(_NUMBER.sub("#", reason), []).append(reason)
    alike = max(kinds.values(), key=len)
    if len(kinds) > 1:
        return f"the commonest reason ({len(alike)}), such as: {_short(alike[0])}"
    return f"{'the reason' if len(alike) == 1 else 'such as'}: {_short(alike[0])}"


def _damage(damaged: Sequence[Damage]) -> Iterator[str]:
    if damaged:
        places = count(len(damaged), "place")
        yield (
            f"The archive is damaged in {places}: what cannot be read is in none of these numbers."
        )


def _short(text: str) -> str:
    """Text in one line of limited length, without its full stop."""
    line = " ".join(text.split()).rstrip(".")
    return line if len(line) <= LONGEST else f"{line[:LONGEST]} …"
