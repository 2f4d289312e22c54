"""Rigs unlike the shipped ones, for excitations: any size, rotary or linear, each from its seed.

One inertia with LuGre friction behind a gear or a screw, a PI rate loop of some 6 to 20 Hz sampled
at 4 kHz, and sensors with noise. Friction is told as a share of the torque that the rig has.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from functools import partial

from campaign.physics.bench import Bench
from tests.physics.random_benches import Draw, Tree

ROTARY = {
    "inertia": "kg m^2", "force": "N m", "rate": "rad/s", "stiffness": "N m/rad",
    "damping": "N m s/rad", "angle": "rad", "acceleration": "rad/s^2", "gain": "A s/rad",
}  # fmt: skip
LINEAR = {
    "inertia": "kg", "force": "N", "rate": "m/s", "stiffness": "N/m",
    "damping": "N s/m", "angle": "m", "acceleration": "m/s^2", "gain": "A s/m",
}  # fmt: skip


def excited_rig(
    seed: int,
    *,
    linear: bool,
    friction: tuple[float, float] = (0.01, 0.08),
    alike: bool = True,
    appendage: bool = False,
) -> Bench:
    """A rig of that seed.

    Args:
        friction: Coulomb friction, from and to, over the torque that reaches the rate limit within
            a tenth of a second.
        alike: whether friction is the same both ways.
        appendage: whether something elastic hangs on the load.
    """
    draw, of = Draw(seed, 15), LINEAR if linear else ROTARY
    inertia = draw.log(2.0, 200.0) if linear else draw.log(0.01, 500.0)
    rate = draw.log(0.3, 1.0) if linear else draw.log(1.0, 6.0)
    torque = inertia * rate / 0.1
    coulomb = torque * draw.log(*friction)
    reach = rate * draw.log(2e-4, 2e-3)  # of a bristle before it slips
    stiffness = coulomb / reach
    damping = 2.0 * draw.log(0.1, 1.0) * math.sqrt(stiffness * inertia)
    loop = 2.0 * math.pi * draw.log(6.0, 20.0)
    ratio = 2.0 * math.pi / 0.01 if linear else draw.log(1.0, 100.0)
    motor = torque / ratio / 8.0  # N m/A: 8 A for that torque
    resistance = 1.0
    current = 2.0 * math.pi * 400.0
    inductance = resistance * 2e-3

    def told(value: float, unit: str) -> str:
        return f"{value!r} {of[unit]}"

    load: Tree = {
        "model": "lugre",
        "static_torque": told(coulomb * draw.log(1.0, 1.4), "force"),
        "coulomb_torque": told(coulomb, "force"),
        "stribeck_velocity": told(rate * draw.log(0.005, 0.03), "rate"),
        "viscous_friction": told(coulomb / rate * draw.log(0.2, 2.0), "damping"),
        "bristle_stiffness": told(stiffness, "stiffness"),
        "bristle_damping": told(damping, "damping"),
    }
    if not alike:
        other = coulomb * draw.log(0.7, 0.9)
        load["negative"] = {
            "static_torque": told(other * 1.2, "force"),
            "coulomb_torque": told(other, "force"),
        }
    axis: Tree = {"name": "axis", "inertia": told(inertia, "inertia")}
    hung: Tree = {
        "inertia": told(inertia * draw.log(0.02, 0.2), "inertia"),
        "frequency": f"{draw.log(8.0, 20.0)!r} Hz",
        "damping_ratio": draw.log(0.01, 0.04),
    }
    return Bench.model_validate(
        {
            **({"appendage": hung} if appendage else {}),
            "name": f"excited {seed}",
            "axis": {**axis, "kind": "linear"} if linear else axis,
            "motor": {
                "torque_constant": f"{motor!r} N m/A",
                "back_emf_constant": f"{motor!r} V s/rad",
                "resistance": f"{resistance!r} ohm",
                "inductance": f"{inductance!r} H",
            },
            "gear": {"lead": "10 mm/rev"} if linear else {"ratio": ratio},
            "friction": {"load": load},
            "controller": {
                "sample_rate": "4 kHz",
                "delay": "0.1 ms",
                "rate": {
                    "form": "ideal",
                    "proportional": told(loop * inertia / (ratio * motor), "gain"),
                    "integral": f"{0.2 * loop!r} 1/s",
                },
                "current": {
                    "form": "parallel",
                    "proportional": f"{current * inductance!r} V/A",
                    "integral": f"{current * resistance!r} V/(A s)",
                },
            },
            "sensors": {
                "gyro": {
                    "noise": told(rate * draw.log(1e-5, 3e-4), "rate"),
                    "resolution": told(rate * 1e-6, "rate"),
                },
                "encoder": {"resolution": told(rate * draw.log(1e-6, 3e-5), "angle")},
                "current": {"noise": f"{draw.log(5e-4, 1e-2)!r} A", "resolution": "1 mA"},
            },
            "limits": {
                "angle": told(20.0 * rate, "angle"),
                "rate": told(rate, "rate"),
                "acceleration": told(100.0 * rate, "acceleration"),
                "torque": told(5.0 * torque, "force"),
                "current": "40 A",
                "duration": "10 min",
            },
        }
    )


THREE: Mapping[str, Callable[[], Bench]] = {
    "a turntable": partial(excited_rig, 11, linear=False),
    "a turntable that rubs less one way": partial(excited_rig, 12, linear=False, alike=False),
    "a carriage": partial(excited_rig, 13, linear=True),
}
"""Rotary and linear, of other inertia, friction and noise than the shipped benches."""
