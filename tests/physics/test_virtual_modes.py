"""Tasks without a motor: a prescribed motion, a spring, and a force from outside."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from campaign.backends.sim import SimBackend, SimOptions
from campaign.physics.bench import Bench
from campaign.physics.steady_friction import steady_friction
from campaign.protocol.bench_file import load_bench
from campaign.recording import MemoryRecorder, Outcome, Recording
from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial
from tests.physics.benches import RATIO, Tree, bench, run, stribeck, task

# The paper's numbers, typed from it.
S0, S1, S2, FC, FS, VS = 1e5, math.sqrt(1e5), 0.4, 1.0, 1.5, 1e-3


def free(**extra: str) -> Bench:
    """One dry interface of 2 N m and 0.5 N m s/rad on 35 kg m^2."""

    def edit(tree: Tree) -> None:
        tree["friction"] = {"load": stribeck(2.0, 2.0, 0.5)}
        tree["limits"].update({"angle": "1e9 rad", "rate": "1e9 rad/s", **extra})

    return bench(edit)


def recorded(on: Bench, what: Task) -> Recording:
    recorder = MemoryRecorder()
    trial = Trial(number=1, test="t", kind="k", seed=1, bench=on.model_dump(mode="json"), task=what)
    ending = SimBackend(SimOptions()).execute(trial, recorder, lambda: False)
    assert ending.outcome is Outcome.COMPLETED
    return recorder.recording(ending)


def test_a_prescribed_rate_is_followed_exactly() -> None:
    swing = Sine(amplitude=0.2, frequency=0.5)
    what = task(mode="prescribed", command=swing, duration=2.0, start_angle=0.3)
    time, out = run(bench(), what)
    np.testing.assert_allclose(out["relative_rate"], 0.2 * np.sin(np.pi * time), atol=1e-12)
    angle = 0.3 + 0.2 / np.pi * (1 - np.cos(np.pi * time))
    np.testing.assert_allclose(out["relative_angle"], angle, atol=1e-8)
    assert not out["motor_current"].any()


def test_static_friction_at_a_prescribed_rate_is_its_curve_at_that_very_moment() -> None:
    """Not half a step before or after: friction that lags by 0.1 ms would make a loop."""
    what = task(mode="prescribed", command=Sine(amplitude=0.1, frequency=5.0, phase=0.3))
    time, out = run(free(), what)
    rate = 0.1 * np.sin(10 * np.pi * time + 0.3)
    clear = np.abs(rate) > 0.01
    expected = 2.0 * np.sign(rate) + 0.5 * rate
    np.testing.assert_allclose(out["friction_torque"][clear], expected[clear], rtol=1e-9)


def test_lugre_friction_at_a_prescribed_rate_solves_its_equation() -> None:
    frequency, amplitude = 2.0, 5 * VS

    def bristle(t: float, z: np.ndarray) -> np.ndarray:
        v = amplitude * np.sin(2 * np.pi * frequency * t)
        return np.asarray(v - S0 * abs(v) * z / (FC + (FS - FC) * np.exp(-((v / VS) ** 2))))

    swing = Sine(amplitude=amplitude, frequency=frequency)
    time, out = run(
        load_bench("specimen-lugre-1995"), task(mode="prescribed", command=swing), step=2e-5
    )
    solved = solve_ivp(
        bristle, (0, 1), [0.0], method="LSODA", rtol=1e-9, atol=1e-14, t_eval=time, max_step=1e-3
    )
    z = solved.y[0]
    v = swing.sample(time)
    dz = np.array([bristle(t, np.array(here)) for t, here in zip(time, z, strict=True)])
    torque = S0 * z + S1 * dz + S2 * v
    # Its peaks are 1.5 N m. The damping term changes by kinks, where v changes its sign.
    assert np.max(np.abs(out["friction_torque"] - torque)) < 2e-3


def test_compensation_is_driven_by_the_prescribed_rate_too() -> None:
    what = task(mode="prescribed", command=Sine(amplitude=0.1, frequency=1.0), compensation="lugre")
    _, out = run(bench(), what)
    np.testing.assert_allclose(out["compensation_torque"], out["friction_torque"], atol=1e-9)
    assert np.ptp(out["compensation_torque"]) > 60


def test_a_load_on_a_spring_swings_at_its_natural_frequency() -> None:
    def frictionless(tree: Tree) -> None:
        tree["friction"] = {}

    # Its far end stands 0.1 rad away: the load swings about it by that much.
    stiffness = 35.0 * (2 * np.pi) ** 2
    what = task(
        mode="spring",
        spring_stiffness=stiffness,
        command=Polyline(times=(0.0,), values=(0.1,)),
        duration=3.0,
    )
    time, out = run(bench(frictionless), what)
    expected = 0.1 * (1 - np.cos(2 * np.pi * time))
    np.testing.assert_allclose(out["relative_angle"], expected, atol=1e-9)
    assert not out["motor_current"].any()  # back-EMF drives none: there is no motor


def test_an_ideal_force_moves_a_free_load_against_its_friction() -> None:
    """10 N m on 2 N m of Coulomb and 0.5 N m s/rad of viscous friction."""
    what = task(mode="spring", disturbance=Polyline(times=(0.0,), values=(10.0,)), duration=5.0)
    time, out = run(free(), what)
    expected = (10.0 - 2.0) / 0.5 * (1 - np.exp(-0.5 / 35.0 * time))
    np.testing.assert_allclose(out["relative_rate"], expected, rtol=1e-6, atol=1e-9)
    held = task(mode="spring", disturbance=Polyline(times=(0.0,), values=(1.9,)), duration=1.0)
    _, out = run(free(), held)
    assert np.max(np.abs(out["relative_rate"])) < 1e-12
    np.testing.assert_allclose(out["friction_torque"][1:], 1.9, rtol=1e-9)


def test_the_backend_says_what_pulls_the_load() -> None:
    command = Polyline(times=(0.0, 1.0), values=(0.0, 0.05))
    pulled = recorded(free(), task(mode="spring", spring_stiffness=30.0, command=command))
    assert pulled.channels["command"].unit == "rad"
    np.testing.assert_allclose(pulled["drive_torque"], 30.0 * 0.05 * pulled.time, atol=1e-9)
    assert not pulled["motor_current"].any()
    moved = recorded(free(), task(mode="prescribed", command=Sine(amplitude=0.1, frequency=1.0)))
    assert moved.channels["command"].unit == "rad/s"
    assert not moved["drive_torque"].any()


def test_steady_friction_adds_up_at_the_load() -> None:
    rate = np.array([-0.02, 0.001, 0.5])
    dry, viscous = steady_friction(bench(), rate)
    fall = np.exp(-((rate / 0.03) ** 2))
    expected = 26 + 6 * fall + RATIO * (0.03 + 0.01 * fall)
    np.testing.assert_allclose(dry, np.sign(rate) * expected, rtol=1e-12)
    np.testing.assert_allclose(viscous, (4 + RATIO * 0.001) * rate, rtol=1e-12)
