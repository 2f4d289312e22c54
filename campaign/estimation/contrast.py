"""Interval of a - R b for two independent estimates: difference and ratio.

The interval for the difference is that of R = 1. The interval for the ratio holds every R for which
the interval of a - R b holds 0 (Fieller, Journal of the Royal Statistical Society B 16, 1954), so
that both always say the same: where one holds "equal", so does the other.

**Scatter.** Where both intervals are Student's t around their numbers, the variances add and the
degrees of freedom follow from Welch, Biometrika 34 (1947), and Satterthwaite; GUM G.4.1. Where one
is lopsided, or found in another way, half-widths add in squares, on each side those that lead
there: the upper end of a - b is reached by a large a and by a small b (Zou and Donner, Statistics
in Medicine 27, 2008). That is what `Estimate.combined` does with the parts of one number.

**Systematic parts.** What both numbers share, shifts both alike: with a correlation of 1 it leaves
|u_a - R u_b| (GUM 5.2.2, Note 1, equation 16), which is nothing for equal numbers. What they do not
share, or are not known to, adds in squares. Archives have the size of a part and not its sign; of
one quantity under one condition it is the same.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from campaign.estimate import Estimate, Systematic
from campaign.estimation.intervals import LEVEL, student, welch

LOPSIDED = 0.1
"""Share of its half-width by which an interval may lean and still be taken as Student's t."""
AGREES = 0.02
"""Share of a half-width by which it may differ from its standard error times Student's t."""
DOUBLINGS = 60
"""How far outward an end of a ratio is looked for, in doublings of the half-width at the ratio."""
SMALLEST = -600.0
"""Logarithm of the smallest p value that is told apart."""


@dataclass(frozen=True)
class Contrast:
    """A number `value` that scatters by `below` and `above` (1 sigma) on its two sides.

    Attributes:
        below, above: standard errors towards smaller and larger values; infinite where that side
            is open.
        freedom: degrees of freedom of both; infinite when they are known.
        shift: root of the sum of squares of the systematic parts (1 sigma).
        welch: whether `below` and `above` are one standard error, of a Student's t.
    """

    value: float
    below: float
    above: float
    freedom: float
    shift: float
    welch: bool

    def half(self, alpha: float = 1.0 - LEVEL, *, upper: bool) -> float:
        """Half-width of the interval of level 1 - `alpha` on one side, systematic part included."""
        from scipy.special import ndtri, stdtrit

        normal = -float(ndtri(0.5 * alpha))
        own = normal if math.isinf(self.freedom) else -float(stdtrit(self.freedom, 0.5 * alpha))
        side = self.above if upper else self.below
        return math.hypot(own * side, normal * self.shift)

    @property
    def towards_zero(self) -> float:
        """How many half-widths (95 %) 0 lies away, on the side where it lies; over 1: outside."""
        half = self.half(upper=self.value < 0)
        if math.isinf(half):
            return 0.0
        return abs(self.value) / half if half > 0 else math.inf if self.value else 0.0

    @property
    def p(self) -> float:
        """Two-sided p value of 0: the level at which the interval would just hold it.

        Below 5 % exactly when the 95 % interval does not hold 0.
        """
        from scipy.optimize import brentq
        from scipy.special import ndtr, stdtr

        upper, value = self.value < 0, abs(self.value)
        side = self.above if upper else self.below
        size = math.hypot(side, self.shift)
        if math.isinf(size) or not value:
            return 1.0
        if not size:
            return 0.0
        if math.isinf(self.freedom) or not side:
            return float(2.0 * ndtr(-value / size))
        if not self.shift:
            return float(2.0 * stdtr(self.freedom, -value / size))

        def beyond(logarithm: float) -> float:
            return value - self.half(math.exp(logarithm), upper=upper)

        if beyond(SMALLEST) >= 0:
            return math.exp(SMALLEST)
        return math.exp(float(brentq(beyond, SMALLEST, 0.0, xtol=1e-12)))


def contrast(
    one: Estimate, other: Estimate, factor: float = 1.0, shared: Collection[str] = ()
) -> Contrast:
    """`one` - `factor` * `other`, of independent estimates in one unit, each with an interval.

    shared: sources of systematic parts that are one and the same for both numbers.
    """
    value, size = one.value - factor * other.value, abs(factor)
    parts = left_over(one, other, factor, shared)
    shift = math.hypot(*(part.standard_uncertainty or 0.0 for part in parts))
    if is_student(one) and is_student(other):
        errors = (one.standard_error or 0.0, size * (other.standard_error or 0.0))
        error = math.hypot(*errors)
        freedom = welch((errors[0], one.freedom), (errors[1], other.freedom)) if error else math.inf
        return Contrast(value, error, error, freedom, shift, welch=True)
    freedom = min(one.freedom or math.inf, other.freedom or math.inf)
    wide = student(freedom)
    (low, high), (less, more) = _sides(one), _sides(other)
    if factor < 0:
        less, more = more, less
    return Contrast(
        value,
        math.hypot(low, size * more) / wide,
        math.hypot(high, size * less) / wide,
        freedom,
        shift,
        welch=False,
    )


def is_student(estimate: Estimate) -> bool:
    """Whether its interval is that of Student's t with its standard error, or nearly so.

    One in the logarithm is, as long as it is narrow; one at a bound or of another method is not.
    """
    if estimate.standard_error is None or estimate.low is None or estimate.high is None:
        return False
    half = 0.5 * (estimate.high - estimate.low)
    own = student(estimate.freedom or math.inf) * estimate.standard_error
    leans = abs(estimate.high + estimate.low - 2.0 * estimate.value)
    return leans <= LOPSIDED * half and abs(own - half) <= AGREES * half


def left_over(
    one: Estimate, other: Estimate, factor: float = 1.0, shared: Collection[str] = ()
) -> tuple[Systematic, ...]:
    """The systematic parts of `one` - `factor` * `other`, by source.

    What is shared is told only where something of known size is left of it. A source of which
    either side does not know the size is told with what is known, and once more as unknown.
    """
    sizes = [_by_source(one, 1.0), _by_source(other, abs(factor))]
    found: list[Systematic] = []
    for source in dict.fromkeys((*sizes[0], *sizes[1])):
        known = [sum_of(own[source]) for own in sizes if source in own and _known(own[source])]
        if source in shared and all(source in own for own in sizes):
            left = abs(known[0] - known[1]) if len(known) == 2 else 0.0
            if left:
                found.append(Systematic(source, left))
            continue
        if known:
            found.append(Systematic(source, math.hypot(*known)))
        if any(None in own.get(source, ()) for own in sizes):
            found.append(Systematic(source, None))
    return tuple(found)


def sum_of(sizes: list[float | None]) -> float:
    """Root of the sum of squares of those that are known."""
    return math.hypot(*(size or 0.0 for size in sizes))


def ratio_ends(
    one: Estimate, other: Estimate, shared: Collection[str] = ()
) -> tuple[float | None, float | None]:
    """Low and high of `one` / `other`: all R for which the interval of one - R other holds 0.

    None on a side where no R is large enough to be excluded. Both None where `other` cannot be told
    from 0: then no ratio is.
    """
    if not other.value or not _told_from_zero(other):
        return None, None
    middle = one.value / other.value
    there = contrast(one, other, middle, shared)
    if not (there.half(upper=False) or there.half(upper=True)):
        return middle, middle  # nothing scatters
    return _outward(one, other, middle, -1.0, shared), _outward(one, other, middle, 1.0, shared)


def _outward(
    one: Estimate, other: Estimate, middle: float, way: float, shared: Collection[str]
) -> float | None:
    """The first R beyond `middle` in the direction `way` that the interval excludes."""
    from scipy.optimize import brentq

    def excluded(far: float) -> float:
        return contrast(one, other, middle + way * far, shared).towards_zero - 1.0

    there = contrast(one, other, middle, shared)
    halves = [
        half for half in (there.half(upper=True), there.half(upper=False)) if 0 < half < math.inf
    ]
    near, far = 0.0, max(halves, default=abs(one.value)) / abs(other.value) or 1e-9
    for _ in range(DOUBLINGS):
        if excluded(far) > 0:
            break
        near, far = far, 2.0 * far
    else:
        return None
    return middle + way * float(brentq(excluded, near, far, xtol=1e-15, rtol=1e-12))


def _told_from_zero(estimate: Estimate) -> bool:
    low, high = estimate.combined
    return (low is not None and low > 0) or (high is not None and high < 0)


def _sides(estimate: Estimate) -> tuple[float, float]:
    """Half-widths that scatter leaves below and above; infinite on an open side."""
    low, high, value = estimate.low, estimate.high, estimate.value
    return (
        math.inf if low is None else max(value - low, 0.0),
        math.inf if high is None else max(high - value, 0.0),
    )


def _by_source(estimate: Estimate, size: float) -> dict[str, list[float | None]]:
    found: dict[str, list[float | None]] = {}
    for part in estimate.systematic:
        own = part.standard_uncertainty
        found.setdefault(part.source, []).append(None if own is None else size * own)
    return found


def _known(sizes: list[float | None]) -> bool:
    return any(size is not None for size in sizes)
