"""Trials of experiments that analyze any recorded motion, and trials of a validation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

from campaign.experiments.interface import Experiment, Model, Suits, TestData, TrialData, validated
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Result
from campaign.trial import TrialRequest

AnyOptions = TypeVar("AnyOptions", bound=Options)


def nothing_to_plan(options: Options, bench: Bench) -> Iterable[TrialRequest]:
    """Raise ValueError: such trials are recorded, not planned."""
    raise ValueError(
        "trials of this kind are recorded, so there is nothing to plan: add [[test.recording]] and "
        "run `campaign import`"
    )


def validation_of(data: TestData, suits: Suits) -> Sequence[TrialData]:
    """Trials of the validation that suit; none without one. Raises ValueError if none suits."""
    if not data.validation:
        return ()
    chosen, why = suits(data.validation)
    if why:
        raise ValueError(f"of the validation {why}")
    return chosen


def of_any_motion(
    name: str,
    summary: str,
    options: type[AnyOptions],
    suits: Suits,
    identify: Callable[[TestData, AnyOptions], Result],
) -> Experiment:
    """An experiment that identifies from any motion; its model has its name and options.

    Args:
        identify: result for the options of the model, or else of the recorded test. Raises
            ValueError if there is none; a report then has a note.
    """

    def analyse(data: TestData) -> Result:
        if data.model is not None:
            return identify(data, data.model)
        trials, why = suits(tuple(data.completed()))
        if not trials:
            return Result(notes=(f"{why}.",))
        own = validated(options, trials[0].trial.options)
        try:
            result = identify(replace(data, trials=tuple(trials)), own)
        except ValueError as error:
            return Result(notes=(f"{error}.",))
        warnings = (each.text for each in result.identified.warnings)
        return replace(result, notes=(*warnings, *result.notes))

    return Experiment(
        name,
        summary,
        options,
        nothing_to_plan,
        analyse,
        model=Model(name, summary, options, suits),
    )
