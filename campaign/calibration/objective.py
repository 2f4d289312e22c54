"""Residuals of a bench with given unknowns: simulation and analysis in memory."""

from __future__ import annotations

import threading
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from campaign.arrays import Array
from campaign.axis_kind import axis_terms, sides_in
from campaign.backends.sim import SimBackend, SimOptions
from campaign.calibration.problem import CalibrationProblem
from campaign.calibration.targets import residuals, restricted
from campaign.errors import CampaignError, ProtocolError, UsageError
from campaign.estimate import Estimate
from campaign.experiments.analysis import analysed, with_named_tables
from campaign.experiments.interface import Experiment, TestData, bench_of
from campaign.experiments.post_processing.axis_units import in_axis_units
from campaign.protocol.expand import expand, seed_of
from campaign.protocol.points import PointError
from campaign.protocol.schema import Test
from campaign.published.evidence import Evidence, evidence_of
from campaign.published.scoreboard import score
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording
from campaign.trial import Trial

Item = TypeVar("Item")
Made = TypeVar("Made")


@dataclass(frozen=True)
class FinishedTrial:
    """A trial with its recording in memory, for an analysis."""

    trial: Trial
    record: Recording
    estimates: tuple[Estimate, ...] = ()
    not_kept: str = ""

    @property
    def ending(self) -> Ending:
        return self.record.ending

    def recording(self) -> Recording:
        return self.record

    def channel_names(self) -> frozenset[str]:
        return frozenset(self.record.channels)


@dataclass(frozen=True)
class Evaluation:
    """Reproduced cells for one set of values.

    Attributes:
        found: reproduced value by cell path, in the printed unit; without missing cells.
        problems: sentences on failures.
    """

    found: Mapping[str, float]
    problems: tuple[str, ...] = ()


class Simulation:
    """Evaluates sets of values, several trials or several sets at once."""

    def __init__(
        self, problem: CalibrationProblem, experiments: Mapping[str, Experiment], workers: int
    ) -> None:
        self._problem = problem
        self._experiments = experiments
        self._workers = workers
        self._published = restricted(problem.published, problem.targets)
        self._stopped = threading.Event()
        step = {"longest_step": problem.options.longest_step}
        self._backend = SimBackend(SimOptions.model_validate(step, context={"si": True}))

    def check(self) -> Evaluation:
        """Evaluate the unchanged bench. Raises UsageError for a cell that no test reproduces."""
        present = self._problem.space.present
        try:
            groups = [trials for _, trials in self._planned(present)]
        except PointError as error:
            raise ProtocolError(error.problems) from None
        for trial in (trial for group in groups for trial in group):
            why = self._backend.refuses(trial)
            if why:
                raise UsageError(f"{trial.name} ({trial.label}) cannot be simulated: {why}")
        evaluation = self.evaluate(present)
        missing = [
            t.cell.path for t in self._problem.targets if t.cell.path not in evaluation.found
        ]
        if missing and not evaluation.problems:
            raise UsageError(
                f"no test of {self._problem.protocol.path} finds {', '.join(missing)}; "
                "sweep what these cells need, or name them under 'without'"
            )
        return evaluation

    def residuals(self, values: Sequence[float]) -> Array:
        """Residual of each target, shape (n,)."""
        return residuals(self._problem.targets, self.evaluate(values).found)

    def residuals_of_all(self, sets: Sequence[Sequence[float]]) -> list[Array]:
        """Residuals of several sets of values, one set per worker at a time."""
        if self._workers == 1 or len(sets) == 1:
            return [self.residuals(values) for values in sets]

        def one(values: Sequence[float]) -> Array:
            reproduced = self.evaluate(values, alone=False).found
            return residuals(self._problem.targets, reproduced)

        return self._at_once(one, sets)

    def evaluate(self, values: Sequence[float], *, alone: bool = True) -> Evaluation:
        """Simulate every test with `values` (SI) and compare its findings with the targets.

        Args:
            values: in the order of the parameters.
            alone: whether this evaluation may use all workers for its trials.
        """
        try:
            planned = list(self._planned(values))
        except PointError as error:  # the bench does not accept these values together
            return Evaluation({}, (str(error),))
        batches = list(self._batches([trial for _, trials in planned for trial in trials]))
        at_once = alone and self._workers > 1
        ended = (self._at_once if at_once else map)(self._execute, batches)
        by_number = {item.trial.number: item for batch in ended for item in batch}
        problems: list[str] = []
        evidence = []
        for test, trials in planned:
            finished = tuple(by_number[trial.number] for trial in trials)
            problems += (
                f"{item.trial.name} {item.trial.label}: {item.ending.reason}"
                for item in finished
                if item.ending.outcome is not Outcome.COMPLETED
            )
            evidence.append(self._analyse(test, finished, problems))
        board = score(self._published, evidence)
        reproduced = {
            line.cell.path: line.reproduced for line in board.lines if line.reproduced is not None
        }
        return Evaluation(reproduced, (*problems, *board.problems))

    def _planned(self, values: Sequence[float]) -> Iterator[tuple[Test, tuple[Trial, ...]]]:
        calibration = self._problem.calibration
        bench = self._problem.space.bench(calibration.bench.tree, values)
        before = 0
        for test in self._problem.tests:
            seed = seed_of(test, self._problem.options.seed)
            expanded = expand(replace(test, bench=bench), seed, before, allow_large=False)
            if expanded.stages:
                name = expanded.stages[0].name
                message = f"a calibration executes planned trials only; leave out the {name}"
                raise PointError([test.origin.problem((), "value", message)])
            before += len(expanded.trials)
            yield test, expanded.trials

    def _batches(self, trials: Iterable[Trial]) -> Iterator[tuple[Trial, ...]]:
        """Batches of trials for joint simulation; single trials of groups that are too small."""
        groups: dict[Hashable, list[Trial]] = {}
        for trial in trials:
            groups.setdefault(self._group(trial), []).append(trial)
        fewest, most = self._backend.fewest_together, self._backend.most_together
        for group in groups.values():
            size = most if len(group) >= fewest else 1
            yield from (tuple(group[k : k + size]) for k in range(0, len(group), size))

    def _group(self, trial: Trial) -> Hashable:
        try:
            return self._backend.group(trial)
        except (ArithmeticError, ValueError, CampaignError):
            return trial.number  # executed alone; it fails

    def _execute(self, batch: Sequence[Trial]) -> list[FinishedTrial]:
        """Simulate a batch; a failed trial has a recording like any other."""
        recorders = [MemoryRecorder() for _ in batch]
        stops = [self._stopped.is_set] * len(batch)
        endings: dict[int, Ending] = {}
        failed = Ending(Outcome.FAULT)
        try:
            with np.errstate(all="ignore"):
                endings |= self._backend.execute_together(batch, recorders, stops)
        except (ArithmeticError, ValueError, CampaignError) as error:
            failed = Ending(Outcome.FAULT, f"{type(error).__name__}: {error}")
        return [
            FinishedTrial(trial, recorder.recording(endings.get(place, failed)))
            for place, (trial, recorder) in enumerate(zip(batch, recorders, strict=True))
        ]

    def _analyse(
        self, test: Test, finished: tuple[FinishedTrial, ...], problems: list[str]
    ) -> Evidence:
        experiment = self._experiments[test.entry.kind]
        name, reproduces = test.entry.name, test.entry.reproduces
        if not finished:
            return evidence_of(name, reproduces, (), None)
        first = finished[0].trial
        data = TestData(name, test.entry.kind, first.options, finished)
        try:
            with axis_terms(sides_in(data.trials[0].trial.bench)):
                findings = in_axis_units(analysed(experiment, with_named_tables(data))).findings
        except Exception as error:  # noqa: BLE001 (a fit tries values that are new to the analysis)
            problems.append(f"{name}: the analysis failed: {type(error).__name__}: {error}")
            findings = ()
        return evidence_of(name, reproduces, findings, bench_of(first))

    def _at_once(self, function: Callable[[Item], Made], items: Sequence[Item]) -> list[Made]:
        pool = ThreadPoolExecutor(self._workers)
        try:
            return list(pool.map(function, items))
        except BaseException:
            self._stopped.set()  # Ctrl-C: let running trials end
            raise
        finally:
            pool.shutdown(cancel_futures=True)
            self._stopped.clear()
