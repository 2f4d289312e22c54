"""Place of a published value among the draws of a random bench.

The friction of a simulated bench scatters, and its seed says how (`[variation]` of the bench). A
mean of ten readings that one seed gave is one draw; so is the mean that a document prints. How
well one draw is known says nothing of how draws lie apart: a published value is to be held against
where one more draw would lie.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from statistics import fmean, median, stdev

from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Cause
from campaign.result import Finding, Value
from campaign.units import convert

SEED = "bench.variation.seed"
"""What a matrix sweeps for several draws: the condition in which their findings differ."""
LEVEL = 0.95
LOST_DRAWS = Cause("draws without a number", "{lost} of {draws} draws have no number")
ONE_DRAW = Cause("too few draws", "it takes two draws or more")
DRAWS_ALIKE = Cause("draws alike", "all {draws} draws are alike")


def without_seed(conditions: Mapping[str, Value]) -> dict[str, Value]:
    """What findings of several draws have in common."""
    return {name: value for name, value in conditions.items() if name != SEED}


def by_draw(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Findings that differ in nothing but the seed of their draw, together."""
    groups: dict[str, list[Finding]] = {}
    for each in findings:
        key = str((each.quantity, each.unit, sorted(without_seed(each.conditions).items())))
        groups.setdefault(key, []).append(each)
    return list(groups.values())


def together(findings: Sequence[Finding], seeds: Collection[Value] = ()) -> Finding:
    """One finding in place of those of several draws: their spread, under what they share.

    Args:
        findings: of one quantity, alike but for the seed.
        seeds: those that were executed. A draw of which nothing was found is among them, and then
            the others are a selection.

    Raises ValueError for units that do not go together.
    """
    first = findings[0]
    values = [float(convert(each.value, each.unit, first.unit)) for each in findings]
    shifts = [
        float(convert(each.known.systematic_uncertainty, each.unit, first.unit))
        for each in findings
    ]
    usable = [
        math.isfinite(each.value)
        and each.known.kind not in ("at least", "at most")
        and each.known.origin is not Origin.NOT_DETERMINED
        for each in findings
    ]
    missing = set(seeds) - {each.conditions.get(SEED) for each in findings}
    told = spread(first.quantity, values, first.unit, _shared(shifts))
    if "deviation" in str(first.conditions.get("statistic")) and told.low is not None:
        told = replace(told, low=max(told.low, 0.0))  # it cannot be less
    if lost := usable.count(False) + len(missing):
        reason = LOST_DRAWS(lost=lost, draws=len(findings) + len(missing))
        value = told.value
        told = Estimate.without_interval(
            first.quantity, value, first.unit, reason, origin=Origin.NOT_DETERMINED
        )
    return Finding.of(told, without_seed(first.conditions), recomputed=first.recomputed)


def spread(
    name: str, values: Sequence[float], unit: str, systematic: tuple[Systematic, ...] = ()
) -> Estimate:
    """Median of draws, and where one more draw lies with 95 %; NaN counts as no draw.

    From 39 draws on that is from the k-th smallest to the k-th largest, which hold one more of n
    with (n + 1 - 2 k)/(n + 1), whatever the distribution (Wilks 1941). Fewer cannot say as much
    without one: then it is Student's t for one more normal value. Wider than the interval of their
    mean, because the value that is held against it scatters, too.
    """
    found = sorted(value for value in values if math.isfinite(value))
    count = len(found)
    middle = median(found) if found else math.nan
    if count < 2:
        return Estimate.without_interval(name, middle, unit, ONE_DRAW())
    if found[0] == found[-1] and not systematic:
        return Estimate.without_interval(name, middle, unit, DRAWS_ALIKE(draws=count))
    outermost = int((1.0 - LEVEL) / 2.0 * (count + 1) + 1e-9)
    if outermost:
        low, high = found[outermost - 1], found[-outermost]
        how = "order statistics"
    else:
        half = _student(count - 1) * stdev(found) * math.sqrt(1.0 + 1.0 / count)
        low, high = fmean(found) - half, fmean(found) + half
        how = "Student's t, as if they were normal"
    return Estimate(
        name,
        middle,
        unit,
        low,
        high,
        LEVEL,
        f"median of {count} draws, interval of one further draw; {how}",
        kind="quantile",
        freedom=count,
        systematic=systematic,
    )


def place_in(values: Sequence[float], published: float, rounding: float = 0.0) -> Estimate:
    """Share of all such draws that lie below `published`; ties count half.

    With the exact interval of a share of n draws (Clopper and Pearson 1934): [0, 0.31] for the
    smallest of ten. Raises ValueError for no values.

    rounding: half a printed digit: within it a draw is no other number than the printed one.
    """
    from scipy.special import betaincinv

    found = [value for value in values if math.isfinite(value)]
    if not found:
        raise ValueError("a place among no values")
    count, tail = len(found), 0.5 * (1.0 - LEVEL)
    ties = sum(abs(value - published) <= rounding for value in found)
    below = sum(value < published - rounding for value in found) + 0.5 * ties
    low = float(betaincinv(below, count - below + 1, tail)) if below > 0 else 0.0
    high = float(betaincinv(below + 1, count - below, 1 - tail)) if below < count else 1.0
    method = f"share of {count} values below it, Clopper and Pearson"
    return Estimate(
        "place", below / count, "", low, high, LEVEL, method, kind="quantile", freedom=count
    )


def _student(freedom: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * LEVEL))


def _shared(shifts: Sequence[float]) -> tuple[Systematic, ...]:
    """What shifts all draws alike: root mean square of what each says of itself."""
    size = math.sqrt(fmean(shift * shift for shift in shifts))
    return (Systematic("what shifts all draws alike", size),) if size else ()
