"""The interface of an experiment: options, trials, measurement, analysis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, Protocol, TypeVar, cast

from pydantic_core import to_json

from campaign.estimate import Estimate
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.protocol.schema import ChosenValue as ChosenValue
from campaign.protocol.schema import ExperimentKind, StageKind
from campaign.reason import Cause
from campaign.recording import Ending, Recording
from campaign.result import Result, Value
from campaign.trial import Tree, Trial, TrialRequest

NOT_TOLD = Cause("not in the recording", "the recording does not contain it")

_Options = TypeVar("_Options", bound=Options)


class TrialData(Protocol):
    """A finished trial for an analysis; `recording` reads its samples."""

    @property
    def trial(self) -> Trial: ...

    @property
    def ending(self) -> Ending: ...

    def recording(self) -> Recording:
        """The samples. Raises ArchiveError when they cannot be read."""

    def channel_names(self) -> frozenset[str]:
        """Names of the recorded channels, without reading samples. Raises ArchiveError likewise."""

    @property
    def estimates(self) -> Sequence[Estimate]:
        """Metrics by `Experiment.measure` at execution; empty if not measured then."""

    @property
    def not_kept(self) -> str:
        """Why its recorded samples were not archived; empty if they were."""


class ChangedTrial:
    """A finished trial with other metrics, and other attributes of its `trial`."""

    def __init__(self, data: TrialData, estimates: Sequence[Estimate], **changes: Any) -> None:
        self.trial = data.trial.model_copy(update=changes)
        self.ending = data.ending
        self.recording = data.recording
        self.channel_names = data.channel_names
        self.not_kept = data.not_kept
        self.estimates = estimates


def no_progress(text: str) -> None:
    """Ignore progress."""


def say_at(say: Callable[[str], None], step: str, text: str) -> None:
    """Report progress at a step of several, e.g. `model 2 of 5`."""
    say(f"{step}, {text}")


@dataclass(frozen=True)
class TestData:
    """Data of one test of a run for its analysis, or of trials that suit a model.

    Attributes:
        options: the test's normalised options before the sweep (SI).
        trials: in plan order, failed ones included.
        model: options of the experiment's `Model`, where `campaign identify` asks for parameters;
            None in a report.
        validation: trials that are not fitted, for comparison with predictions; read once, after
            all choices.
        say: reports progress.
        left_out: further trials, which are not analysed because of their recordings.
    """

    name: str
    kind: str
    options: Tree
    trials: tuple[TrialData, ...]
    model: Any = None
    validation: tuple[TrialData, ...] = ()
    say: Callable[[str], None] = no_progress
    left_out: tuple[Trial, ...] = ()

    @property
    def bench(self) -> Bench:
        """Stated bench of the rig, from the first trial."""
        return bench_of(self.trials[0].trial)

    def completed(self) -> Iterator[TrialData]:
        """The measurements that ran to their end, in plan order."""
        return (
            data
            for data in self.trials
            if data.ending.outcome == "completed" and data.trial.role == "measurement"
        )


def with_samples(trials: Iterable[TrialData]) -> list[TrialData]:
    """Trials with archived samples, for figures over time."""
    return [data for data in trials if not data.not_kept]


@dataclass(frozen=True)
class Stage(StageKind):
    """Trials of one point of a test's matrix that depend on results of earlier trials.

    Attributes:
        name: a word or two, unique within the experiment: `refinement`.
        why: how they depend on earlier trials, for the plan and the archive.
        most: upper bound of their trials and time at a point, from its options and bench. The plan
            shows and checks it; a stage that exceeds it is not executed.
        trials: the trials, from options and bench of the point and all of its trials so far, failed
            ones included. Called once, after all of those have ended; equal data give equal trials.
            They are numbered, checked and archived like planned ones. An exception ends the stage,
            not the run.
    """

    trials: Callable[[Any, Bench, TestData], Iterable[TrialRequest]]


Suits = Callable[[Sequence[TrialData]], tuple[Sequence[TrialData], str]]
"""Recorded trials that an analysis can use; without any, the reason."""


@dataclass(frozen=True)
class Model:
    """How `campaign identify` uses an experiment's analysis, which gives `Result.identified`.

    The analysis then has `TestData.model` and `TestData.validation`, and raises ValueError with a
    message for the user if there is no result.

    Attributes:
        name: value of `--model`.
        summary: one line for `campaign kinds`.
        options: of `--set NAME.option=value`; the analysis has them as `TestData.model`.
        suits: recorded trials that the analysis can use. Absent: those of the experiment itself
            that have the channels it requires.
    """

    name: str
    summary: str
    options: type[Options] = Options
    suits: Suits | None = None


NO_MODEL = Model("", "")


@dataclass(frozen=True)
class KeyQuantity:
    """Quantity whose findings with all of these conditions are key numbers."""

    quantity: str
    where: Mapping[str, Value]


def key(quantity: str, **where: Value) -> KeyQuantity:
    """`key("breakaway_torque", statistic="mean")`."""
    return KeyQuantity(quantity, where)


@dataclass(frozen=True)
class Experiment(ExperimentKind):
    """A kind of test.

    Attributes:
        name: value of `kind` in a protocol.
        summary: one line for `campaign kinds`.
        options: of a test of this kind, besides those of every test.
        trials: the trials of one point of the test's matrix, in the order to execute them. Raises
            ValueError with a message for the user if options and bench are not compatible.
        analyse: tables, figures and findings of a whole test. Must accept failed trials, and
            recordings without a channel of `can_use`.
        measure: the metrics of one recording, from its samples and its trial's windows alone; they
            are archived with the trial, and `metrics` gives them to `analyse`. Raises ValueError
            with a message for the user if the recording has none. Any exception affects that trial
            only: the others are analysed, and a note states which one is left out.
        needs_samples: whether `analyse` has fewer results from metrics alone. If not, and if it
            draws time histories of `with_samples` only, a protocol may leave samples out (`keep`).
        fit: defaults that depend on the bench, for options that a test omits. Takes the options
            with plain defaults (`model_fields_set` has the written ones) and the bench; options
            that it does not name keep their defaults.
        requires: channels without which a measurement has no result, and the purpose of each. A
            `TrialRequest` states its own if its trial requires only some of them.
        can_use: names of further channels, and the result that is missing without each, in words
            that continue after "no": `figure of the command`.
        seeks_instability: it measures where a loop becomes unstable; the plan of any other test
            with an unstable loop is refused.
        uses_failed: its analysis uses trials that did not complete, and states which are left out;
            for any other experiment a note counts them.
        perturbs_bench: its trials are on benches that it derives from the test's own, on purpose
            (`TrialRequest.bench`); its findings still belong to the test's bench.
        stages: further trials of a point, which depend on those of `trials` and of the stages
            before; only stages add trials that are not in the plan.
        recorded: the trials in a recording of another program, with their windows, and with the
            part of each if there are several. Raises ValueError with a message for the user if
            there is none. Absent: it is one trial, with the windows of its mapping.
        windows: names of the windows that its analysis reads, if other names have no meaning for
            it; a mapping with another name is refused. Absent: any name.
        most_samples: of a recording that is analysed as a whole, in memory; longer ones are
            archived and not analysed. None: no limit.
        warnings: warnings for the plan, with the remedy: sentences without a full stop, from
            options and bench of a point whose trials were made. Equal ones of a test are shown
            once.
        model: how `campaign identify` uses its analysis.
        key_numbers: findings that answer the question of a test, the most important first.
    """

    analyse: Callable[[TestData], Result]
    measure: Callable[[TrialData], Sequence[Estimate]] | None = None
    needs_samples: bool = True
    uses_failed: bool = False
    perturbs_bench: bool = False
    stages: tuple[Stage, ...] = field(default=(), kw_only=True)
    most_samples: int | None = None
    model: Model = NO_MODEL
    key_numbers: tuple[KeyQuantity, ...] = ()


def metrics(
    data: TrialData, measure: Callable[[TrialData], Sequence[Estimate]]
) -> dict[str, Estimate]:
    """Metrics of one recording by name: those measured before (`analysis`), else measured now.

    Metrics without a value are not archived, and are not determined. Raises what `measure` raises.
    """
    return Metrics({each.name: each for each in data.estimates or measure(data)})


class Metrics(dict[str, Estimate]):
    """Metrics by name; missing ones are not determined."""

    def __missing__(self, name: str) -> Estimate:
        return Estimate.without_interval(name, math.nan, "", NOT_TOLD())


def bench_of(trial: Trial) -> Bench:
    """The trial's bench; equal benches share one object, which must not be changed."""
    return validated(Bench, trial.bench)


def options_of(experiment: Experiment, tree: Mapping[str, Any]) -> Any:
    """Normalised options as an object of the experiment's class; equal ones share one object."""
    return validated(experiment.options, tree)


def validated(kind: type[_Options], tree: Mapping[str, Any]) -> _Options:
    """A normalised tree (SI) as an object. Raises what validation raises.

    Trials of a test share their bench and most options, so objects are cached: by content, because
    trees can be changed.
    """
    return cast("_Options", _validated(kind, to_json(tree)))


@lru_cache(maxsize=256)  # of up to 40 kB each
def _validated(kind: type[Options], content: bytes) -> Options:
    return kind.model_validate_json(content, context={"si": True})
