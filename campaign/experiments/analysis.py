"""From the trials of a test to its result: checks, metrics, the experiment's analysis, notes."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from campaign.axis_kind import BOTH_ROTARY, axis_terms, sides_in
from campaign.channels import missing
from campaign.errors import ArchiveError, UsageError
from campaign.estimate import Estimate
from campaign.experiments.interface import ChangedTrial, Experiment, TestData, TrialData
from campaign.experiments.post_processing.axis_units import in_axis_units
from campaign.experiments.post_processing.draws import draws_of, merged
from campaign.experiments.post_processing.key_numbers import key_numbers
from campaign.experiments.post_processing.recording_checks import (
    doubt,
    doubted,
    not_measured,
    notes_on,
)
from campaign.experiments.post_processing.swept_tables import table_names
from campaign.published.draws import SEED
from campaign.reason import Cause
from campaign.result import RecordingDoubt, Result
from campaign.trial import canonical_json

TOO_LONG = Cause(
    "too long",
    "it has {samples:.3g} samples, more than the {most:.0e} that are looked at in one: cut it by "
    "start and stop, or by each",
)


def suitable(experiment: Experiment, trials: Sequence[TrialData]) -> tuple[list[TrialData], str]:
    """Recorded trials that the experiment's model can use; without any, the reason."""
    if experiment.model.suits is not None:
        usable, why = experiment.model.suits(trials)
        return list(usable), why
    needed = experiment.requires.keys()
    own = [t for t in trials if t.trial.kind == experiment.name and needed <= t.channel_names()]
    channels = f" with {' and '.join(needed)}" if needed else ""
    return own, "" if own else f"there is no trial of {experiment.name}{channels}"


def result_of(experiment: Experiment, data: TestData) -> Result:
    """Result of the analysis, with notes on missing trials and channels.

    A test that sweeps the seed of its bench's scatter is analysed draw by draw. Metrics of trials
    of other kinds, which a model may suit, belong to other analyses and are not used.
    """
    with axis_terms(sides_in(data.trials[0].trial.bench) if data.trials else BOTH_ROTARY):
        draws = draws_of(item.trial for item in data.trials) if data.model is None else ()
        result = in_axis_units(_result_of(experiment, data, draws))
        chosen = key_numbers(result.findings, experiment.key_numbers, draws)
        return replace(result, key_numbers=chosen)


def _result_of(experiment: Experiment, data: TestData, draws: Sequence[Any]) -> Result:
    if data.model is not None:
        data = replace(data, trials=tuple(_own(experiment, item) for item in data.trials))
    doubted_of = [(item, _doubt(experiment, item)) for item in data.trials]
    before = tuple(defect for _, defect in doubted_of if defect)
    usable = with_named_tables(
        _without(data, [item for item, defect in doubted_of if defect and defect.fatal])
    )
    result = Result()
    if usable.trials or not data.trials:
        result = _of_draws(experiment, usable, draws) if draws[1:] else analysed(experiment, usable)
    doubts = (*result.doubts, *before)
    notes = (
        *result.notes,
        *_failures(experiment, data),
        *notes_on(doubts, len(data.trials)),
        *_lacking(experiment, data),
    )
    return replace(result, notes=tuple(dict.fromkeys(notes)), doubts=doubts)


def analysed(experiment: Experiment, data: TestData) -> Result:
    """Result of an analysis, with doubts about trials that cannot be measured.

    Raises what the analysis raises, and ValueError if a model has no trial left.
    """
    good, doubts = _measured_trials(experiment, data)
    if doubts and not any(good.completed()):
        if data.model is not None:  # `identify` reports the reason
            raise ValueError(doubts[0].reason.text)
        return Result(doubts=doubts)
    return replace(experiment.analyse(good), doubts=doubts)


def _without(data: TestData, lost: Sequence[TrialData]) -> TestData:
    """Test data without the lost trials, which are then left out."""
    gone = {id(item) for item in lost}
    kept = tuple(item for item in data.trials if id(item) not in gone)
    return replace(data, trials=kept, left_out=(*data.left_out, *(item.trial for item in lost)))


def _measured_trials(
    experiment: Experiment, data: TestData
) -> tuple[TestData, tuple[RecordingDoubt, ...]]:
    """Trials with their metrics, and doubts about trials that cannot be measured.

    A model that selects its trials (`suits`) measures them itself.
    """
    if experiment.measure is None or not _is_own(experiment, data):
        return data, ()
    doubts: list[RecordingDoubt] = []
    lost: list[TrialData] = []
    with_metrics: dict[int, TrialData] = {}
    for item in data.completed():
        if item.estimates:
            continue
        try:
            estimates = tuple(map(in_axis_units, experiment.measure(item)))
            with_metrics[id(item)] = ChangedTrial(item, estimates)
        except (ArchiveError, UsageError):
            raise
        except (Exception, SystemExit) as error:  # noqa: BLE001 - whatever it is, of one trial
            doubts.append(not_measured(item.trial, error))
            lost.append(item)
    good = _without(data, lost)
    trials = tuple(with_metrics.get(id(item), item) for item in good.trials)
    return replace(good, trials=trials), tuple(doubts)


def _is_own(experiment: Experiment, data: TestData) -> bool:
    """Whether the trials are the experiment's own, and not those that suit its model."""
    return data.model is None or experiment.model.suits is None


def _failures(experiment: Experiment, data: TestData) -> Iterator[str]:
    """Sentence on failed trials that the analysis leaves out."""
    failed = sum(item.ending.outcome != "completed" for item in data.trials)
    if failed and _is_own(experiment, data) and not experiment.uses_failed:
        yield (
            f"{failed} of {len(data.trials)} trials did not complete and are not analysed; "
            "the table of failed trials says why."
        )


def _lacking(experiment: Experiment, data: TestData) -> Iterator[str]:
    """Sentences on channels without a recording, with the lost result, and on samples not kept."""
    lacking: dict[str, None] = {}
    for item in data.trials:
        own = data.model is None or item.trial.kind == experiment.name
        if own and item.trial.can_use and item.ending.outcome == "completed":
            lacking |= dict.fromkeys(missing(item.trial.can_use, item.channel_names()))
    for name in lacking:
        yield f"Without {name}: no {lost_without(experiment, name)}."
    if gone := sum(bool(item.not_kept) for item in data.trials):
        yield f"Samples of {gone} of {len(data.trials)} trials were not kept."


def measured(experiment: Experiment, data: TrialData) -> Sequence[Estimate]:
    """Metrics of one recording; empty for an experiment without `measure`.

    Raises ValueError with a message for the user if the recording is defective or has none.
    """
    wrong = _doubt(experiment, data)
    if wrong and wrong.fatal:
        raise ValueError(wrong.reason.text)
    if experiment.measure is None:
        return ()
    with axis_terms(sides_in(data.trial.bench)):
        return tuple(map(in_axis_units, experiment.measure(data)))


def lost_without(experiment: Experiment, name: str) -> str:
    """Result that is missing without a channel that the experiment can use."""
    return experiment.can_use.get(name, "result that needs it")


def _own(experiment: Experiment, data: TrialData) -> TrialData:
    """The trial without the metrics of another experiment."""
    if data.trial.kind == experiment.name or not data.estimates:
        return data
    return ChangedTrial(data, ())


def _doubt(experiment: Experiment, data: TrialData) -> RecordingDoubt | None:
    """Doubt about a recording, or None; the check of its length reads no sample.

    A model that suits trials of other kinds checks them itself.
    """
    if data.trial.kind != experiment.name:
        return None
    most, task = experiment.most_samples, data.trial.task
    if most is not None and task.samples > most:
        return doubted(data.trial, TOO_LONG(samples=task.samples, most=most))
    return doubt(data)


def with_named_tables(data: TestData) -> TestData:
    """Test data with a name in place of each swept value that is a table (`table_names`)."""
    swept = [value for item in data.trials for value in item.trial.point.values()]
    names = table_names(swept)
    if not names:
        return data

    def named(point: Mapping[str, Any]) -> dict[str, Any]:
        return {
            path: names[canonical_json(value)] if isinstance(value, dict) else value
            for path, value in point.items()
        }

    return _with_points(data, ((item, named(item.trial.point)) for item in data.trials))


def _of_draws(experiment: Experiment, data: TestData, draws: Sequence[Any]) -> Result:
    """Merged results of the draws of a random bench, each analysed alone."""
    parts = {}
    for seed in draws:
        points = (
            (item, {path: v for path, v in item.trial.point.items() if path != SEED})
            for item in data.trials
            if item.trial.point.get(SEED) == seed
        )
        lost = tuple(trial for trial in data.left_out if trial.point.get(SEED) == seed)
        part = replace(_with_points(data, points), left_out=lost)
        parts[seed] = _of_draw(experiment, part, seed)
    return merged(parts)


def _of_draw(experiment: Experiment, part: TestData, seed: Any) -> Result:
    """Result of one draw; a failed analysis gives a note."""
    if not part.trials:
        return Result()
    try:
        return analysed(experiment, part)
    except (ArchiveError, UsageError):
        raise
    except Exception as error:  # noqa: BLE001 - a fit may wander with one draw of many
        message = f"{type(error).__name__}: {error}"
        return Result(notes=(f"The draw of seed {seed} could not be analysed: {message}.",))


def _with_points(data: TestData, moved: Iterable[tuple[TrialData, Mapping[str, Any]]]) -> TestData:
    """Test data of these trials, each at its new point of the sweep."""
    trials = tuple(ChangedTrial(item, item.estimates, point=dict(at)) for item, at in moved)
    return replace(data, trials=trials)
