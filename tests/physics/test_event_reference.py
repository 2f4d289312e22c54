"""The event-switched reference against closed forms, so that it may judge the stepping scheme."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from campaign.signals import Sine
from tests.physics.bench_reference import reference
from tests.physics.benches import INERTIA, RATIO, bench, task
from tests.physics.event_reference import STATES, THESIS_DRY, Curve, Dry, DryLoop, simulate_events

AMPLITUDE, OMEGA = math.radians(18.0), 2 * math.pi * 0.24
SWINGING = DryLoop(
    base_rate=lambda t: -AMPLITUDE / OMEGA * math.cos(OMEGA * t),
    base_acceleration=lambda t: AMPLITUDE * math.sin(OMEGA * t),
)
STIFFNESS = 4000.0
NATURAL = math.sqrt(STIFFNESS / INERTIA)


def test_a_coasting_load_is_stopped_by_coulomb_and_viscous_friction() -> None:
    """J dw/dt = -Tc - sigma2 w: both the instant and the angle of rest are known."""
    coulomb, viscous, rate = 26.0, 4.0, 0.5
    loop = DryLoop(
        friction=(Dry(Curve(coulomb, coulomb, viscous=viscous)),),
        spring=0.0,
        initial=(rate, *(0.0,) * (STATES - 1)),
    )
    out, history = simulate_events(loop, np.linspace(0.0, 2.0, 201))
    log = math.log(1.0 + viscous * rate / coulomb)
    assert [direction for _, direction in history] == [1, 0]
    assert history[1][0] == pytest.approx(INERTIA / viscous * log, rel=1e-9)
    rest = INERTIA / viscous * (rate - coulomb / viscous * log)
    assert out["relative_angle"][-1] == pytest.approx(rest, rel=1e-9)


def test_an_oscillator_loses_the_same_amplitude_each_half_cycle() -> None:
    """Released at 5.3 Tc / k it turns at -3.3 and 1.3, and stays where it next stops, at 0.7."""
    reach = 26.0 / STIFFNESS
    loop = DryLoop(
        friction=(Dry(Curve(26.0, 26.0)),),
        spring=STIFFNESS,
        initial=(0.0, 0.0, 5.3 * reach, *(0.0,) * (STATES - 3)),
    )
    half = math.pi / NATURAL
    out, history = simulate_events(loop, np.array([0.0, half, 2 * half, 3.5 * half, 5 * half]))
    assert [direction for _, direction in history] == [-1, 1, -1, 0]
    np.testing.assert_allclose([at for at, _ in history], half * np.arange(4), rtol=1e-9)
    found = out["relative_angle"] / reach
    np.testing.assert_allclose(found, [5.3, -3.3, 1.3, 0.7, 0.7], rtol=1e-8)
    assert out["friction_torque"][-1] == pytest.approx(-0.7 * 26.0, rel=1e-8)


def test_breakaway_under_a_torque_ramp() -> None:
    """Pulled at speed V through a spring: it breaks away when k V t = Ts, and then slides."""
    speed = 0.02
    loop = DryLoop(
        friction=(Dry(Curve(26.0, 26.0)),), spring=STIFFNESS, command=lambda t: speed * t
    )
    start = 26.0 / (STIFFNESS * speed)
    after = np.array([0.05, 0.15, 0.3])
    out, history = simulate_events(loop, np.concatenate([[0.0], start + after]))
    assert history[:2] == [(0.0, 0), (pytest.approx(start, rel=1e-10), 1)]
    expected = speed * (after - np.sin(NATURAL * after) / NATURAL)
    np.testing.assert_allclose(out["relative_angle"][1:], expected, rtol=1e-6)


def test_a_block_on_a_moving_belt_slips_for_the_known_time() -> None:
    """Stick-slip: Ts falls to Tc at once, the slip ends when the rate is zero again.

    With b = (Ts - Tc) / (J omega) the rate is V (1 - cos) + b sin, which is zero when omega t is
    2 pi - 2 atan(b / V). The curve falls over 1e-7 rad/s: the slip starts some microseconds late.
    """
    speed, static, coulomb = 0.05, 32.0, 26.0
    loop = DryLoop(
        friction=(Dry(Curve(coulomb, static, velocity=1e-7, exponent=1.0)),),
        spring=STIFFNESS,
        command=lambda t: speed * t,
    )
    _, history = simulate_events(loop, np.linspace(0.0, 1.2, 100), rtol=1e-8)
    begin, end, again = (at for at, _ in history[1:4])
    ratio = (static - coulomb) / (INERTIA * NATURAL) / speed
    slip = (2 * math.pi - 2 * math.atan(ratio)) / NATURAL
    assert begin == pytest.approx(static / (STIFFNESS * speed), rel=1e-9)
    assert end - begin == pytest.approx(slip, rel=1e-4)
    # The slip takes the block past where the spring holds Tc by as much as it lay before it.
    assert again - end == pytest.approx(2 * (static - coulomb) / (STIFFNESS * speed), rel=1e-3)


def test_its_loop_is_that_of_the_other_reference() -> None:
    """The same equations with LuGre friction and compensation, where nothing is switched."""
    times = np.arange(300) * 1e-3
    loop = replace(SWINGING, bristles=True, bristle_compensation=True)
    out, _ = simulate_events(loop, times)
    swing = Sine(amplitude=AMPLITUDE, frequency=0.24)
    expected = reference(bench(), task(base_acceleration=swing, compensation="lugre", duration=0.3))
    for name in ("load_rate", "relative_angle", "motor_current"):
        scale = float(np.max(np.abs(expected[name])))
        np.testing.assert_allclose(out[name], expected[name], atol=2e-7 * scale)


def test_two_interfaces_are_one_with_the_sum_of_both() -> None:
    times = np.arange(1500) * 1e-3
    summed = Curve(26.0 + 0.03 * RATIO, 32.0 + 0.04 * RATIO, viscous=4.0 + 0.001 * RATIO)
    two, events = simulate_events(replace(SWINGING, friction=THESIS_DRY), times)
    one, same = simulate_events(replace(SWINGING, friction=(Dry(summed),)), times)
    assert [direction for _, direction in events] == [1, 0, -1]
    np.testing.assert_allclose([at for at, _ in same], [at for at, _ in events], atol=1e-9)
    np.testing.assert_allclose(one["load_rate"], two["load_rate"], atol=1e-10)
