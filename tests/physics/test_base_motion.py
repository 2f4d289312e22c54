"""Motion of the hull: closed forms, exact integrals."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.physics.base_motion import base_rate
from campaign.physics.grid import make_grid
from campaign.signals import MultiSine, Polyline, Sine, Zero
from tests.physics.benches import bench, run, stribeck, task


def test_rate_of_a_sine_is_its_integral_with_zero_mean() -> None:
    """18 deg/s^2 at 0.24 Hz swings by 11.94 deg/s."""
    swing = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24, phase=0.7)
    time = np.linspace(0.0, 1 / 0.24, 200_001)
    rate = base_rate(swing, time)
    assert np.rad2deg(rate.max()) == pytest.approx(18.0 / (2 * np.pi * 0.24), rel=1e-9)
    assert np.mean(rate[:-1]) == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(np.gradient(rate, time)[1:-1], swing.sample(time)[1:-1], atol=1e-8)


def test_angle_of_a_load_that_is_locked_to_the_hull() -> None:
    """A / (2 pi f)^2: 36 deg/s^2 at 1 Hz carries a stuck load by 0.912 deg either way."""

    def locked(tree: dict[str, dict[str, object]]) -> None:
        tree["friction"] = {"load": stribeck(1e6, 1e6)}
        tree["compensation"] = {}

    amplitude = float(np.deg2rad(36.0))
    swing = Sine(amplitude=amplitude, frequency=1.0, phase=np.pi / 2)  # rate (A/w) sin(w t)
    time, out = run(bench(locked), task(mode="torque", base_acceleration=swing, duration=2.0))
    omega = 2 * np.pi
    expected = amplitude / omega**2 * (1 - np.cos(omega * time))
    np.testing.assert_allclose(out["pointing_angle"], expected, atol=1e-5 * amplitude / omega**2)
    np.testing.assert_allclose(out["relative_angle"], 0.0, atol=1e-6 * amplitude / omega**2)


@pytest.mark.parametrize(
    ("times", "values", "expected"),
    [
        # trapezoid: up to 2 rad/s^2 in 1 s, hold 1 s, down in 1 s
        ((0.0, 1.0, 2.0, 3.0), (0.0, 2.0, 2.0, 0.0), (0.0, 0.25, 1.0, 3.0, 4.0, 4.0)),
        # a step at 1 s: the acceleration is 0, then 1
        ((0.0, 1.0, 1.0, 2.0), (0.0, 0.0, 1.0, 1.0), (0.0, 0.0, 0.0, 1.0, 2.0, 3.0)),
        # the first value holds before the first point, the last after the last
        ((0.5, 1.5), (1.0, 3.0), (0.0, 0.5, 1.25, 4.0, 7.0, 10.0)),
        # points before the trial begins
        ((-1.0, 1.0), (0.0, 2.0), (0.0, 0.625, 1.5, 3.5, 5.5, 7.5)),
    ],
)
def test_rate_of_a_polyline_starts_from_rest(
    times: tuple[float, ...], values: tuple[float, ...], expected: tuple[float, ...]
) -> None:
    at = np.array([0.0, 0.5, 1.0, 2.0, 3.0, 4.0])
    found = base_rate(Polyline(times=times, values=values), at)
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_rate_does_not_depend_on_which_times_are_asked_together() -> None:
    signal = Polyline(times=(0.1, 0.7, 0.7, 2.3), values=(0.3, -1.7, 0.9, 0.1))
    time = np.linspace(0.0, 3.0, 1001)
    whole = base_rate(signal, time)
    parts = np.concatenate([base_rate(signal, part) for part in np.array_split(time, 7)])
    np.testing.assert_array_equal(whole, parts)
    np.testing.assert_array_equal(base_rate(Zero(), time), 0.0)


TWO = MultiSine(amplitudes=(0.3, 0.1), frequencies=(0.2, 0.5), phases=(0.4, -1.0))


def test_a_sum_of_sines_is_the_sum_of_its_sines() -> None:
    time = np.linspace(0.0, 10.0, 1001)
    one = Sine(amplitude=0.3, frequency=0.2, phase=0.4)
    other = Sine(amplitude=0.1, frequency=0.5, phase=-1.0)
    np.testing.assert_allclose(TWO.sample(time), one.sample(time) + other.sample(time), atol=1e-15)
    np.testing.assert_allclose(
        base_rate(TWO, time), base_rate(one, time) + base_rate(other, time), atol=1e-15
    )


def test_integrals_and_derivative_of_a_sum_of_sines() -> None:
    """Numerical derivatives of each order are the order before; whole periods (10 s) average 0."""
    time = np.linspace(0.0, 10.0, 100_001)
    for order in (-1, 0, 1, 2):
        slope = np.gradient(TWO.integral(time, order), time)[1:-1]
        np.testing.assert_allclose(slope, TWO.integral(time, order - 1)[1:-1], atol=1e-6)
        assert np.mean(TWO.integral(time[:-1], order)) == pytest.approx(0.0, abs=1e-12)


def test_a_sum_of_sines_needs_a_whole_table() -> None:
    with pytest.raises(ValueError, match="as many"):
        MultiSine(amplitudes=(1.0, 2.0), frequencies=(1.0,), phases=(0.0, 0.0))
    with pytest.raises(ValueError, match="greater than 0"):
        MultiSine(amplitudes=(1.0,), frequencies=(0.0,), phases=(0.0,))


def test_a_simulation_resolves_the_fastest_component() -> None:
    slow = task(base_acceleration=TWO, duration=1.0)
    fast = task(
        base_acceleration=MultiSine(amplitudes=(0.1, 0.1), frequencies=(0.2, 100.0), phases=(0, 0)),
        duration=1.0,
    )
    assert make_grid(bench(), slow, 1e-3).step == pytest.approx(1e-3)
    assert make_grid(bench(), fast, 1e-3).step <= 1 / (80 * 100.0)
