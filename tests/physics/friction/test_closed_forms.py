"""Friction models against closed forms, limits and energy."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.physics.friction.cases import MODELS, Driven

FLAT = {"static_torque": 26.0}
"""Ts = Tc."""


@pytest.mark.parametrize("way", [1e-4, 1e-3, 6e-3])
def test_dahl_is_its_closed_form(way: float) -> None:
    """i = 1: T = Tc (1 - exp(-sigma0 q / Tc)), and back from there; i = 2 and 1/2 likewise."""
    a = 18000.0 * way / 26.0
    there = 26.0 * (1.0 - math.exp(-a))
    driven = Driven("dahl")
    assert driven.move(way) == pytest.approx(there, rel=1e-12)
    back = -26.0 + (there + 26.0) * math.exp(-a)
    assert driven.move(-way) == pytest.approx(back, rel=1e-11)
    assert Driven("dahl", exponent=2.0).move(way) == pytest.approx(26.0 * a / (1 + a), rel=1e-11)
    left = max(1.0 - 0.5 * a, 0.0) ** 2
    assert Driven("dahl", exponent=0.5).move(way) == pytest.approx(26.0 * (1 - left), rel=1e-11)


@pytest.mark.parametrize("exponent", [0.3, 1.0, 1.7, 4.0])
def test_dahl_turns_as_its_equation_does(exponent: float) -> None:
    """Loops with another Tc in each direction, against scipy over the path."""
    driven = Driven("dahl", exponent=exponent, negative={"coulomb_torque": 20.0})
    torque = 0.0
    for way in (1e-3, -1.5e-3, 8e-4, -3e-4, 2e-3):
        sign, most = math.copysign(1.0, way), 26.0 if way > 0 else 20.0

        def slope(_: float, t: Any, sign: float = sign, most: float = most) -> Any:
            left = 1.0 - sign * t / most
            return 18000.0 * sign * np.abs(left) ** exponent * np.sign(left)

        path = solve_ivp(slope, (0.0, abs(way)), [torque], rtol=1e-11, atol=1e-11, max_step=1e-5)
        torque = float(path.y[0, -1])
        assert driven.move(way) == pytest.approx(torque, rel=1e-7)


def test_bliman_sorine_settles_at_tc_after_a_peak_below_ts() -> None:
    """And its first order is Dahl's. As the thesis prints it, it would settle at 2 Tc - Ts = 20."""
    driven = Driven("bliman-sorine")
    ways = np.arange(1, 2001) * 1e-4
    torques = [driven.move(1e-4, 1) for _ in ways]
    expected = 32.0 * (1 - np.exp(-18000 / 32 * ways)) - 6.0 * (1 - np.exp(-500 / 6 * ways))
    np.testing.assert_allclose(torques, expected, rtol=1e-11)
    assert 28.0 < max(torques) < 32.0
    assert torques[-1] == pytest.approx(26.0, abs=1e-3)
    first = Driven("bliman-sorine", order=1)
    dahl = Driven("dahl")
    for way in (1e-3, -5e-4, 2e-3):
        assert first.move(way) == dahl.move(way)


def virgin(way: float, elements: int, shape: float, torque: float = 26.0) -> float:
    """First loading of elements that slip after ways in proportion to i^shape, typed anew."""
    ways = [float(i) ** shape for i in range(1, elements + 1)]
    scale = sum(1.0 / each for each in ways)
    parts = (min(18000.0 * way / each / scale, torque / elements) for each in ways)
    return sum(parts)


@pytest.mark.parametrize(("elements", "shape"), [(1, 1.0), (4, 0.0), (10, 1.0), (10, 2.0)])
def test_flat_gms_follows_masings_rules(elements: int, shape: float) -> None:
    """Going back is twice the first loading at half the way; a small loop inside closes."""
    parts = {"elements": elements, "element_shape": shape, **FLAT}
    driven = Driven("gms", **parts)
    turned = driven.move(3e-3)
    assert turned == pytest.approx(virgin(3e-3, elements, shape), rel=1e-11)
    memory = driven.state.copy()
    for way in (3e-4, 1.2e-3, 4e-3):
        driven.state[:] = memory
        expected = turned - 2.0 * virgin(way / 2.0, elements, shape)
        assert driven.move(-way) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    driven.state[:] = memory
    driven.move(-6e-4)
    driven.move(4e-4)
    driven.move(-4e-4)
    assert driven.move(6e-4) == pytest.approx(turned, rel=1e-11)


def test_leuven_has_masings_hysteresis_where_nothing_slides_yet() -> None:
    """With d = 10 and torques below 60 % of s, z follows the angle to 2 %; loops close."""
    driven = Driven("leuven", transition_exponent=10.0, bristle_damping=0.0, elements=5)
    turned = driven.move(1.2e-3)
    assert turned == pytest.approx(virgin(1.2e-3, 5, 1.0, 32.0), rel=2e-3)
    assert turned < 0.6 * 32.0
    back = driven.move(-8e-4)
    assert back == pytest.approx(turned - 2.0 * virgin(4e-4, 5, 1.0, 32.0), rel=5e-3)
    assert driven.move(8e-4) == pytest.approx(turned, rel=1e-3)


def swings(count: int) -> np.ndarray:
    """Rates (rad/s) that grow, turn and fall, shape (count,)."""
    k = np.arange(count)
    return 0.1 * np.sin(2e-3 * np.pi * k) * np.sin(3.1e-4 * np.pi * k)


def paths(name: str, step: float = 1e-3, **changes: Any) -> np.ndarray:
    """Torques at the ends of all steps (N m)."""
    driven, rates = Driven(name, step, **changes), swings(3000)
    return np.array([driven.over(*pair)[1] for pair in itertools.pairwise(rates)])


def test_one_element_of_leuven_is_lugre() -> None:
    """While its z is one: reversals inside a step are met by other means of the same order."""
    one = paths("leuven", elements=1)
    assert np.max(np.abs(one - paths("lugre"))) < 0.02
    finer = paths("leuven", 1e-4, elements=1) - paths("lugre", 1e-4)
    assert np.max(np.abs(finer)) < 5e-4
    constant = [Driven(name, **more) for name, more in (("lugre", {}), ("leuven", {"elements": 1}))]
    for way in (2e-4, 1e-3, 5e-3):
        assert constant[0].move(way) == pytest.approx(constant[1].move(way), rel=1e-9)


def test_damping_that_fades_nowhere_is_lugre() -> None:
    slow = paths("lugre-fading", damping_velocity=1e6)
    assert np.max(np.abs(slow - paths("lugre"))) < 0.02
    assert np.max(np.abs(paths("lugre-fading") - paths("lugre"))) > 1.0


def test_lugre_without_damping_and_stribeck_is_dahl() -> None:
    flat = paths("lugre", bristle_damping=0.0, viscous_friction=0.0, **FLAT)
    assert np.max(np.abs(flat - paths("dahl"))) < 0.02


def dissipated(name: str, **changes: Any) -> tuple[float, float]:
    """Least work that a step takes and does not store, and what all of them dissipate (J).

    Slow sliding bends the bristles to Ts; then the rate jumps, where s(v) has fallen to Tc.
    """
    driven = Driven(name, **changes)
    driven.move(2e-2, 4000)  # 5 mrad/s
    driven.step = step = 1e-5
    slow, fast = np.full(4000, 5e-3), 0.6 * np.sin(np.pi * np.arange(801) / 200)
    rates = np.concatenate([slow[:100], fast, slow, -fast])
    viscous, found = driven.model.viscous(driven.options), []
    before = driven.model.stored_energy(driven.options, driven.state)
    for v0, v1 in itertools.pairwise(rates):
        if v0 * v1 < 0.0:  # the work of a jump from one direction to the other is no product
            continue
        mean, end = driven.over(v0, v1)
        rise = 2.0 * (end - mean)  # the torque is a straight line, and so is the rate
        v = 0.5 * (v0 + v1)
        work = step * (mean * v + rise * (v1 - v0) / 12.0 + viscous * v * v)
        stored = driven.model.stored_energy(driven.options, driven.state)
        found.append(work - (stored - before))
        before = stored
    return min(found), sum(found)


PASSIVE = {
    "dahl": {},
    "dahl, exponent 2": {"exponent": 2.0},
    "dahl, exponent 1/2": {"exponent": 0.5},
    "bliman-sorine": {"order": 1},
    "gms": {**FLAT},
    "lugre": {"bristle_damping": 15.0},  # 15 (32 - 26) / 26 = 3.5 <= 4
    "elasto-plastic": {"bristle_damping": 15.0},
    "lugre-fading": {"damping_velocity": 0.3},  # 800 * 0.3 = 240 <= 9.3 * 26
}


@pytest.mark.parametrize("case", PASSIVE)
def test_what_is_not_stored_is_dissipated(case: str) -> None:
    least, whole = dissipated(case.split(",")[0], **PASSIVE[case])
    assert whole > 0.0
    assert least > -1e-7 * whole


@pytest.mark.parametrize(
    ("name", "changes"),
    [("lugre", {}), ("elasto-plastic", {}), ("lugre-fading", {"damping_velocity": 30.0})],
)
def test_outside_its_condition_a_model_gives_more_than_it_stores(name: str, changes: Any) -> None:
    """A control of the test above: 800 (32 - 26) / 26 = 185 > 4."""
    least, whole = dissipated(name, **changes)
    assert least < -1e-5 * whole


@pytest.mark.parametrize("name", MODELS)
def test_stored_energy_is_a_number_or_stated_as_unknown(name: str) -> None:
    driven = Driven(name)
    driven.move(1e-3)
    stored = driven.model.stored_energy
    unknown = stored is None or math.isnan(stored(driven.options, driven.state))
    assert unknown == (name in ("armstrong", "bliman-sorine", "gms", "leuven"))
