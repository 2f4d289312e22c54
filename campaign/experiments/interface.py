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
    """A finished trial as an analysis sees it; its samples are read only when asked for."""

    @property
    def trial(self) -> Trial: ...

    @property
    def ending(self) -> Ending: ...

    def recording(self) -> Recording:
        """The samples. Raises ArchiveError when they cannot be read."""

    def channel_names(self) -> frozenset[str]:
        """What was recorded, without reading any of it. Raises ArchiveError likewise."""

    @property
    def estimates(self) -> Sequence[Estimate]:
        """What `Experiment.measure` found when it was executed; nothing if nobody looked then."""

    @property
    def not_kept(self) -> str:
        """Why it has no samples though it recorded some; empty when it has."""


def no_progress(text: str) -> None:
    """Reports progress to nobody."""


def say_at(say: Callable[[str], None], step: str, text: str) -> None:
    """Report progress at a step of several, e.g. `model 2 of 5`."""
    say(f"{step}, {text}")


@dataclass(frozen=True)
class TestData:
    """All there is about one test of a run, for its analysis; or trials that a model suits.

    Attributes:
        options: the test's normalised options before the sweep (SI).
        trials: in plan order, failed ones included.
        model: options of the experiment's `Model`, where `campaign identify` asks for parameters;
            None in a report.
        validation: trials that no model is fitted to, for comparison with its predictions; read
            once, when everything is chosen.
        say: reports progress.
        left_out: trials that are not among those, as nothing can be told from their recordings.
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
        """What is stated of the rig: that of the first trial."""
        return bench_of(self.trials[0].trial)

    def completed(self) -> Iterator[TrialData]:
        """The measurements that ran to their end, in plan order."""
        return (
            data
            for data in self.trials
            if data.ending.outcome == "completed" and data.trial.role == "measurement"
        )


def with_samples(trials: Iterable[TrialData]) -> list[TrialData]:
    """Those whose samples are archived: time histories are drawn of them."""
    return [data for data in trials if not data.not_kept]


@dataclass(frozen=True)
class Stage(StageKind):
    """Trials of one point of a test's matrix that follow from what those before them found.

    Attributes:
        name: a word or two, unique within the experiment: `refinement`.
        why: what follows from what, for the plan and the record.
        most: what they take at most at a point, from its options and bench. The plan shows it and
            judges its size, and nobody gets more: a stage that asks for more is not executed.
        trials: which they are, from options and bench of the point and all of its trials so far,
            failed ones included. Asked once, when all of those have ended; the same data gives the
            same trials. They are numbered, checked and archived like planned ones. What it raises
            costs the stage and not the run.
    """

    trials: Callable[[Any, Bench, TestData], Iterable[TrialRequest]]


Suits = Callable[[Sequence[TrialData]], tuple[Sequence[TrialData], str]]
"""Of recorded trials, those that an analysis can use; where none, why."""


@dataclass(frozen=True)
class Model:
    """How `campaign identify` uses an experiment's analysis, which gives `Result.identified`.

    The analysis then has `TestData.model` and `TestData.validation`, and raises ValueError with a
    message for the user where there is no result.

    Attributes:
        name: what `--model` says.
        summary: one line for `campaign kinds`.
        options: what it accepts, `--set NAME.option=value`; the analysis has them as
            `TestData.model`.
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
    """A quantity of which findings are key numbers: those with all of these conditions."""

    quantity: str
    where: Mapping[str, Value]


def key(quantity: str, **where: Value) -> KeyQuantity:
    """`key("breakaway_torque", statistic="mean")`."""
    return KeyQuantity(quantity, where)


@dataclass(frozen=True)
class Experiment(ExperimentKind):
    """A kind of test.

    Attributes:
        name: what a protocol's `kind` says.
        summary: one line for `campaign kinds`.
        options: what a test of this kind accepts, besides what every test accepts.
        trials: the trials of one point of the test's matrix, in the order to execute them. Raises
            ValueError with a message for the user when options and bench do not go together.
        analyse: tables, figures and findings of a whole test. Must cope with failed trials, and
            with recordings that lack a channel of `can_use`.
        measure: the metrics of one recording, from its samples and its trial's windows alone; they
            are archived with the trial, and `metrics` gives them to `analyse`. Raises ValueError
            with a message for the user when the recording holds none. Whatever it raises costs
            that trial only: the others are analysed, and a note says which one is left out.
        needs_samples: whether `analyse` finds less in metrics alone. Where it does not, and draws
            time histories of `with_samples` only, a protocol may leave samples out (`keep`).
        fit: options that a test does not write, as they suit its bench. Handed the options with
            their plain defaults (`model_fields_set` has those written) and the bench; what it does
            not name keeps its default.
        requires: names of the channels without which a measurement is in vain, and what each is
            for. A `TrialRequest` says so where its trial requires only some of them.
        can_use: names of further channels, and what there is none of without them, in words that
            go on after "no": `figure of the command`.
        seeks_instability: it goes to where a loop is unstable, to find out where that is; the plan
            of any other test with an unstable loop is refused.
        uses_failed: its analysis uses trials that did not complete, and says which are left out; of
            any other a note counts them.
        perturbs_bench: its trials are on benches that it makes from the test's own, on purpose
            (`TrialRequest.bench`); what it finds is still said of the test's bench.
        stages: further trials of a point, which follow from those of `trials` and of the stages
            before; nothing else may lead to trials that are not in the plan.
        recorded: the trials that a recording from elsewhere holds, with their windows, and with the
            part of it that each is where there are several. Raises ValueError with a message for
            the user where it holds none. Absent: it is one trial, with the windows that whoever
            recorded it names.
        windows: names of the windows that its analysis looks for, where other names tell it
            nothing; a mapping that names another is refused. Absent: whoever recorded it knows.
        most_samples: of a recording that is looked at in one, whole channels in memory; longer ones
            are archived and not analysed. None: however many there are.
        warnings: what the plan should warn of, with what to do about it: sentences without a full
            stop, of the options and the bench of a point whose trials were made. What a test's
            points say alike is told once.
        model: how `campaign identify` uses its analysis.
        key_numbers: which findings answer what a test asks, the most important first.
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
    """What one recording says, by name: as it was measured before (`analysis`), or else by now.

    What was not determined is not archived, and comes back as such. Raises what `measure` raises.
    """
    return Metrics({each.name: each for each in data.estimates or measure(data)})


class Metrics(dict[str, Estimate]):
    """Metrics by name; those that a recording does not tell are not determined."""

    def __missing__(self, name: str) -> Estimate:
        return Estimate.without_interval(name, math.nan, "", NOT_TOLD())


def bench_of(trial: Trial) -> Bench:
    """The trial's bench as an object; of equal benches one, which nobody may change."""
    return validated(Bench, trial.bench)


def options_of(experiment: Experiment, tree: Mapping[str, Any]) -> Any:
    """Normalised options as an object of the experiment's own class; of equal ones one."""
    return validated(experiment.options, tree)


def validated(kind: type[_Options], tree: Mapping[str, Any]) -> _Options:
    """A normalised tree (SI) as an object. Raises what validation raises.

    The trials of a test share their bench and nearly all options, so objects are kept: by content,
    as trees can be changed.
    """
    return cast("_Options", _validated(kind, to_json(tree)))


@lru_cache(maxsize=256)  # of up to 40 kB each
def _validated(kind: type[Options], content: bytes) -> Options:
    return kind.model_validate_json(content, context={"si": True})
