"""Presliding: stiffness from closed-form curves, Table 4.5's damping, the breakaway torque."""

from __future__ import annotations

import math

import numpy as np
import pytest

from campaign.identification.presliding import (
    breakaway_torque,
    damping_by_ratio,
    fit_presliding,
)


def curve(angle: np.ndarray, *interfaces: tuple[float, float]) -> np.ndarray:
    """Sum of Tb (1 - exp(-sigma0 q / Tb))."""
    return np.sum([t * (1 - np.exp(-s * angle / t)) for s, t in interfaces], axis=0)


def test_one_interface() -> None:
    angle = np.linspace(0.0, 8 * 32 / 18000, 20_000)
    found = fit_presliding(angle, curve(angle, (18000.0, 32.0)), 32.0)
    assert len(found.interfaces) == 1
    assert found.stiffness == pytest.approx(18000.0, rel=1e-9)
    assert found.interfaces[0][2] == pytest.approx(32.0, rel=1e-9)
    assert found.stiffness_at_rest == found.stiffness
    assert list(found.by_window.values()) == pytest.approx([18000.0] * 4, rel=1e-9)


@pytest.mark.parametrize("noise", [0.0, 1e-3, 0.05])
def test_two_interfaces(noise: float) -> None:
    """The appendix' load and motor side on one velocity: stiffnesses add until the motor slips."""
    angle = np.linspace(0.0, 8 * 32 / 18000, 30_000)
    random = np.random.default_rng(2)
    torque = curve(angle, (18000.0, 32.0), (141176.0, 141.176 * 0.04))
    found = fit_presliding(angle, torque + noise * random.normal(size=len(angle)), 37.647)
    assert len(found.interfaces) == 2
    assert found.stiffness == pytest.approx(18000.0, rel=0.005)
    assert found.stiffness_at_rest == pytest.approx(159176.0, rel=0.02)
    # Within four of its own standard errors, too.
    for (stiffness, error, _), true in zip(found.interfaces, (18000.0, 141176.0), strict=True):
        assert abs(stiffness - true) < 4 * error + 1e-6 * true


def test_no_second_interface_where_there_is_none() -> None:
    random = np.random.default_rng(9)
    for noise in (1e-3, 0.05, 0.5):
        for _ in range(8):
            limit, stiffness = random.uniform(10, 60), random.uniform(5e3, 5e4)
            angle = np.linspace(0.0, 8 * limit / stiffness, 5_000)
            torque = curve(angle, (stiffness, limit)) + noise * random.normal(size=len(angle))
            found = fit_presliding(angle, torque, limit)
            assert len(found.interfaces) == 1
            # The window ends at the first sample beyond it: noise leaves less curve to fit.
            assert found.stiffness == pytest.approx(stiffness, rel=0.002 + 0.2 * noise)


@pytest.mark.parametrize("share", [0.5, 0.65, 0.8, 0.9])
def test_a_chord_is_always_too_low(share: float) -> None:
    """A concave curve lies below its initial slope; for 0.8 the end-to-end chord is 0.497 of it."""
    angle = np.linspace(0.0, 0.02, 20_000)
    found = fit_presliding(angle, curve(angle, (18000.0, 32.0)), 32.0, share)
    end_to_end = -share / math.log(1 - share)
    assert found.chord < 18000.0
    assert found.chord == pytest.approx(18000.0 * end_to_end, rel=0.15)


def test_a_window_without_samples_is_refused() -> None:
    angle = np.linspace(0.0, 0.02, 12)
    with pytest.raises(ValueError, match="samples lie between"):
        fit_presliding(angle, curve(angle, (18000.0, 32.0)), 32.0)


@pytest.mark.parametrize(("stiffness", "printed"), [(14251.0, 1125), (16334.0, 1205)])
def test_damping_reproduces_table_4_5(stiffness: float, printed: int) -> None:
    """Every row is rounded down from J = 35, sigma2 = 4.07 and a damping ratio of 0.8."""
    assert math.floor(damping_by_ratio(stiffness, 35.0, 4.07, 0.8)) == printed


def test_breakaway_torque_takes_off_what_accelerates_the_load() -> None:
    """Friction 30 N m throughout; from 3 s on the drive exceeds it and J dw/dt takes the rest."""
    time = np.arange(0.0, 5.0, 1e-3)
    drive = np.minimum(10.0 * time, 30.0) + 20.0 * np.maximum(time - 3.0, 0.0)
    rate = 0.5 * (20.0 / 35.0) * np.maximum(time - 3.0, 0.0) ** 2
    found, at = breakaway_torque(time, rate, drive, 35.0, 0.05)
    assert found == pytest.approx(30.0, rel=2e-3)
    assert time[at] == pytest.approx(3.0 + math.sqrt(0.05 * 2 * 35 / 20), abs=2e-3)
    with pytest.raises(ValueError, match="never reached"):
        breakaway_torque(time, rate, drive, 35.0, 5.0)
