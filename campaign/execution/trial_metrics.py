"""Metrics of a recording at the end of its trial.

They are archived, so that a later analysis reads the same values. The recording is already on the
disk: an error here does not cost it, and an analysis computes metrics that were not archived.
"""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import campaign
from campaign.archive.reading.archived_metrics import ArchivedMetrics
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.axis_kind import in_axis_terms, sides_in
from campaign.backends.calls import Call
from campaign.entry_points import PlugIn
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.execution.safety import describe
from campaign.experiments.analysis import measured
from campaign.experiments.interface import Experiment
from campaign.plugins import Kinds
from campaign.recording import Outcome
from campaign.source_hash import digest, sources_of
from campaign.stopwatch import UNTIMED, Timing, Work
from campaign.trial import Role

LIMIT = 60.0
"""s; time limit per recording: the bench and later stages wait for it."""


@dataclass(frozen=True)
class TrialMeasurement:
    """Computes metrics of completed trials whose experiment has `measure`; a `Measure`.

    Any thread may use it.

    Attributes:
        limit: time limit (s); a longer computation is abandoned, without metrics in the archive.
        only_plug_ins: whether the limit applies to plug-ins only, as no bench waits. A thread for
            each trial costs as much as its metrics.
    """

    experiments: Kinds[Experiment]
    timing: Timing = UNTIMED
    limit: float = LIMIT
    only_plug_ins: bool = False
    _authors: dict[str, str] = field(default_factory=dict)  # by kind

    def __call__(self, data: ArchivedTrial) -> ArchivedMetrics:
        if data.ending.outcome is not Outcome.COMPLETED or data.trial.role is not Role.MEASUREMENT:
            return ArchivedMetrics()
        with self.timing.span(Work.MEASURING):
            if self.only_plug_ins and self.experiments.plug_in(data.trial.kind) is None:
                return self._found(data)
            return self._in_time(data)

    def _in_time(self, data: ArchivedTrial) -> ArchivedMetrics:
        """Measure in a separate thread, which can be abandoned if it hangs."""
        call = Call(partial(self._measured, data), "measuring")
        if call.has_ended(self.limit):
            return call.answer()
        return ArchivedMetrics(problem=f"measuring did not end within {self.limit:g} s")

    def _measured(self, data: ArchivedTrial) -> ArchivedMetrics:
        began = time.thread_time()  # of a thread outside all spans
        try:
            return self._found(data)
        finally:
            self.timing.add(Work.MEASURING, time.thread_time() - began)

    def _found(self, data: ArchivedTrial) -> ArchivedMetrics:
        try:
            experiment = self.experiments.get(data.trial.kind)
            if experiment is None or experiment.measure is None:
                return ArchivedMetrics()
            estimates = checked(measured(experiment, data))
            return ArchivedMetrics(estimates, self._by(data.trial.kind) if estimates else "")
        except (ValueError, UsageError) as error:
            sides = sides_in(data.trial.bench)
            return ArchivedMetrics(problem=in_axis_terms(_one_line(str(error)), sides))
        except BaseException as error:  # noqa: BLE001 - a plug-in must not cost the trial
            return ArchivedMetrics(problem=_one_line(f"measuring failed: {describe(error)}"))

    def _by(self, kind: str) -> str:
        if kind not in self._authors:
            self._authors[kind] = author(self.experiments.plug_in(kind))
        return self._authors[kind]


def checked(found: Sequence[Estimate]) -> tuple[Estimate, ...]:
    """Estimates with a finite value. Raises ValueError if two have the same name."""
    names = Counter(estimate.name for estimate in found)
    twice = [name for name, count in names.items() if count > 1]
    if twice:
        raise ValueError(f"{twice[0]!r} was measured twice in one recording")
    return tuple(estimate for estimate in found if math.isfinite(estimate.value))


def author(plug_in: PlugIn | None) -> str:
    """Origin of a kind's code: this program, or a package with the hash of its sources."""
    program = f"campaign {campaign.__version__}"
    if plug_in is None:
        return program
    sources = digest(sources_of(plug_in.packages))
    return f"{plug_in.distribution} {plug_in.version} (sha256 {sources}) with {program}"


def _one_line(text: str) -> str:
    return next(iter(text.strip().splitlines()), "")[:300]
