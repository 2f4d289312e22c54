"""What a section lists as the conditions of its test: what acted, and nothing else."""

from __future__ import annotations

from types import SimpleNamespace

from campaign.experiments import experiments
from campaign.report.content.conditions import conditions_of
from campaign.report.content.written_units import TestUnits
from campaign.result import Result
from campaign.trial import Trial
from tests.experiments.laboratory import trials
from tests.physics.benches import bench


def _asked(trial: Trial, **options: object) -> Trial:
    return trial.model_copy(update={"options": {**trial.options, **options}})


def test_only_options_that_acted_are_conditions() -> None:
    """What one trial of a swept test uses is listed; what none uses is not, nor what is absent."""
    (closed,) = trials("frequency_response", bench(), {"frequencies": ["2 Hz"]})
    opened = _asked(closed.model_copy(update={"number": 2}), loop="open")

    def labels(*asked: Trial) -> set[str]:
        test = SimpleNamespace(
            kind=closed.kind,
            bench=None,
            result=Result(),
            source="",
            failed=(),
            trials=tuple(SimpleNamespace(trial=trial) for trial in asked),
            options=closed.options,
            experiment=experiments()["frequency_response"],
        )
        return {name for name, _ in conditions_of(test, TestUnits(test))}  # type: ignore[arg-type]

    one, both = labels(closed), labels(closed, opened)
    assert {"frequency (swept)", "cycles", "settle time", "loop", "amplitude"} <= one
    assert not {"lowest", "highest", "step", "torque", "max acceleration"} & one
    assert both - one == {"torque"}
    assert "amplitude" not in labels(opened)
    assert "torque" in labels(_asked(closed, options_of_another_version=1))  # nobody can tell
