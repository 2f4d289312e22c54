"""Presliding: stiffness from closed-form curves, Table 4.5's damping, the breakaway torque."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.estimation.autocorrelated_errors import errors_of, misfit
from campaign.estimation.breakaway_torque import breakaway_torque
from campaign.estimation.bristle_fit import fit_bristles, two_interfaces
from campaign.estimation.presliding import OFF_THE_CURVE, damping_by_ratio, fit_presliding
from campaign.estimation.presliding_curve import (
    Interface,
    angle_derivatives,
    presliding_angle,
    presliding_torque,
)
from campaign.estimation.presliding_dynamics.simulation import Motion
from campaign.estimation.torque_ramp import ramp_of
from tests.estimation.coverage import autoregressive
from tests.estimation.test_ramp_coverage import INERTIA, bending, letting_go

LOAD = Interface(18000.0, 32.0)
MOTOR = Interface(141176.0, 141.176 * 0.04)
REST = 5.0


def test_the_curve_is_the_closed_form_and_its_inverse() -> None:
    angle = np.linspace(0.0, 0.01, 500)
    expected = 32.0 * (1 - np.exp(-18000.0 * angle / 32.0))
    expected += MOTOR.torque * (1 - np.exp(-MOTOR.stiffness * angle / MOTOR.torque))
    torque = presliding_torque(angle, (LOAD, MOTOR))
    np.testing.assert_allclose(torque, expected, rtol=1e-12)
    np.testing.assert_allclose(presliding_angle(torque, (LOAD, MOTOR)), angle, rtol=1e-7)
    torque = presliding_torque(angle, (LOAD,))
    np.testing.assert_allclose(presliding_angle(torque, (LOAD,)), angle, rtol=1e-9, atol=1e-15)


def test_derivatives_are_differences() -> None:
    torque = np.linspace(0.1, 34.0, 50)
    found = angle_derivatives(presliding_angle(torque, (LOAD, MOTOR)), (LOAD, MOTOR))
    values = [*LOAD, *MOTOR]
    for column in range(4):
        ends = []
        for side in (-1.0, 1.0):
            moved = [v * (1 + side * 1e-5 * (k == column)) for k, v in enumerate(values)]
            ends.append(presliding_angle(torque, (Interface(*moved[:2]), Interface(*moved[2:]))))
        numeric = (ends[1] - ends[0]) / (2e-5 * values[column])
        np.testing.assert_allclose(found[:, column], numeric, rtol=1e-4, atol=1e-12)


def test_one_interface() -> None:
    time, rate, torque = bending(LOAD)
    found = fit_presliding(time, rate, torque, REST, 32.0)
    assert len(found.interfaces) == 1
    assert found.stiffness.value == pytest.approx(18000.0, rel=1e-4)
    assert found.interfaces[0].torque == pytest.approx(32.0, rel=1e-4)
    assert found.stiffness_at_rest.value == found.stiffness.value
    values = [each.value for each in found.by_window.values()]
    assert list(found.by_window) == [0.5, 0.65, 0.8, 0.9]
    assert values == pytest.approx([18000.0] * 4, rel=1e-3)


@pytest.mark.parametrize("noise", [0.0, 0.002])
@pytest.mark.parametrize("bias", [0.0, 0.05])
def test_two_interfaces(noise: float, bias: float) -> None:
    """The appendix' load and motor side on one velocity: stiffnesses add until the motor slips.

    A gyro's bias of 0.05 deg/s is ten times the rate at which the load bends its bristles.
    """
    time, rate, torque = bending(LOAD, MOTOR)
    random = np.random.default_rng(2)
    rate = rate + np.deg2rad(noise) * random.normal(size=len(rate)) + np.deg2rad(bias)
    found = fit_presliding(time, rate, torque, REST, 37.647)
    assert len(found.interfaces) == 2
    assert found.stiffness.value == pytest.approx(18000.0, rel=0.001 if noise == 0 else 0.03)
    assert found.stiffness_at_rest.value == pytest.approx(
        159176.0, rel=0.01 if noise == 0 else 0.15
    )
    assert found.bias == pytest.approx(np.deg2rad(bias), abs=np.deg2rad(1e-4))


def test_errors_of_two_interfaces_come_from_the_true_slopes() -> None:
    """The fit's Jacobian, against what the closed form's rates change by."""
    time, rate, torque = bending(LOAD, MOTOR)
    ramp = ramp_of(time, rate, torque, REST, 30.0)
    found = fit_bristles(ramp, 2.0, two_interfaces(ramp, 37.647, 2.0))
    (load, motor), spans = found.interfaces, np.diff(ramp.edges)
    total = load.torque + motor.torque

    def rates(stiffness: float, total: float, weaker: float) -> np.ndarray:
        parts = (
            Interface(load.stiffness * stiffness, total - motor.torque * weaker),
            Interface(motor.stiffness, motor.torque * weaker),
        )
        return np.diff(presliding_angle(ramp.torque, parts)) / spans

    small = 1e-5
    for column, changed in (
        (0, rates(1 + small, total, 1.0) - rates(1 - small, total, 1.0)),
        (1, rates(1.0, total * (1 + small), 1.0) - rates(1.0, total * (1 - small), 1.0)),
        (3, rates(1.0, total, 1 + small) - rates(1.0, total, 1 - small)),
    ):
        expected = changed[found.used] / (2 * small)
        scale = float(np.max(np.abs(expected)))
        np.testing.assert_allclose(found.jacobian[:, column], expected, atol=1e-3 * scale)


@pytest.mark.slow
def test_no_second_interface_where_there_is_none() -> None:
    random = np.random.default_rng(9)
    for noise in (0.001, 0.01):
        for _ in range(4):
            only = Interface(random.uniform(5e3, 5e4), random.uniform(10.0, 60.0))
            time, rate, torque = bending(only)
            rate = rate + np.deg2rad(noise) * random.normal(size=len(rate))
            found = fit_presliding(time, rate, torque, REST, only.torque)
            assert len(found.interfaces) == 1


def test_the_breakaway_torque_need_not_be_the_asymptote() -> None:
    """A ramp's peak is 2 to 4 % below what the bristles would carry in the end."""
    time, rate, torque = bending(LOAD)
    for breakaway in (0.96 * 32.0, 32.0):
        found = fit_presliding(time, rate, torque, REST, breakaway)
        assert found.stiffness.value == pytest.approx(18000.0, rel=1e-3)


@pytest.mark.parametrize("share", [0.5, 0.65, 0.8, 0.9])
def test_a_chord_is_always_too_low(share: float) -> None:
    """A concave curve lies below its initial slope; for 0.8 the end-to-end chord is 0.497 of it."""
    time, rate, torque = bending(LOAD)
    found = fit_presliding(time, rate, torque, REST, 32.0, share)
    end_to_end = -share / math.log(1 - share)
    assert found.chord < 18000.0
    assert found.chord == pytest.approx(18000.0 * end_to_end, rel=0.15)


def test_what_is_no_curve_of_bristles_has_no_interval() -> None:
    """A rate that swings by a tenth over seconds is not noise around the curve."""
    time, rate, torque = bending(LOAD)
    random = np.random.default_rng(4)
    swing = 1.0 + 0.5 * np.sin(2.0 * np.pi * time / 4.0)
    rate = rate * swing + np.deg2rad(0.002) * random.normal(size=len(rate))
    found = fit_presliding(time, rate, torque, REST, 32.0)
    assert not found.stiffness.has_interval
    assert found.stiffness.reason in OFF_THE_CURVE


def test_the_stiffness_at_rest_depends_on_the_window_as_the_stiffness_does() -> None:
    """Bristles that are straight at first: the longer the window, the stiffer they look."""
    time = np.arange(35_000) / 1000.0
    torque = np.maximum(time - REST, 0.0)
    bent = 10.0 - 22.0 * np.log1p(-np.clip(torque - 10.0, 0.0, 21.0) / 22.0)
    rate = np.gradient(np.where(torque < 10.0, torque, bent) / LOAD.stiffness, time)
    rate += 1e-4 * np.random.default_rng(2).standard_normal(len(time))
    found = fit_presliding(time, rate, torque, REST, 32.0)
    assert len(found.interfaces) == 1
    window = [part for part in found.stiffness.systematic if part.source == "window"]
    assert window[0].standard_uncertainty
    assert window[0] in found.stiffness_at_rest.systematic


def test_a_window_without_samples_is_refused() -> None:
    time, rate, torque = bending(LOAD)
    with pytest.raises(ValueError, match="samples lie below"):
        fit_presliding(time[::2000], rate[::2000], torque[::2000], REST, 32.0)
    with pytest.raises(ValueError, match="no ramp"):
        fit_presliding(time, rate, -torque, REST, 32.0)


@pytest.mark.parametrize(("stiffness", "printed"), [(14251.0, 1125), (16334.0, 1205)])
def test_damping_reproduces_table_4_5(stiffness: float, printed: int) -> None:
    """Every row is rounded down from J = 35, sigma2 = 4.07 and a damping ratio of 0.8."""
    assert math.floor(damping_by_ratio(stiffness, 35.0, 4.07, 0.8)) == printed


@pytest.mark.parametrize("way", [1.0, -1.0])
@pytest.mark.parametrize("slope", [1.0, 4.0])
def test_breakaway_torque_of_a_load_that_slides_away(slope: float, way: float) -> None:
    """The closed form's top, without noise to 5e-4."""
    time, rate, torque, top = letting_go(slope)
    found = breakaway_torque(time, way * rate, way * torque, INERTIA, 0.005)
    assert found.torque.value == pytest.approx(top, rel=5e-4)
    assert not found.torque.has_interval  # nothing scatters: the quintic's own error is all
    assert found.acceleration == pytest.approx(slope * 0.25 / INERTIA, rel=0.1)
    with pytest.raises(ValueError, match="never reached"):
        breakaway_torque(time, rate, torque, INERTIA, 5.0)


def test_a_wrong_inertia_moves_the_breakaway_torque_by_the_acceleration() -> None:
    time, rate, torque, _ = letting_go(1.0)
    rate = rate + np.deg2rad(0.002) * np.random.default_rng(1).normal(size=len(rate))
    found = breakaway_torque(time, rate, torque, INERTIA, 0.005)
    wrong = breakaway_torque(time, rate, torque, 1.02 * INERTIA, 0.005)
    moved = wrong.torque.value - found.torque.value
    assert moved == pytest.approx(-0.02 * INERTIA * found.acceleration, rel=0.1)


def test_friction_that_still_rises_when_the_recording_ends_is_a_bound() -> None:
    time, rate, torque, top = letting_go(1.0)
    early = time < time[-1] - 1.2  # 0.4 s before the top
    rate = rate + np.deg2rad(0.002) * np.random.default_rng(1).normal(size=len(rate))
    found = breakaway_torque(time[early], rate[early], torque[early], INERTIA, 1e-4).torque
    assert found.kind == "at least"
    assert found.value < top


def test_errors_of_a_mean_of_ar1_noise() -> None:
    """Var of a mean of n: s^2 (1 + r)/(1 - r)/n; of white noise: s^2/n."""
    random = np.random.default_rng(5)
    count, rho = 4000, 0.8
    noise = autoregressive(random, count, rho) / np.sqrt(1.0 - rho**2)
    found = errors_of(np.ones((count, 1)), noise - noise.mean())
    assert found.correlation == pytest.approx(rho, abs=0.051)  # a grid of 0.05
    expected = 1.0 / (1.0 - rho) ** 2 / count  # innovations of variance 1
    assert found.covariance[0, 0] == pytest.approx(expected, rel=0.6)
    white = random.normal(size=count)
    found = errors_of(np.ones((count, 1)), white - white.mean())
    assert found.covariance[0, 0] == pytest.approx(1.0 / count, rel=0.2)
    assert misfit(white, 1) == pytest.approx(1.0, abs=0.05)
    assert misfit(np.sin(np.linspace(0, 6, count)), 1) > 1000


def test_a_motion_that_diverges_is_read_without_a_word() -> None:
    """The search leaves it by itself; a person at a terminal has nothing to do with it."""
    grown = np.array([0.0, 1.0, np.inf, np.nan, np.inf])
    motion = Motion(1e-3, 1, grown, grown, grown, grown[:, None])
    with np.errstate(all="raise"):
        assert len(motion.rate_at(3e-4)) == 5
