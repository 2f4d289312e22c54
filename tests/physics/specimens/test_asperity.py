"""Asperities against one contact by another solver, expectations in closed form, and energy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad, solve_ivp

from campaign.physics.specimens import specimens
from campaign.physics.specimens.asperity import PITCH, SPOTS, AsperityOptions, length_of, surface

SPECIMEN = specimens()["asperity"]
KINETIC, STATIC, STIFFNESS, STRIBECK = 2.0, 3.0, 1500.0, 0.01
"""N m, N m, N m/rad, rad/s."""
PER_STRETCH = STATIC / STIFFNESS
"""rad: Ts / sigma0."""


def options(**changes: Any) -> AsperityOptions:
    tree = {
        "model": "asperity",
        "coulomb_torque": KINETIC,
        "static_torque": STATIC,
        "bristle_stiffness": STIFFNESS,
        "stribeck_velocity": STRIBECK,
    }
    return AsperityOptions.model_validate(tree | changes, context={"si": True})


def holds(age: Any, creep: float) -> Any:
    """Torque (N m) of all contacts of that age (s) when they slip."""
    return STATIC - (STATIC - KINETIC) * np.exp(-age / creep)


def test_one_contact_is_that_of_a_stiff_solver() -> None:
    """Maxwell slip with a limit that creeps, as a viscoplastic element of a very small viscosity;
    the asperity is led from its gap onto a spot and back and forth on it.
    """
    given = options(asperities=1)
    length = length_of(given)
    creep = length / STRIBECK
    (place,), heights = surface(given)
    stiffness = STIFFNESS * PITCH
    start = PITCH * length * 3 - place  # the left end of spot 3
    height = heights[3, 0]
    duration = 6.0
    time = np.linspace(0.0, duration, 20_001)

    def angle(t: Any) -> Any:
        return start + length * (0.3 * np.sin(1.5 * t) + 0.1 * t)

    touch = -1e-9  # the path is led onto the spot from just before
    led = np.concatenate(([start - 0.3 * length, angle(0.0)], angle(time[1:])))
    found = SPECIMEN.torque(given, np.concatenate(([touch], time)), led)[1:]

    def flow(t: float, state: Any) -> list[float]:
        limit = PITCH * height * holds(t, creep)
        over = max(abs(state[0]) - limit, 0.0) * np.sign(state[0])
        rate = length * (0.45 * np.cos(1.5 * t) + 0.1)
        return [stiffness * rate - 1e6 * over]

    solved = solve_ivp(
        flow, (0.0, duration), [0.0], "LSODA", time, rtol=1e-8, atol=1e-9, max_step=0.02
    )
    scale = PITCH * height * STATIC
    assert np.max(found) > 0.7 * scale
    assert np.min(found) < -0.5 * scale
    np.testing.assert_allclose(found, solved.y[0], atol=1e-4 * scale)


def test_from_rest_it_is_dahls_curve() -> None:
    """Exponential heights: the mean of min(k x, h Ts) is Ts (1 - exp(-k x / Ts))."""
    given = options(asperities=100_000)
    angle = np.linspace(0.0, 3.0 * PER_STRETCH, 31)
    found = SPECIMEN.torque(given, 1e3 * angle, angle)
    # A contact lost and gained in this way is seldom: the way is 0.15 of a spot.
    free = options(asperities=100_000, spot_length=1000)
    undisturbed = SPECIMEN.torque(free, 1e3 * angle, angle)
    expected = STATIC * -np.expm1(-angle / PER_STRETCH)
    np.testing.assert_allclose(undisturbed, expected, atol=4 * STATIC * np.sqrt(3e-5))
    assert undisturbed[1] / angle[1] == pytest.approx(STIFFNESS * 0.95, rel=0.01)
    assert np.all(found <= undisturbed + 0.02 * STATIC)


@pytest.mark.parametrize("rate", [0.1, 1.0, 10.0])
def test_steady_sliding_is_its_expectation(rate: float) -> None:
    """rate: in Stribeck velocities. Over a whole pass of the surface, whose heights are known."""
    given = options(asperities=300, spot_length=8)
    length, rate = length_of(given), rate * STRIBECK
    creep = length / STRIBECK
    angle = np.linspace(0.0, (SPOTS + 3) * PITCH * length, 200 * (SPOTS + 3) + 1)
    found = SPECIMEN.torque(given, angle / rate, angle)[600:]

    def held(way: float) -> float:
        full = holds(way / rate, creep)
        return float(full * -np.expm1(-STIFFNESS * way / full))

    expected = quad(held, 0.0, length, epsabs=1e-12)[0] / length
    assert SPECIMEN.steady_state(given, np.array([rate, -rate])) == pytest.approx(
        [expected, -expected], rel=1e-9
    )
    # 300 * 64 contacts; of each, exp(1) has a deviation of its mean.
    assert np.mean(found) == pytest.approx(expected, rel=3 / np.sqrt(300 * SPOTS))
    assert np.std(found) == pytest.approx(expected * np.sqrt(3 / 300), rel=0.25)


def test_the_ends_of_the_curve_have_closed_forms() -> None:
    given = options()
    for rate, torque in ((1e-9, STATIC), (1e9, KINETIC)):
        lost = torque / STIFFNESS / length_of(given)
        expected = torque * (1.0 - lost * -np.expm1(-1.0 / lost))
        assert SPECIMEN.steady_state(given, np.array([rate]))[0] == pytest.approx(expected)
    assert SPECIMEN.steady_state(given, np.zeros(1))[0] == 0.0
    curve = SPECIMEN.steady_state(given, np.geomspace(1e-4, 1.0, 50))
    assert np.all(np.diff(curve) < 0)


@pytest.mark.slow
def test_friction_lags_behind_a_rate_that_varies() -> None:
    """In one direction, a contact touched when the base was at x - u: its age is what counts."""
    given = options(asperities=20_000)
    length = length_of(given)
    creep = length / STRIBECK
    mean, turned = STRIBECK, 2.0 * np.pi * STRIBECK / (4.0 * length)
    time = np.linspace(0.0, 3.0 * 2.0 * np.pi / turned, 1501)

    def angle(t: Any) -> Any:
        return mean * (t - 0.9 / turned * np.sin(turned * t))

    found = SPECIMEN.torque(given, time, angle(time))
    fine = np.linspace(0.0, time[-1], 200_001)
    ways = length * (np.arange(400) + 0.5) / 400
    lag = []
    for share in (2.25, 2.75):  # the same rate, accelerating and decelerating
        now = share * 2.0 * np.pi / turned
        age = now - np.interp(angle(now) - ways, angle(fine), fine)
        full = holds(age, creep)
        expected = np.mean(full * -np.expm1(-STIFFNESS * ways / full))
        at = int(np.argmin(np.abs(time - now)))
        near = found[at - 5 : at + 6]
        assert np.mean(near) == pytest.approx(expected, rel=4 * np.sqrt(3 / 20_000))
        lag.append(expected)
    assert lag[0] > 1.04 * lag[1]


def test_breakaway_grows_with_the_time_of_rest() -> None:
    """Contacts made by fast sliding are young; at rest they creep, by 1 - exp(-t/tau)."""
    given = options(asperities=5000)
    length = length_of(given)
    creep = length / STRIBECK
    peaks = []
    for rest in (0.0, creep, 30.0 * creep):
        angle = [0.0, *np.linspace(0.1, 6.0 * length, 30), 6.0 * length]
        angle += list(6.0 * length + np.linspace(0.0, 6.0 * PER_STRETCH, 60)[1:])
        time = np.cumsum([0.0, *np.full(30, 1e-6), rest, *np.full(59, 1e-6)])
        peaks.append(np.max(SPECIMEN.torque(given, time, np.array(angle))[31:]))
    share = (peaks[1] - peaks[0]) / (peaks[2] - peaks[0])
    assert peaks[2] / peaks[0] > 1.2
    assert share == pytest.approx(-np.expm1(-1.0), abs=0.06)


def test_samples_do_not_count_on_a_straight_way_and_seeds_do() -> None:
    """Steps of three spots and a little lead some asperities from the end of a spot straight onto
    the next but one.
    """
    given = options(asperities=300)
    step = 3.08 * length_of(given)
    corners = np.array([0.0, step, 2.0 * step, 0.1, 0.1, 0.1 - step])
    times = np.array([0.0, 3.0, 4.0, 5.0, 9.0, 9.5])
    coarse = SPECIMEN.torque(given, times, corners)
    fine = np.unique(np.concatenate((times, np.linspace(0.0, 9.5, 3001))))
    found = SPECIMEN.torque(given, fine, np.interp(fine, times, corners))
    np.testing.assert_allclose(found[np.isin(fine, times)], coarse, atol=1e-9)
    other = SPECIMEN.torque(options(asperities=300, seed=2), times, corners)
    assert not np.allclose(other[1:], coarse[1:])


@settings(max_examples=30, deadline=None)
@given(
    corners=st.lists(st.floats(-0.1, 0.1), min_size=1, max_size=4),
    rate=st.floats(1e-4, 1.0),
    asperities=st.integers(1, 6),
    seed=st.integers(0, 9),
)
def test_no_closed_motion_yields_work(
    corners: list[float], rate: float, asperities: int, seed: int
) -> None:
    given = options(asperities=asperities, seed=seed)
    step = 0.05 * PER_STRETCH
    ends = [0.0, *corners, 0.0]
    parts = [np.linspace(a, b, 2 + int(abs(b - a) / step))[1:] for a, b in pairwise(ends)]
    angle = np.concatenate(([0.0], *parts))
    moved = np.diff(angle)
    time = np.concatenate(([0.0], np.cumsum(np.abs(moved) / rate)))
    found = SPECIMEN.torque(given, time, angle)
    work = np.sum(0.5 * (found[1:] + found[:-1]) * moved)
    largest = np.max(np.abs(found), initial=0.0)
    # The trapezoid meets each break within a step.
    assert work >= -0.5 * step * largest * (2 + np.sum(np.abs(moved)) / length_of(given))


def test_adhesion_that_shrinks_is_refused() -> None:
    with pytest.raises(ValueError, match="no less than coulomb_torque"):
        options(static_torque=1.0)
