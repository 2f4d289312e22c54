"""Repeated check trials of a run: `[check]`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.protocol.expand import ExpandedTest, place_hash
from campaign.protocol.schema import CheckEntry, Protocol
from campaign.trial import Role, Trial


def with_checks(
    tests: Sequence[ExpandedTest], named: int, check: CheckEntry, seed: int
) -> list[ExpandedTest]:
    """The tests with the checks inserted, all numbered in the order of execution.

    After every `check.every` measurements of the plan, the first measurement of the test with the
    index `named` is repeated: role `check`, counted by `repeat`, with a seed that depends on that
    test's `seed`. Checks are trials of that test; only the numbers of other trials change.
    """
    original, bench = _first(tests[named])
    pairs: list[list[tuple[Trial, Bench]]] = [[] for _ in tests]
    number = measured = 0
    for owner, test in enumerate(tests):
        for trial, own in zip(test.trials, test.benches, strict=True):
            number += 1
            pairs[owner].append((_changed(trial, number=number), own))
            if trial.role is not Role.MEASUREMENT:
                continue
            measured += 1
            if measured % check.every == 0:
                number, count = number + 1, measured // check.every
                again = _changed(
                    original,
                    number=number,
                    role=Role.CHECK,
                    repeat=count,
                    seed=place_hash("check", seed, count),
                    note="again, to see that the bench is still the same",
                )
                pairs[named].append((again, bench))
    return [
        replace(test, trials=tuple(t for t, _ in own), benches=tuple(b for _, b in own))
        for test, own in zip(tests, pairs, strict=True)
    ]


def nothing_to_check(protocol: Protocol, test: str) -> Problem:
    """The problem of a `[check]` whose test has no measurement."""
    message = f"the test '{test}' has no measurement that could be repeated"
    return protocol.origin.problem(("check", "test"), "value", message)


def _first(test: ExpandedTest) -> tuple[Trial, Bench]:
    index = test.first_measurement
    if index is None:
        raise ValueError("no measurement to repeat")  # excluded by a check of the plan
    return test.trials[index], test.benches[index]


def _changed(trial: Trial, **changes: Any) -> Trial:
    """A changed copy without cached values such as the fingerprint."""
    fields = {name: getattr(trial, name) for name in Trial.model_fields}
    return Trial.model_construct(**{**fields, **changes})
