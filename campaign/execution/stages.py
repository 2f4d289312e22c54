"""Later stages of a run: when their trials follow, and their execution.

A stage is evaluated after the final end of all trials of its point. Its trials are journaled before
the first one begins. The order of stages is that of their points' last planned trials, independent
of the workers: a trial has the same number in every run, and a resumed run reads the evaluated
stages from the journal.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from campaign.archive.layout.followup_trials import trials_followed
from campaign.archive.layout.journal import TrialsFollowed, utc_now
from campaign.archive.reading.archived_metrics import Measure
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.writing.writer import RunWriter
from campaign.axis_kind import each_in_axis_terms
from campaign.backends import calls
from campaign.backends.interface import Backend
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.execution.safety import describe
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of, options_of
from campaign.protocol.stage_trials import Refusal, StageTrials, TooMuchError, follow
from campaign.protocol.stages import PlannedStage, place_of
from campaign.reason import Cause
from campaign.text import count, shortened
from campaign.trial import Role, Trial, canonical_json

NOTHING_TOLD = Cause("nothing found", "the recording shows nothing")
TOLD = 3
"""Number of refused trials per stage that are reported individually; the journal has all."""


UNKNOWN = Estimate.without_interval("nothing", math.nan, "", NOTHING_TOLD())
"""Metric of a recording that could not be measured."""


class Stages:
    """The stages of a run that are not yet evaluated. Used from one thread."""

    def __init__(
        self,
        planned: Iterable[PlannedStage],
        trials: Sequence[Trial],
        archive: RunWriter,
        experiments: Mapping[str, Experiment],
        refusal: Refusal,
        *,
        measure: Measure | None = None,
        finished: Iterable[int] = (),
        asked: Sequence[TrialsFollowed] = (),
    ) -> None:
        """Begin, or continue an earlier session.

        Args:
            planned: all stages of the plan.
            trials: all known trials: of the plan and of `asked`.
            refusal: the backend's reason to refuse a trial; empty for an executable trial.
            measure: metrics of an archived trial, within a time limit; None: a stage measures.
            finished: numbers of the trials that need no further attempt.
            asked: the journaled stages.
        """
        known = {(place_of(each.test, each.point), each.stage) for each in asked}
        places = {stage.place: stage for stage in planned}
        paths = {stage.test: tuple(stage.point) for stage in places.values()}
        self._trials: dict[str, list[Trial]] = {}
        for trial in trials:
            if trial.test in paths and trial.role is not Role.CHECK:
                point = {path: trial.point[path] for path in paths[trial.test]}
                self._trials.setdefault(place_of(trial.test, point), []).append(trial)
        followed = {each.number for stage in asked for each in stage.trials}
        last = {
            place: max(trial.number for trial in own if trial.number not in followed)
            for place, own in self._trials.items()
        }
        waiting = [stage for stage in planned if (stage.place, stage.number) not in known]
        waiting.sort(key=lambda stage: (last[stage.place], stage.number))
        self._waiting = deque(waiting)
        self._followed = followed
        self._ended = set(finished)
        self._next = max((trial.number for trial in trials), default=0) + 1
        self._archive = archive
        self._experiments = experiments
        self._measure = measure
        self._refusal = refusal
        self._failures = [text for stage in asked if (text := _failure(stage))]

    @property
    def left(self) -> bool:
        """Whether a stage is not yet evaluated."""
        return bool(self._waiting)

    @property
    def failed(self) -> str:
        """Why trials of stages are missing; empty if none are missing."""
        return ", ".join(shortened(self._failures, 1))

    def in_order(self, trials: Iterable[Trial]) -> list[Trial]:
        """Trials in order of execution: those of evaluated stages first, as before a resume."""
        return sorted(trials, key=lambda trial: trial.number not in self._followed)

    def ended(self, trial: Trial) -> None:
        """Note that a trial needs no further attempt and is archived."""
        self._ended.add(trial.number)

    @property
    def is_due(self) -> bool:
        """Whether all trials on which the next stage depends have ended."""
        if not self._waiting:
            return False
        own = self._trials[self._waiting[0].place]
        return all(trial.number in self._ended for trial in own)

    def ask(self) -> tuple[Sequence[Trial], Sequence[str]]:
        """Evaluate and journal the stage that is due; its trials, and remarks for the operator.

        An error in the stage costs only the stage. Raises ArchiveError if it cannot be journaled.
        """
        stage = self._waiting[0]
        outcome, reason = StageTrials(()), ""
        try:
            outcome = self._follow(stage)
        except (Exception, SystemExit) as error:  # noqa: BLE001 - must not cost the run
            reason = str(error) if isinstance(error, TooMuchError) else describe(error)
        what = (stage.test, stage.number, stage.name, stage.point)
        entry = trials_followed(utc_now(), *what, outcome.trials, outcome.refused, reason)
        self._archive.note(entry)
        self._waiting.popleft()
        self._trials[stage.place] += outcome.trials
        self._next += len(outcome.trials)
        if text := _failure(entry):
            self._failures.append(text)
        return outcome.trials, _remarks(entry)

    def _follow(self, stage: PlannedStage) -> StageTrials:
        trials = self._trials[stage.place]
        first = trials[0]
        experiment = self._experiments[first.kind]
        (declared,) = (each for each in experiment.stages if each.name == stage.name)
        archived = tuple(self._measured(self._archive.archived(trial.number)) for trial in trials)
        if not _on_benches_of(trials, archived):
            raise UsageError("its trials were executed on different benches")
        data = TestData(first.test, first.kind, first.options, archived)
        bench = bench_of(first)
        asked = declared.trials(options_of(experiment, first.options), bench, data)
        requests = each_in_axis_terms(bench.sides, asked)
        return follow(stage, experiment, requests, first, self._next, self._refusal)

    def _measured(self, trial: ArchivedTrial) -> ArchivedTrial:
        """The trial with its metrics, measured now if none are archived; never empty.

        The bench waits for the stage. An experiment's `measure` that hung at the end of its trial
        must not hang here; `UNKNOWN` marks a trial that is not to be measured again.
        """
        if self._measure is None or trial.estimates:
            return trial
        return replace(trial, estimates=self._measure(trial).estimates or (UNKNOWN,))


def _on_benches_of(trials: Sequence[Trial], archived: Sequence[TrialData]) -> bool:
    """Whether each trial was executed on its present bench.

    A run may be resumed on a changed bench. Results of the previous bench must not decide how the
    changed bench moves.
    """
    return all(
        canonical_json(then.trial.bench) == canonical_json(now.bench)
        for then, now in zip(archived, trials, strict=True)
    )


def refusal_of(backend: Backend) -> Refusal:
    """Function that returns why the connected `backend` does not execute a trial."""

    def why(trial: Trial) -> str:
        if reason := calls.refusal(backend, trial):
            return reason
        lacking = calls.unrecorded(backend, trial, trial.requires)
        return f"it requires {', '.join(lacking)}, and that is not recorded" if lacking else ""

    return why


def _failure(entry: TrialsFollowed) -> str:
    """Which trials of a stage are missing, and why; empty if none are missing."""
    if entry.reason:
        return f"{entry.title} failed: {entry.reason}"
    if entry.refused:
        refused = len(entry.refused)
        what = "a trial was" if refused == 1 else f"{refused} trials were"
        return f"{entry.title}: {what} refused: {entry.refused[0].why}"
    return ""


def _remarks(entry: TrialsFollowed) -> list[str]:
    """Remarks for the operator about an evaluated stage."""
    if entry.reason:
        return [_failure(entry)]
    remarks = [f"{entry.title}: {count(len(entry.trials), 'trial follows', 'trials follow')}"]
    refused = [f"refused: {each.label}: {each.why}" for each in entry.refused]
    return remarks + shortened(refused, TOLD, "more trials are refused")
