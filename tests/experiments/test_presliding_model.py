"""`campaign identify` on small motions: which trials, which numbers, which keys of the bench."""

from __future__ import annotations

import math
from functools import cache
from typing import Any, cast

import pytest

from campaign.physics.bench import Bench
from campaign.result import Result
from tests.experiments.asked import asked, suitable
from tests.experiments.laboratory import Done, execute, trials
from tests.physics.benches import bench

SMALL = {"lowest": "0.5 Hz", "highest": "20 Hz", "periods": 4, "sample_rate": "500 Hz"}


def alone() -> Bench:
    """The load's interface only: 18 000 N m/rad, 800 + 4 N m s/rad, 35 kg m^2."""

    def without_motor(tree: dict[str, Any]) -> None:
        del tree["friction"]["motor"]

    return bench(without_motor)


@cache
def shaken(both: bool, seed: int = 1) -> tuple[Done, ...]:
    on = bench() if both else alone()
    sizes = ["0.3 N m", "0.6 N m"] if both else ["1 N m", "2 N m"]
    highest = {"highest": "50 Hz"} if both else {}
    return execute(
        trials("presliding_multisine", on, {**SMALL, **highest, "amplitudes": sizes, "seed": seed})
    )


def identified(both: bool, validation: tuple[Done, ...] = (), **options: Any) -> Result:
    return asked("presliding", shaken(both), validation, **options)


def test_only_small_motions_are_taken() -> None:
    ramps = execute(
        trials("breakaway", alone(), {"positions": ["0 deg"], "torque_rate": "9 N m/s"})
    )
    chosen, why = suitable("presliding", (*ramps, *shaken(False)))
    assert [each.trial.kind for each in chosen] == ["presliding_multisine"] * 2
    assert why == ""
    none, why = suitable("presliding", ramps)
    assert not none
    assert "no trial is a small motion below breakaway" in why
    assert "reversal" in why or "come back" in why or "slides" in why


@pytest.mark.slow
def test_of_one_interface_stiffness_and_damping_go_to_the_bench() -> None:
    found = {each.estimate.name: each for each in identified(both=False).identified.parameters}
    for name, key, value in (
        ("stiffness_at_rest", "friction.load.bristle_stiffness", 18_000.0),
        ("bristle_damping", "friction.load.bristle_damping", 800.0),
        ("inertia", "axis.inertia", 35.0),
        ("damping_at_rest", "", 804.0),
    ):
        assert found[name].bench == key
        assert found[name].estimate.value == pytest.approx(value, rel=2e-3)
        assert found[name].advice
    ratio = 804.0 / (2.0 * math.sqrt(18_000.0 * 35.0))
    assert found["damping_ratio"].estimate.value == pytest.approx(ratio, rel=2e-3)


@pytest.mark.slow
def test_viscous_friction_is_taken_off_as_it_is_told() -> None:
    found = {
        e.estimate.name: e.estimate
        for e in identified(False, viscous_friction="54 N m s/rad").identified.parameters
    }
    assert found["bristle_damping"].value == pytest.approx(found["damping_at_rest"].value - 54.0)


@pytest.mark.slow
def test_of_several_interfaces_only_their_sum_is_known_and_goes_nowhere() -> None:
    found = identified(both=True)
    told = {each.estimate.name: each for each in found.identified.parameters}
    assert told["stiffness_at_rest"].estimate.value == pytest.approx(18_000.0 + 141_176.0, rel=2e-3)
    assert told["stiffness_at_rest"].bench == told["bristle_damping"].bench == ""
    assert told["inertia"].bench == "axis.inertia"
    assert any("2 interfaces" in note for note in found.notes)


@pytest.mark.slow
def test_unseen_trials_are_predicted_and_not_fitted() -> None:
    found = identified(False, validation=shaken(False, 7))
    assert found.identified.parameters == identified(False).identified.parameters
    (table,) = (each for each in found.tables if each.key == "presliding-missed")
    assert [row["use"] for row in table.rows] == ["fitted", "fitted", "unseen", "unseen"]
    assert all(cast("float", row["missed"]) < 5e-3 for row in table.rows)
    other = identified(False, validation=shaken(True))
    (table,) = (each for each in other.tables if each.key == "presliding-missed")
    assert min(cast("float", row["missed"]) for row in table.rows[2:]) > 0.5
