"""What an identification finds of trials in memory, without an archive."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

from campaign.experiments.analysis import result_of
from campaign.experiments.analysis import suitable as _suitable
from campaign.experiments.interface import TestData, TrialData
from campaign.identify import experiments_by_model
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
    own = experiments_by_model()[name]
    data = data_of(trials, validation, own.model.options.model_validate(options))
    return result_of(own, data)


def suitable(name: str, trials: Iterable[object]) -> tuple[list[TrialData], str]:
    """The trials that a model can use; where none, why."""
    return _suitable(experiments_by_model()[name], cast("Any", tuple(trials)))
