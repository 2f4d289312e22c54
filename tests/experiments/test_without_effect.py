"""Options that a test does not use: whatever they are, its trials are the same."""

from __future__ import annotations

from typing import Any

import pytest

from campaign.experiments import experiments
from campaign.experiments.sensitivity.experiment import SensitivityOptions
from campaign.experiments.stabilization.experiment import OF_A_SINE
from campaign.protocol.bench_file import load_bench

CASES: list[tuple[str, dict[str, Any], dict[str, Any]]] = [
    (
        "velocity_map",
        {"speeds": ["1 deg/s"]},
        {"slowest": "2 deg/s", "fastest": "3 deg/s", "points": 2},
    ),
    ("velocity_map", {"speeds": ["1 deg/s"], "warm_up_cycles": 0}, {"warm_up_speed": "9 deg/s"}),
    (
        "frequency_response",
        {"frequencies": ["2 Hz"]},
        {"lowest": "1 Hz", "highest": "3 Hz", "step": "1 Hz"},
    ),
    ("frequency_response", {"frequencies": ["2 Hz"], "loop": "closed"}, {"torque": "99 N m"}),
    (
        "frequency_response",
        {"frequencies": ["2 Hz"], "loop": "open"},
        {"amplitude": "1 deg/s", "max_acceleration": "1 deg/s^2", "refine": True},
    ),
    (
        "observer_gain",
        {"disturbance_frequencies": []},
        {"disturbance": "9 N m", "disturbance_cycles": 2},
    ),
    ("model_output", {"vary": []}, {"factors": [3.0]}),
    ("sensitivity", {"model_output": False, "repeats": 1}, {"model_change": 0.2}),
]


@pytest.mark.parametrize(("kind", "written", "idle"), CASES)
def test_what_has_no_effect_changes_no_trial(
    kind: str, written: dict[str, Any], idle: dict[str, Any]
) -> None:
    experiment, bench = experiments()[kind], load_bench("platform")

    def planned(**more: Any) -> list[object]:
        options = experiment.options.model_validate({**written, **more})
        assert idle.keys() <= options.without_effect()
        return list(experiment.trials(options, bench))

    assert planned() == planned(**idle)


def test_a_motion_that_is_no_sine_has_no_use_for_those_of_a_sine() -> None:
    options = experiments()["stabilization"].options
    assert options.model_validate({"motion": {"kind": "ship"}}).without_effect() == set(OF_A_SINE)
    assert options().without_effect() == frozenset()


def test_a_threshold_that_follows_from_a_ratio() -> None:
    assert SensitivityOptions(threshold_ratio=1.5).without_effect() == {"threshold"}
    assert SensitivityOptions().without_effect() == frozenset()
