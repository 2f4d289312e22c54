"""Random benches with a continuous controller and a trial for each: what an engine is judged by.

Ordinary ones are what a laboratory might have: contacts of 3 to 60 Hz, loops tuned for the inertia.
Extreme ones are stiff or hardly damped: contacts of 30 Hz to 3 kHz, damping ratios of 0 to 10, and
loads that never break away. The frequency of a contact is sqrt(sum of sigma0 / J) / 2 pi and its
damping ratio sum of sigma1 / (2 sqrt(J sum of sigma0)), both at the load.

Every choice comes from the seed. A bench whose loop is unstable, stuck or sliding, is drawn again.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.signals import MultiSine, Polyline, Sine
from campaign.trial import Task
from tests.physics.bench_equations import poles
from tests.physics.benches import Tree

DURATION = 5.0
SAMPLE_RATE = 1000.0
WIDE = {
    "angle": "1e4 rad",
    "rate": "1e4 rad/s",
    "acceleration": "1e6 rad/s^2",
    "torque": "1e7 N m",
    "current": "1e7 A",
    "duration": "1 h",
}
SLOWEST_GROWTH = 1e-3
"""1/s; a pole that grows slower than this stands still."""


class Draw:
    """Random numbers of one seed."""

    def __init__(self, *seed: int) -> None:
        self.random = np.random.Generator(np.random.PCG64(seed))

    def log(self, low: float, high: float) -> float:
        """Between low and high, every decade as likely as the next."""
        return float(math.exp(self.random.uniform(math.log(low), math.log(high))))

    def flat(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def one_of(self, *items: Any) -> Any:
        return items[int(self.random.integers(len(items)))]

    def chance(self, probability: float) -> bool:
        return bool(self.random.random() < probability)


def random_bench(seed: int, extreme: bool) -> tuple[Bench, Task]:
    """A bench and a trial of 5 s, recorded at 1 kHz."""
    for attempt in range(100):
        draw = Draw(int(extreme), seed, attempt)
        tree = _bench_tree(draw, extreme)
        bench = Bench.model_validate(tree)
        task = _task(draw, bench, stuck=extreme and seed % 5 == 0)
        growth = max(float(np.max(poles(bench, task, stuck=stuck).real)) for stuck in (True, False))
        if growth < SLOWEST_GROWTH:
            return bench, task
    raise ArithmeticError(f"seed {seed}: no stable bench")


def _bench_tree(draw: Draw, extreme: bool) -> Tree:
    """A bench as a file has it."""
    inertia, ratio = draw.log(0.005, 100.0), draw.log(1.0, 200.0)
    rate_loop = 2 * math.pi * draw.log(5.0, 40.0)
    friction = _interfaces(draw, inertia, ratio, extreme)
    tree = {
        "name": "random",
        "axis": {"name": "any", "inertia": f"{inertia!r} kg m^2"},
        "gear": {"ratio": ratio},
        "friction": friction,
        **_drive(draw, inertia, ratio, rate_loop),
        "compensation": _compensations(draw, friction, inertia, ratio, rate_loop),
        "limits": WIDE,
    }
    if draw.chance(0.25):
        tree["appendage"] = {
            "inertia": f"{inertia * draw.flat(0.01, 0.2)!r} kg m^2",
            "frequency": f"{draw.log(5.0, 80.0)!r} Hz",
            "damping_ratio": draw.log(0.005, 0.1),
        }
    return tree


def _drive(draw: Draw, inertia: float, ratio: float, rate_loop: float) -> Tree:
    """Motor and controller; `rate_loop` is the bandwidth of the rate loop (rad/s).

    The motor fits the inertia: its mechanical time constant J R / (N^2 Kt Ke) is 5 to 100 ms, as
    that of the thesis' is 39 ms. The current controller cancels its electrical pole, which leaves
    a loop of first order, 200 to 800 Hz.
    """
    current_loop = 2 * math.pi * draw.log(200.0, 800.0)
    resistance, electrical = draw.log(0.05, 5.0), draw.log(0.5e-3, 10e-3)
    inductance = resistance * electrical
    mechanical, emf_per_torque = draw.log(5e-3, 0.1), draw.flat(0.5, 1.0)
    torque_constant = math.sqrt(inertia * resistance / (mechanical * emf_per_torque)) / ratio
    controller = {
        "current": {
            "form": "parallel",
            "proportional": f"{current_loop * inductance!r} V/A",
            "integral": f"{current_loop * resistance!r} V/(A s)",
        },
        "rate": {
            "form": "ideal",
            "proportional": f"{rate_loop * inertia / (ratio * torque_constant)!r} A s/rad",
            "integral": f"{rate_loop * draw.flat(0.05, 0.3)!r} 1/s",
        },
    }
    if draw.chance(0.2):
        controller["relative_rate_filter"] = f"{draw.log(0.2e-3, 3e-3)!r} s"
    if draw.chance(0.2):
        controller["pointing_high_pass"] = "0.3 Hz"
    motor = {
        "torque_constant": f"{torque_constant!r} N m/A",
        "back_emf_constant": f"{emf_per_torque * torque_constant!r} V s/rad",
        "resistance": f"{resistance!r} ohm",
        "inductance": f"{inductance!r} H",
    }
    return {"motor": motor, "controller": controller}


def _interfaces(draw: Draw, inertia: float, ratio: float, extreme: bool) -> Tree:
    """One to three LuGre interfaces, which share torque, stiffness and damping of the contact."""
    frequency = draw.log(30.0, 3000.0) if extreme else draw.log(3.0, 60.0)
    damping_ratio = draw.log(0.01, 10.0) if extreme else draw.log(0.1, 2.0)
    if extreme and draw.chance(0.2):
        damping_ratio = 0.0
    stiffness = inertia * (2 * math.pi * frequency) ** 2
    damping = 2 * damping_ratio * math.sqrt(inertia * stiffness)
    torque = inertia * draw.log(0.1, 10.0)
    stribeck_velocity = draw.log(0.003, 0.1)
    count = draw.one_of(1, 1, 2, 3)
    shares = np.array([[draw.flat(0.2, 1.0) for _ in range(count)] for _ in range(3)])
    shares /= shares.sum(axis=1, keepdims=True)
    viscous = draw.log(0.01, 1.0) * torque  # N m at 1 rad/s
    interfaces: Tree = {}
    for k, (of_torque, of_stiffness, of_damping) in enumerate(shares.T):
        motor = draw.chance(0.4)
        fast = motor and draw.chance(0.5)  # driven by the rate of the motor
        t, v = (ratio if motor else 1.0), (ratio if fast else 1.0)
        static = float(torque * of_torque / t)
        coulomb = static * draw.flat(0.5, 1.0)
        entry: Tree = {
            "model": "lugre",
            "static_torque": f"{static!r} N m",
            "coulomb_torque": f"{coulomb!r} N m",
            "stribeck_velocity": f"{stribeck_velocity * v * draw.flat(0.5, 2.0)!r} rad/s",
            "stribeck_exponent": draw.one_of(2.0, 2.0, draw.flat(0.5, 2.5)),
            "viscous_friction": f"{float(viscous / count / t / v)!r} N m s/rad",
            "bristle_stiffness": f"{float(stiffness * of_stiffness / t / v)!r} N m/rad",
            "bristle_damping": f"{float(damping * of_damping / t / v)!r} N m s/rad",
        }
        if motor:
            entry["side"] = "motor"
        if fast:
            entry["velocity"] = "motor"
        if draw.chance(0.3):
            entry["negative"] = {
                "static_torque": f"{static * draw.flat(0.8, 1.25)!r} N m",
                "coulomb_torque": f"{coulomb * draw.flat(0.8, 1.25)!r} N m",
                "stribeck_velocity": f"{stribeck_velocity * v * draw.flat(0.5, 2.0)!r} rad/s",
            }
        elif draw.chance(0.15):
            entry["ripple"] = {
                "amplitude": draw.flat(0.005, 0.1),
                "periods": float(round(draw.log(3.0, 200.0))),
                "phase": f"{draw.flat(0.0, 6.28)!r} rad",
            }
        interfaces[f"interface_{k}"] = entry
    return interfaces


def _scaled(value: str, factor: float) -> str:
    number, unit = value.split(" ", 1)
    return f"{float(number) * factor!r} {unit}"


def _compensations(
    draw: Draw, friction: Tree, inertia: float, ratio: float, rate_loop: float
) -> Tree:
    """Every method tuned for the bench; the models know the friction exactly, or nearly."""
    exact = draw.chance(0.5)
    torque, bristles = (1.0, 1.0) if exact else (draw.flat(0.8, 1.05), draw.flat(0.6, 1.05))
    of_bristles = ("bristle_stiffness", "bristle_damping")
    models: Tree = {}
    static: Tree = {}
    for name, entry in friction.items():
        model = {key: value for key, value in entry.items() if key != "negative"}
        model["negative"] = dict(entry.get("negative", {}))
        for part in (model, model["negative"]):
            for key in ("static_torque", "coulomb_torque"):
                if key in part:
                    part[key] = _scaled(part[key], torque)
        for key in of_bristles:
            model[key] = _scaled(model[key], bristles)
        models[name] = model
        static[name] = {key: value for key, value in model.items() if key not in of_bristles} | {
            "model": "stribeck",
            "sign_smoothing": _scaled(entry["stribeck_velocity"], draw.log(0.1, 1.0)),
        }
    return {
        "lugre": {"method": "friction-model", "friction": models},
        "static": {"method": "friction-model", "friction": static, "gain": draw.flat(0.3, 0.9)},
        # Its corner is N K0 / J.
        "observer": {
            "gain": f"{rate_loop * draw.log(0.5, 5.0) * inertia / ratio!r} N m s/rad",
            "inertia": f"{inertia * draw.flat(0.8, 1.2)!r} kg m^2",
        },
    }


def _task(draw: Draw, bench: Bench, stuck: bool) -> Task:
    """A swinging hull, a commanded rate, or a torque: through breakaway, or never reaching it."""
    static = sum(
        options.static_torque * (bench.gear.ratio if options.side == "motor" else 1.0)
        for options in bench.friction.values()
    )
    fastest = draw.log(0.01, 1.0)  # rad/s
    fields: Tree = {"mode": "rate"}
    if stuck:
        # Well below what holds in the weaker direction too.
        command = Sine(amplitude=static * draw.flat(0.05, 0.4), frequency=draw.log(0.2, 5.0))
        return _lasting(mode="torque", command=command)
    if draw.chance(0.15):
        peak = static * draw.flat(1.2, 2.0)
        ramps = Polyline(times=(0.0, 2.0, 3.0, 5.0), values=(0.0, peak, -0.5 * peak, 0.3 * peak))
        fields = {"mode": "torque", "command": ramps}
    else:
        fields["compensation"] = draw.one_of("none", "none", "lugre", "lugre", "static", "observer")
        fields |= draw.one_of(_swing, _swing, _sea, _commanded)(draw, fastest)
    if draw.chance(0.3):
        amplitude = static * draw.flat(0.1, 0.5)
        fields["disturbance"] = Sine(amplitude=amplitude, frequency=draw.log(0.5, 20.0))
    return _lasting(**fields)


def _lasting(**fields: Any) -> Task:
    return Task(**fields, duration=DURATION, window=(0.0, DURATION), sample_rate=SAMPLE_RATE)


def _swing(draw: Draw, fastest: float) -> Tree:
    """One sine; under way when the trial begins, or starting from rest."""
    frequency = draw.log(0.1, 5.0)
    phase = draw.one_of(0.5 * math.pi, draw.flat(0.0, 2 * math.pi))
    amplitude = fastest * 2 * math.pi * frequency
    return {"base_acceleration": Sine(amplitude=amplitude, frequency=frequency, phase=phase)}


def _sea(draw: Draw, fastest: float) -> Tree:
    count = int(draw.one_of(3, 5, 10))
    frequencies = tuple(draw.log(0.1, 1.0) for _ in range(count))
    sea = MultiSine(
        amplitudes=tuple(fastest / math.sqrt(count) * 2 * math.pi * f for f in frequencies),
        frequencies=frequencies,
        phases=tuple(draw.flat(0.0, 2 * math.pi) for _ in range(count)),
    )
    return {"base_acceleration": sea}


def _commanded(draw: Draw, fastest: float) -> Tree:
    return {"command": Sine(amplitude=fastest, frequency=draw.log(0.1, 5.0))}
