"""Simulated trials of two runs with the same random draws, which are not independent."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from campaign.api.analysis import AnalysedTest
from campaign.comparison.same_quantity import Pairing
from campaign.text import count
from campaign.trial import Role, Trial

SIMULATION = "simulation"
"""Source whose samples a trial's fingerprint determines; samples of a rig never repeat."""


def common_draws(pairing: Pairing) -> Iterator[str]:
    """Sentences on identical trials, and on trials that share only the seed."""
    own: list[Trial] = []
    others: list[Trial] = []
    for tested in pairing.tests:
        if {tested.reference.source, tested.other.source} == {SIMULATION}:
            own += _measured(tested.reference)
            others += _measured(tested.other)
    identical = _common([t.fingerprint for t in own], [t.fingerprint for t in others])
    if identical:
        trials = count(len(others), "trial is", "trials are")
        yield f"{identical} of {trials} identical, to the seed: equal numbers say nothing."
    seeds = _common([t.seed for t in own], [t.seed for t in others]) - identical
    if seeds > 0:
        trials = count(len(others), "trial has", "trials have")
        yield (
            f"{seeds} of {trials} the seed in common, and so their random draws,"
            " but not all of bench and task. They are judged as independent runs. As far as the"
            " draws act alike in both, intervals are too wide and may hide a difference. Another"
            " seed in one of the protocols makes them independent."
        )


def _measured(test: AnalysedTest) -> Iterator[Trial]:
    trials = (archived.trial for archived in test.trials)
    return (trial for trial in trials if trial.role is Role.MEASUREMENT)


def _common(one: list[str] | list[int], other: list[str] | list[int]) -> int:
    """Count of elements that have their own partner in the other list."""
    return (Counter[str | int](one) & Counter[str | int](other)).total()
