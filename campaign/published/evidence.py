"""Findings of a test for published cells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from campaign.physics.bench import Bench
from campaign.published.calibration_covariance import NOTHING, CalibrationPart
from campaign.published.patterns import covers
from campaign.published.provenance import NOTHING_ALTERED, Provenance
from campaign.published.values import THESIS, Cell, Published, thesis
from campaign.result import Finding, Value, same_value


@dataclass(frozen=True)
class Evidence:
    """What one test brings to the scoreboard.

    Attributes:
        reproduces: the published tables the test stands for, by name.
        given, fitted, seen: of its bench: cells (or rows, or tables) it was given, was fitted to,
            and that were looked at while it was made.
        known: conditions that hold for every finding which does not state them itself, such as
            the `domain`.
        cells: that these name, of the bench's own document, which need not be the one that the
            run is compared with.
        failed: whether something of the test was lost of which nobody can tell which cells it
            costs: its analysis failed, or trials are damaged.
        source: where its samples come from: `simulation`, `hardware`, `recording`; "" unknown.
        provenance: whether its trials ran on the bench that was described, and which failed.
        calibration: what that of the bench leaves open of its numbers.
    """

    test: str
    reproduces: Sequence[str]
    findings: Sequence[Finding]
    given: Sequence[str] = ()
    fitted: Sequence[str] = ()
    seen: Sequence[str] = ()
    known: Mapping[str, Value] = field(default_factory=dict)
    cells: Sequence[Cell] = ()
    failed: bool = False
    source: str = ""
    provenance: Provenance = NOTHING_ALTERED
    calibration: CalibrationPart = NOTHING

    def is_described(self, finding: Finding) -> bool:
        """Whether a finding is of the bench that was described, so that its calibration counts."""
        conditions = {**self.known, **finding.conditions}
        altered = self.provenance.why_altered(conditions)
        return not altered and self.provenance.is_described(conditions)


def evidence_of(
    test: str,
    reproduces: Sequence[str],
    findings: Sequence[Finding],
    bench: Bench | None,
    *,
    source: str = "",
    provenance: Provenance = NOTHING_ALTERED,
) -> Evidence:
    """What a test on `bench` brings; None when nobody knows the bench.

    A table may ask whether a number is from a simulation or from hardware: here that is whether
    the bench's controller is continuous, or sampled as a real one is; of a bench that says nothing
    of its controller nobody knows. Where the samples themselves come from is the `source`.
    """
    if bench is None:
        return Evidence(test, reproduces, findings, source=source, provenance=provenance)
    conditions: dict[str, Value] = {}
    if bench.controller is not None:
        sampled = bench.controller.sample_rate is not None
        conditions["domain"] = "hardware" if sampled else "simulation"
    known = bench.known
    return Evidence(
        test,
        reproduces,
        findings,
        known.given,
        known.fitted,
        known.seen,
        conditions,
        _named(known.document, (*known.given, *known.fitted, *known.seen)),
        source=source,
        provenance=provenance,
    )


def _named(document: str, patterns: Sequence[str]) -> tuple[Cell, ...]:
    """The cells that a bench names, of a document that is at hand here."""
    return tuple(_covered(thesis(), patterns)) if document == THESIS else ()


def _covered(published: Published, patterns: Sequence[str]) -> Iterator[Cell]:
    for table in published.values():
        for cell in table.cells:
            if any(covers(pattern, cell.path) for pattern in patterns):
                yield cell


def with_cells(test: Evidence, published: Published) -> Evidence:
    """With the cells that its bench names in the document of this comparison."""
    patterns = (*test.given, *test.fitted, *test.seen)
    return replace(test, cells=(*test.cells, *_covered(published, patterns)))


def concerns(finding: Finding, cell: Cell, known: Mapping[str, Value]) -> bool:
    """Whether a finding is of the cell's quantity and states each of the cell's conditions."""
    stated = {**known, **finding.conditions}
    return finding.quantity == cell.quantity and all(
        name in stated and same_value(stated[name], value)
        for name, value in cell.conditions.items()
    )
