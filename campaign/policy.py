"""Run policy: faults, cool-down, kept samples.

The protocol states a policy (`[faults]`, `[rest]`, `keep`), the runner applies it, and the archive
keeps each resulting decision.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

from pydantic import Field, Strict, model_validator

from campaign.options import Options
from campaign.recording import Ending, Fault, Outcome
from campaign.trial import Role, Trial
from campaign.units import Time


class Response(Options):
    """Response to a trial that does not complete; a bare word is short for `{do = word}`."""

    do: Literal["retry", "skip", "abort"] = "skip"
    """Repeat the trial, continue with the next one, or end the run."""
    times: int = Field(default=1, ge=1, le=1000)
    """Largest number of retries of a trial."""
    pause: Time = Field(default=0.0, ge=0)
    """Pause before a retry; a simulated bench has no pause."""
    then: Literal["skip", "abort"] = "skip"
    """Response after the last retry has failed."""

    @model_validator(mode="before")
    @classmethod
    def _from_word(cls, value: Any) -> Any:
        return {"do": value} if isinstance(value, str) else value

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.do != "retry" and (self.times, self.pause, self.then) != (1, 0.0, "skip"):
            raise ValueError("'times', 'pause' and 'then' belong to do = \"retry\"")
        return self


class Rest(Options):
    """Pauses in which the bench cools down."""

    every: Time = Field(gt=0)
    """Bench time between two pauses; a pause never interrupts a trial."""
    pause: Time = Field(gt=0)
    """Length of a pause; a simulated bench has no pause."""


Occasion = Literal[
    "default", "limit", "diverged",
    "lost-connection", "lost-samples", "heartbeat", "reset", "over-temperature", "limit-switch",
    "sensor", "drive", "refused", "recording", "other",
]  # fmt: skip
"""A fault, a reached limit of the bench, a divergence, or `default` for all others."""


Keep = Literal["all", "none", "failed", "extremes"] | Annotated[int, Strict(), Field(ge=1)]
"""Trials whose samples are archived: a word, or the number of first trials of each test."""
NotKept = Callable[[Ending], str]
"""Returns why the samples of a trial with this ending are not archived; empty if they are."""


class Policy(Options):
    """Policy of a protocol. After a safe state that is not confirmed, nothing moves."""

    faults: dict[Occasion, Response] = {}
    rest: Rest | None = None
    keep: Keep = "all"

    def response(self, ending: Ending) -> Response:
        """Response to the ending of a trial that neither completed nor was interrupted."""
        occasion: Any = ending.fault or Fault.OTHER
        if ending.outcome in (Outcome.LIMIT, Outcome.DIVERGED):
            occasion = ending.outcome
        return self.faults.get(occasion) or self.faults.get("default") or Response()


@dataclass(frozen=True)
class SampleRetention:
    """Rule for archived samples; attempts without samples keep their record and metrics.

    Attributes:
        first: numbers of the trials with samples, if `keep` is a number.
    """

    keep: Keep = "all"
    first: frozenset[int] = frozenset()

    @classmethod
    def of(cls, keep: Keep, trials: Iterable[Trial]) -> Self:
        """The rule for the trials of a plan."""
        if not isinstance(keep, int):
            return cls(keep)
        counts: Counter[str] = Counter()
        first = set()
        for trial in trials:
            counts[trial.test] += 1
            if counts[trial.test] <= keep:
                first.add(trial.number)
        return cls(keep, frozenset(first))

    def rule(self, trial: Trial, attempt: int) -> NotKept | None:
        """Function for the ending of an attempt; None if its samples are kept in any case."""
        # Extremes are known after all trials: they are executed a second time.
        again = self.keep == "extremes" and attempt > 1
        check = trial.role is Role.CHECK  # its samples show a drift of the bench
        if self.keep == "all" or again or check or trial.number in self.first:
            return None
        return self._not_kept

    def _not_kept(self, ending: Ending) -> str:
        if self.keep != "none" and ending.outcome.failed:
            return ""
        return f"the protocol says keep = {self.keep}"


KEEP_ALL = SampleRetention()
