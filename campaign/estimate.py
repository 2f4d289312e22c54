"""Estimates: a number with its interval, origin and systematic parts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, Literal, Self

from campaign.reason import NONE, Cause, Reason

ROUNDING = 1e-9
"""Relative tolerance for a value outside of its interval, due to rounding of unit conversions."""

OF_ONE_TRIAL = Cause(
    "of one trial",
    "the interval is of one trial and does not include the scatter between trials; three equal "
    "trials measure that",
)
Kind = Literal["number", "share", "count", "quantile", "at least", "at most"]


class Origin(StrEnum):
    """Origin of a number."""

    MEASURED = "measured"
    ASSUMED = "assumed"  # a rule or a guess replaces a measurement
    GIVEN = "given"  # from a document or a data sheet
    AT_BOUND = "at its bound"  # the data indicate a value beyond the physically possible range
    CONTRADICTED = "model contradicted"  # by the data: no parameter of a rig
    NOT_DETERMINED = "not determined"  # the data contain no or too little information


@dataclass(frozen=True)
class Systematic:
    """A systematic part of the uncertainty: it shifts all repetitions equally.

    Attributes:
        source: a code, declared by its user: `torque constant`, `inertia`, `ramp rate` ... It is
            the same for every kind of axis; a page shows it in terms of the axis.
        standard_uncertainty: its contribution to the value (1 sigma, in the value's unit); None if
            the uncertainty of the source is unknown.
        of_rig: whether it is the same for all recordings of a rig, e.g. a constant.
    """

    source: str
    standard_uncertainty: float | None = None
    of_rig: bool = False


@dataclass(frozen=True)
class Estimate:
    """A number with its uncertainty, or the reason for none.

    Attributes:
        name: of the quantity, e.g. `coulomb_torque`.
        value: SI, in `unit`; NaN only if `origin` is not determined.
        low, high: ends of the interval due to scatter (SI); they enclose the value. Both None: no
            interval, and `reason` states why. One None: the interval is open on that side.
        level: coverage probability of the interval, e.g. 0.95.
        method: estimator of value and interval, in words.
        reason: why there is no interval, or why the value is not determined.
        origin: origin of the number.
        kind: kind of the number. A share and its `combined` ends lie between 0 and 1. A bound
            (`at least`, `at most`) limits the true value on one side and has no interval.
        standard_error: 1 sigma of the value (SI), if meaningful.
        freedom: degrees of freedom of `standard_error`, or effective sample size.
        systematic: parts of the uncertainty that scatter does not show; not in `low` and `high`.
    """

    name: str
    value: float
    unit: str
    low: float | None = None
    high: float | None = None
    level: float | None = None
    method: str = ""
    reason: Reason = NONE
    origin: Origin = Origin.MEASURED
    kind: Kind = "number"
    standard_error: float | None = None
    freedom: float | None = None
    systematic: tuple[Systematic, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.reason, Reason):  # from a plug-in without type check
            raise TypeError(
                f"{self.name}: a reason is a `Reason`: declare a `campaign.reason.Cause`"
            )
        open_value = self.origin is Origin.NOT_DETERMINED and math.isnan(self.value)
        numbers = (self.low, self.high, self.level, self.standard_error, self.freedom)
        finite = all(number is None or math.isfinite(number) for number in numbers)
        if not finite or not (open_value or math.isfinite(self.value)):
            raise ValueError(f"{self.name}: an estimate is finite, or it is not given")
        slack = ROUNDING * max(abs(end) for end in (self.value, self.low or 0.0, self.high or 0.0))
        below = self.low is not None and self.value < self.low - slack
        above = self.high is not None and self.value > self.high + slack
        if below or above:  # never true of NaN
            ends = f"{self.low} to {self.high}"
            raise ValueError(f"{self.name}: {self.value} lies outside of its interval, {ends}")

    @classmethod
    def without_interval(
        cls, name: str, value: float, unit: str, reason: Reason, **more: Any
    ) -> Self:
        """A number without interval, and the reason; NaN sets `not determined`."""
        if math.isnan(value):
            more = {**more, "origin": Origin.NOT_DETERMINED}
        return cls(name, value, unit, reason=reason, **more)

    @property
    def has_interval(self) -> bool:
        """Whether at least one side of the value is bounded."""
        return self.low is not None or self.high is not None

    @property
    def is_bound(self) -> bool:
        """Whether the number only limits the true value, on one side."""
        return self.kind in ("at least", "at most")

    @property
    def is_determined(self) -> bool:
        """Whether the value is finite and determined."""
        return math.isfinite(self.value) and self.origin is not Origin.NOT_DETERMINED

    @property
    def says_enough(self) -> bool:
        """Whether there is an interval, a bound, or a reason for neither."""
        return self.has_interval or self.is_bound or bool(self.reason)

    @property
    def systematic_uncertainty(self) -> float:
        """Root of the sum of squares of the systematic parts whose size is known (1 sigma)."""
        return math.hypot(*(part.standard_uncertainty or 0.0 for part in self.systematic))

    @property
    def combined(self) -> tuple[float | None, float | None]:
        """Low and high with the systematic parts: half-widths add in squares (GUM 5.1.2, 6.2).

        A systematic part counts with the normal quantile of `level`: without scatter it has no
        degrees of freedom. The interval stays asymmetric as from scatter. A bound is shifted by the
        one-sided quantile, and is the only end.
        """
        from scipy.special import ndtri

        level, shift = self.level or 0.95, self.systematic_uncertainty
        if self.kind == "at least":
            return self.value - float(ndtri(level)) * shift, None
        if self.kind == "at most":
            return None, self.value + float(ndtri(level)) * shift
        if not self.has_interval or not shift:
            return self.low, self.high
        wide = float(ndtri(0.5 + 0.5 * level)) * shift
        low = None if self.low is None else self.value - math.hypot(self.value - self.low, wide)
        high = None if self.high is None else self.value + math.hypot(self.high - self.value, wide)
        if self.kind == "share":
            low, high = (
                None if low is None else max(low, 0.0),
                None if high is None else min(high, 1.0),
            )
        return low, high

    @property
    def half_width(self) -> float:
        """Half of the combined interval; NaN for an open or missing interval."""
        low, high = self.combined
        return math.nan if low is None or high is None else 0.5 * (high - low)


@dataclass(frozen=True)
class Window:
    """A part of a trial that an analysis uses: start <= time < stop (s)."""

    name: str
    start: float
    stop: float
