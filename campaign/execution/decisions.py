"""Decisions after a failed trial by policy, and rests of the bench."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from campaign.estimate import Estimate
from campaign.policy import Policy, Rest
from campaign.recording import Ending
from campaign.text import count
from campaign.trial import Trial


@dataclass(frozen=True)
class Choice:
    """Decision about a failed trial.

    Attributes:
        pause: waiting time before a retry (s).
        reason: cause of the failure, and the number of the retry or of retries made.
    """

    do: Literal["retry", "skip", "abort"]
    reason: str
    pause: float = 0.0


class Responses:
    """Applies a policy; counts the retries of each trial in this session."""

    def __init__(self, policy: Policy) -> None:
        self._policy = policy
        self._retries: dict[int, int] = {}

    def choose(self, trial: Trial, ending: Ending) -> Choice:
        """Decide about a trial that neither completed nor was interrupted."""
        response = self._policy.response(ending)
        what = str(ending.fault or ending.outcome)
        reason = f"{what}: {ending.reason}" if ending.reason else what
        if response.do != "retry":
            return Choice(response.do, reason)
        retries = self._retries.get(trial.number, 0)
        if retries >= response.times:
            return Choice(response.then, f"{reason}; after {count(retries, 'retry', 'retries')}")
        self._retries[trial.number] = retries + 1
        return Choice("retry", f"{reason}; retry {retries + 1} of {response.times}", response.pause)


class Rests:
    """Counts bench time (s) until the next rest of the bench."""

    def __init__(self, rest: Rest | None) -> None:
        self._rest = rest
        self._since = 0.0

    def worked(self, seconds: float) -> None:
        """Add `seconds` of bench time."""
        self._since += seconds

    @property
    def left(self) -> float:
        """Bench time (s) until the next rest, which is due at 0; infinite without rests."""
        return math.inf if self._rest is None else self._rest.every - self._since

    def taken(self) -> None:
        """Reset the count after a rest."""
        self._since = 0.0


def extremes(trials: Iterable[Trial], metrics: Mapping[int, Sequence[Estimate]]) -> dict[int, str]:
    """By trial number, the metrics of its test whose smallest or largest value it has."""
    values_of: dict[tuple[str, str], dict[int, float]] = {}
    for trial in trials:
        for each in metrics.get(trial.number, ()):
            values_of.setdefault((trial.test, each.name), {})[trial.number] = each.value
    roles: dict[int, list[str]] = {}
    for (_, name), values in values_of.items():
        for choose, which in ((min, "smallest"), (max, "largest")):
            roles.setdefault(choose(values, key=values.__getitem__), []).append(f"{which} {name}")
    return {number: ", ".join(which) for number, which in roles.items()}
