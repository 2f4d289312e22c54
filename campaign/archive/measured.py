"""What a recording says by itself, measured before its trial is closed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from campaign.archive.archived_trial import ArchivedTrial
from campaign.estimate import Estimate


@dataclass(frozen=True)
class Measured:
    """What was found.

    Attributes:
        estimates: each finite, and of another name than the others.
        by: which code measured them, with its version.
        problem: why there are none, in one line; empty when there are, or when nobody looked.
    """

    estimates: tuple[Estimate, ...] = ()
    by: str = ""
    problem: str = ""


Measure = Callable[[ArchivedTrial], Measured]
"""Measures a trial that is about to be closed. Raises nothing."""
