"""What a family of differences comes to: what is declared different, and what is not.

All p values of a comparison are one family. Benjamini and Hochberg (Journal of the Royal
Statistical Society B 57, 1995): of what is declared different, at most `RATE` is expected to be
wrong, for tests that are independent or positively dependent (Benjamini and Yekutieli, Annals of
Statistics 29, 2001).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from campaign.access.analysis import AnalysedTest
from campaign.comparing.doubts import DERIVED, FOLLOWS, doubt
from campaign.comparing.draws import SIMULATION
from campaign.comparing.pairing import PairedTest
from campaign.comparing.words import display_unit
from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import BOUNDS, Difference, difference_of
from campaign.reason import NONE, Reason
from campaign.result import Value

RATE = 0.05
"""Expected share of false ones among those that are declared different."""


class Verdict(StrEnum):
    """What a pair comes to."""

    DIFFERENT = "different"  # declared: the family of all pairs leaves no doubt worth 5 %
    BEYOND_BOUND = "beyond a bound"  # a bound excludes that they are equal; no test is made of it
    NOT_SHOWN = "no difference shown"  # which does not say that there is none
    NOT_JUDGED = "not judged"  # and `reason` says why


@dataclass(frozen=True)
class Pair:
    """A finding of the reference beside the same of another run.

    Attributes:
        test, other_test: the tests they are of.
        conditions: SI, as the reference states them.
        reference, other: as each run found it, SI.
        display: the unit that a reader is shown.
        reason: why it is not judged.
        adjusted: p value adjusted for the family; None without a p value.
    """

    test: AnalysedTest
    other_test: AnalysedTest
    quantity: str
    conditions: Mapping[str, Value]
    reference: Estimate
    other: Estimate
    found: Difference
    verdict: Verdict
    display: str = ""
    reason: Reason = NONE
    adjusted: float | None = None

    @property
    def testable(self) -> bool:
        """Whether it takes part in the family."""
        return self.found.p is not None and not self.reason

    @property
    def simulated_bare(self) -> bool:
        """Whether both numbers are simulated, measured there, and neither has an interval."""
        return (
            {self.test.source, self.other_test.source} == {SIMULATION}
            and self.quantity not in DERIVED
            and not math.isnan(self.found.difference.value)
            and all(
                each.kind not in BOUNDS
                and not each.has_interval
                and each.origin is not Origin.GIVEN
                for each in (self.reference, self.other)
            )
        )


def pairs_of(tested: PairedTest, shared: Collection[str] = ()) -> Iterator[Pair]:
    """The pairs of one test with their differences, not yet judged.

    shared: sources of systematic parts that are the same for both runs: `shared_sources`.
    """
    sides = (tested.reference, tested.other)
    for one, another in tested.findings:
        reference, other = one.known, another.known
        found = difference_of(reference, other, shared)
        derived = one.quantity in DERIVED
        reason = FOLLOWS() if derived else found.reason or doubt(sides, (one, another))
        bound = found.difference.kind in BOUNDS and not derived
        beyond = bound and _excludes_zero(found.difference)
        yield Pair(
            tested.reference,
            tested.other,
            one.quantity,
            one.conditions,
            reference,
            other,
            found,
            Verdict.BEYOND_BOUND if beyond else Verdict.NOT_JUDGED,
            display_unit(tested.reference, one),
            reason,
        )


def with_verdicts(pairs: Sequence[Pair], rate: float = RATE) -> tuple[Pair, ...]:
    """The pairs with their verdicts: one family, however many runs and tests they are of."""
    from scipy.stats import false_discovery_control

    tested = [pair for pair in pairs if pair.testable]
    if not tested:
        return tuple(pairs)
    adjusted = iter(false_discovery_control([pair.found.p for pair in tested], method="bh"))
    return tuple(
        _with(pair, float(next(adjusted)), rate) if pair.testable else pair for pair in pairs
    )


def _with(pair: Pair, adjusted: float, rate: float) -> Pair:
    """No difference is declared that the pair's own interval leaves open."""
    declared = adjusted <= rate and _excludes_zero(pair.found.difference)
    verdict = Verdict.DIFFERENT if declared else Verdict.NOT_SHOWN
    return replace(pair, verdict=verdict, adjusted=adjusted)


def _excludes_zero(estimate: Estimate) -> bool:
    low, high = estimate.combined
    return (low is not None and low > 0) or (high is not None and high < 0)
