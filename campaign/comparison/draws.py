"""Simulated trials of two runs with the same random draws: these are not independent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from campaign.api.analysis import AnalysedTest
from campaign.comparison.same_quantity import Pairing
from campaign.trial import Role, Trial

SIMULATION = "simulation"
"""The source whose samples a trial's fingerprint determines; a rig never repeats itself."""


def common_draws(pairing: Pairing) -> Iterator[str]:
    """Sentences on trials that are identical, and on those that have only the seed in common."""
    own: list[Trial] = []
    theirs: list[Trial] = []
    for tested in pairing.tests:
        if {tested.reference.source, tested.other.source} == {SIMULATION}:
            own += _measured(tested.reference)
            theirs += _measured(tested.other)
    identical = _common([t.fingerprint for t in own], [t.fingerprint for t in theirs])
    if identical:
        are = "trial is" if len(theirs) == 1 else "trials are"
        yield (
            f"{identical} of {len(theirs)} {are} identical, to the seed: equal numbers say nothing."
        )
    seeds = _common([t.seed for t in own], [t.seed for t in theirs]) - identical
    if seeds > 0:
        have = "trial has" if len(theirs) == 1 else "trials have"
        yield (
            f"{seeds} of {len(theirs)} {have} the seed in common, and so their random draws,"
            " but not all of bench and task. They are judged as independent runs. As far as the"
            " draws act alike in both, intervals are too wide and may hide a difference. Another"
            " seed in one of the protocols makes them independent."
        )


def _measured(test: AnalysedTest) -> Iterator[Trial]:
    trials = (archived.trial for archived in test.trials)
    return (trial for trial in trials if trial.role is Role.MEASUREMENT)


def _common(one: list[str] | list[int], other: list[str] | list[int]) -> int:
    """How many of one list have a partner of their own in the other."""
    return (Counter[str | int](one) & Counter[str | int](other)).total()
