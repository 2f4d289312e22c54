"""Friction models of another kind than the shipped ones go through the same door.

A Maxwell-slip model of ten elements (the sticking part of the generalised Maxwell-slip model:
Al-Bender, Lampaert and Swevers, IEEE Trans. Automatic Control 50 (2005) 1883) has a state whose
size follows from its options. Karnopp's model (J. Dyn. Sys., Meas., Control 107 (1985) 100) has
none, and holds what is applied; or it is declared as a set at rest, and needs no band of rates.
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
from campaign.physics.lanes import Lane
from campaign.physics.rows import OUTPUTS
from campaign.physics.simulate import simulate_together
from campaign.physics.step_function import Motion, single_step
from campaign.signals import Polyline
from campaign.testing import known
from campaign.units import AngularRate, RotationalStiffness, Torque
from tests.physics.benches import Tree, bench, run, task


class MaxwellOptions(FrictionOptions):
    """Parallel springs, each of which slips at a torque of its own."""

    model: Literal["maxwell"]
    """Maxwell slip."""
    elements: int = Field(default=10, ge=1, le=50)
    """How many."""
    slip_torque: Torque = Field(gt=0)
    """Of all elements, when all slip."""
    stiffness: RotationalStiffness = Field(gt=0)
    """Of all elements, while all stick."""


def _maxwell_parameters(options: MaxwellOptions) -> np.ndarray:
    """Equal stiffnesses; the i-th of n slips at a torque in proportion to i."""
    n = options.elements
    torques = options.slip_torque * np.arange(1, n + 1) / (n * (n + 1) / 2)
    return np.concatenate([[n, options.stiffness / n], torques])


def _maxwell_step(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """state: the torque of each element (N m)."""
    before, after = 0.0, 0.0
    for i in range(int(parameters[0])):
        slip = parameters[2 + i]
        before += state[i]
        stuck = state[i] + parameters[1] * motion.rate_mean * motion.step
        state[i] = min(max(stuck, -slip), slip)
        after += state[i]
    return 0.5 * (before + after), after - before


MAXWELL = FrictionModel(
    name="maxwell",
    summary="parallel springs that slip",
    options=MaxwellOptions,
    parameters=_maxwell_parameters,
    state_size=lambda options, step: options.elements,
    step=_maxwell_step,
    viscous=lambda options: 0.0,
    steady_state=lambda options, v: options.slip_torque * np.sign(v),
)


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
MAXWELL_TREE: Tree = {"model": "maxwell", "slip_torque": "30 N m", "stiffness": "20000 N m/rad"}
KARNOPP_TREE: Tree = {
    "model": "karnopp",
    "static_torque": "30 N m",
    "coulomb_torque": "25 N m",
    "band": "1e-4 rad/s",
}


def on(tree: Tree, inertia: float = 35.0) -> Any:
    def edit(whole: Tree) -> None:
        whole["friction"], whole["compensation"] = {"load": tree}, {}
        whole["axis"]["inertia"] = f"{inertia!r} kg m^2"

    return bench(edit)


def moved(way: float, state: np.ndarray, steps: int = 100) -> float:
    """The torque of ten elements after a motion (rad), slow or fast."""
    options = MaxwellOptions.model_validate(MAXWELL_TREE)
    parameters = MAXWELL.parameters(options)
    for _ in range(steps):
        rate = way / steps / 1e-3
        mean, change = single_step(MAXWELL.step, parameters, state, Motion.at(rate, rate, 1e-3))
    return mean + 0.5 * change


def virgin(way: float) -> float:
    """Torque of the first loading: each element k x up to its own slip."""
    return float(sum(min(2000.0 * way, 30.0 * i / 55) for i in range(1, 11)))


@pytest.mark.slow
def test_ten_elements_have_a_memory_of_where_they_turned() -> None:
    """Masing's rule: going back is twice the first loading at half the way, from where it turned;
    and a small loop inside closes."""
    state = np.zeros(10)
    turned = moved(2e-3, state)
    assert turned == pytest.approx(virgin(2e-3), rel=1e-12)
    inner = state.copy()
    for way in (-3e-4, -1.2e-3, -3.6e-3):
        own = state.copy()
        assert moved(way, own) == pytest.approx(turned - 2 * virgin(-way / 2), rel=1e-12)
    moved(-5e-4, inner)
    assert moved(5e-4, inner) == pytest.approx(turned, rel=1e-12)


@pytest.mark.slow
def test_a_bench_with_ten_elements_is_the_same_alone_and_in_company() -> None:
    push = Polyline(times=(0.0, 0.15, 0.3), values=(0.0, 40.0, -40.0))
    turning = task(mode="torque", command=push, duration=0.3)
    with known(MAXWELL):
        lanes = [Lane.of(on(MAXWELL_TREE, 30.0 + n), turning, seed=1) for n in range(5)]
        together = [
            np.hstack(own) for own in zip(*(o for _, o in simulate_together(lanes)), strict=True)
        ]
        for lane, out in zip(lanes, together, strict=True):
            alone = np.hstack([own for _, (own,) in simulate_together([lane])])
            assert out.tobytes() == alone.tobytes()
    friction = together[0][OUTPUTS.index("friction_torque")]
    assert friction.max() > 25.0
    assert friction.min() < -10.0


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

    fields = {name: getattr(MAXWELL, name) for name in MAXWELL.__dataclass_fields__}
    with pytest.raises(TypeError, match=r"'maxwell'.*v0, v1, h.*docs/developers/plug-ins\.md"):
        FrictionModel(**{**fields, "step": former})
    with pytest.raises(TypeError, match=r"'maxwell'.*fixed state size"):
        FrictionModel(**{**fields, "state_size": 10})
    with pytest.raises(TypeError, match=r"'maxwell' must take options and step"):
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
