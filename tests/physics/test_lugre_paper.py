"""The LuGre step function on the examples of Canudas de Wit et al. (1995).

The published figures were recomputed with an implicit Runge-Kutta method (Radau) at tight
tolerance; those are the numbers expected here. The step function is driven by a
stepper for a unit mass: exact for forces that are straight lines over a step, like the engine's.

Step size: the bristle oscillates at sqrt(sigma0 / m) = 316 rad/s. With 0.5 ms (0.16 rad) halving
the step moves no peak by more than 1e-4, no stick-slip number by more than 5e-4.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from campaign.physics.friction.lugre import FRICTION
from campaign.physics.step_function import Motion, single_step

VISCOUS, STIFFNESS = 0.4, 1e5
PARAMETERS = FRICTION.parameters(
    FRICTION.options.model_validate(
        {
            "model": "lugre",
            "coulomb_torque": 1.0,
            "static_torque": 1.5,
            "stribeck_velocity": 0.001,
            "viscous_friction": VISCOUS,
            "bristle_stiffness": STIFFNESS,
            "bristle_damping": float(np.sqrt(STIFFNESS)),
        },
        context={"si": True},
    )
)
STEP = 0.5e-3


def advance(state: np.ndarray, motion: Motion) -> tuple[float, float]:
    """Mean torque and its change over a step; the state is advanced."""
    return single_step(FRICTION.step, PARAMETERS, state, motion)


def slide(
    force: Callable[[float, float], float], duration: float, step: float = STEP
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A unit mass under force(t, x): midpoint times, friction (viscous too), and velocity.

    The pull enters by its value at the middle of the step, where its change is second order.
    """
    count = round(duration / step)
    friction, velocity = np.empty(count), np.empty(count)
    state = np.zeros(1)
    x = v = last = 0.0
    for k in range(count):
        pull = force((k + 0.5) * step, x + 0.5 * step * v)

        def velocity_after(torque: float, pull: float = pull, v: float = v) -> float:
            """Implicit midpoint for the viscous part."""
            half = 0.5 * step * VISCOUS
            return ((1 - half) * v + step * (pull - torque)) / (1 + half)

        mean, change = advance(state, Motion.at(v, velocity_after(last), step, compliance=step))
        last = mean + 0.5 * change
        new = velocity_after(mean)
        x += 0.5 * step * (v + new)
        friction[k] = mean + VISCOUS * 0.5 * (v + new)
        velocity[k] = 0.5 * (v + new)
        v = new
    return (np.arange(count) + 0.5) * step, friction, velocity


@pytest.mark.parametrize(
    ("rate", "peak"),
    [
        (0.1, 1.4852), (1.0, 1.4324), (2.0, 1.3944), (5.0, 1.3132), (10.0, 1.2200), (20.0, 1.0986),
        (50.0, 1.0075),
    ],
)  # fmt: skip
def test_break_away_force_falls_with_the_force_rate(rate: float, peak: float) -> None:
    """The peak before sliding; long after it viscous friction would exceed any of them."""
    _, friction, velocity = slide(lambda t, x: rate * t, 1.6 / rate)
    before = slice(0, int(np.argmax(velocity > 0.1)) or None)
    assert friction[before].max() == pytest.approx(peak, rel=1e-3)


def test_stick_slip() -> None:
    """A unit mass pulled through a spring of 2 N/m at 0.1 m/s."""
    stretch: list[float] = []

    def spring(t: float, x: float) -> float:
        stretch.append(2.0 * (0.1 * t - x))
        return stretch[-1]

    time, _, velocity = slide(spring, 22.0)
    fast = velocity > 0.02  # the speed at which 7.478 s was read off: 0.01 m/s says 7.458
    slips = time[1:][fast[1:] & ~fast[:-1]]
    assert slips[0] == pytest.approx(7.478, rel=2e-3)
    # The first slip starts from an unloaded spring, so periods are counted after it.
    assert np.diff(slips[1:]) == pytest.approx(6.3627, rel=2e-3)
    assert len(slips) == 3
    assert max(stretch) == pytest.approx(1.508, rel=2e-3)
    assert velocity.max() == pytest.approx(0.3698, rel=2e-3)


@pytest.mark.slow
def test_steady_sliding_is_the_stribeck_curve() -> None:
    """dz/dt = 0: T = s(v) sgn(v), whatever sigma1 and however long the step."""
    for step in (1e-3, 0.1):
        for v in (-0.01, 3e-4, 0.002, 5.0):
            state = np.zeros(1)
            for _ in range(20_000 if step < 0.01 else 400):
                line = advance(state, Motion.at(v, v, step))
            expected = np.sign(v) * (1.0 + 0.5 * np.exp(-((v / 0.001) ** 2)))
            assert line[0] == pytest.approx(expected, rel=1e-9)
            assert line[1] == pytest.approx(0.0, abs=1e-9)


def test_presliding_hysteresis_loses_no_bristle() -> None:
    """Slow and small: z follows x, so a displacement and back leaves almost no torque behind."""
    state = np.zeros(1)
    for v in [1e-5] * 100 + [-1e-5] * 100:  # 1e-7 m there and back; break-away is at 1.5e-5
        advance(state, Motion.at(v, v, 1e-4))
    assert abs(state[0]) < 0.01 * 1e-7 * STIFFNESS  # the state is the bristles' torque
