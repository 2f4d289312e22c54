"""Metrics of single recordings, measured after the trial and kept in the journal.

A trial is archived before it is measured: no error or crash of the measurement loses a recording.
The line of the journal refers to the record of the trial by its digest.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from campaign.archive.layout.journal import TrialFinished, TrialMeasured
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.estimate import Estimate


@dataclass(frozen=True)
class ArchivedMetrics:
    """Metrics of one recording.

    Attributes:
        estimates: finite, with distinct names.
        by: the code that measured them, with its version.
        problem: reason why there are none, in one line; empty if measured, or not attempted.
    """

    estimates: tuple[Estimate, ...] = ()
    by: str = ""
    problem: str = ""


Measure = Callable[[ArchivedTrial], ArchivedMetrics]
"""Measures an archived trial. Raises nothing."""


def trial_measured(at: str, finished: TrialFinished, found: ArchivedMetrics) -> TrialMeasured:
    """The line of the journal for the metrics of a trial."""
    return TrialMeasured.model_validate(
        {
            "at": at,
            "trial": finished.trial,
            "attempt": finished.attempt,
            "record": finished.record,
            "by": found.by,
            "estimates": [
                {**vars(each), "systematic": [vars(part) for part in each.systematic]}
                for each in found.estimates
            ],
        }
    )


def with_metrics(archived: ArchivedTrial, measured: TrialMeasured | None) -> ArchivedTrial:
    """The trial with its metrics, if any."""
    if measured is None:
        return archived
    estimates = (*archived.estimates, *measured.estimates)
    return replace(archived, estimates=estimates, measured_by=measured.by)
