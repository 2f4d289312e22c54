"""Verdicts on published and reproduced numbers."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from campaign.estimate import OF_ONE_TRIAL, Kind, Origin
from campaign.published.values import NO_SIZE, Cell
from campaign.reason import NONE, Cause, Reason
from campaign.result import Finding
from campaign.units import convert

NARROW = 0.10
"""Largest half-width of an interval that permits a decision, as a share of the published value."""
LOST = Cause("lost by calibration", "not found within the uncertainty of the bench's calibration")
CLAIMS = ("at most", "at least")
"""Relations of published cells that are one-sided."""


class Verdict(StrEnum):
    """Outcome of the comparison with one published number."""

    AGREES = "agrees"  # it rounds to the printed digits
    COMPATIBLE = "compatible"  # its interval contains the printed value and is narrow
    UNDECIDED = "undecided"  # its interval permits no decision, or it is not determined
    DIFFERS = "differs"
    MET = "met"  # a claim of "at most" or "at least"
    MISSED = "missed"
    NOT_REACHED = "not reached"  # only a bound: the value lies beyond the tested range
    NOT_FOUND = "not found"  # trials were executed; one failed, or the analysis has no number
    NOT_RUN = "not run"  # no trial was executed for it


GOOD = frozenset({Verdict.AGREES, Verdict.COMPATIBLE, Verdict.MET})
"""Verdicts that count as reproduced."""


@dataclass(frozen=True)
class ReproducedNumber:
    """A reproduced number, in the unit of the published one.

    Attributes:
        low, high: 95 % interval with systematic parts and the calibration uncertainty of the bench;
            None where it is open or unknown. A bound has only its own side. The scatter within one
            trial alone is no interval.
        kind: `at least` and `at most` are bounds: `value` is the end of the tested range, `low` or
            `high` includes the uncertainty of the bench's constants.
        origin: a number that is `not determined` decides nothing.
        reason: why it has no interval, or which part the interval does not include.
        calibration_alone: whether the interval is of the calibration only, because the analysis
            gives none.
    """

    value: float
    low: float | None = None
    high: float | None = None
    kind: Kind = "number"
    origin: Origin = Origin.MEASURED
    reason: Reason = NONE
    calibration_alone: bool = False

    @property
    def is_determined(self) -> bool:
        return self.origin is not Origin.NOT_DETERMINED

    @property
    def has_interval(self) -> bool:
        return self.low is not None or self.high is not None

    @property
    def ends(self) -> tuple[float, float]:
        """Ends of the interval; infinite where it is open."""
        return (
            -math.inf if self.low is None else self.low,
            math.inf if self.high is None else self.high,
        )

    @property
    def is_bound(self) -> bool:
        return self.kind in ("at least", "at most")


def reproduced(
    finding: Finding, unit: str, calibration: float | None = None, *, lost: bool = False
) -> ReproducedNumber:
    """Convert a finding to `unit`. Raises ValueError for a different dimension.

    Args:
        calibration: half-width of the 95 % interval from the calibration of the bench, in `unit`;
            half-widths add in squares. None where it is unknown.
        lost: whether the calibration uncertainty includes benches without this number.
    """
    known = finding.known
    value = float(convert(finding.value, finding.unit, unit))
    low, high = (
        None if end is None else float(convert(end, finding.unit, unit)) for end in known.combined
    )
    if lost:
        return ReproducedNumber(value, None, None, known.kind, Origin.NOT_DETERMINED, LOST())
    if known.is_bound:
        return ReproducedNumber(value, low, high, known.kind, known.origin, known.reason)
    alone = calibration is not None and low is None and high is None
    if calibration is not None:
        low, high = (value, value) if alone else (low, high)
        low = None if low is None else value - math.hypot(value - low, calibration)
        high = None if high is None else value + math.hypot(high - value, calibration)
    elif known.reason in OF_ONE_TRIAL:
        low = high = None
    return ReproducedNumber(value, low, high, known.kind, known.origin, known.reason, alone)


def judge(cell: Cell, found: ReproducedNumber) -> Verdict:
    """Verdict on a published cell with a reproduced number."""
    if found.is_bound:
        return Verdict.MISSED if _excludes(found, cell) else Verdict.NOT_REACHED
    if not found.is_determined:
        return Verdict.UNDECIDED
    if cell.relation in CLAIMS:
        return _claim(cell, found)
    low, high = found.ends
    narrow = 0.5 * (high - low) <= NARROW * abs(cell.value)
    if rounds_to_print(cell, found.value):
        # With a wide interval, the agreement may result from chance or from a selection.
        by_luck = found.has_interval and not narrow
        return Verdict.UNDECIDED if by_luck else Verdict.AGREES
    if not found.has_interval or cell.relation == "rank":
        return Verdict.DIFFERS
    if not low <= cell.value <= high:
        return Verdict.DIFFERS
    return Verdict.COMPATIBLE if narrow else Verdict.UNDECIDED


def _claim(cell: Cell, found: ReproducedNumber) -> Verdict:
    """Verdict on "at most" or "at least", from the whole interval, or from a number without one."""
    low, high = found.ends if found.has_interval else (found.value, found.value)
    if cell.relation == "at most":
        met, missed = high <= cell.value, low > cell.value
    else:
        met, missed = low >= cell.value, high < cell.value
    if met:
        return Verdict.MET
    return Verdict.MISSED if missed else Verdict.UNDECIDED


def _excludes(bound: ReproducedNumber, cell: Cell) -> bool:
    """Whether a bound alone shows that a claim is missed.

    No bound shows that a claim is met: the value itself, e.g. a threshold, was not observed.
    """
    if bound.low is not None:
        return cell.relation == "at most" and bound.low > cell.value
    return cell.relation == "at least" and bound.high is not None and bound.high < cell.value


def rounds_to_print(cell: Cell, value: float) -> bool:
    """Whether a number in the cell's unit rounds to the printed digits."""
    if cell.decimals is None:
        return math.isclose(value, cell.value, rel_tol=1e-12)
    return abs(value - cell.value) <= half_digit(cell)


def half_digit(cell: Cell) -> float:
    """Half of the last printed digit, plus floating-point rounding; 0 if digits are unknown."""
    return 0.0 if cell.decimals is None else 0.5 * 10.0**-cell.decimals * (1 + 1e-9)


def deviation(cell: Cell, found: ReproducedNumber, verdict: Verdict) -> float | None:
    """Deviation of the reproduced number in percent of the published value.

    None for a rank, a mark, a claim that is not missed, a bound, a number that is not determined,
    and a printed 0.
    """
    claim = cell.relation in CLAIMS and verdict is not Verdict.MISSED
    number = found.is_determined and not found.is_bound
    if cell.relation in NO_SIZE or claim or not number or not cell.value:
        return None
    return 100 * (found.value - cell.value) / cell.value
