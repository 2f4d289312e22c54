"""A data sheet's facts: no gear, lines of an encoder, no end of travel, Coulomb friction."""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from campaign.physics.bench import Bench
from campaign.physics.complete import complete, lacking
from campaign.physics.limit_watch import LimitWatch, judged_samples
from campaign.physics.limits import margins
from campaign.physics.true_values import true_value
from campaign.signals import Polyline
from tests.physics.benches import Tree, bench, run, stribeck, task

TORQUE, INERTIA, KT, COULOMB, VISCOUS = 0.02, 1.4e-4, 0.05, 0.008, 2e-5
LIMITS = {
    "angle": "unlimited",
    "rate": "600 rad/s",
    "acceleration": "5000 rad/s^2",
    "torque": "0.5 N m",
    "current": "10 A",
    "duration": "120 s",
}


def motor(**changed: Any) -> Tree:
    return {
        "name": "motor",
        "axis": {"name": "shaft", "inertia": f"{INERTIA} kg m^2"},
        "motor": {
            "torque_constant": f"{KT} N m/A",
            "back_emf_constant": f"{KT} V s/rad",
            "resistance": "0.9 ohm",
            "inductance": "0.6 mH",
        },
        "friction": {
            "load": {
                "model": "coulomb",
                "coulomb_torque": f"{COULOMB} N m",
                "viscous_friction": f"{VISCOUS} N m s/rad",
                "negative": {"coulomb_torque": "9 mN m"},
            }
        },
        "controller": {
            "rate": {"form": "parallel", "proportional": "0.15 A s/rad", "integral": "1.5 A/rad"},
            "current": {"form": "parallel", "proportional": "19 V/A", "integral": "28000 V/(A s)"},
        },
        "limits": LIMITS,
        **changed,
    }


def test_a_motor_without_a_gear_drives_its_load_directly() -> None:
    on = Bench.model_validate(motor())
    assert not lacking(on)
    assert (on.ratio, on.torque_per_current) == (1.0, KT)
    assert complete(on).gear.ratio == 1.0
    without = Bench.model_validate({"name": "r", "axis": {"name": "a"}})
    assert (without.ratio, without.torque_per_current) == (None, None)


def test_coulomb_friction_slows_as_its_closed_form_says() -> None:
    """From rest under a constant torque: w = (T - Tc) / sigma2 (1 - exp(-sigma2 t / J))."""
    commanded = Polyline(times=(0.0, 0.0, 0.2), values=(0.0, TORQUE, TORQUE))
    time, out = run(
        complete(Bench.model_validate(motor())),
        task(mode="torque", command=commanded, duration=0.2),
        1e-5,
    )
    expected = (TORQUE - COULOMB) / VISCOUS * -np.expm1(-VISCOUS / INERTIA * time)
    # The current loop is not infinitely fast: 1/15 ms, which 0.2 s forget.
    assert out["load_rate"][-1] == pytest.approx(expected[-1], rel=2e-3)


@pytest.mark.parametrize(("torque", "moves"), [(0.0079, False), (-0.0089, False), (-0.0095, True)])
def test_coulomb_friction_holds_up_to_its_torque_in_each_direction(
    torque: float, moves: bool
) -> None:
    commanded = Polyline(times=(0.0, 0.1, 0.3), values=(0.0, torque, torque))
    _, out = run(
        complete(Bench.model_validate(motor())),
        task(mode="torque", command=commanded, duration=0.3),
        1e-4,
    )
    assert bool(abs(out["load_rate"][-1]) > 1e-6) == moves


def test_coulomb_friction_moves_as_stribeck_friction_without_a_drop() -> None:
    """Another model's code, with Ts = Tc: the same motion, through two reversals."""
    swing = Polyline(times=(0.0, 0.1, 0.3, 0.4), values=(0.0, 0.05, -0.05, 0.0))
    curve = stribeck(5.0, 5.0, 2.0)
    flat = {name: value for name, value in curve.items() if name.split("_")[0] != "stribeck"}
    del flat["static_torque"]
    flat["model"] = "coulomb"
    rates = []
    for friction in (curve, flat):
        on = bench(lambda tree, own=friction: tree.update(friction={"load": own}))
        rates.append(run(on, task(command=swing, duration=0.4))[1]["load_rate"])
    np.testing.assert_allclose(*rates, rtol=1e-12, atol=1e-15)


def test_truth_of_coulomb_friction() -> None:
    on = Bench.model_validate(motor())
    assert true_value(on, "coulomb_torque", {"direction": "positive"}) == COULOMB
    assert true_value(on, "static_torque", {"direction": "negative"}) == pytest.approx(0.009)
    assert true_value(on, "stribeck_velocity", {"direction": "positive"}) is None


@pytest.mark.parametrize(
    ("told", "count"), [({"lines": 2000}, 2 * math.pi / 8000), ({"counts": 4096}, math.pi / 2048)]
)
def test_an_encoder_is_told_by_its_lines_or_counts(told: Tree, count: float) -> None:
    controller = {**motor()["controller"], "sample_rate": "1 kHz"}
    sensors = {"encoder": told, "resolver": told}
    on = Bench.model_validate(motor(sensors=sensors, controller=controller))
    assert on.sensors.encoder.resolution == pytest.approx(count, rel=1e-12)
    assert on.sensors.resolver.resolution == pytest.approx(count, rel=1e-12)
    assert Bench.model_validate(on.model_dump(mode="json"), context={"si": True}) == on


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"lines": 2000, "counts": 8000}, "say the same"),
        ({"lines": 2000, "resolution": "1 deg"}, "say the same"),
        ({"lines": "2000"}, "a number of 1 or more"),
        ({"counts": 0}, "a number of 1 or more"),
    ],
)
def test_an_encoder_that_is_told_twice_or_not_at_all(told: Tree, message: str) -> None:
    controller = {**motor()["controller"], "sample_rate": "1 kHz"}
    with pytest.raises(ValidationError, match=message):
        Bench.model_validate(motor(sensors={"encoder": told}, controller=controller))


def test_an_axis_that_turns_for_ever_has_no_limit_of_angle() -> None:
    on = Bench.model_validate(motor())
    tree = on.model_dump(mode="json")
    assert tree["limits"]["angle"] == "unlimited"
    json.dumps(tree, allow_nan=False)
    assert Bench.model_validate(tree, context={"si": True}) == on
    turning = Polyline(times=(0.0, 1.0, 90.0), values=(0.0, 500.0, 500.0))
    found = {each.limit: each for each in margins(on, task(command=turning, duration=90.0))}
    assert "angle" not in found
    assert found["rate"].value == 500.0
    watch = LimitWatch(on.limits, 1000.0, ["relative_angle", "relative_rate"])
    time = np.arange(100) / 1000.0
    assert watch.look(time, np.stack([np.full(100, 1e9), np.full(100, 500.0)])) is None
    assert judged_samples(on.limits, 1000.0) == 10


def test_a_linear_axis_has_ends() -> None:
    limits = {**LIMITS, "rate": "1 m/s", "acceleration": "9 m/s^2", "torque": "5 N"}
    axis = {"name": "axis", "kind": "linear"}
    with pytest.raises(ValidationError, match="a linear axis has ends"):
        Bench.model_validate({"name": "slide", "axis": axis, "limits": limits})


def test_a_loop_that_the_encoder_feeds_is_sampled() -> None:
    controller = {**motor()["controller"], "rate_feedback": "encoder"}
    with pytest.raises(ValidationError, match=r"needs controller\.sample_rate"):
        Bench.model_validate(motor(controller=controller))
