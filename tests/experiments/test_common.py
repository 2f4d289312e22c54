"""A bench with other values, for experiments that vary the bench itself."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from campaign.estimate import Estimate
from campaign.experiments.shared.common import numbered, with_changes
from campaign.experiments.shared.friction_models import resolved
from campaign.physics.bench import Bench
from campaign.result import Figure, Result, Table

BENCHES = Path(__file__).parents[2] / "protocols" / "benches"


@pytest.fixture
def bench() -> Bench:
    return Bench.model_validate(tomllib.loads((BENCHES / "simulink.toml").read_text()))


def test_only_the_named_values_change(bench: Bench) -> None:
    before = bench.model_dump(mode="json")
    changed = with_changes(
        bench, {"friction.load.coulomb_torque": 30.0, "controller.sample_rate": 1000.0}
    )
    assert changed["friction"]["load"].pop("coulomb_torque") == 30.0
    assert changed["controller"].pop("sample_rate") == 1000.0
    del before["friction"]["load"]["coulomb_torque"], before["controller"]["sample_rate"]
    assert changed == before
    assert bench.friction["load"].coulomb_torque == 26.0


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("friction.load.coulomb_torqe", "the nearest is 'friction.load.coulomb_torque'"),
        ("friction.laod.coulomb_torque", "the nearest is 'friction.load.coulomb_torque'"),
        ("axis.inertia.more", "the nearest is 'axis.inertia'"),
        ("zzzzzz", "has no 'zzzzzz'"),
    ],
)
def test_an_unknown_path_names_the_nearest(bench: Bench, path: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        with_changes(bench, {path: 1.0})


def test_a_value_the_bench_refuses_says_where(bench: Bench) -> None:
    with pytest.raises(ValueError, match=r"load.*coulomb_torque: Input should be greater than 0"):
        with_changes(bench, {"friction.load.coulomb_torque": -1.0})


def test_a_difference_no_larger_than_the_engine_s_error_is_0_and_says_so() -> None:
    width = Estimate("friction_lag_width", -1e-3, "N m", -1.1e-3, -0.9e-3, 0.95, "m")
    assert resolved(width, 1.0) is width  # the engine's error is 2e-4 of the friction
    found = resolved(width, 10.0)
    assert (found.value, found.low, found.high) == (0.0, None, None)
    assert found.reason.code == "not resolved by the simulation"
    assert "0.002" in found.reason.text


@pytest.mark.parametrize(("places", "keys"), [(0, []), (1, ["map"]), (2, ["map-1", "map-2"])])
def test_keys_of_several_places_get_the_number_of_the_place(places: int, keys: list[str]) -> None:
    one = Result(
        tables=(Table("map", "Friction", (), ()),),
        figures=(Figure("map", "Friction", "", "", ()),),
    )
    result = numbered([one] * places)
    assert [each.key for each in result.tables] == keys
    assert [each.key for each in result.figures] == keys
