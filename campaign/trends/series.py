"""One number of a rig over its runs, with its uncertainty.

Findings are paired as in `campaign compare`. An error that all runs share shifts all points
equally. It neither causes nor hides a trend and is excluded. If a constant of the bench was
determined again between runs, points with the same value share its error.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import axis_quantity_name, condition_words, display_unit
from campaign.comparison.not_judged import DERIVED, FOLLOWS
from campaign.comparison.same_quantity import pair_tests
from campaign.estimate import Estimate, Origin
from campaign.estimation.contrast import is_student
from campaign.estimation.difference import in_unit
from campaign.estimation.intervals import LEVEL, student
from campaign.estimation.trends.own_errors import moderated
from campaign.reason import NONE, Cause, Reason
from campaign.references.verdict import WRONG_MODEL
from campaign.result import Finding, Value
from campaign.trends.members import LEAST, Member
from campaign.units import convert

Array = NDArray[np.float64]

TWIN = "the same simulation as"
Seen = dict[tuple[str, tuple[str, ...]], Member]
"""First run with the same simulated trials, by test and their fingerprints."""
TOO_FEW_RUNS = Cause("too few runs", "found in {runs} runs{lost}: three are the least")
SAME_IN_ALL = Cause("same in all runs", "it is the same in all runs, to the last digit")


@dataclass(frozen=True)
class Point:
    """Value of one run.

    Attributes:
        member: the run.
        test: test of the run; "" for the whole run.
        estimate: in the unit of its series.
    """

    member: Member
    test: str
    estimate: Estimate


@dataclass(frozen=True)
class Series:
    """One number over runs.

    Attributes:
        test: name of the test, or of the method that estimated the number.
        name: display name with the conditions.
        unit: SI, of all points.
        display: unit for display.
        points: in order of time.
        left_out: runs without a point, with the reason.
        reason: why no trend is estimated; `NONE` if one is.
    """

    test: str
    title: str
    quantity: str
    name: str
    unit: str
    display: str
    points: tuple[Point, ...]
    left_out: tuple[str, ...] = ()
    reason: Reason = NONE
    conditions: Mapping[str, Value] = field(default_factory=dict)

    @property
    def values(self) -> Array:
        """Values of the points, shape (n,), in `unit`."""
        return np.array([point.estimate.value for point in self.points])

    @property
    def scale(self) -> float:
        """Factor from `unit` to `display`."""
        return float(convert(1.0, self.unit, self.display))

    @property
    def bare(self) -> str:
        """Text on points without an interval, as then all have equal weight; "" without any."""
        without = sum(_own(point.estimate) is None for point in self.points)
        if not without:
            return ""
        which = "none" if without == len(self.points) else f"{without} of {len(self.points)}"
        have = "has" if without == len(self.points) else "have no"
        return f"{which} {have} {'an ' if have == 'has' else ''}interval: weighed alike"

    def own(self) -> tuple[Array, tuple[str, ...], tuple[str, ...]]:
        """Covariance of the points' own errors (n, n), canceled sources, unknown sources.

        Unknown sources are constants that differ between runs, without a stated uncertainty.
        """
        covariance = np.diag(np.square(_own_errors([point.estimate for point in self.points])))
        cancelled, unknown = [], []
        for source in _sources(self.points):
            keys = [point.member.constants.get(source, "") for point in self.points]
            sizes = np.array([_size(point.estimate, source) for point in self.points])
            if len(set(keys)) == 1 and keys[0]:
                cancelled.append(source)
            elif np.any(np.isnan(sizes)) and any(keys):
                unknown.append(source)
            else:
                sizes = np.nan_to_num(sizes)
                alike = np.array([[a == b and a != "" for b in keys] for a in keys])
                covariance += np.where(
                    alike | np.eye(len(keys), dtype=bool), np.outer(sizes, sizes), 0
                )
        return covariance, tuple(cancelled), tuple(unknown)


def series_of(members: Sequence[Member]) -> list[Series]:
    """Series of every finding of the run with the most findings."""
    reference = max(
        members, key=lambda m: (sum(len(t.result.findings) for t in m.tests), -m.number)
    )
    collected = {
        id(finding): (test, finding, Collected(finding.unit))
        for test in reference.tests
        for finding in test.result.findings
        if not finding.recomputed
    }
    seen: Seen = {}
    for member in members:
        for pair in pair_tests(reference.tests, member.tests).tests:
            prints = member.identical.get(pair.other.name, ())
            why = why_twin(seen, member, prints, pair.reference.name)
            for one, other in pair.findings:
                collected[id(one)][2].add(member, pair.other.name, other.known, why)
    return [_series(*each) for each in collected.values()]


@dataclass
class Collected:
    """Points of one number, collected run by run.

    Attributes:
        unit: of all points (SI).
        left_out: runs without a point, with the reason.
        wrong: reasons for numbers with a model that the data contradict.
    """

    unit: str
    points: list[Point] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    wrong: list[Reason] = field(default_factory=list)

    def add(self, member: Member, test: str, estimate: Estimate, why: str = "") -> None:
        """Add a point, or a reason to `left_out`: no finite value, a bound, given, or `why`."""
        estimate = in_unit(estimate, self.unit)
        if not why and not math.isfinite(estimate.value):
            why = "not found"
        if not why and estimate.is_bound:
            why = "a bound"
        if not why and estimate.origin is Origin.GIVEN:
            why = "given, not measured"
        if why:
            self.left_out.append(f"{member.name}: {why}")
        else:
            self.points.append(Point(member, test, estimate))
        if estimate.origin is Origin.CONTRADICTED:
            self.wrong.append(estimate.reason)

    def series(self, reason: Reason = NONE, **more: Any) -> Series:
        """Create the series. `reason`: why no trend is estimated; default: from the points."""
        values = [point.estimate.value for point in self.points]
        if not reason and len(values) < LEAST:
            whys = (why.partition(": ")[2].partition(TWIN)[0] or TWIN for why in self.left_out)
            counts = "; ".join(f"{why} in {count}" for why, count in Counter(whys).items())
            reason = TOO_FEW_RUNS(runs=len(values), lost=f", {counts}" if counts else "")
        if not reason and max(values) - min(values) <= 1e-12 * max(map(abs, values)):
            reason = SAME_IN_ALL()
        points, left_out = tuple(self.points), tuple(self.left_out)
        return Series(unit=self.unit, points=points, left_out=left_out, reason=reason, **more)


def _series(test: AnalysedTest, finding: Finding, collected: Collected) -> Series:
    words = condition_words(test, finding.conditions)
    name = axis_quantity_name(test, finding.quantity)
    reason = FOLLOWS() if finding.quantity in DERIVED else NONE
    if not reason and 2 * len(collected.wrong) > len(collected.points):
        reason = WRONG_MODEL(side="most of it", why=collected.wrong[0])
    return collected.series(
        reason,
        test=test.name,
        title=test.title,
        quantity=finding.quantity,
        name=f"{name}, {words}" if words else name,
        display=display_unit(test, finding),
        conditions=finding.conditions,
    )


def why_twin(seen: Seen, member: Member, prints: tuple[str, ...], test: str = "") -> str:
    """Reason why a run is a duplicate: an earlier run has the same simulated trials; else "".

    prints: fingerprints of its simulated trials, seeds included. Adds the run to `seen`.
    """
    first = seen.setdefault((test, prints), member) if prints else member
    return "" if first is member else f"{TWIN} {first.name}"


def _own_errors(found: Sequence[Estimate]) -> Array:
    """Standard deviations of the points' scatter, shape (n,); all 0 if any is unknown."""
    known = [error for each in found if (error := _own(each)) is not None]
    if len(known) < len(found):
        return np.zeros(len(found))
    if all(is_student(each) and each.standard_error for each in found):
        errors = np.array([each.standard_error for each in found], dtype=float)
        return moderated(errors, np.array([each.freedom or math.inf for each in found]))
    return np.array(known)


def _own(estimate: Estimate) -> float | None:
    """Standard deviation of a point's scatter; None if unknown.

    Half-width of the interval over the normal quantile; larger for few repeats (Student's t).
    """
    low, high = estimate.low, estimate.high
    if low is None or high is None or estimate.kind == "quantile" or estimate.level != LEVEL:
        return None
    return 0.5 * (high - low) / student(math.inf)


def _sources(points: Sequence[Point]) -> Iterator[str]:
    yield from dict.fromkeys(part.source for p in points for part in p.estimate.systematic)


def _size(estimate: Estimate, source: str) -> float:
    """Standard uncertainty of a number by a source; 0 without the source, NaN if unknown."""
    own = [p.standard_uncertainty for p in estimate.systematic if p.source == source]
    return math.nan if None in own else math.hypot(*(size or 0.0 for size in own))
