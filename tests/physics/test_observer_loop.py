"""Equations 5.4 and 5.5 with a PI: against the printed forms, and against the simulated loop."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.sine_amplitude import amplitude
from campaign.physics import observer_loop as theory
from campaign.physics.bench import Bench
from campaign.signals import Sine
from tests.physics.benches import INERTIA, KT, RATIO, bench, run, task

FREQUENCY = np.geomspace(0.05, 50.0, 40)


def linear(integral: str = "30 1/s", **controller: object) -> Bench:
    """The simulink bench without friction and back-EMF, with an observer of 2 Hz."""

    def edit(tree):
        tree["friction"] = {}
        tree["motor"]["back_emf_constant"] = "0 V s/rad"
        tree["compensation"] = {"observer": {"gain": f"{4 * np.pi * INERTIA / RATIO} N m s/rad"}}
        tree["controller"]["rate"]["integral"] = integral
        tree["controller"] |= controller

    return bench(edit)


def test_the_printed_equations_with_a_constant_controller() -> None:
    """Ki = 0: G_cv = N Kt Kp; both factors of 5.4 and both terms of 5.5 typed from print."""
    on = linear(integral="0 1/s")
    gcv = RATIO * KT * on.controller.rate.proportional
    s, corner = 2j * np.pi * FREQUENCY, 2 * np.pi * 2.0
    printed_54 = (1 / INERTIA) / (s + gcv / INERTIA) * s / (s + corner)
    printed_55 = -(gcv / INERTIA) / (s + gcv / INERTIA) - corner / (s + corner) * s / (
        s + gcv / INERTIA
    )
    np.testing.assert_allclose(theory.rejection(on, 2.0, None, FREQUENCY), printed_54, rtol=1e-12)
    np.testing.assert_allclose(
        theory.noise_coupling(on, 2.0, None, FREQUENCY), printed_55, rtol=1e-12
    )


def test_without_observer_and_with_an_inertia_of_its_own() -> None:
    """The observer of a wrong inertia, solved as two simultaneous equations at each frequency."""
    on, assumed = linear(), 20.0
    for corner in (0.0, 3.0):
        for f in (0.3, 4.0):
            s, a = 2j * np.pi * f, 2 * np.pi * corner
            g = RATIO * KT * (on.controller.rate.proportional * (1 + 30 / s))
            # unknowns: w, Tm, T'; disturbance 1 N m:  J s w = Tm + 1,  Tm = -G w - T',
            # (s + a) T' = a (J' s w - Tm)
            matrix = np.array(
                [[INERTIA * s, -1, 0], [g, 1, 1], [-a * assumed * s, a, s + a]], dtype=complex
            )
            expected = np.linalg.solve(matrix, np.array([1.0, 0.0, 0.0]))[0]
            found = theory.rejection(on, corner, assumed, np.array([f]))[0]
            assert found == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("name", ["none", "observer"])
@pytest.mark.parametrize("frequency", [0.5, 2.0, 8.0])
def test_the_simulated_loop_rejects_as_equation_5_4_says(name: str, frequency: float) -> None:
    """Within 2 %: the current loop, which the equation leaves out, is a hundred times faster."""
    disturbance = Sine(amplitude=5.0, frequency=frequency)
    stop = 2.0 + 4 / frequency
    time, out = run(linear(), task(compensation=name, disturbance=disturbance, duration=stop))
    late = time >= 2.0
    rate = amplitude("rate", time[late], out["load_rate"][late], frequency, "rad/s")
    measured = rate.value / 5.0
    corner = 2.0 if name == "observer" else 0.0
    expected = abs(theory.rejection(linear(), corner, None, np.array([frequency]))[0])
    assert measured == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("name", ["none", "observer"])
def test_the_gyro_s_noise_reaches_the_load_as_equation_5_5_says(name: str) -> None:
    """On a loop sampled at 10 kHz, where the delay of a sample hardly counts: within 5 %."""

    def sampled() -> Bench:
        on = linear(sample_rate="10 kHz")
        gyro = on.sensors.gyro.model_copy(update={"noise": 1e-3})
        return on.model_copy(update={"sensors": on.sensors.model_copy(update={"gyro": gyro})})

    on = sampled()
    time, out = run(on, task(compensation=name, duration=40.0), step=1e-4)
    measured = float(np.std(out["load_rate"][time >= 2.0]))
    expected = theory.noise_rate(on, 2.0 if name == "observer" else 0.0, None)
    assert measured == pytest.approx(expected, rel=0.05)


def test_noise_of_a_first_order_loop_in_closed_form() -> None:
    """Ki = 0, no observer: sigma sqrt(g T / 2) for a corner g far below the sampling."""
    on = linear(integral="0 1/s", sample_rate="10 kHz")
    gyro = on.sensors.gyro.model_copy(update={"noise": 1e-3})
    on = on.model_copy(update={"sensors": on.sensors.model_copy(update={"gyro": gyro})})
    corner = RATIO * KT * on.controller.rate.proportional / INERTIA
    expected = 1e-3 * np.sqrt(corner * 1e-4 / 2)
    assert theory.noise_rate(on, 0.0, None) == pytest.approx(expected, rel=5e-3)
    assert theory.noise_rate(linear(), 0.0, None) == 0.0  # continuous: no noise


def test_gain_and_corner_are_one_another_s_inverse() -> None:
    """K0 = 2000 N m s/rad at the motor is 141.176 * 2000 / 35 = 8067 rad/s."""
    corner = theory.corner_frequency(bench(), 2000.0)
    assert 2 * np.pi * corner == pytest.approx(8067.2, rel=1e-5)
    assert theory.gain_for(bench(), corner) == pytest.approx(2000.0)
