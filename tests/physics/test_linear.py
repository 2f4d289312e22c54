"""The linear part: against closed forms and scipy.signal."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.polynomial import polynomial
from scipy import signal

from campaign.physics.loop import discretise
from campaign.signals import Polyline, Sine
from tests.physics.benches import (
    DEG,
    INERTIA,
    KE,
    KIC,
    KIV,
    KPC,
    KPV,
    KT,
    RATIO,
    L,
    R,
    bench,
    run,
    stribeck,
    task,
)


def test_discretise_double_integrator_under_a_ramp() -> None:
    """x'' = u, u from u0 to u1: x1 = x0 + h v0 + h^2 (u0/2 + (u1 - u0)/6)."""
    h, x0, v0, u0, u1 = 0.3, 1.0, -2.0, 0.7, 1.9
    f, g, hh = discretise(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([[0.0], [1.0]]), h)
    x1, v1 = f @ [x0, v0] + g[:, 0] * u0 + hh[:, 0] * (u1 - u0)
    assert x1 == pytest.approx(x0 + h * v0 + h * h * (u0 / 2 + (u1 - u0) / 6), rel=1e-14)
    assert v1 == pytest.approx(v0 + h * (u0 + u1) / 2, rel=1e-14)


def test_discretise_agrees_with_scipys_first_order_hold() -> None:
    """scipy moves the state by H u to keep a standard form: the responses are what must agree."""
    random = np.random.default_rng(7)
    a = random.normal(size=(4, 4)) - 2 * np.eye(4)
    b, c, d = random.normal(size=(4, 2)), random.normal(size=(1, 4)), np.zeros((1, 2))
    u = random.normal(size=(50, 2))
    u[0] = 0.0
    f, g, h = discretise(a, b, 0.1)
    x, found = np.zeros(4), []
    for now, then in zip(u, np.vstack([u[1:], u[-1]]), strict=True):
        found.append(float((c @ x)[0]))
        x = f @ x + g @ now + h @ (then - now)
    fa, fb, fc, fd, _ = signal.cont2discrete((a, b, c, d), 0.1, method="foh")
    _, expected, _ = signal.dlsim((fa, fb, fc, fd, 0.1), u)
    np.testing.assert_allclose(found, expected[:, 0], rtol=1e-9, atol=1e-12)


def frictionless(tree: dict[str, dict[str, object]]) -> None:
    tree["friction"] = {}
    tree["compensation"] = {}


def characteristic(viscous: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Ascending polynomials of the rate loop, from its transfer functions by hand.

    With P = Kpc + Kic/s, C = 180/pi Kpv (1 + Kiv/s) and k = N Kt:
    w [(L s + R + P) (J s + B) / k + P C + Ke N] = P C r + [(L s + R + P) B / k + Ke N] wb,
    times s^2. Returned are that bracket and P C.
    """
    p = np.array([KIC, KPC])  # s P
    c = DEG * KPV * np.array([KIV, 1.0])  # s C
    impedance = np.array([KIC, R + KPC, L])  # s (L s + R + P)
    k = RATIO * KT
    pc = polynomial.polymul(p, c)
    plant = polynomial.polymul(impedance, np.array([viscous, INERTIA]) / k)
    left = polynomial.polyadd(polynomial.polymul(plant, [0, 1]), pc)
    return polynomial.polyadd(left, np.array([0.0, 0.0, KE * RATIO])), pc


@pytest.mark.parametrize("viscous", [0.0, 40.0])
def test_step_response(viscous: float) -> None:
    """A constant command is a straight line, so the engine is exact at any step."""

    def viscous_only(tree: dict[str, dict[str, object]]) -> None:
        frictionless(tree)
        if viscous:
            tree["friction"] = {"load": stribeck(0.0, 0.0, viscous)}

    left, pc = characteristic(viscous)
    time, found = run(
        bench(viscous_only), task(command=Polyline(times=(0.0,), values=(0.2,))), 1e-3
    )
    _, expected = signal.step(signal.lti(pc[::-1], left[::-1]), T=time)
    np.testing.assert_allclose(found["load_rate"], 0.2 * expected, atol=1e-9)


def test_base_motion_reaches_the_load_through_back_emf() -> None:
    """Steady response to a 2 Hz base rate, from the same transfer function."""
    left, _ = characteristic()
    s = 2j * np.pi * 2.0
    gain = KE * RATIO * s**2 / polynomial.polyval(s, left)
    swing = Sine(amplitude=1.0, frequency=2.0)
    time, found = run(bench(frictionless), task(base_acceleration=swing, duration=6.0))
    late = time >= 4.0
    base = 1.0 / (4 * np.pi)  # amplitude of the rate
    expected = -base * np.abs(gain) * np.cos(4 * np.pi * time[late] + np.angle(gain))
    np.testing.assert_allclose(found["load_rate"][late], expected, atol=1e-5 * base * abs(gain))


def test_parallel_rate_controller_is_another_loop() -> None:
    """Kiv stands alone: the same numbers in parallel form integrate three times more slowly."""

    def parallel(tree: dict[str, dict[str, object]]) -> None:
        frictionless(tree)
        tree["controller"]["rate"] = {
            "form": "parallel",
            "proportional": "3 A s/deg",
            "integral": "90 A/deg",
        }

    command = Polyline(times=(0.0,), values=(0.2,))
    _, ideal = run(bench(frictionless), task(command=command))
    _, same = run(bench(parallel), task(command=command))
    np.testing.assert_allclose(same["load_rate"], ideal["load_rate"], rtol=1e-12, atol=1e-15)


def test_torque_mode_delivers_the_commanded_torque() -> None:
    """Open loop on a frictionless axis: constant torque, constant acceleration T / J."""
    command = Polyline(times=(0.0,), values=(7.0,))
    time, found = run(bench(frictionless), task(mode="torque", command=command))
    late = time > 0.5
    slope = np.polyfit(time[late], found["load_rate"][late], 1)[0]
    # Back-EMF grows with the rate; the current integral follows it with a lag, the loss is
    # Ke N (T / J) / Kic amperes.
    lost = RATIO * KT * KE * RATIO * (7.0 / INERTIA) / KIC
    assert slope * INERTIA == pytest.approx(7.0 - lost, rel=2e-3)
    assert lost / 7.0 < 0.01
