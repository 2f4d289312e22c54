"""The benches of the coverage tests: `platform`, and 40 that are unlike it.

Seeds were fixed before any result was looked at. What is stated of each has no friction, and an
inertia and a torque constant that are off by 20 % and 5 % (1 sigma), which it says.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench

SEED = 20261122
BENCHES = 41
"""`platform` is number 0."""
INERTIA_ERROR, TORQUE_CONSTANT_ERROR = 0.20, 0.05
"""Standard uncertainties of what is stated, relative to it; errors are drawn with them, up to twice
as large."""
DEG = math.pi / 180.0


@dataclass(frozen=True)
class Case:
    """A bench that is simulated, and what is known of it.

    Attributes:
        torque_ratio: true over stated N Kt: what a torque that was found has to be multiplied by.
        scale: sizes by which an engineer would choose speeds, ramps and amplitudes: rounded to one
            digit, as nobody knows them better before the test.
    """

    number: int
    truth: Bench
    stated: Bench
    scale: Scale

    @property
    def torque_ratio(self) -> float:
        return self.truth.torque_per_current / self.stated.torque_per_current

    @property
    def name(self) -> str:
        return self.truth.name


@dataclass(frozen=True)
class Scale:
    """Sizes of a bench, SI: of its friction, its Stribeck effect, its bristles, its loop."""

    torque: float
    velocity: float
    breakaway_angle: float
    bandwidth: float


def make_case(number: int) -> Case:
    """Bench `number`, the same whenever it is made."""
    random = np.random.default_rng([SEED, number])
    truth = load_bench("platform") if number == 0 else _random_bench(number, random)
    inertia = truth.axis.inertia * (1.0 + INERTIA_ERROR * _error(random))
    constant = truth.motor.torque_constant * (1.0 + TORQUE_CONSTANT_ERROR * _error(random))
    return Case(number, truth, _stated(truth, inertia, constant), _scale(truth))


def _error(random: np.random.Generator) -> float:
    """A standard normal number, but not beyond 2."""
    return float(np.clip(random.standard_normal(), -2.0, 2.0))


def _stated(truth: Bench, inertia: float, torque_constant: float) -> Bench:
    tree = truth.model_dump(mode="json")
    tree |= {"name": f"{truth.name}, as stated", "friction": {}, "variation": None}
    tree["axis"] |= {"inertia": inertia}
    tree["motor"] |= {"torque_constant": torque_constant}
    tree["gear"] |= {"preload": None}
    if "known" not in Bench.model_fields:  # it cannot say how well its values are known
        return Bench.model_validate(tree | {"given": [], "fitted": []}, context={"si": True})
    errors = {
        "axis.inertia": INERTIA_ERROR * inertia,
        "motor.torque_constant": TORQUE_CONSTANT_ERROR * torque_constant,
    }
    values = {path: {"standard_uncertainty": error} for path, error in errors.items()}
    tree["known"] = {"values": values}
    return Bench.model_validate(tree, context={"si": True})


def _scale(truth: Bench) -> Scale:
    interfaces: list[Any] = list(truth.friction.values())
    ratio = truth.gear.ratio
    torques = [(ratio if f.side == "motor" else 1.0) * f.static_torque for f in interfaces]
    softest = max(
        t / (f.bristle_stiffness * (ratio if f.side == "motor" else 1.0))
        for t, f in zip(torques, interfaces, strict=True)
    )
    rate = truth.controller.rate.proportional * truth.torque_per_current / truth.axis.inertia
    return Scale(
        _rounded(sum(torques)),
        _rounded(interfaces[0].stribeck_velocity),
        _rounded(softest),
        _rounded(rate / (2.0 * math.pi)),
    )


def _rounded(value: float) -> float:
    return float(f"{value:.0e}")


def _random_bench(number: int, random: np.random.Generator) -> Bench:
    """A sampled axis with LuGre friction; sizes are drawn relative to each other, so that it works.

    One in five has less static than Coulomb friction, two in five a second interface at the motor,
    one in five no asymmetry.
    """

    def spread(low: float, high: float) -> float:
        return float(10.0 ** random.uniform(math.log10(low), math.log10(high)))

    inertia, ratio = spread(0.01, 100.0), spread(1.0, 200.0)
    coulomb = inertia * spread(0.3, 3.0)
    below = random.random() < 0.2
    static = coulomb * (random.uniform(0.8, 0.95) if below else random.uniform(1.1, 1.6))
    velocity, exponent = spread(0.005, 0.06), random.uniform(0.7, 2.0)
    viscous = coulomb * random.uniform(0.1, 0.8) / (20.0 * velocity)
    stiffness = static / (spread(0.03, 0.3) * DEG)
    damping = 2.0 * random.uniform(0.2, 1.0) * math.sqrt(stiffness * inertia)
    symmetric = random.random() < 0.2
    factors = np.ones(5) if symmetric else 1.0 + random.uniform(-0.12, 0.12, 5)
    ripple = {
        "amplitude": random.uniform(0.0, 0.02),
        "periods": float(random.integers(20, 200)),
        "phase": random.uniform(0.0, 2.0 * math.pi),
    }
    names = (
        "coulomb_torque",
        "static_torque",
        "viscous_friction",
        "stribeck_velocity",
        "stribeck_exponent",
    )
    values = dict(zip(names, (coulomb, static, viscous, velocity, exponent), strict=True))
    own = values | {"bristle_stiffness": stiffness, "bristle_damping": damping}
    negative = {name: values[name] * f for name, f in zip(names, factors, strict=True)}
    share = random.uniform(0.1, 0.4) if random.random() < 0.4 else 0.0
    friction = {"load": _interface(own, negative, 1.0 - share) | {"ripple": ripple}}
    if share:
        stiff = own | {"bristle_stiffness": 8.0 * stiffness, "viscous_friction": 0.0}
        at_motor = {"side": "motor", "velocity": "load"}
        sliding = negative | {"viscous_friction": 0.0}
        friction["motor"] = _interface(stiff, sliding, share / ratio) | at_motor
    return Bench.model_validate(
        {
            "name": f"bench-{number:02d}",
            "axis": {"name": "axis", "inertia": inertia},
            "gear": {"ratio": ratio},
            "friction": friction,
            "variation": {
                "seed": number,
                "trial_to_trial": {
                    "torques": {
                        "paths": ["coulomb_torque", "static_torque"],
                        "relative": random.uniform(0.0, 0.004),
                    }
                },
            },
            **_drive(inertia, ratio, max(static, coulomb), random),
        },
        context={"si": True},
    )


_TORQUES = ("coulomb_torque", "static_torque", "viscous_friction")


def _interface(own: dict[str, float], negative: dict[str, float], share: float) -> dict[str, Any]:
    """One interface with its share of the torques; rates and shape are those of all."""
    scaled = (*_TORQUES, "bristle_stiffness", "bristle_damping")
    return {
        "model": "lugre",
        **{name: value * (share if name in scaled else 1.0) for name, value in own.items()},
        "negative": {
            name: value * (share if name in _TORQUES else 1.0) for name, value in negative.items()
        },
    }


def _drive(
    inertia: float, ratio: float, friction: float, random: np.random.Generator
) -> dict[str, Any]:
    """Motor, loops, sensors and limits that fit an axis of this inertia and friction."""
    strongest = 50.0 * friction
    constant = strongest / (20.0 * ratio)  # it has its strongest torque at 20 A
    omega = 2.0 * math.pi * 10.0 ** random.uniform(math.log10(4.0), 1.0)
    gain = omega * inertia / (ratio * constant)
    count = 2.0 * math.pi / 2.0 ** int(random.integers(10, 21))
    noise = 10.0 ** random.uniform(math.log10(0.002), math.log10(0.02)) * DEG
    return {
        "motor": {
            "torque_constant": constant,
            "back_emf_constant": 0.8 * constant,
            "resistance": 1.0,
            "inductance": 1e-3,
        },
        "controller": {
            "sample_rate": 1000.0,
            "delay": 0.5e-3,
            "relative_rate_filter": 3e-3,
            "rate": {"form": "parallel", "proportional": gain, "integral": gain * omega / 6.0},
            "current": {"form": "parallel", "proportional": 3.0, "integral": 3000.0},
        },
        "sensors": {
            "gyro": {"noise": noise, "resolution": 1e-4 * DEG},
            "encoder": {"resolution": count},
            "resolver": {"resolution": count},
            "current": {"noise": 0.002, "resolution": 0.001},
        },
        "limits": {
            "angle": 120.0 * DEG,
            "rate": 10.0,
            "acceleration": 0.7 * strongest / inertia,
            "torque": strongest,
            "current": 25.0,
            "duration": 900.0,
        },
    }
