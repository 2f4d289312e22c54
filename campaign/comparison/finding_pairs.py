"""Pairs of findings of two runs, with their difference and the reason for no verdict."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import display_unit
from campaign.comparison.draws import SIMULATION
from campaign.comparison.not_judged import DERIVED, FOLLOWS, doubt
from campaign.comparison.same_quantity import PairedTest
from campaign.estimate import Origin
from campaign.references.verdict import JudgedNumber


@dataclass(frozen=True, kw_only=True)
class Pair(JudgedNumber):
    """A finding of the reference and the matching one of another run.

    Attributes:
        test, other_test: tests of the findings.
        display: unit for display.
    """

    test: AnalysedTest
    other_test: AnalysedTest
    display: str

    @property
    def simulated_bare(self) -> bool:
        """Whether both numbers are from simulations, not given, and without an interval."""
        return (
            {self.test.source, self.other_test.source} == {SIMULATION}
            and self.quantity not in DERIVED
            and not math.isnan(self.found.difference.value)
            and all(
                not each.is_bound and not each.has_interval and each.origin is not Origin.GIVEN
                for each in (self.reference, self.other)
            )
        )


def pairs_of(tested: PairedTest, shared: Collection[str] = ()) -> Iterator[Pair]:
    """Pairs of one test with their differences, before verdicts.

    shared: sources of systematic parts that both runs share (`shared_sources`).
    """
    for one, another in tested.findings:
        pair = Pair.of(
            one.known,
            another.known,
            shared=shared,
            doubt=doubt((tested.reference, tested.other), (one, another)),
            quantity=one.quantity,
            conditions=one.conditions,
            test=tested.reference,
            other_test=tested.other,
            display=display_unit(tested.reference, one),
        )
        yield pair.not_judged(FOLLOWS()) if one.quantity in DERIVED else pair
