"""What a controller is set to for a trial, by name."""

from __future__ import annotations

import pytest

from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial
from campaign.wire.configuration import configuration_of, flatten, nest

BENCH = {
    "name": "bench",
    "friction": {"load": {"model": "lugre"}},
    "gear": {"ratio": 100.0, "preload": {"torque": 42.0, "nominal": 40.0}},
    "controller": {"rate": {"form": "ideal", "proportional": 3.0}, "sample_rate": None},
    "limits": {"angle": 1.0},
    "compensation": {
        "static": {"method": "friction-model", "gain": 0.5},
        "observer": {"method": "observer", "gain": 1.5},
    },
}


def trial(**changes: object) -> Trial:
    task = Task(
        mode="rate",
        command=Polyline(times=(0.0, 0.1), values=(0.0, 1e-17)),
        base_acceleration=Sine(amplitude=0.1, frequency=2.0),
        compensation="observer",
        duration=2.0,
        window=(1.0, 2.0),
        sample_rate=1000.0,
        start_angle=0.25,
    )
    given = {"number": 1, "test": "t", "kind": "k", "seed": 2**62 + 1, "bench": BENCH, "task": task}
    return Trial.model_validate({**given, **changes})


def test_only_what_is_the_controllers_business_is_sent() -> None:
    settings = configuration_of(trial())
    assert {name.split(".")[0] for name in settings} == {
        "task", "controller", "limits", "compensation", "rehearsal",
    }  # fmt: skip
    assert not [name for name in settings if "friction" in name and "compensation" not in name]
    assert not [name for name in settings if name.startswith("compensation.static")]
    assert settings["compensation.observer.gain"] == 1.5


def test_what_only_a_simulation_can_be_told_has_names_of_its_own() -> None:
    settings = configuration_of(trial(set_by_operator=("bench.gear.preload.torque",)))
    rehearsal = {name for name in settings if name.startswith("rehearsal.")}
    assert rehearsal == {
        "rehearsal.seed",
        "rehearsal.start_angle",
        "rehearsal.base_acceleration.shape",
        "rehearsal.base_acceleration.amplitude",
        "rehearsal.base_acceleration.frequency",
        "rehearsal.base_acceleration.phase",
        "rehearsal.disturbance.shape",
        "rehearsal.bench.gear.preload.torque",
    }
    assert settings["rehearsal.seed"] == 2**62 + 1
    assert settings["rehearsal.bench.gear.preload.torque"] == 42.0


def test_a_tree_survives_its_names_but_for_what_is_none() -> None:
    tree = {"a": {"b": 1, "c": None, "d": (1.0, 2.0)}, "e": "text", "f": False}
    assert dict(flatten(tree)) == {"a.b": 1, "a.d": (1.0, 2.0), "e": "text", "f": False}
    assert nest(dict(flatten(tree))) == {"a": {"b": 1, "d": (1.0, 2.0)}, "e": "text", "f": False}


@pytest.mark.parametrize("names", [("a", "a.b"), ("a.b", "a")])
def test_a_name_is_a_value_or_a_table(names: tuple[str, str]) -> None:
    with pytest.raises(ValueError, match="'a"):
        nest({names[0]: 1.0, names[1]: 2.0})


def test_a_limit_without_end_is_sent_as_a_finite_number() -> None:
    limits = {"angle": "unlimited", "rate": 60.0}
    settings = configuration_of(trial(bench={**BENCH, "limits": limits}))
    assert settings["limits.angle"] == 1e300
    assert settings["limits.rate"] == 60.0
