"""Rigs of every size for `benchmarks.blind_rigs`, drawn by a text: as they are, and as stated.

A rig is two bench files, as an engineer writes them. The truth has the friction, ripple, scatter
and the constants that the motor has; what is stated has the inertia and the torque constant with
their errors, and of friction nothing or one rounded Coulomb torque, as a data sheet has it.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

INERTIA_ERROR, TORQUE_CONSTANT_ERROR = 0.10, 0.03
"""Standard uncertainties of what is stated, relative; errors are drawn with them, up to twice."""
UNITS = {
    "rotary": {"m": "rad", "J": "kg m^2", "T": "N m", "s": "N m s/rad", "k": "N m/rad"},
    "linear": {"m": "m", "J": "kg", "T": "N", "s": "N s/m", "k": "N/m"},
}
RATES = (200.0, 500.0, 1000.0, 2000.0, 5000.0, 10_000.0)
"""Sample rates of the controller (Hz)."""
Tree = dict[str, Any]


@dataclass(frozen=True)
class Rig:
    """A rig that was drawn.

    Attributes:
        facts: what it is like, for the list of draws.
        truth, stated: bench files as trees of text.
        offset: what its torque sensor shows at no torque (N m, or N).
    """

    number: int
    facts: dict[str, str | float]
    truth: Tree
    stated: Tree
    offset: float


class Draw:
    """Random numbers of one rig, by the text and its number."""

    def __init__(self, text: str, number: int) -> None:
        seed = hashlib.sha256(f"{text} {number}".encode()).digest()
        self.random = np.random.default_rng(list(seed))

    def log(self, low: float, high: float) -> float:
        """Uniform in the logarithm."""
        return float(math.exp(self.random.uniform(math.log(low), math.log(high))))

    def flat(self, low: float, high: float) -> float:
        return float(self.random.uniform(low, high))

    def happens(self, probability: float) -> bool:
        return bool(self.random.random() < probability)

    def error(self, deviation: float) -> float:
        """Normal, within two deviations."""
        return deviation * float(np.clip(self.random.standard_normal(), -2.0, 2.0))


def drawn(text: str, number: int) -> Rig:
    """Rig `number` of those that `text` draws; always the same."""
    draw = Draw(text, number)
    kind = "linear" if draw.happens(0.2) else "rotary"
    unit = UNITS[kind]
    inertia = draw.log(0.1, 1e3) if kind == "linear" else draw.log(1e-5, 1e3)
    # Small axes are fast: friction over inertia, and the Stribeck velocity, fall with the size.
    coulomb = inertia * inertia**-0.35 * draw.log(0.5, 5.0)
    velocity = 0.02 * inertia**-0.25 * draw.log(0.3, 3.0)
    shape, drop = _shape(draw)
    static = coulomb * drop
    model = "coulomb" if shape == "none" else "stribeck" if draw.happens(0.12) else "lugre"
    span = draw.log(2e-6, 1e-4) if kind == "linear" else math.radians(draw.log(0.02, 0.3))
    strongest = max(coulomb, static) * draw.log(3.0, 40.0)
    rate = velocity * draw.log(30.0, 500.0)
    # Its drive reaches the rate limit.
    viscous = min(coulomb * draw.log(0.02, 0.8) / (20.0 * velocity), 0.4 * strongest / rate)
    friction = _friction(draw, model, unit, (coulomb, static, velocity, viscous, span), inertia)
    ratio = 1.0 if draw.happens(0.5) else draw.log(2.0, 200.0)
    constant = strongest / (10.0 * ratio)
    control = RATES[int(draw.random.integers(len(RATES)))]
    feedback = "encoder" if draw.happens(0.4) else "gyro"
    loop = 2.0 * math.pi * min(draw.log(1.5, 20.0), control / 50.0)
    endless = kind == "rotary" and draw.happens(0.2)
    way = rate * draw.log(0.5, 10.0)
    count = 2.0 * math.pi / 2.0 ** int(draw.random.integers(12, 21))
    if kind == "linear":
        count = way * draw.log(1e-6, 1e-4)
    low_pass = max(2.0 / control, 0.05 / loop)
    # One count of the encoder makes the loop ask for a tenth of the torque, at most.
    quiet = 0.1 * strongest / (loop * inertia * control * -math.expm1(-1.0 / (control * low_pass)))
    count = min(count, quiet) if feedback == "encoder" else count
    gain = loop * inertia / (ratio * constant)
    noise = velocity * draw.log(1e-3, 0.1)
    controller = {
        "sample_rate": f"{control!r} Hz",
        "delay": f"{0.5 / control!r} s",
        "rate_feedback": feedback,
        "relative_rate_filter": f"{low_pass!r} s",
        "rate": {
            "form": "parallel",
            "proportional": f"{gain!r} A s/{unit['m']}",
            "integral": f"{gain * loop / draw.log(3.0, 12.0)!r} A/{unit['m']}",
        },
        "current": {"form": "parallel", "proportional": "3 V/A", "integral": "3000 V/(A s)"},
    }
    sensors = {
        "encoder": {"resolution": f"{count!r} {unit['m']}"},
        "current": {"noise": f"{10.0 * draw.log(3e-5, 3e-3)!r} A", "resolution": "0.5 mA"},
    }
    if feedback == "gyro":
        sensors["gyro"] = {"noise": f"{noise!r} {unit['m']}/s"}
    common = {
        "controller": controller,
        "sensors": sensors,
        "limits": {
            "angle": "unlimited" if endless else f"{_ends(way, kind)!r} {unit['m']}",
            "rate": f"{rate!r} {unit['m']}/s",
            "acceleration": f"{strongest / inertia * draw.log(0.4, 1.0)!r} {unit['m']}/s^2",
            "torque": f"{strongest!r} {unit['T']}",
            "current": "11 A",
            "duration": f"{draw.log(120.0, 900.0)!r} s",
        },
    }
    if ratio != 1.0:
        common["gear"] = {"ratio": ratio}
    offset = static * draw.flat(-0.1, 0.1) if draw.happens(0.25) else 0.0
    guess = draw.happens(0.5)
    stated = _stated(draw, inertia, constant, coulomb, unit, guess=guess)
    scatter = draw.flat(0.0, 0.005)
    truth = {
        "axis": {"inertia": f"{inertia!r} {unit['J']}"},
        "motor": _motor(constant, kind),
        "friction": friction,
    }
    if model != "coulomb":
        paths = ["coulomb_torque", "static_torque"]
        lines = {"torques": {"paths": paths, "relative": scatter}}
        truth["variation"] = {"seed": number, "trial_to_trial": lines}
    facts = {
        "kind": kind,
        "inertia": inertia,
        "Tc": coulomb,
        "Ts/Tc": drop,
        "Stribeck": shape,
        "vs": velocity,
        "model": model,
        "interfaces": len(friction),
        "ripple": friction["load"].get("ripple", {}).get("amplitude", 0.0),
        "control Hz": control,
        "feedback": feedback,
        "loop Hz": loop / (2.0 * math.pi),
        "count": count,
        "gyro noise": noise if feedback == "gyro" else 0.0,
        "ratio": ratio,
        "rate limit": rate,
        "angle limit": "unlimited" if endless else _ends(way, kind),
        "torque limit": strongest,
        "offset": offset,
        "scatter": scatter if model != "coulomb" else 0.0,
        "friction stated": "guess" if guess else "none",
    }
    head = {"name": f"rig-{number:03d}", "axis": {"name": "axis", "kind": kind}}
    return Rig(
        number,
        facts,
        _merged(head, truth, common),
        _merged(head, stated, {"motor": _motor(stated.pop("constant"), kind)}, common),
        offset,
    )


def _shape(draw: Draw) -> tuple[str, float]:
    """How strong the Stribeck effect is, and static over Coulomb friction."""
    what = draw.random.random()
    if what < 0.15:
        return "none", 1.0
    if what < 0.25:
        return "negative", draw.flat(0.8, 0.95)
    return ("weak", draw.flat(1.03, 1.12)) if what < 0.5 else ("strong", draw.flat(1.2, 1.8))


def _friction(
    draw: Draw, model: str, unit: Tree, sizes: tuple[float, ...], inertia: float
) -> dict[str, Tree]:
    """One interface, or two: the second is stiffer and carries a tenth to four tenths."""
    coulomb, static, velocity, viscous, span = sizes
    exponent = draw.flat(0.7, 2.0)
    damping = 2.0 * draw.flat(0.2, 1.0) * math.sqrt(static / span * inertia)
    ways = [1.0 + draw.flat(-0.12, 0.12) for _ in range(3)] if draw.happens(0.8) else [1.0] * 3
    share = draw.flat(0.1, 0.4) if model == "lugre" and draw.happens(0.4) else 0.0
    ripple = {"amplitude": draw.flat(0.0, 0.03), "periods": float(draw.random.integers(1, 200))}

    def interface(part: float, stiffer: float, *, slides: bool) -> Tree:
        made: Tree = {
            "model": model,
            "coulomb_torque": f"{part * coulomb!r} {unit['T']}",
            "viscous_friction": f"{(viscous if slides else 0.0)!r} {unit['s']}",
        }
        other = {
            "coulomb_torque": f"{part * coulomb * ways[0]!r} {unit['T']}",
            "viscous_friction": f"{(viscous * ways[2] if slides else 0.0)!r} {unit['s']}",
        }
        if model != "coulomb":
            made |= {
                "static_torque": f"{part * static!r} {unit['T']}",
                "stribeck_velocity": f"{velocity!r} {unit['m']}/s",
                "stribeck_exponent": exponent,
            }
            other["static_torque"] = f"{part * static * ways[0]!r} {unit['T']}"
            other["stribeck_velocity"] = f"{velocity * ways[1]!r} {unit['m']}/s"
        if model == "lugre":
            made["bristle_stiffness"] = f"{stiffer * part * static / span!r} {unit['k']}"
            made["bristle_damping"] = f"{part * damping!r} {unit['s']}"
        return made | {"negative": other}

    found = {"load": interface(1.0 - share, 1.0, slides=True)}
    if draw.happens(0.6):
        found["load"]["ripple"] = ripple
    if share:
        found["second"] = interface(share, 8.0, slides=False)
    return found


def _ends(way: float, kind: str) -> float:
    """Limit of angle or position: within three quarters of a turn where it has one."""
    return min(way, 1.5 * math.pi) if kind == "rotary" else way


def _motor(constant: float, kind: str) -> Tree:
    moved = "rad" if kind == "rotary" else "m"
    torque = "N m" if kind == "rotary" else "N"
    return {
        "torque_constant": f"{constant!r} {torque}/A",
        "back_emf_constant": f"{0.8 * constant!r} V s/{moved}",
        "resistance": "1 ohm",
        "inductance": "1 mH",
    }


def _stated(
    draw: Draw, inertia: float, constant: float, coulomb: float, unit: Tree, *, guess: bool
) -> Tree:
    """What is known beforehand, and how well."""
    inertia *= 1.0 + draw.error(INERTIA_ERROR)
    constant *= 1.0 + draw.error(TORQUE_CONSTANT_ERROR)
    about = float(f"{coulomb * draw.log(0.7, 1.4):.0e}")
    sheet = {"model": "coulomb", "coulomb_torque": f"{about!r} {unit['T']}"}
    return {
        "axis": {"inertia": f"{inertia!r} {unit['J']}"},
        "constant": constant,
        "friction": {"load": sheet} if guess else {},
        "known": {
            "values": {
                "axis.inertia": {"standard_uncertainty": f"{100 * INERTIA_ERROR:g} %"},
                "motor.torque_constant": {
                    "standard_uncertainty": f"{100 * TORQUE_CONSTANT_ERROR:g} %"
                },
            }
        },
    }


def _merged(*trees: Tree) -> Tree:
    found: Tree = {}
    for tree in trees:
        for key, value in tree.items():
            both = isinstance(value, dict) and isinstance(found.get(key), dict)
            found[key] = _merged(found[key], value) if both else value
    return found
