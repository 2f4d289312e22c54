"""Metrics of single recordings, measured after the trial and kept in the journal.

A trial is archived first, so nothing that goes wrong while it is measured costs its recording, not
even a program that crashes. The line of the journal names the record of the trial by its digest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, replace

from campaign.archive.layout.journal import Entry, TrialFinished, TrialMeasured
from campaign.archive.layout.record import plain
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.estimate import Estimate


@dataclass(frozen=True)
class ArchivedMetrics:
    """What was found.

    Attributes:
        estimates: each finite, and of another name than the others.
        by: which code measured them, with its version.
        problem: why there are none, in one line; empty when there are, or when nobody looked.
    """

    estimates: tuple[Estimate, ...] = ()
    by: str = ""
    problem: str = ""


Measure = Callable[[ArchivedTrial], ArchivedMetrics]
"""Measures a trial that is archived. Raises nothing."""


def trial_measured(at: str, finished: TrialFinished, found: ArchivedMetrics) -> TrialMeasured:
    """The line of the journal for what was found of a trial."""
    return TrialMeasured.model_validate(
        {
            "at": at,
            "trial": finished.trial,
            "attempt": finished.attempt,
            "record": finished.record,
            "by": found.by,
            "estimates": [plain(asdict(estimate)) for estimate in found.estimates],
        }
    )


def measured_in(entries: Iterable[Entry]) -> dict[str, TrialMeasured]:
    """What the lines of a journal say was measured, by the digest of the trial's record."""
    return {entry.record: entry for entry in entries if isinstance(entry, TrialMeasured)}


def with_metrics(archived: ArchivedTrial, told: TrialMeasured | None) -> ArchivedTrial:
    """A trial with what was measured of it, if anything was."""
    if told is None:
        return archived
    estimates = (*archived.estimates, *told.estimates)
    return replace(archived, estimates=estimates, measured_by=told.by)
