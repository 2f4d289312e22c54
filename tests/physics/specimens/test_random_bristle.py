"""Random bristles against the closed forms of a renewal process, elasticity and energy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from campaign.physics.friction import friction_models
from campaign.physics.specimens import specimens
from campaign.physics.specimens.random_bristle import RandomBristleOptions, snap_deflection

SPECIMEN = specimens()["random-bristle"]
TORQUE, STIFFNESS = 2.0, 100.0
"""N m, N m/rad."""


def options(**changes: Any) -> RandomBristleOptions:
    tree = {"model": "random-bristle", "coulomb_torque": TORQUE, "bristle_stiffness": STIFFNESS}
    return RandomBristleOptions.model_validate(tree | changes, context={"si": True})


def torque(given: RandomBristleOptions, *corners: float, step: float = 0.05) -> tuple[Any, Any]:
    """Angles from corner to corner, and the torque there; step: in deflections of a snap."""
    step *= snap_deflection(given)
    parts = [np.linspace(a, b, 2 + int(abs(b - a) / step))[1:] for a, b in pairwise(corners)]
    angle = np.concatenate((corners[:1], *parts))
    return angle, SPECIMEN.torque(given, np.zeros(len(angle)), angle)


@pytest.mark.slow
@pytest.mark.parametrize("spacing", [0.3, 1.0, 2.0])
def test_mean_and_noise_of_sliding_are_those_of_the_renewal_process(spacing: float) -> None:
    """Samples a pitch and more apart are nearly independent; the deflection is delta_s - u with
    the density 2/D (1 - u/D) of u in (0, D): mean delta_s - D/3, variance D^2/18.
    """
    given = options(bristles=400, spacing=spacing)
    most = snap_deflection(given)
    _, found = torque(given, 0.0, 3000 * most, step=1.3)
    found = found[200:]
    deviation = STIFFNESS * spacing * most / np.sqrt(18.0 * 400)
    assert np.mean(found) == pytest.approx(TORQUE, abs=4 * deviation / np.sqrt(len(found) / 3))
    assert np.std(found) == pytest.approx(deviation, rel=0.08)
    assert SPECIMEN.steady_state(given, np.array([-3.0, 0.0, 1e-6])).tolist() == [-2.0, 0.0, 2.0]


def test_noise_falls_as_the_root_of_the_number_of_bristles() -> None:
    """Over seeds, at one place."""
    spread = []
    for bristles in (4, 64):
        ends = []
        for seed in range(400):
            given = options(bristles=bristles, seed=seed)
            ends.append(torque(given, 0.0, 20.3 * snap_deflection(given), step=100)[1][-1])
        spread.append(np.std(ends))
        expected = STIFFNESS * snap_deflection(given) / np.sqrt(18.0 * bristles)
        assert spread[-1] == pytest.approx(expected, rel=0.12)  # 3 sigma of 400 seeds
    assert spread[0] / spread[1] == pytest.approx(4.0, rel=0.15)


def test_it_is_elastic_where_no_bond_snaps() -> None:
    """From rest up to delta_s, and after a reversal over 2 delta_s - Delta, to the last digits;
    without microslip, a smaller motion has no hysteresis.
    """
    given = options(bristles=50, spacing=0.8)
    most = snap_deflection(given)
    angle, found = torque(given, 0.0, 0.99 * most, -0.99 * most, 0.5 * most)
    np.testing.assert_allclose(found, STIFFNESS * angle, rtol=0, atol=1e-12)
    slid = 30.0 * most
    angle, found = torque(given, 0.0, slid, slid - 3.0 * most)
    back = angle[np.argmax(angle) :]
    elastic = found[np.argmax(angle)] - STIFFNESS * (slid - back)
    same = slid - back < (2.0 - 0.8) * most
    after = found[np.argmax(angle) :]
    np.testing.assert_allclose(after[same], elastic[same], atol=1e-12)
    assert np.all(after[slid - back > 2.0 * most] > elastic[slid - back > 2.0 * most] + 0.1)
    assert after[-1] == pytest.approx(-TORQUE, rel=0.15)


def test_the_path_alone_counts_and_the_seed() -> None:
    corners = (0.0, 0.4, -0.3, 0.1, 0.05)
    coarse = torque(options(), *corners, step=1e9)[1]
    assert len(coarse) == len(corners)
    angle, fine = torque(options(), *corners, step=0.01)
    for corner, found in zip(corners, coarse, strict=True):
        # No corner is met twice, but on the way to another one: the first of the last ones.
        assert np.min(np.abs(fine[np.isclose(angle, corner)] - found)) < 1e-12
    assert np.array_equal(fine, torque(options(), *corners, step=0.01)[1])
    assert not np.array_equal(fine, torque(options(seed=2), *corners, step=0.01)[1])


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(
    corners=st.lists(st.floats(-0.2, 0.2), min_size=1, max_size=6),
    bristles=st.integers(1, 6),
    spacing=st.floats(0.1, 2.0),
    seed=st.integers(0, 9),
)
def test_no_closed_motion_yields_work(
    corners: list[float], bristles: int, spacing: float, seed: int
) -> None:
    given = options(bristles=bristles, spacing=spacing, seed=seed)
    angle, found = torque(given, 0.0, *corners, 0.0, step=0.01)
    moved = np.diff(angle)
    work = np.sum(0.5 * (found[1:] + found[:-1]) * moved)
    # The trapezoid meets each snap within a step: its error is a jump times half a step.
    assert work >= -1e-3 * STIFFNESS * snap_deflection(given) * np.sum(np.abs(moved)) - 1e-9


def test_a_cycle_of_long_sliding_loses_the_mean_torque_times_the_way() -> None:
    given = options(bristles=400)
    angle, found = torque(given, 0.0, 2.0, -2.0, 2.0)
    last = np.flatnonzero(angle == 2.0)[0]  # the first is where the closed part begins
    work = np.sum((0.5 * (found[1:] + found[:-1]) * np.diff(angle))[last:])
    # Each of two reversals loses less, by about the torque times delta_s (0.03 rad).
    assert work == pytest.approx(TORQUE * 8.0, rel=0.02)


def test_spacing_beyond_two_is_refused() -> None:
    """A new bond would be stretched more than the old one."""
    with pytest.raises(ValueError, match="less than or equal to 2"):
        options(spacing=2.1)


def test_no_bench_can_name_a_specimen() -> None:
    assert not set(specimens()) & set(friction_models())
