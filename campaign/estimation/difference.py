"""Difference of two findings of one quantity: size, share, p value.

A difference is the second finding minus the first, which is the reference.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass, replace

from campaign.estimate import Estimate, Origin
from campaign.estimation.contrast import Contrast, contrast, left_over, ratio_ends
from campaign.estimation.intervals import LEVEL, multiplied
from campaign.reason import NONE, Cause, Reason
from campaign.units import factor

DIFFERENCE = "difference"
CHANGE = "change"
BOUNDS = ("at least", "at most")
NOT_A_MEAN = Cause("not a mean", "it is a range of single values, not how well one number is known")
OPEN_SIDE = Cause("open on one side", "its interval is open on one side")
AROUND_ZERO = Cause(
    "reference around zero", "the interval of the reference holds 0, so no share of it has one"
)
ZERO = Cause("reference of zero", "the reference is 0")
SIGN_CHANGE = Cause("sign change", "its sign changes")
NOT_FOUND = Cause("not found", "{whose}: not found{why}")
OTHER_LEVEL = Cause(
    "interval of another level",
    "{whose} has an interval of another level ({percent:g} %)",
)
GIVEN_IN_BOTH = Cause("given in both", "given in both, not measured{why}")
NO_INTERVAL = Cause("no interval in a pair", "{whose}: no interval{why}")
ALIKE_BOUNDS = Cause("bounds on the same side", "both are bounds on the same side")
BOUND_ALONE = Cause("bound without interval", "a bound, and no interval")
OF_A_BOUND = Cause("share of a bound", "the reference is a bound")
WITH_A_BOUND = Cause("difference of bounds", "a bound takes part")


@dataclass(frozen=True)
class Difference:
    """Difference of a pair of estimates, with its test.

    Attributes:
        difference: in the unit of the reference (SI); a bound where one of the two is a bound.
        change: the difference as a share of the size of the reference (1 is 100 %); NaN where the
            reference is 0 or the sign changes.
        p: two-sided, of "no difference"; None where no test is possible (see `reason`).
        reason: why there is no p value; `NONE` where there is one.
    """

    difference: Estimate
    change: Estimate
    p: float | None = None
    reason: Reason = NONE


def difference_of(reference: Estimate, other: Estimate, shared: Collection[str] = ()) -> Difference:
    """`other` - `reference`, of independent estimates with compatible units.

    shared: sources of systematic parts that are the same for both, such as the torque constant of
        one drive; they cancel (`contrast`).

    Raises ValueError for incompatible units.
    """
    other = in_unit(other, reference.unit)
    if math.isnan(reference.value) or math.isnan(other.value):
        return _untold(reference, other, math.nan, _why_none(reference, other))
    value = other.value - reference.value
    if reference.kind in BOUNDS or other.kind in BOUNDS:
        return _of_bounds(reference, other)
    reason = _why_without(reference, other)
    if reason:
        return _untold(reference, other, value, reason)
    test = contrast(other, reference, 1.0, shared)
    difference = _estimate(test, reference, other, shared)
    change = _change(reference, other, shared)
    if not (difference.low is None or difference.high is None):
        return Difference(difference, change, test.p)
    return Difference(difference, change, None, OPEN_SIDE())


def in_unit(estimate: Estimate, unit: str) -> Estimate:
    """Estimate in another unit. Raises ValueError for a unit of another quantity."""
    if estimate.unit == unit:
        return estimate
    return replace(multiplied(estimate, float(factor(estimate.unit, unit))), unit=unit)


def _estimate(
    found: Contrast, reference: Estimate, other: Estimate, shared: Collection[str]
) -> Estimate:
    """Estimate of the difference, with scatter and systematic parts apart."""
    scatter = replace(found, shift=0.0)
    low, high = (scatter.half(upper=False), scatter.half(upper=True))
    how = "Welch" if found.welch else "half-widths in squares"
    return Estimate(
        DIFFERENCE,
        found.value,
        reference.unit,
        None if math.isinf(low) else found.value - low,
        None if math.isinf(high) else found.value + high,
        LEVEL,
        f"difference of independent estimates, {how}",
        standard_error=found.below if found.welch else None,
        freedom=found.freedom if found.welch and math.isfinite(found.freedom) else None,
        systematic=left_over(other, reference, 1.0, shared),
    )


def _change(reference: Estimate, other: Estimate, shared: Collection[str]) -> Estimate:
    """Difference over the size of the reference; low and high include the systematic parts."""
    if why := _no_share(reference, other):
        return Estimate.without_interval(CHANGE, math.nan, "", why)
    low, high = ratio_ends(other, reference, shared)
    value = _share(other.value / reference.value, reference)
    if low is None and high is None:
        return Estimate.without_interval(CHANGE, value, "", AROUND_ZERO())
    ends = [None if end is None else _share(end, reference) for end in (low, high)]
    if reference.value < 0:
        ends.reverse()
    return Estimate(
        CHANGE, value, "", ends[0], ends[1], LEVEL, "all ratios that the difference leaves, Fieller"
    )


def _no_share(reference: Estimate, other: Estimate) -> Reason:
    """Why the difference has no share of the reference; `NONE` where it has."""
    if not reference.value:
        return ZERO()
    return SIGN_CHANGE() if reference.value * other.value < 0 else NONE


def _share(ratio: float, reference: Estimate) -> float:
    """(other - reference) / |reference|, from other / reference."""
    return math.copysign(1.0, reference.value) * (ratio - 1.0)


def _untold(reference: Estimate, other: Estimate, value: float, reason: Reason) -> Difference:
    """Difference without an interval, with the reason."""
    share = math.nan if _no_share(reference, other) else value / abs(reference.value)
    return Difference(
        Estimate.without_interval(DIFFERENCE, value, reference.unit, reason),
        Estimate.without_interval(CHANGE, share, "", reason),
        None,
        reason,
    )


def _why_none(reference: Estimate, other: Estimate) -> Reason:
    whose = _whose(math.isnan(reference.value), math.isnan(other.value))
    own = (reference if math.isnan(reference.value) else other).reason
    return NOT_FOUND(whose=whose, why=_in_brackets(own))


def _why_without(reference: Estimate, other: Estimate) -> Reason:
    """Why the difference of two numbers has no interval; `NONE` where it has."""
    for each, alone in ((reference, "the reference"), (other, "the other")):
        if each.kind == "quantile":
            return NOT_A_MEAN()
        if each.has_interval and each.level is not None and each.level != LEVEL:
            return OTHER_LEVEL(whose=alone, percent=100 * each.level)
    missing = [not reference.has_interval, not other.has_interval]
    if not any(missing):
        return NONE
    own = (reference if missing[0] else other).reason
    given = [each.origin is Origin.GIVEN for each in (reference, other)]
    if all(given):
        return GIVEN_IN_BOTH(why=_in_brackets(own))
    return NO_INTERVAL(whose=_whose(*missing), why=_in_brackets(own))


def _in_brackets(reason: Reason) -> Reason:
    """Reason in brackets, to follow another text; `NONE` stays `NONE`."""
    return replace(reason, text=f" ({reason})") if reason else reason


def _whose(of_reference: bool, of_other: bool) -> str:
    return "both" if of_reference and of_other else "the reference" if of_reference else "the other"


def _of_bounds(reference: Estimate, other: Estimate) -> Difference:
    """Bound of a difference with bounds; no bound for two bounds on the same side.

    The ends are subtracted directly, which needs no independence.
    """
    # Range of each: open on one side for a bound, the interval for a number.
    (a_low, a_high), (b_low, b_high) = other.combined, reference.combined
    low = None if a_low is None or b_high is None else a_low - b_high
    high = None if a_high is None or b_low is None else a_high - b_low
    value = other.value - reference.value
    if low is None and high is None:
        alike = reference.kind == other.kind
        reason = ALIKE_BOUNDS() if alike else BOUND_ALONE()
        return _untold(reference, other, value, reason)
    end, kind = (high, "at most") if low is None else (low, "at least")
    left = Estimate(
        DIFFERENCE,
        float(end or 0.0),
        reference.unit,
        method="ends of bounds",
        kind=kind,  # type: ignore[arg-type]
    )
    share = replace(left, name=CHANGE, unit="", value=left.value / abs(reference.value or math.nan))
    if not (reference.value and reference.kind not in BOUNDS):
        # A share needs a reference that is no bound.
        share = Estimate.without_interval(CHANGE, math.nan, "", OF_A_BOUND())
    return Difference(left, share, None, WITH_A_BOUND())
