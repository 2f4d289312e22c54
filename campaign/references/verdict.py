"""Reference values beside findings: pairs, family, verdicts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self, TypeVar

from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import BOUNDS, Difference, difference_of
from campaign.estimation.family import RATE, adjusted
from campaign.reason import NONE, Cause, Reason
from campaign.result import Value

WRONG_MODEL = Cause("contradicted model", "{side} is of a model that the data contradict: {why}")
"""The interval is that of the closest curve of its kind, whose residuals are no noise. On the bench
`platform`, whose Stribeck exponent is about 0.9, viscous friction fitted with the exponent held at
2 scatters between runs by 1.5 times its standard error."""


class Verdict(StrEnum):
    """What a pair comes to."""

    DIFFERENT = "different"  # declared: the family of all pairs leaves no doubt worth 5 %
    BEYOND_BOUND = "beyond a bound"  # a bound excludes that they are equal; no test is made of it
    NOT_SHOWN = "no difference shown"  # which does not say that there is none
    NOT_JUDGED = "not judged"  # and `reason` says why


@dataclass(frozen=True, kw_only=True)
class JudgedNumber:
    """A number beside its reference.

    Attributes:
        conditions: SI, as the reference or the finding states them.
        reference, other: SI.
        reason: why it is not judged.
        adjusted: p value adjusted for the family; None without a p value.
    """

    quantity: str
    conditions: Mapping[str, Value]
    reference: Estimate
    other: Estimate
    found: Difference
    verdict: Verdict = Verdict.NOT_JUDGED
    reason: Reason = NONE
    adjusted: float | None = None

    @classmethod
    def of(
        cls,
        reference: Estimate,
        other: Estimate,
        *,
        shared: Collection[str] = (),
        doubt: Reason = NONE,
        **more: Any,
    ) -> Self:
        """A pair with its difference, not yet judged.

        Args:
            shared: sources of systematic parts that are the same for both.
            doubt: why it is not judged although both have intervals.
            more: further fields.

        Raises ValueError for units that do not go together.
        """
        found = difference_of(reference, other, shared)
        beyond = found.difference.kind in BOUNDS and excludes_zero(found.difference)
        return cls(
            reference=reference,
            other=other,
            found=found,
            verdict=Verdict.BEYOND_BOUND if beyond else Verdict.NOT_JUDGED,
            reason=found.reason or doubt or _of_wrong_model(reference, other),
            **more,
        )

    def not_judged(self, reason: Reason) -> Self:
        """The same pair, which takes part in no family."""
        return replace(self, verdict=Verdict.NOT_JUDGED, reason=reason)

    @property
    def testable(self) -> bool:
        """Whether it takes part in the family."""
        return self.found.p is not None and not self.reason

    @property
    def outcome(self) -> str:
        """Its verdict, or why there is none."""
        return str(self.reason if self.verdict is Verdict.NOT_JUDGED else self.verdict)


J = TypeVar("J", bound=JudgedNumber)


def _of_wrong_model(reference: Estimate, other: Estimate) -> Reason:
    for side, each in (("the reference", reference), ("the other", other)):
        if each.origin is Origin.CONTRADICTED:
            return WRONG_MODEL(side=side, why=each.reason)
    return NONE


def with_verdicts(pairs: Sequence[J]) -> tuple[J, ...]:
    """The pairs with their verdicts: one family, whatever they are of.

    No difference is declared that the pair's own interval leaves open.
    """
    tested = (pair.found.p for pair in pairs if pair.testable)
    p = iter(adjusted([each for each in tested if each is not None]))
    return tuple(_with(pair, next(p)) if pair.testable else pair for pair in pairs)


def _with(pair: J, p: float) -> J:
    declared = p <= RATE and excludes_zero(pair.found.difference)
    verdict = Verdict.DIFFERENT if declared else Verdict.NOT_SHOWN
    return replace(pair, verdict=verdict, adjusted=p)


def excludes_zero(estimate: Estimate) -> bool:
    """Whether its interval, or its bound, does."""
    low, high = estimate.combined
    return (low is not None and low > 0) or (high is not None and high < 0)
