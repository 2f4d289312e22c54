"""Interval of a - R b for two independent estimates: difference and ratio.

The interval for the difference is that of R = 1. The interval for the ratio includes every R for
which the interval of a - R b includes 0 (Fieller, Journal of the Royal Statistical Society B 16,
1954). So both always agree: if one includes "equal", the other does, too.

**Scatter.** Where both intervals are Student's t around their numbers, the variances add and the
degrees of freedom follow from Welch, Biometrika 34 (1947), and Satterthwaite; GUM G.4.1. Where one
is asymmetric or from another method, the squares of half-widths add, separately for each end: the
upper end of a - b results from a large a and a small b (Zou and Donner, Statistics in Medicine 27,
2008). `Estimate.combined` does the same with the parts of one number.

**Systematic parts.** A common part shifts both numbers with a correlation of 1: |u_a - R u_b|
remains (GUM 5.2.2, Note 1, equation 16), which is 0 for equal parts and R = 1. Squares of other
parts add. Archives contain the size of a part without its sign; the sign is the same for one
quantity under one condition.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

from campaign.estimate import Estimate, Systematic
from campaign.estimation.intervals import LEVEL, student, welch

LOPSIDED = 0.1
"""Largest asymmetry over half-width of an interval that counts as Student's t."""
AGREES = 0.02
"""Largest relative difference of a half-width from its standard error times Student's t."""
DOUBLINGS = 60
"""Range of the search for an end of a ratio, in doublings of the half-width at the ratio."""
SMALLEST = -600.0
"""Logarithm of the smallest p value."""


@dataclass(frozen=True)
class Contrast:
    """A number `value` with standard errors `below` and `above` (1 sigma).

    Attributes:
        below, above: standard errors towards smaller and larger values; infinite where that side
            is open.
        freedom: degrees of freedom of both; infinite when the errors are exact.
        shift: root of the sum of squares of the systematic parts (1 sigma).
        welch: whether `below` and `above` are the same standard error, of a Student's t.
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
        """Distance of 0 in half-widths (95 %) of its side; above 1: outside the interval."""
        half = self.half(upper=self.value < 0)
        if math.isinf(half):
            return 0.0
        return abs(self.value) / half if half > 0 else math.inf if self.value else 0.0

    @property
    def p(self) -> float:
        """Two-sided p value of 0: 1 less the level of the interval that ends at 0.

        Below 5 % exactly when the 95 % interval does not include 0.
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

    shared: sources of systematic parts that are the same for both numbers.
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
    """Whether the interval is approximately Student's t with the standard error.

    This includes a narrow interval in the logarithm, but none at a bound or of another method.
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
    """Systematic parts of `one` - `factor` * `other`, by source.

    A shared source has a part only if a known size remains. A source with an unknown size on either
    side has a part for the known sizes, and a second one of unknown size.
    """
    sizes = [_by_source(one, 1.0), _by_source(other, abs(factor))]
    parts: list[Systematic] = []
    for source in dict.fromkeys((*sizes[0], *sizes[1])):
        of_source = [own.get(source, []) for own in sizes]
        stated = [[size for size in each if size is not None] for each in of_source]
        known = [math.hypot(*each) for each in stated if each]
        if source in shared and all(of_source):
            left = abs(known[0] - known[1]) if len(known) == 2 else 0.0
            if left:
                parts.append(Systematic(source, left))
            continue
        if known:
            parts.append(Systematic(source, math.hypot(*known)))
        if any(None in each for each in of_source):
            parts.append(Systematic(source, None))
    return tuple(parts)


def ratio_ends(
    one: Estimate, other: Estimate, shared: Collection[str] = ()
) -> tuple[float | None, float | None]:
    """Low and high of `one` / `other`: all R for which the interval of one - R other includes 0.

    None on a side where no R is excluded. Both None where the interval of `other` includes 0: then
    there is no ratio.
    """
    if not other.value or not excludes_zero(other):
        return None, None
    middle = one.value / other.value
    centre = contrast(one, other, middle, shared)
    if not (centre.half(upper=False) or centre.half(upper=True)):
        return middle, middle  # no uncertainty
    return _outward(one, other, middle, -1.0, shared), _outward(one, other, middle, 1.0, shared)


def _outward(
    one: Estimate, other: Estimate, middle: float, way: float, shared: Collection[str]
) -> float | None:
    """First R beyond `middle` in the direction `way` (-1 or 1) that the interval excludes."""
    from scipy.optimize import brentq

    def excluded(far: float) -> float:
        return contrast(one, other, middle + way * far, shared).towards_zero - 1.0

    centre = contrast(one, other, middle, shared)
    halves = [
        half for half in (centre.half(upper=True), centre.half(upper=False)) if 0 < half < math.inf
    ]
    near, far = 0.0, max(halves, default=abs(one.value)) / abs(other.value) or 1e-9
    for _ in range(DOUBLINGS):
        if excluded(far) > 0:
            break
        near, far = far, 2.0 * far
    else:
        return None
    return middle + way * float(brentq(excluded, near, far, xtol=1e-15, rtol=1e-12))


def excludes_zero(estimate: Estimate) -> bool:
    """Whether the interval, or the bound, of the estimate excludes zero."""
    low, high = estimate.combined
    return (low is not None and low > 0) or (high is not None and high < 0)


def _sides(estimate: Estimate) -> tuple[float, float]:
    """Half-widths by scatter below and above; infinite on an open side."""
    low, high, value = estimate.low, estimate.high, estimate.value
    return (
        math.inf if low is None else max(value - low, 0.0),
        math.inf if high is None else max(high - value, 0.0),
    )


def _by_source(estimate: Estimate, size: float) -> dict[str, list[float | None]]:
    sizes: dict[str, list[float | None]] = {}
    for part in estimate.systematic:
        own = part.standard_uncertainty
        sizes.setdefault(part.source, []).append(None if own is None else size * own)
    return sizes
