"""Status of a reproduced number from the bench's origin."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from campaign.published.evidence import Evidence, concerns
from campaign.published.patterns import covers, overlap
from campaign.published.values import Cell
from campaign.published.verdicts import rounds_to_print
from campaign.result import Finding
from campaign.units import convert


class Status(StrEnum):
    """Where a reproduced number comes from. The first that applies."""

    INCONSISTENT = "inconsistent"  # the document contradicts itself there
    NOT_REPRODUCIBLE = "not reproducible"  # nobody could reproduce it; the reason is given
    ALTERED = "altered"  # the bench is not the one that was calibrated or described
    UNDESCRIBED = "undescribed"  # the bench does not say what it was made from
    CALIBRATED = "calibrated"  # the bench was fitted to it
    RECOVERED = "recovered"  # the bench was given this value and the experiment found it again
    RECOMPUTED = "recomputed"  # derived from other published cells
    SELECTED = "selected"  # it was looked at while the bench's structure was chosen
    PREDICTED = "predicted"  # the bench was fitted, but not to this
    SIMULATED = "simulated"  # nothing was fitted


def status_of(cell: Cell, finding: Finding, test: Evidence) -> tuple[Status, str]:
    """The status of a number that was found, and what there is to say of it."""
    if cell.status:
        return Status(cell.status), cell.reason
    altered = test.provenance.why_altered({**test.known, **finding.conditions})
    if altered:
        return Status.ALTERED, altered
    if not test.provenance.is_described({**test.known, **finding.conditions}):
        return Status.UNDESCRIBED, "the bench does not say what it was made from"
    if _repeats(cell, test.fitted) or _is_among(cell, finding, test, test.fitted):
        return Status.CALIBRATED, ""
    if _is_among(cell, finding, test, test.given):
        return Status.RECOVERED, ""
    if finding.recomputed:
        return Status.RECOMPUTED, ""
    if _repeats(cell, test.seen) or _is_among(cell, finding, test, test.seen):
        return Status.SELECTED, ""
    return (Status.PREDICTED if test.fitted else Status.SIMULATED), ""


def _repeats(cell: Cell, patterns: Sequence[str]) -> bool:
    """Whether the patterns cover anything whose condition the cell repeats."""
    return any(overlap(pattern, again) for pattern in patterns for again in cell.repeats)


def _is_among(cell: Cell, finding: Finding, test: Evidence, patterns: Sequence[str]) -> bool:
    """Whether the patterns cover the cell, or another one with the same value of the same quantity.

    A number that the bench was fitted to stays fitted when another table prints it again: whoever
    writes a document may give a table any name.
    """
    return any(covers(pattern, cell.path) for pattern in patterns) or any(
        any(covers(pattern, other.path) for pattern in patterns)
        for other in test.cells
        if _print_alike(cell, other) and concerns(finding, other, test.known)
    )


def _print_alike(cell: Cell, other: Cell) -> bool:
    """Whether two cells print one number of a quantity, and state conditions of the same names."""
    named = (cell.conditions.keys() ^ other.conditions.keys()) - {"domain"}
    if named or cell.quantity != other.quantity:
        return False
    try:
        again = float(convert(other.value, other.unit, cell.unit))
    except ValueError:
        return False
    return rounds_to_print(cell, again)
