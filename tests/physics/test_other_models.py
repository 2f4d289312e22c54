"""Friction models of another kind than the shipped ones go through the same door.

Karnopp's model (J. Dyn. Sys., Meas., Control 107 (1985) 100) has no state, and holds what is
applied; or it is declared as a set at rest, and needs no band of rates. Models whose state follows
from their options are in `tests/physics/friction`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from pydantic import Field

from campaign.physics.elementary import where
from campaign.physics.friction.interface import DryFriction, FrictionModel, FrictionOptions
from campaign.physics.step_function import Motion, single_step
from campaign.signals import Polyline
from campaign.testing import known
from campaign.units import AngularRate, Torque
from tests.physics.benches import Tree, bench, run, task


class KarnoppOptions(FrictionOptions):
    """Coulomb friction that holds within a band of rates."""

    model: Literal["karnopp"]
    """Karnopp."""
    static_torque: Torque = Field(gt=0)
    """Most that it holds."""
    coulomb_torque: Torque = Field(gt=0)
    """Of sliding."""
    band: AngularRate = Field(gt=0)
    """Rate below which it holds."""


def _karnopp_step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    static, coulomb, band = parameters[0], parameters[1], parameters[2]
    # What brings the rate to zero by the end of the step.
    holding = motion.applied + motion.rate_start / motion.compliance
    sliding = where(motion.rate_start >= 0.0, coulomb, -coulomb)
    breaking = where(holding >= 0.0, coulomb, -coulomb)
    held = where(abs(holding) <= static, holding, breaking)
    return where(abs(motion.rate_start) < band, held, sliding), 0.0


KARNOPP = FrictionModel(
    name="karnopp",
    summary="Coulomb friction with a band in which it holds",
    options=KarnoppOptions,
    parameters=lambda options: np.array(
        [options.static_torque, options.coulomb_torque, options.band]
    ),
    state_size=lambda options, step: 0,
    step=_karnopp_step,
    viscous=lambda options: 0.0,
    steady_state=lambda options, v: options.coulomb_torque * np.sign(v),
)
KARNOPP_TREE: Tree = {
    "model": "karnopp",
    "static_torque": "30 N m",
    "coulomb_torque": "25 N m",
    "band": "1e-4 rad/s",
}


def on(tree: Tree) -> Any:
    def edit(whole: Tree) -> None:
        whole["friction"], whole["compensation"] = {"load": tree}, {}

    return bench(edit)


@pytest.mark.slow
def test_karnopp_holds_up_to_its_static_torque_and_slides_then() -> None:
    rate = 60.0
    ramp = Polyline(times=(0.0, 1.0), values=(0.0, rate))
    with known(KARNOPP):
        time, found = run(on(KARNOPP_TREE), task(mode="torque", command=ramp), 0.25e-3)
    angle, torque = found["relative_angle"], found["friction_torque"]
    drive = found["motor_current"] * 141.176 * 0.086
    stuck = drive < 30.0 - 0.1
    assert np.max(np.abs(angle[stuck])) < 1e-6
    # Half a step late, as a line without a change is.
    assert torque[stuck] == pytest.approx(drive[stuck], abs=rate * 0.25e-3)
    sliding = time > time[stuck][-1] + 0.02
    assert torque[sliding] == pytest.approx(25.0, rel=1e-12)
    assert angle[-1] > 0.01


def _karnopp_sliding(parameters: Any, direction: float, speed: float) -> float:
    return parameters[1]


KARNOPP_SET = replace(
    KARNOPP,
    dry=DryFriction(
        sliding=_karnopp_sliding, static_torque=lambda options, direction: options.static_torque
    ),
)


@pytest.mark.slow
def test_a_set_at_rest_breaks_away_inside_a_step_and_falls_to_its_sliding_torque() -> None:
    """Pulled at V through a spring: it holds until k V t = Ts, and then, with tau from there on,

    q = V tau + (Ts - Tc) / k (1 - cos(omega tau)) - V / omega sin(omega tau).
    """
    stiffness, speed, inertia = 4000.0, 0.0203, 35.0
    pull = Polyline(times=(0.0, 1.0), values=(0.0, speed))
    fields = {"mode": "spring", "command": pull, "spring_stiffness": stiffness}
    omega, away = math.sqrt(stiffness / inertia), 30.0 / (stiffness * speed)
    off = []
    with known(KARNOPP_SET):
        for step in (1e-3, 0.5e-3, 0.25e-3):
            time, found = run(on(KARNOPP_TREE), task(duration=0.6, **fields), step)
            tau = np.maximum(time - away, 0.0)
            angle = speed * tau - speed / omega * np.sin(omega * tau)
            angle += 5.0 / stiffness * (1.0 - np.cos(omega * tau))
            assert np.max(np.abs(found["relative_angle"][time < away])) < 1e-18
            held = time < away - 1e-3
            pulled = stiffness * speed * time[held]
            np.testing.assert_allclose(found["friction_torque"][held], pulled, atol=1e-9)
            assert found["friction_torque"][-1] == pytest.approx(25.0, rel=1e-12)
            off.append(np.max(np.abs(found["relative_angle"] - angle)) / angle[-1])
    assert off[0] < 1e-5
    assert off[0] > 8 * off[2]


def test_a_model_of_the_former_kind_is_refused_by_name() -> None:
    def former(parameters, state, v0, v1, h, compliance, line):  # type: ignore[no-untyped-def]
        line[0] = 0.0

    fields = {name: getattr(KARNOPP, name) for name in KARNOPP.__dataclass_fields__}
    with pytest.raises(TypeError, match=r"'karnopp'.*v0, v1, h.*docs/developers/plug-ins\.md"):
        FrictionModel(**{**fields, "step": former})
    with pytest.raises(TypeError, match=r"'karnopp'.*fixed state size"):
        FrictionModel(**{**fields, "state_size": 10})
    with pytest.raises(TypeError, match=r"'karnopp' must take options and step"):
        FrictionModel(**{**fields, "state_size": lambda options: 10})


def _sizes(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    return float(len(parameters)), float(len(state))


@pytest.mark.slow
@pytest.mark.parametrize(("parameters", "states"), [(1, 0), (12, 10)])
def test_a_step_function_sees_its_own_numbers_and_no_others(parameters: int, states: int) -> None:
    line = single_step(_sizes, np.zeros(parameters), np.zeros(states), Motion.at(0.1, 0.1, 1e-3))
    assert line == (parameters, states)


@pytest.mark.slow
def test_nothing_is_applied_where_there_is_no_compliance() -> None:
    def applied(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
        return motion.applied, 0.0

    free = Motion.at(0.1, 0.1, 1e-3, applied=7.0)
    assert single_step(applied, np.zeros(1), np.zeros(0), free)[0] == 0.0
    bound = Motion.at(0.1, 0.1, 1e-3, applied=7.0, compliance=1e-4)
    assert single_step(applied, np.zeros(1), np.zeros(0), bound)[0] == 7.0
