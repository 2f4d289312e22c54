"""The interface of an experiment: options, trials, measurement, analysis."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, Protocol, TypeVar, cast

from pydantic_core import to_json

from campaign.axis_kind import BOTH_ROTARY, Sides, axis_terms, sides_in
from campaign.channels import missing
from campaign.errors import ArchiveError, UsageError
from campaign.estimate import Estimate
from campaign.experiments.post_processing.axis_units import (
    estimate_in_axis_terms,
    in_axis_units,
)
from campaign.experiments.post_processing.draws import draws_of, merged
from campaign.experiments.post_processing.key_numbers import KeyQuantity, key_numbers
from campaign.experiments.post_processing.key_numbers import key as key
from campaign.experiments.post_processing.recording_checks import (
    doubt,
    doubted,
    not_measured,
    notes_on,
)
from campaign.experiments.post_processing.swept_tables import table_names
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.complete import IncompleteBenchError
from campaign.protocol.schema import ChosenValue as ChosenValue
from campaign.protocol.schema import ExperimentKind, StageKind
from campaign.published.draws import SEED
from campaign.reason import Cause
from campaign.recording import Ending, Recording
from campaign.result import RecordingDoubt, Result
from campaign.trial import Tree, Trial, TrialRequest, canonical_json

NOT_TOLD = Cause("not in the recording", "the recording does not tell it")

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
    """

    name: str
    kind: str
    options: Tree
    trials: tuple[TrialData, ...]
    model: Any = None
    validation: tuple[TrialData, ...] = ()
    say: Callable[[str], None] = no_progress

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
    perturbs_bench: bool = False
    stages: tuple[Stage, ...] = field(default=(), kw_only=True)
    most_samples: int | None = None
    model: Model = NO_MODEL
    key_numbers: tuple[KeyQuantity, ...] = ()


EMPTY = Result()
TOO_LONG = Cause(
    "too long",
    "it has {samples:.3g} samples, more than the {most:.0e} that are looked at in one: cut it by "
    "start and stop, or by each",
)


def suitable(experiment: Experiment, trials: Sequence[TrialData]) -> tuple[list[TrialData], str]:
    """Of recorded trials, those that the experiment's model can use; where none, why."""
    if experiment.model.suits is not None:
        found, why = experiment.model.suits(trials)
        return list(found), why
    needed = experiment.requires.keys()
    own = [t for t in trials if t.trial.kind == experiment.name and needed <= t.channel_names()]
    channels = f" with {' and '.join(needed)}" if needed else ""
    return own, "" if own else f"there is no trial of {experiment.name}{channels}"


def result_of(experiment: Experiment, data: TestData) -> Result:
    """What the analysis finds, with a note on every channel that it had to do without.

    Recordings that cannot hold anything are kept from it, and a note says which and why. Of a test
    that sweeps the seed of its bench's scatter each draw is analysed by itself. Metrics of trials
    of other kinds, which a model may suit, are those of other analyses, and not used.
    """
    with axis_terms(_sides(data)):
        result = in_axis_units(_result_of(experiment, data))
        draws = draws_of(item.trial for item in data.trials) if data.model is None else ()
        chosen = key_numbers(result.findings, experiment.key_numbers, draws)
        return replace(result, key_numbers=chosen)


def _sides(data: TestData) -> Sides:
    """How the bench of a test moves: all of its trials are of one protocol's one bench."""
    return sides_in(data.trials[0].trial.bench) if data.trials else BOTH_ROTARY


def _result_of(experiment: Experiment, data: TestData) -> Result:
    if data.model is not None:
        data = replace(data, trials=tuple(_own(experiment, item) for item in data.trials))
    before = [_doubt(experiment, item) for item in data.trials]
    kept = zip(data.trials, before, strict=True)
    trials = tuple(item for item, wrong in kept if not (wrong and wrong.fatal))
    result = EMPTY
    if trials or not data.trials:
        usable = with_named_tables(replace(data, trials=trials))
        draws = draws_of(item.trial for item in data.trials) if data.model is None else ()
        if len(draws) > 1:
            parts = {seed: _draw(usable, seed) for seed in draws}
            result = merged(
                {seed: _of_draw(experiment, part, seed) for seed, part in parts.items()}
            )
        else:
            result = _analysed(experiment, usable)
    doubts = (*result.doubts, *filter(None, before))
    lacking: dict[str, None] = {}
    for item in data.trials:
        own = data.model is None or item.trial.kind == experiment.name
        if own and item.trial.can_use and item.ending.outcome == "completed":
            lacking |= dict.fromkeys(missing(item.trial.can_use, item.channel_names()))
    without = [f"Without {name}: no {lost_without(experiment, name)}." for name in lacking]
    if gone := sum(bool(item.not_kept) for item in data.trials):
        without.append(f"Samples of {gone} of {len(data.trials)} trials were not kept.")
    notes = (*result.notes, *notes_on(doubts, len(data.trials)), *without)
    return replace(result, notes=notes, doubts=doubts)


def _analysed(experiment: Experiment, data: TestData) -> Result:
    """What an analysis finds; a trial that cannot be measured costs no more than itself."""
    try:
        return experiment.analyse(data)
    except (ArchiveError, UsageError, IncompleteBenchError):
        raise
    except (Exception, SystemExit):  # of the whole test, or of a trial that it has measured
        good, doubts = _measurable(experiment, data)
        # Who asks for parameters is told why there are none; a report has notes on each trial.
        if not doubts or (data.model is not None and not any(good.completed())):
            raise
    result = experiment.analyse(good) if any(good.completed()) else EMPTY
    return replace(result, doubts=doubts)


def _measurable(
    experiment: Experiment, data: TestData
) -> tuple[TestData, tuple[RecordingDoubt, ...]]:
    """The trials that can be measured, each with what that found; and why the others cannot."""
    good: list[TrialData] = []
    doubts: list[RecordingDoubt] = []
    completed = {item.trial.number for item in data.completed()}
    for item in data.trials:
        estimates = item.estimates
        try:
            own = data.model is None or item.trial.kind == experiment.name
            if experiment.measure and own and not estimates and item.trial.number in completed:
                estimates = tuple(experiment.measure(item))
        except ArchiveError:
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever it is, of one trial
            doubts.append(not_measured(item.trial, error))
        else:
            good.append(_Instead(item, item.trial.point, estimates))
    return replace(data, trials=tuple(good)), tuple(doubts)


def metrics(
    data: TrialData, measure: Callable[[TrialData], Sequence[Estimate]]
) -> dict[str, Estimate]:
    """What one recording says, by name: as it was archived when the trial ended, or else by now.

    What was not determined is not archived, and comes back as such. Raises what `measure` raises.
    """
    found = data.estimates or measure(data)
    return Metrics({each.name: estimate_in_axis_terms(each) for each in found})


class Metrics(dict[str, Estimate]):
    """Metrics by name; those that a recording does not tell are not determined."""

    def __missing__(self, name: str) -> Estimate:
        return Estimate.without_interval(name, math.nan, "", NOT_TOLD())


def measured(experiment: Experiment, data: TrialData) -> Sequence[Estimate]:
    """What a recording says by itself, of an experiment that measures.

    Raises ValueError with a message for the user where it says nothing, or cannot.
    """
    wrong = _doubt(experiment, data)
    if wrong and wrong.fatal:
        raise ValueError(wrong.reason.text)
    if experiment.measure is None:
        return ()
    with axis_terms(sides_in(data.trial.bench)):
        return tuple(map(estimate_in_axis_terms, experiment.measure(data)))


def _own(experiment: Experiment, data: TrialData) -> TrialData:
    """The trial without the metrics of another experiment."""
    if data.trial.kind == experiment.name or not data.estimates:
        return data
    return _Instead(data, data.trial.point, ())


def _doubt(experiment: Experiment, data: TrialData) -> RecordingDoubt | None:
    """Why a recording is not analysed; of one that is too long no sample is read to find out.

    A model that suits trials of other kinds looks at them itself.
    """
    if data.trial.kind != experiment.name:
        return None
    most, task = experiment.most_samples, data.trial.task
    samples = task.duration * task.sample_rate
    if most is not None and samples > most:
        return doubted(data.trial, TOO_LONG(samples=samples, most=most))
    return doubt(data)


def with_named_tables(data: TestData) -> TestData:
    """The same, with a name in place of each swept value that is a table (`table_names`)."""
    swept = [value for item in data.trials for value in item.trial.point.values()]
    names = table_names(swept)
    if not names:
        return data

    def named(point: Mapping[str, Any]) -> dict[str, Any]:
        return {
            path: names[canonical_json(value)] if isinstance(value, dict) else value
            for path, value in point.items()
        }

    return replace(
        data, trials=tuple(_Instead(item, named(item.trial.point)) for item in data.trials)
    )


def _of_draw(experiment: Experiment, part: TestData, seed: Any) -> Result:
    """What one draw found; one whose analysis fails costs no more than itself."""
    if not part.trials:
        return EMPTY
    try:
        return _analysed(experiment, part)
    except (ArchiveError, UsageError):
        raise
    except Exception as error:  # noqa: BLE001 - a fit may wander with one draw of many
        told = f"{type(error).__name__}: {error}"
        return Result(notes=(f"The draw of seed {seed} could not be analysed: {told}.",))


def _draw(data: TestData, seed: Any) -> TestData:
    """The trials of one draw of a random bench, as if nothing but that draw had been executed."""
    return replace(
        data,
        trials=tuple(
            _Instead(item, {path: v for path, v in item.trial.point.items() if path != SEED})
            for item in data.trials
            if item.trial.point.get(SEED) == seed
        ),
    )


class _Instead:
    """A trial told to be at another point of the sweep, or measured; all else is as it was."""

    def __init__(
        self,
        data: TrialData,
        point: Mapping[str, Any],
        estimates: Sequence[Estimate] | None = None,
    ) -> None:
        self.trial = data.trial.model_copy(update={"point": dict(point)})
        self.ending = data.ending
        self.recording = data.recording
        self.channel_names = data.channel_names
        self.not_kept = data.not_kept
        self.estimates = data.estimates if estimates is None else estimates


def lost_without(experiment: Experiment, name: str) -> str:
    """What there is none of without a channel that the experiment can use."""
    return experiment.can_use.get(name, "result that needs it")


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
