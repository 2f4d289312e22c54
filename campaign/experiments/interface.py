"""What an experiment is: options, how they become trials, and what their recordings say."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

from campaign.channels import missing
from campaign.estimate import Estimate
from campaign.experiments.swept_tables import table_names
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Result
from campaign.trial import Ending, Most, Recording, Tree, Trial, TrialRequest, canonical_json


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


@dataclass(frozen=True)
class TestData:
    """All there is about one test of a run, for its analysis.

    Attributes:
        options: the test's normalised options before the sweep (SI).
        trials: in plan order, failed ones included.
    """

    name: str
    kind: str
    options: Tree
    trials: tuple[TrialData, ...]

    def completed(self) -> Iterator[TrialData]:
        """The measurements that ran to their end, in plan order."""
        return (
            data
            for data in self.trials
            if data.ending.outcome == "completed" and data.trial.role == "measurement"
        )


@dataclass(frozen=True)
class Chosen:
    """A value (SI) that an experiment chose for an option that a test does not write, and why."""

    value: Any
    reason: str


@dataclass(frozen=True)
class Stage:
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

    name: str
    why: str
    most: Callable[[Any, Bench], Most]
    trials: Callable[[Any, Bench, TestData], Iterable[TrialRequest]]


@dataclass(frozen=True)
class Experiment:
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
            with a message for the user when the recording holds none.
        fit: options that a test does not write, as they suit its bench. Handed the options with
            their plain defaults (`model_fields_set` has those written) and the bench; what it does
            not name keeps its default.
        requires: names of the channels without which a measurement is in vain, and what each is
            for. A `TrialRequest` says so where its trial requires only some of them.
        can_use: names of further channels, and what there is none of without them, in words that
            go on after "no": `figure of the command`.
        seeks_instability: it goes to where a loop is unstable, to find out where that is; the plan
            of any other test with an unstable loop is refused.
        perturbs_bench: its trials are on benches that it makes from the test's own, on purpose
            (`TrialRequest.bench`); what it finds is still said of the test's bench.
        stages: further trials of a point, which follow from those of `trials` and of the stages
            before; nothing else may lead to trials that are not in the plan.
    """

    name: str
    summary: str
    options: type[Options]
    trials: Callable[[Any, Bench], Iterable[TrialRequest]]
    analyse: Callable[[TestData], Result]
    measure: Callable[[TrialData], Sequence[Estimate]] | None = None
    fit: Callable[[Any, Bench], Mapping[str, Chosen]] | None = None
    requires: Mapping[str, str] = field(default_factory=dict)
    can_use: Mapping[str, str] = field(default_factory=dict)
    seeks_instability: bool = False
    perturbs_bench: bool = False
    stages: tuple[Stage, ...] = ()


def result_of(experiment: Experiment, data: TestData) -> Result:
    """What the analysis finds, with a note on every channel that it had to do without."""
    result = experiment.analyse(with_named_tables(data))
    lacking: dict[str, None] = {}
    for item in data.trials:
        if item.trial.can_use and item.ending.outcome == "completed":
            lacking |= dict.fromkeys(missing(item.trial.can_use, item.channel_names()))
    notes = (f"Without {name}: no {lost_without(experiment, name)}." for name in lacking)
    return replace(result, notes=(*result.notes, *notes))


def metrics(
    data: TrialData, measure: Callable[[TrialData], Sequence[Estimate]]
) -> dict[str, Estimate]:
    """What one recording says, by name: as it was archived when the trial ended, or else by now.

    Raises what `measure` raises.
    """
    return {found.name: found for found in data.estimates or measure(data)}


def with_named_tables(data: TestData) -> TestData:
    """The same, with a name in place of each swept value that is a table (`table_names`)."""
    swept = [value for item in data.trials for value in item.trial.point.values()]
    names = table_names(swept)
    if not names:
        return data
    return replace(data, trials=tuple(_Named(item, names) for item in data.trials))


class _Named:
    """A trial whose point has names in place of tables; all else is as it was."""

    def __init__(self, data: TrialData, names: Mapping[str, str]) -> None:
        point = {
            path: names[canonical_json(value)] if isinstance(value, dict) else value
            for path, value in data.trial.point.items()
        }
        self.trial = data.trial.model_copy(update={"point": point})
        self.ending = data.ending
        self.recording = data.recording
        self.channel_names = data.channel_names
        self.estimates = data.estimates


def lost_without(experiment: Experiment, name: str) -> str:
    """What there is none of without a channel that the experiment can use."""
    return experiment.can_use.get(name, "result that needs it")


def bench_of(trial: Trial) -> Bench:
    """The trial's bench as an object."""
    return Bench.model_validate(trial.bench, context={"si": True})


def options_of(experiment: Experiment, tree: Mapping[str, Any]) -> Any:
    """Normalised options as an object of the experiment's own class."""
    return experiment.options.model_validate(tree, context={"si": True})
