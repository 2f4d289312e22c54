"""Findings of two runs as pairs, with difference and reservations."""

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
from campaign.estimation.difference import BOUNDS
from campaign.references.verdict import JudgedNumber


@dataclass(frozen=True, kw_only=True)
class Pair(JudgedNumber):
    """A finding of the reference beside the same of another run.

    Attributes:
        test, other_test: the tests they are of.
        display: the unit that a reader is shown.
    """

    test: AnalysedTest
    other_test: AnalysedTest
    display: str

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
