"""What an identification finds of trials in memory, without an archive."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from campaign.experiments.interface import TestData, TrialData
from campaign.identify import methods
from campaign.options import Options
from campaign.result import Result


def data_of(
    trials: Iterable[object], validation: Iterable[object] = (), model: Options | None = None
) -> TestData:
    """Trials, or what stands in for them."""
    own, unseen = (cast("Any", tuple(each)) for each in (trials, validation))
    return TestData("", "", {}, own, model, unseen)


def asked(
    name: str, trials: Iterable[object], validation: Iterable[object] = (), **options: Any
) -> Result:
    """As `campaign identify --model NAME`; raises ValueError where there is no result."""
    model = methods()[name]
    return model.analyse(data_of(trials, validation, model.options.model_validate(options)))


def suitable(name: str, trials: Iterable[object]) -> tuple[list[TrialData], str]:
    """The trials that a model can use; where none, why."""
    found, why = methods()[name].suits(cast("Any", tuple(trials)))
    return list(found), why
