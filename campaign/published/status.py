"""Status of a reproduced number from the bench's origin."""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum

from campaign.published.evidence import Evidence, concerns
from campaign.published.patterns import covers, overlap
from campaign.published.values import Cell
from campaign.published.verdicts import rounds_to_print
from campaign.result import Finding


class Status(StrEnum):
    """Origin of a reproduced number; the first that applies."""

    INCONSISTENT = "inconsistent"  # the document contradicts itself
    NOT_REPRODUCIBLE = "not reproducible"  # cannot be reproduced; the reason is given
    ALTERED = "altered"  # the bench is not the calibrated or described one
    UNDESCRIBED = "undescribed"  # the bench does not state its origin
    CALIBRATED = "calibrated"  # the bench was fitted to it
    RECOVERED = "recovered"  # an input of the bench that the experiment estimates
    RECOMPUTED = "recomputed"  # derived from other published cells
    SELECTED = "selected"  # it was looked at when the bench's structure was selected
    PREDICTED = "predicted"  # the bench was fitted, but not to this
    SIMULATED = "simulated"  # nothing was fitted


def status_of(cell: Cell, finding: Finding, test: Evidence) -> tuple[Status, str]:
    """Status of a reproduced number, and its reason ("" without one)."""
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
    """Whether the patterns overlap with any of the tables or cells that the cell repeats."""
    return any(overlap(pattern, again) for pattern in patterns for again in cell.repeats)


def _is_among(cell: Cell, finding: Finding, test: Evidence, patterns: Sequence[str]) -> bool:
    """Whether the patterns cover the cell, or another one with the same value of the same quantity.

    A number that the bench was fitted to stays fitted when another table, of any name, repeats it.
    """
    return any(covers(pattern, cell.path) for pattern in patterns) or any(
        any(covers(pattern, other.path) for pattern in patterns)
        for other in test.cells
        if _print_alike(cell, other) and concerns(finding, other, test.known)
    )


def _print_alike(cell: Cell, other: Cell) -> bool:
    """Whether two cells have the same printed number, quantity and names of conditions."""
    named = (cell.conditions.keys() ^ other.conditions.keys()) - {"domain"}
    if named or cell.quantity != other.quantity:
        return False
    again = other.in_unit(cell.unit)
    return again is not None and rounds_to_print(cell, again)
