"""Reference values beside findings: pairs, family, verdicts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Self, TypeVar

from campaign.estimate import Estimate, Origin
from campaign.estimation.contrast import excludes_zero
from campaign.estimation.difference import Difference, difference_of
from campaign.estimation.family import RATE, adjusted
from campaign.reason import NONE, Cause, Reason
from campaign.result import Value

WRONG_MODEL = Cause("contradicted model", "{side} is of a model that the data contradict: {why}")
"""The interval belongs to the closest curve of a wrong model, and its residuals are no noise. On
the bench `platform` (Stribeck exponent about 0.9), viscous friction fitted with the exponent held
at 2 scatters between runs by 1.5 times its standard error."""


class Verdict(StrEnum):
    """Outcome of a pair."""

    DIFFERENT = "different"  # declared at a false discovery rate of 5 % in the family of all pairs
    BEYOND_BOUND = "beyond a bound"  # a bound excludes equality; no test is made
    NOT_SHOWN = "no difference shown"  # a difference may exist
    NOT_JUDGED = "not judged"  # see `reason`


@dataclass(frozen=True, kw_only=True)
class JudgedNumber:
    """A number beside its reference.

    Attributes:
        conditions: as the reference or the finding states them, in SI.
        reference, other: in SI.
        reason: why the pair is not judged.
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
            shared: sources of systematic parts that are common to both.
            doubt: reason not to judge the pair although both have intervals.
            more: further fields.

        Raises ValueError for incompatible units.
        """
        pair = difference_of(reference, other, shared)
        beyond = pair.difference.is_bound and excludes_zero(pair.difference)
        return cls(
            reference=reference,
            other=other,
            found=pair,
            verdict=Verdict.BEYOND_BOUND if beyond else Verdict.NOT_JUDGED,
            reason=pair.reason or doubt or _of_wrong_model(reference, other),
            **more,
        )

    def not_judged(self, reason: Reason) -> Self:
        """The same pair, excluded from the family."""
        return replace(self, verdict=Verdict.NOT_JUDGED, reason=reason)

    @property
    def testable(self) -> bool:
        """Whether the pair is part of the family."""
        return self.found.p is not None and not self.reason

    @property
    def outcome(self) -> str:
        """Its verdict, or the reason for no verdict."""
        return str(self.reason if self.verdict is Verdict.NOT_JUDGED else self.verdict)


J = TypeVar("J", bound=JudgedNumber)


def _of_wrong_model(reference: Estimate, other: Estimate) -> Reason:
    for side, each in (("the reference", reference), ("the other", other)):
        if each.origin is Origin.CONTRADICTED:
            return WRONG_MODEL(side=side, why=each.reason)
    return NONE


def with_verdicts(pairs: Sequence[J]) -> tuple[J, ...]:
    """Judge all pairs as one family, of any quantities.

    No difference is declared if the pair's own interval contains zero.
    """
    tested = (pair.found.p for pair in pairs if pair.testable)
    p = iter(adjusted([each for each in tested if each is not None]))
    return tuple(_with(pair, next(p)) if pair.testable else pair for pair in pairs)


def _with(pair: J, p: float) -> J:
    declared = p <= RATE and excludes_zero(pair.found.difference)
    verdict = Verdict.DIFFERENT if declared else Verdict.NOT_SHOWN
    return replace(pair, verdict=verdict, adjusted=p)
