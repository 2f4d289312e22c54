"""Loops with dry friction, each as a bench of the program and as the event-switched reference."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.signals import Signal, Sine, Zero
from tests.physics.benches import INERTIA, KPV, RATIO, Tree, bench, run, stribeck, task
from tests.physics.event_reference import (
    THESIS_DRY,
    Curve,
    Dry,
    DryLoop,
    Function,
    simulate_events,
    still,
)

STILL = Zero()
COMPARED = ("load_rate", "pointing_angle", "relative_angle", "motor_current", "friction_torque")


@dataclass(frozen=True)
class Case:
    """One loop, twice. `command` is that of the mode; `mode` and `compensation` as a task's.

    Outputs are compared after `settle` (s): what the thesis evaluates is the steady oscillation.
    """

    name: str
    bench: Bench
    reference: DryLoop
    duration: float
    base: Sine
    mode: Any = "rate"
    command: Signal = STILL
    compensation: str = "none"
    settle: float = 0.0

    def expected(self) -> dict[str, np.ndarray]:
        """By the reference, each millisecond."""
        return self.solved[0]

    @cached_property
    def solved(self) -> tuple[dict[str, np.ndarray], list[tuple[float, int]]]:
        """By the reference: values each millisecond, instants and directions of the regimes."""
        times = np.arange(round(self.duration * 1000)) * 1e-3
        return simulate_events(self.reference, times, max_step=2e-3)

    def found(self, step: float | None) -> dict[str, np.ndarray]:
        """By the engine, each millisecond, or each step where that is longer.

        A step of None is the one that the engine chooses.
        """
        on = task(
            mode=self.mode,
            compensation=self.compensation,
            duration=self.duration + 2e-3,
            sample_rate=1.0 / max(step or 0.0, 1e-3),
            command=self.command,
            base_acceleration=self.base,
            spring_stiffness=self.reference.spring or 0.0,
        )
        count = math.ceil(round(self.duration * 1000) * on.sample_rate / 1000 - 1e-9)
        return {name: values[:count] for name, values in run(self.bench, on, step)[1].items()}


def errors(case: Case, expected: dict[str, np.ndarray], step: float | None) -> dict[str, float]:
    """Error of each output, rms over rms; of the friction torque the median, as it jumps.

    `stabilization` is the relative error of the pointing angle's standard deviation.
    """
    found = case.found(step)
    every = max(1, round((step or 0.0) * 1000))
    first = round(case.settle * 1000) // every
    spread = float(np.std(expected["pointing_angle"][::every][first:]))
    result = {"stabilization": float(np.std(found["pointing_angle"][first:])) / spread - 1.0}
    for name in COMPARED:
        true = expected[name][::every][first:]
        off = found[name][first:] - true
        size = float(np.sqrt(np.mean(true**2))) or 1.0
        typical = np.median(np.abs(off)) if name == "friction_torque" else np.sqrt(np.mean(off**2))
        result[name] = float(typical) / size
    return result


def swing(sine: Sine) -> dict[str, Function]:
    """A base in steady sinusoidal motion: its rate and acceleration."""
    omega = 2 * math.pi * sine.frequency
    return {
        "base_rate": lambda t: -sine.amplitude / omega * math.cos(omega * t + sine.phase),
        "base_acceleration": function(sine),
    }


def function(sine: Sine) -> Function:
    """A sine over time."""
    return lambda t: sine.amplitude * math.sin(2 * math.pi * sine.frequency * t + sine.phase)


@cache
def thesis(
    compensation: str = "none", bristles: bool = False, periods: float = 3.0, low_pass: float = 0.0
) -> Case:
    """The appendix' loop on a base at 0.24 Hz and 18 deg/s^2, with Equation 4.6 as friction.

    With `bristles` the plant has the appendix' LuGre friction and only the compensation is dry.
    """

    def dry(tree: Tree) -> None:
        if not bristles:
            tree["friction"] = {
                "load": stribeck(32.0, 26.0, 4.0),
                "motor": stribeck(0.04, 0.03, 0.001, side="motor"),
            }
        tree["controller"]["relative_rate_filter"] = f"{low_pass!r} s"

    base = Sine(amplitude=math.radians(18.0), frequency=0.24)
    reference = DryLoop(
        compensation=THESIS_DRY if compensation == "static" else (),
        bristle_compensation=compensation == "lugre",
        observer=2000.0 * RATIO if compensation == "observer" else 0.0,
        low_pass=low_pass,
        bristles=bristles,
        **swing(base),  # type: ignore[arg-type]
    )
    name = f"{'LuGre' if bristles else 'dry'} plant, compensation {compensation}"
    name += f" behind {low_pass * 1e3:g} ms" if low_pass else ""
    return Case(
        name, bench(dry), reference, periods / 0.24, base,
        compensation=compensation, settle=1.0 / 0.24,
    )  # fmt: skip


def drawn(seed: int, duration: float = 4.0) -> Case:
    """One or two interfaces, inertia, gains, motion and command at random; rate, torque, spring."""
    random = np.random.default_rng(seed)
    uniform = random.uniform
    mode = ("rate", "torque", "spring")[seed % 3]
    inertia = math.exp(uniform(math.log(5.0), math.log(80.0)))
    proportional, integral = KPV * inertia / INERTIA * uniform(0.5, 1.5), uniform(10.0, 40.0)
    total, interfaces = uniform(5.0, 40.0), int(random.integers(1, 3))
    friction = tuple(
        Dry(*(_curve(random, total / interfaces) for _ in range(2))) for _ in range(interfaces)
    )
    base = Sine(amplitude=uniform(0.1, 0.6), frequency=uniform(0.2, 1.0), phase=uniform(0.0, 6.0))
    frequency, phase = uniform(0.2, 1.0), uniform(0.0, 6.0)
    amplitude = {"rate": 0.05, "torque": 1.8 * total, "spring": 0.3}[mode]
    command = Sine(amplitude=amplitude, frequency=frequency, phase=phase)
    drive = function(command)

    def edit(tree: Tree) -> None:
        tree["friction"] = {
            f"interface{k}": _interface(item, k > 0) for k, item in enumerate(friction)
        }
        tree["axis"]["inertia"] = f"{inertia!r} kg m^2"
        tree["controller"]["rate"].update(
            proportional=f"{proportional!r} A s/deg", integral=f"{integral!r} 1/s"
        )

    reference = DryLoop(
        friction=friction,
        command=still if mode == "torque" else drive,
        torque=drive if mode == "torque" else None,
        spring=inertia * uniform(3.0, 12.0) ** 2 if mode == "spring" else None,
        inertia=inertia,
        proportional=proportional,
        integral=integral,
        **swing(base),  # type: ignore[arg-type]
    )
    name = f"drawn {seed}, {mode}, {interfaces} interface(s)"
    return Case(name, bench(edit), reference, duration, base, mode, command)


def steep_rise() -> Case:
    """Ts half of Tc on a light load: h ds/dv / J reaches 2.1 at 1 ms."""
    inertia, proportional = 2.0, KPV * 2.0 / INERTIA
    curve = Curve(coulomb=20.0, static=10.0, velocity=0.002)
    friction = (Dry(curve, curve),)

    base = Sine(amplitude=0.3, frequency=0.5)
    command = Sine(amplitude=0.01, frequency=3.0 / (2 * math.pi))

    def edit(tree: Tree) -> None:
        tree["friction"] = {"interface": _interface(friction[0], on_motor=False)}
        tree["axis"]["inertia"] = f"{inertia!r} kg m^2"
        tree["controller"]["rate"].update(proportional=f"{proportional!r} A s/deg")

    reference = DryLoop(
        friction=friction,
        command=function(command),
        inertia=inertia,
        proportional=proportional,
        **swing(base),  # type: ignore[arg-type]
    )
    return Case("steep rise", bench(edit), reference, 3.0, base, command=command)


def _curve(random: np.random.Generator, torque: float) -> Curve:
    coulomb = torque * random.uniform(0.8, 1.2)
    return Curve(
        coulomb=coulomb,
        static=coulomb * random.uniform(0.8, 1.5),
        velocity=math.exp(random.uniform(math.log(0.005), math.log(0.1))),
        exponent=random.uniform(0.8, 2.5),
        viscous=random.uniform(0.0, 8.0),
    )


def _interface(item: Dry, on_motor: bool) -> dict[str, Any]:
    """As a bench file has it; on the motor's side its torques are N times smaller."""
    scale = RATIO if on_motor else 1.0

    def direction(curve: Curve) -> dict[str, Any]:
        return {
            "static_torque": f"{curve.static / scale!r} N m",
            "coulomb_torque": f"{curve.coulomb / scale!r} N m",
            "stribeck_velocity": f"{curve.velocity!r} rad/s",
            "stribeck_exponent": curve.exponent,
            "viscous_friction": f"{curve.viscous / scale!r} N m s/rad",
        }

    return {
        "model": "stribeck",
        "side": "motor" if on_motor else "load",
        **direction(item.forward),
        "negative": direction(item.backward),
    }
