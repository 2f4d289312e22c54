"""Place of a published value among the draws of a random bench.

The friction of a simulated bench scatters, and its seed determines how (`[variation]` of the
bench). A mean of ten readings with one seed is one draw; so is the printed mean of a document. The
interval of one draw does not include the scatter between draws. Therefore a published value is
compared with the prediction interval of one more draw.
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
"""Path that a matrix sweeps for several draws; their findings differ in this condition only."""
LEVEL = 0.95
LOST_DRAWS = Cause("draws without a number", "{lost} of {draws} draws have no number")
ONE_DRAW = Cause("too few draws", "it takes two draws or more")
DRAWS_ALIKE = Cause("draws alike", "all {draws} draws are alike")


def without_seed(conditions: Mapping[str, Value]) -> dict[str, Value]:
    """Conditions that the findings of several draws share."""
    return {name: value for name, value in conditions.items() if name != SEED}


def by_draw(findings: Iterable[Finding]) -> list[list[Finding]]:
    """Group findings that differ only in the seed of their draw."""
    groups: dict[str, list[Finding]] = {}
    for each in findings:
        key = str((each.quantity, each.unit, sorted(without_seed(each.conditions).items())))
        groups.setdefault(key, []).append(each)
    return list(groups.values())


def together(findings: Sequence[Finding], seeds: Collection[Value] = ()) -> Finding:
    """Combine the findings of several draws into one: their spread, with the shared conditions.

    Args:
        findings: of one quantity; conditions differ only in the seed.
        seeds: executed seeds, including draws without a finding. With such a draw the others are a
            selection, and the number is not determined.

    Raises ValueError for incompatible units.
    """
    first = findings[0]
    values = [float(convert(each.value, each.unit, first.unit)) for each in findings]
    shifts = [
        float(convert(each.known.systematic_uncertainty, each.unit, first.unit))
        for each in findings
    ]
    usable = [
        math.isfinite(each.value)
        and not each.known.is_bound
        and each.known.origin is not Origin.NOT_DETERMINED
        for each in findings
    ]
    missing = set(seeds) - {each.conditions.get(SEED) for each in findings}
    estimate = spread(first.quantity, values, first.unit, _shared(shifts))
    if "deviation" in str(first.conditions.get("statistic")) and estimate.low is not None:
        estimate = replace(estimate, low=max(estimate.low, 0.0))  # it cannot be less
    if lost := usable.count(False) + len(missing):
        reason = LOST_DRAWS(lost=lost, draws=len(findings) + len(missing))
        value = estimate.value
        estimate = Estimate.without_interval(
            first.quantity, value, first.unit, reason, origin=Origin.NOT_DETERMINED
        )
    return Finding.of(estimate, without_seed(first.conditions), recomputed=first.recomputed)


def spread(
    name: str, values: Sequence[float], unit: str, systematic: tuple[Systematic, ...] = ()
) -> Estimate:
    """Median of draws with the 95 % prediction interval of one more draw; NaN is no draw.

    From 39 draws on: from the k-th smallest to the k-th largest of n draws, which contain one more
    with probability (n + 1 - 2 k)/(n + 1) for any distribution (Wilks 1941). With fewer draws:
    Student's t for one more normal value. The interval is wider than that of the mean, because the
    published value scatters, too.
    """
    draws = sorted(value for value in values if math.isfinite(value))
    count = len(draws)
    middle = median(draws) if draws else math.nan
    if count < 2:
        return Estimate.without_interval(name, middle, unit, ONE_DRAW())
    if draws[0] == draws[-1] and not systematic:
        return Estimate.without_interval(name, middle, unit, DRAWS_ALIKE(draws=count))
    outermost = int((1.0 - LEVEL) / 2.0 * (count + 1) + 1e-9)
    if outermost:
        low, high = draws[outermost - 1], draws[-outermost]
        how = "order statistics"
    else:
        half = student(count - 1) * stdev(draws) * math.sqrt(1.0 + 1.0 / count)
        low, high = fmean(draws) - half, fmean(draws) + half
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
    """Share of draws below `published`, with its exact 95 % interval; ties count half.

    The interval is that of Clopper and Pearson (1934), e.g. [0, 0.31] for the smallest of ten.
    Raises ValueError for no values.

    rounding: half a printed digit; a draw within it is a tie.
    """
    from scipy.special import betaincinv

    draws = [value for value in values if math.isfinite(value)]
    if not draws:
        raise ValueError("a place among no values")
    count, tail = len(draws), 0.5 * (1.0 - LEVEL)
    ties = sum(abs(value - published) <= rounding for value in draws)
    below = sum(value < published - rounding for value in draws) + 0.5 * ties
    low = float(betaincinv(below, count - below + 1, tail)) if below > 0 else 0.0
    high = float(betaincinv(below + 1, count - below, 1 - tail)) if below < count else 1.0
    method = f"share of {count} values below it, Clopper and Pearson"
    return Estimate(
        "place", below / count, "", low, high, LEVEL, method, kind="quantile", freedom=count
    )


def student(freedom: int) -> float:
    """Quantile of Student's t for the half-width of a 95 % interval."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, 0.5 + 0.5 * LEVEL))


def _shared(shifts: Sequence[float]) -> tuple[Systematic, ...]:
    """Common systematic part of all draws: root mean square of their own parts."""
    size = math.sqrt(fmean(shift * shift for shift in shifts))
    return (Systematic("what shifts all draws alike", size),) if size else ()
