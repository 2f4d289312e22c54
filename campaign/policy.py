"""What a run does besides its trials: about faults, and to let the bench cool down.

The protocol writes a policy (`[faults]`, `[rest]`), the runner follows it, the archive keeps every
decision it led to.
"""

from __future__ import annotations

from typing import Any, Literal, Self

from pydantic import Field, model_validator

from campaign.options import Options
from campaign.recording import Ending, Fault, Outcome
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


class Policy(Options):
    """What a protocol wants done; nothing ever moves after a safe state that was not confirmed."""

    faults: dict[Occasion, Response] = {}
    rest: Rest | None = None

    def response(self, ending: Ending) -> Response:
        """What to do about a trial that ended so, in any way but completed or interrupted."""
        occasion = str(ending.fault or Fault.OTHER)
        if ending.outcome in (Outcome.LIMIT, Outcome.DIVERGED):
            occasion = str(ending.outcome)
        default = self.faults.get("default", Response())
        return {str(name): response for name, response in self.faults.items()}.get(
            occasion, default
        )
