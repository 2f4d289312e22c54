"""From a stage's requests to checked trials."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice

from campaign.physics.bench import Bench
from campaign.physics.limits import margins
from campaign.physics.plan_loops import loops_used
from campaign.physics.resolution import resolution_margins
from campaign.protocol.expand import check_recording, fields_of, place_hash
from campaign.protocol.limit_check import in_display_units, in_words, one_count
from campaign.protocol.points import first_line
from campaign.protocol.schema import ExperimentKind
from campaign.protocol.stages import PlannedStage
from campaign.trial import Most, Trial, TrialRequest, canonical_json

ROUNDING = 1e-9
"""Relative tolerance of a stage's duration above its bound."""

Refusal = Callable[[Trial], str]
"""Returns the reason why a trial cannot be executed; "" if it can."""


class TooMuchError(Exception):
    """The requests of a stage exceed its bounds."""


@dataclass(frozen=True)
class StageTrials:
    """The trials of a stage.

    Attributes:
        trials: in the order of execution, numbered.
        refused: label and reason of each trial that must not be executed.
    """

    trials: tuple[Trial, ...]
    refused: tuple[tuple[str, str], ...] = ()


def follow(
    stage: PlannedStage,
    experiment: ExperimentKind,
    requests: Iterable[TrialRequest],
    planned: Trial,
    first: int,
    refusal: Refusal,
) -> StageTrials:
    """The trials that a stage requests; each trial that must not be executed is refused alone.

    Args:
        requests: as the experiment yields them; at most one more than permitted is read.
        planned: a planned trial of the same point, with the common bench, options and setup.
        first: number of the first trial.
        refusal: the backend's reason to refuse a trial.

    Raises TooMuchError if the requests exceed the stage's bounds, and the errors of `requests`.
    """
    listed = list(islice(requests, stage.most.trials + 1))
    _check_size(stage.most, listed)
    bench = Bench.model_validate(planned.bench, context={"si": True})
    trials: list[Trial] = []
    refused: list[tuple[str, str]] = []
    for index, request in enumerate(listed):
        trial = _trial(stage, experiment, request, planned, first + len(trials), index)
        try:
            own = bench
            if request.bench is not None:
                own = Bench.model_validate(request.bench, context={"si": True})
                if planned.truth:
                    raise ValueError("it wants a bench of its own, and the truth is another's")
                trial = trial.model_copy(update={"bench": own.model_dump(mode="json")})
            if swept := request.point.keys() & stage.point.keys():
                raise ValueError(f"it chooses {', '.join(sorted(swept))}, which is swept")
            _check(trial, own, experiment)
            why = refusal(trial)
        except (ValueError, ArithmeticError) as error:
            why = first_line(error)
        if why:
            refused.append((trial.label, why))
        else:
            trials.append(trial)
    return StageTrials(tuple(trials), tuple(refused))


def _check_size(most: Most, asked: Sequence[TrialRequest]) -> None:
    if len(asked) > most.trials:
        raise TooMuchError(f"it asks for more than the {most.trials} trials it said at most")
    duration = sum(request.task.duration for request in asked)
    if duration > most.duration * (1.0 + ROUNDING):
        raise TooMuchError(
            f"its trials take {duration:.4g} s, and it said {most.duration:.4g} s at most"
        )
    samples = sum(request.task.samples for request in asked)
    if samples > most.samples:
        raise TooMuchError(
            f"its trials record {samples} samples, and it said {most.samples} at most"
        )


def _trial(
    stage: PlannedStage,
    experiment: ExperimentKind,
    request: TrialRequest,
    planned: Trial,
    number: int,
    index: int,
) -> Trial:
    """A trial of a stage. Its seed depends on the test's seed, the point, the stage, and its index
    among the requests, not on other refused or executed trials.
    """
    fields = fields_of(experiment, request, planned.bench, {})
    return Trial.model_construct(  # as in a plan: `_check` makes the necessary checks
        number=number,
        test=planned.test,
        kind=planned.kind,
        point={**stage.point, **request.point},
        options=planned.options,
        seed=place_hash("stage", stage.seed, stage.point, stage.number, index),
        bench=planned.bench,
        truth=planned.truth,
        setup=planned.setup,
        set_by_operator=planned.set_by_operator,
        **{**fields, "told": {**planned.told, **fields["told"]}},
    )


def _check(trial: Trial, bench: Bench, experiment: ExperimentKind) -> None:
    """Raise ValueError with all reasons for which a plan with this trial would be refused."""
    name, names = trial.task.compensation, ["none", *bench.compensation]
    if name not in names:
        raise ValueError(f"the bench has no compensation {name!r}; it has {', '.join(names)}")
    check_recording(trial.task)
    canonical_json(trial.model_dump(mode="json"))  # the journal permits finite numbers only
    if reasons := [*_broken(trial, bench), *_unstable(trial, bench, experiment)]:
        raise ValueError("; ".join(reasons))


def _broken(trial: Trial, bench: Bench) -> Iterator[str]:
    for margin in (*margins(bench, trial.task), *resolution_margins(bench, trial.task)):
        if margin.broken:
            value, bound = in_display_units(margin)
            what = one_count(margin) if margin.sensor else f"{margin.called} up to {value}"
            yield f"{what}, limit {bound}"


def _unstable(trial: Trial, bench: Bench, experiment: ExperimentKind) -> Iterator[str]:
    if not experiment.seeks_instability:
        for use in loops_used([(trial.number, trial.task, bench)]):
            if not use.margins.stable:
                yield f"its loop is unstable: {in_words(use)}"
                return
