"""Findings of a test for published cells."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

from campaign.physics.bench import Bench
from campaign.published.calibration_covariance import NOTHING, CalibrationPart
from campaign.published.patterns import covers
from campaign.published.provenance import NOTHING_ALTERED, Provenance
from campaign.published.values import THESIS, Cell, Published, thesis
from campaign.result import Finding, Value, meets


@dataclass(frozen=True)
class Evidence:
    """Findings and bench origin of one test, for the scoreboard.

    Attributes:
        reproduces: names of the published tables that the test reproduces.
        given, fitted, seen: patterns of cells (or rows, or tables) that its bench was given, was
            fitted to, and that were looked at during its design.
        known: default conditions of every finding that does not state them, e.g. the `domain`.
        cells: cells that these patterns cover, of the bench's own document, which may differ from
            the document of the comparison.
        failed: whether a loss affects cells that cannot be identified: the analysis failed, or
            trials are damaged.
        source: origin of its samples: `simulation`, `hardware`, `recording`; "" unknown.
        provenance: whether its trials ran on the described bench, and which failed.
        calibration: calibration uncertainty of its numbers.
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
        """Whether a finding is of the described bench; only then its calibration applies."""
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
    """Evidence of a test on `bench`; None for an unknown bench.

    A table may require the `domain` simulation or hardware. It follows from the bench's controller:
    continuous is simulation, sampled is hardware; without a controller the domain is unknown. The
    origin of the samples is `source`.
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
    """Cells that a bench names, if its document is the packaged one."""
    return tuple(_covered(thesis(), patterns)) if document == THESIS else ()


def _covered(published: Published, patterns: Sequence[str]) -> Iterator[Cell]:
    for table in published.values():
        for cell in table.cells:
            if any(covers(pattern, cell.path) for pattern in patterns):
                yield cell


def with_cells(test: Evidence, published: Published) -> Evidence:
    """Add the cells that its bench names in the document of this comparison."""
    patterns = (*test.given, *test.fitted, *test.seen)
    return replace(test, cells=(*test.cells, *_covered(published, patterns)))


def concerns(finding: Finding, cell: Cell, known: Mapping[str, Value]) -> bool:
    """Whether a finding has the cell's quantity and each of its conditions."""
    stated = {**known, **finding.conditions}
    return finding.quantity == cell.quantity and meets(stated, cell.conditions)
