"""The cost of planned trials on a computing backend, for `campaign plan`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping
from dataclasses import dataclass

from campaign.backends.interface import Backend, ExecutesTogether, KnowsCost
from campaign.protocol import Plan
from campaign.trial import Trial

MILLISECOND = 1e-3


@dataclass(frozen=True)
class Cost:
    """Of the trials of one test.

    Attributes:
        steps: of the integration, in all.
        shortest, longest: step (s).
        because: what the shortest is needed for; empty when it is as long as steps get.
        of_milliseconds: steps per millisecond of bench time, on average.
        alone: trials that are executed one by one, because too few of the plan are like them.
    """

    steps: int
    shortest: float
    longest: float
    because: str
    of_milliseconds: float
    alone: int


def costs(backend: Backend, plan: Plan) -> Mapping[str, Cost]:
    """By test; empty for a backend that does not compute."""
    if not isinstance(backend, KnowsCost):
        return {}
    like = _like(plan)
    alone = _alone(backend, like)
    known = {trial.number: backend.cost(trial) for trial in like.values()}
    found = {}
    for test in plan.tests:
        each = [known[like[number].number] for number in test.numbers]
        shortest = min(each, key=lambda cost: cost.step)
        steps = sum(cost.steps for cost in each)
        found[test.name] = Cost(
            steps=steps,
            shortest=shortest.step,
            longest=max(cost.step for cost in each),
            because=shortest.because,
            of_milliseconds=MILLISECOND * steps / sum(cost.steps * cost.step for cost in each),
            alone=sum(number in alone for number in test.numbers),
        )
    return found


def _like(plan: Plan) -> dict[int, Trial]:
    """By number, the first trial that differs in its seed alone: its cost stands for all."""
    first: dict[Hashable, Trial] = {}
    return {t.number: first.setdefault(t.apart_from_seed, t) for t in plan.trials}


def _alone(backend: Backend, like: Mapping[int, Trial]) -> frozenset[int]:
    """Numbers of the trials that have too few companions."""
    if not isinstance(backend, ExecutesTogether):
        return frozenset()
    group = {trial.number: backend.group(trial) for trial in like.values()}
    count = Counter(group[trial.number] for trial in like.values())
    few = backend.fewest_together
    return frozenset(n for n, trial in like.items() if count[group[trial.number]] < few)


def cost_lines(cost: Cost) -> Iterator[str]:
    """For people: the step, why it is what it is, and what cannot be done together."""
    step = f"{1e3 * cost.shortest:.4g}"
    if cost.longest != cost.shortest:
        step += f" to {1e3 * cost.longest:.4g}"
    line = f"{cost.steps / 1e6:.3g} million steps of {step} ms"
    if cost.because:
        line += f", {cost.of_milliseconds:.2g} times those of 1 ms: {cost.because}"
    yield line
    if cost.alone:
        which = "it is" if cost.alone == 1 else f"{cost.alone} of the trials are"
        yield f"{which} simulated alone: too few of the plan have the same structure"
