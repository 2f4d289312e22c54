"""Run policy: faults, cool-down, kept samples.

The protocol writes a policy (`[faults]`, `[rest]`, `keep`), the runner follows it, the archive
keeps every decision it led to.
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
    """What to do when a trial did not run to its end; a bare word is short for `{do = word}`."""

    do: Literal["retry", "skip", "abort"] = "skip"
    """Execute the trial again, go on with the next one, or end the run."""
    times: int = Field(default=1, ge=1, le=1000)
    """How often a trial is executed again at most."""
    pause: Time = Field(default=0.0, ge=0)
    """What is waited before it is; on a simulated bench nothing is waited for."""
    then: Literal["skip", "abort"] = "skip"
    """What to do when the last retry has failed as well."""

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
    """How long each lasts; on a simulated bench nothing is waited for."""


Occasion = Literal[
    "default", "limit", "diverged",
    "lost-connection", "lost-samples", "heartbeat", "reset", "over-temperature", "limit-switch",
    "sensor", "drive", "refused", "recording", "other",
]  # fmt: skip
"""A fault, a limit of the bench met in motion, a divergence, or `default` for all unnamed ones."""


Keep = Literal["all", "none", "failed", "extremes"] | Annotated[int, Strict(), Field(ge=1)]
"""Trials whose samples are archived: a word, or how many of each test, from the first."""
NotKept = Callable[[Ending], str]
"""Why the samples of a trial that ended so are not archived; empty when they are."""


class Policy(Options):
    """What a protocol wants done; nothing ever moves after a safe state that was not confirmed."""

    faults: dict[Occasion, Response] = {}
    rest: Rest | None = None
    keep: Keep = "all"

    def response(self, ending: Ending) -> Response:
        """What to do about a trial that ended so, in any way but completed or interrupted."""
        occasion = str(ending.fault or Fault.OTHER)
        if ending.outcome in (Outcome.LIMIT, Outcome.DIVERGED):
            occasion = str(ending.outcome)
        default = self.faults.get("default", Response())
        return {str(name): response for name, response in self.faults.items()}.get(
            occasion, default
        )


@dataclass(frozen=True)
class SampleRetention:
    """Which attempts of a run keep their samples; of the others record and metrics are archived.

    Attributes:
        first: numbers of the trials that `keep` counts, where it is a number.
    """

    keep: Keep = "all"
    first: frozenset[int] = frozenset()

    @classmethod
    def of(cls, keep: Keep, trials: Iterable[Trial]) -> Self:
        """For the trials of a plan."""
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
        """None where the samples are kept however the trial ends."""
        # Extremes are known when all trials have ended: they are executed a second time.
        again = self.keep == "extremes" and attempt > 1
        check = trial.role is Role.CHECK  # its samples say whether the bench has drifted
        if self.keep == "all" or again or check or trial.number in self.first:
            return None
        return self._not_kept

    def _not_kept(self, ending: Ending) -> str:
        if self.keep != "none" and ending.outcome.failed:
            return ""
        return f"the protocol says keep = {self.keep}"


KEEP_ALL = SampleRetention()
