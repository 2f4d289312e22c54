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
"""Half-width, as a share of the published value, up to which an interval decides something."""
LOST = Cause("lost by calibration", "not found within the uncertainty of the bench's calibration")
CLAIMS = ("at most", "at least")
"""Relations of published cells that say on which side of a number a value lies."""


class Verdict(StrEnum):
    """What came of one published number in a run."""

    AGREES = "agrees"  # it rounds to the printed digits
    COMPATIBLE = "compatible"  # its interval contains the printed value, and is narrow
    UNDECIDED = "undecided"  # its interval contains the printed value and more, or it is not known
    DIFFERS = "differs"
    MET = "met"  # a claim of "at most" or "at least"
    MISSED = "missed"
    NOT_REACHED = "not reached"  # only a bound was found: the value lies beyond what was tried
    NOT_FOUND = "not found"  # it was tried, and a trial failed or the analysis found no number
    NOT_RUN = "not run"  # nobody tried it


GOOD = frozenset({Verdict.AGREES, Verdict.COMPATIBLE, Verdict.MET})
"""Verdicts by which a published number is reproduced."""


@dataclass(frozen=True)
class ReproducedNumber:
    """A number that was found, in the unit of the published one.

    Attributes:
        low, high: its 95 % interval, systematic parts and what the calibration leaves open of its
            bench included; None where it is open or unknown. Of a bound only the side that it
            bounds. What scatters within one trial is no interval by itself.
        kind: `at least` and `at most` are bounds: `value` is where what was tried ends, `low` or
            `high` the same less what the bench's constants may be off by.
        origin: where it comes from; one that is `not determined` decides nothing.
        reason: why it has no interval, or what is not in the one that it has.
        calibration_alone: whether the analysis gives no interval, and this one is of the
            calibration.
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
        """Its interval; infinite where that is open."""
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
    """A finding in `unit`; ValueError when it measures something else.

    Args:
        calibration: half-width of the 95 % interval that the calibration of the bench leaves, in
            `unit`; half-widths add in squares. None where nobody has worked it out.
        lost: whether the calibration does not even say that it can be found.
    """
    known = finding.known
    value = float(convert(finding.value, finding.unit, unit))
    low, high = (
        None if end is None else float(convert(end, finding.unit, unit)) for end in known.combined
    )
    if lost:
        return ReproducedNumber(value, None, None, known.kind, Origin.NOT_DETERMINED, LOST())
    if known.kind in ("at least", "at most"):
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
    """The verdict on a published cell for which something was found."""
    if found.is_bound:
        return Verdict.MISSED if _excludes(found, cell) else Verdict.NOT_REACHED
    if not found.is_determined:
        return Verdict.UNDECIDED
    if cell.relation in CLAIMS:
        return _claim(cell, found)
    low, high = found.ends
    narrow = 0.5 * (high - low) <= NARROW * abs(cell.value)
    if rounds_to_print(cell, found.value):
        # What may lie far off, too, agrees by luck, or by whoever chose it.
        by_luck = found.has_interval and not narrow
        return Verdict.UNDECIDED if by_luck else Verdict.AGREES
    if not found.has_interval or cell.relation == "rank":
        return Verdict.DIFFERS
    if not low <= cell.value <= high:
        return Verdict.DIFFERS
    return Verdict.COMPATIBLE if narrow else Verdict.UNDECIDED


def _claim(cell: Cell, found: ReproducedNumber) -> Verdict:
    """The verdict on "at most" or "at least": of the whole interval, or of a number without one."""
    low, high = found.ends if found.has_interval else (found.value, found.value)
    if cell.relation == "at most":
        met, missed = high <= cell.value, low > cell.value
    else:
        met, missed = low >= cell.value, high < cell.value
    if met:
        return Verdict.MET
    return Verdict.MISSED if missed else Verdict.UNDECIDED


def _excludes(bound: ReproducedNumber, cell: Cell) -> bool:
    """Whether a bound alone says that a claim is not met. None says that one is met: the value
    itself, a threshold for one, was never seen.
    """
    if bound.low is not None:
        return cell.relation == "at most" and bound.low > cell.value
    return cell.relation == "at least" and bound.high is not None and bound.high < cell.value


def rounds_to_print(cell: Cell, value: float) -> bool:
    """Whether a number in the cell's unit is the printed one, as far as that has digits."""
    if cell.decimals is None:
        return math.isclose(value, cell.value, rel_tol=1e-12)
    return abs(value - cell.value) <= half_digit(cell)


def half_digit(cell: Cell) -> float:
    """Half of the last printed digit, and the bits that are lost on the way to it; 0 unknown."""
    return 0.0 if cell.decimals is None else 0.5 * 10.0**-cell.decimals * (1 + 1e-9)


def deviation(cell: Cell, found: ReproducedNumber, verdict: Verdict) -> float | None:
    """Percent of the published value by which the reproduced one is off.

    None where percent mean nothing: of a rank or a mark, of a claim that is not missed, of a bound,
    of what is not determined, of a printed 0.
    """
    claim = cell.relation in CLAIMS and verdict is not Verdict.MISSED
    number = found.is_determined and not found.is_bound
    if cell.relation in NO_SIZE or claim or not number or not cell.value:
        return None
    return 100 * (found.value - cell.value) / cell.value
