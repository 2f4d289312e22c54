"""Sentences of several draws as one: median and prediction interval."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from campaign.estimate import Estimate, Origin
from campaign.published.draws import SEED, together
from campaign.result import Amount, Conclusion, Factor, Finding, Value

Part = str | Amount | Factor


def concluded(draws: Mapping[Value, Sequence[Conclusion]]) -> tuple[Conclusion, ...]:
    """What draws come to together, by seed; of sentences that all of them say in the same words.

    A draw that says nothing counts as one without a number. Where no two draws speak alike, those
    of the first that says something, as its own.
    """
    said = {seed: sentences for seed, sentences in draws.items() if sentences}
    if not said:
        return ()
    first, *_ = said.values()
    alike = [
        _pooled({seed: each[place] for seed, each in said.items()}, tuple(draws))
        for place in range(len(first))
        if all(len(each) > place and _alike(each[place], first[place]) for each in said.values())
    ]
    if len(said) > 1 and alike:
        words = f"Median of {len(draws)} draws of the bench's scatter, and where one more lies: "
        return Conclusion((words, *alike[0].parts)), *alike[1:]
    seed = next(iter(said))
    return Conclusion((f"The draw of seed {seed} alone: ", *first[0].parts)), *first[1:]


def _alike(one: Conclusion, other: Conclusion) -> bool:
    """Whether two sentences differ in nothing but what was found."""
    pairs = zip(one.parts, other.parts, strict=False)
    return len(one.parts) == len(other.parts) and all(_same(a, b) for a, b in pairs)


def _same(one: Part, other: Part) -> bool:
    if isinstance(one, str) or isinstance(other, str):
        return one == other
    if Origin.GIVEN in (one.estimate.origin, other.estimate.origin):
        return one == other
    mine, theirs = (replace(part, estimate=_named(part.estimate)) for part in (one, other))
    return mine == theirs


def _named(estimate: Estimate) -> Estimate:
    """What the number is of, without what it is."""
    return Estimate(estimate.name, math.nan, estimate.unit, origin=Origin.NOT_DETERMINED)


def _pooled(sentences: Mapping[Value, Conclusion], seeds: Sequence[Value]) -> Conclusion:
    first, *_ = sentences.values()
    parts: list[Part] = []
    for place, part in enumerate(first.parts):
        if isinstance(part, str) or part.estimate.origin is Origin.GIVEN:
            parts.append(part)
            continue
        found = {seed: each.parts[place] for seed, each in sentences.items()}
        estimates = {s: p.estimate for s, p in found.items() if not isinstance(p, str)}
        parts.append(replace(part, estimate=_median(estimates, seeds)))
    return Conclusion(tuple(parts))


def _median(estimates: Mapping[Value, Estimate], seeds: Sequence[Value]) -> Estimate:
    # A deviation cannot be less than zero, and `together` is told so by the statistic.
    findings = [
        Finding.of(each, {"statistic": each.name, SEED: seed}) for seed, each in estimates.items()
    ]
    return together(findings, seeds).known
