"""True values of a simulated bench for findings.

Torques are those at the load, summed over the interfaces, at the mean of their ripple over
position, and with the preload and the scatter that the bench given has: `variation.of_its_day`,
`variation.as_it_is` make one of that day, of one trial.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.physics.friction.stribeck import in_direction
from campaign.physics.loop import at_load, viscous_at_load

DIRECTIONS = {"positive": +1.0, "negative": -1.0}
COULOMB = ("viscous_friction", "negative")
"""What every model of sliding friction has besides a Coulomb torque."""
SAME = 1e-9
"""Relative difference up to which two interfaces have the same Stribeck velocity."""


def true_value(bench: Bench, quantity: str, conditions: Mapping[str, Any]) -> float | None:
    """The true value (SI) of what a finding is about; None where it is no parameter of the bench.

    Args:
        quantity: as findings call it, e.g. `coulomb_torque`, `bristle_stiffness`.
        conditions: of the finding; `direction` is `positive`, `negative` or `nominal` (the mean of
            both), `exponent` says `2` where the Stribeck exponent was held there.
    """
    if conditions.get("component") is not None or conditions.get("statistic") not in (None, "mean"):
        return None  # of a part of the bench, or of the scatter of a number
    if quantity in _OF_ALL:
        return _OF_ALL[quantity](bench)
    if quantity not in _SLIDING:
        return None
    direction = str(conditions.get("direction", "nominal"))
    if direction == "nominal":
        both = [_sliding(bench, quantity, sign, conditions) for sign in DIRECTIONS.values()]
        found = [value for value in both if value is not None]
        return math.fsum(found) / 2.0 if len(found) == 2 else None
    if direction not in DIRECTIONS:
        return None
    return _sliding(bench, quantity, DIRECTIONS[direction], conditions)


def _sliding(
    bench: Bench, quantity: str, sign: float, conditions: Mapping[str, Any]
) -> float | None:
    """A parameter of the Stribeck curve of the whole bench, where it has such a curve."""
    values = stribeck_parameters(bench, sign)
    value = values.get(quantity)
    held = str(conditions.get("exponent", "free")) != "free"
    if not held or quantity == "stribeck_exponent":
        return None if held else value
    exponent = values.get("stribeck_exponent", math.nan)
    # With a wrong exponent the other parameters are those of the best wrong curve, not the bench's.
    return value if math.isclose(exponent, float(conditions["exponent"]), rel_tol=SAME) else None


_SLIDING = (
    "coulomb_torque",
    "static_torque",
    "viscous_friction",
    "stribeck_velocity",
    "stribeck_exponent",
)


def stribeck_parameters(bench: Bench, sign: float) -> dict[str, float]:
    """Tc, Ts (N m), sigma2 (N m s/rad), vs (rad/s) and delta of the whole bench in a direction.

    Torques of interfaces add up. Stribeck velocity and exponent are those that all interfaces with
    a Stribeck effect share; where they do not, their sum is no Stribeck curve, and both are absent.
    Empty for a bench with another model of friction, or with none.
    """
    sums = dict.fromkeys(("coulomb_torque", "static_torque", "viscous_friction"), 0.0)
    shapes: list[tuple[float, float]] = []
    for options in bench.friction.values():
        if not all(hasattr(options, name) for name in ("coulomb_torque", *COULOMB)):
            return {}
        torque, rate = at_load(options, bench)
        known = [name for name in _SLIDING if hasattr(options, name)]
        own = {name: in_direction(options, name, sign) for name in known}
        own.setdefault("static_torque", own["coulomb_torque"])
        sums["coulomb_torque"] += torque * own["coulomb_torque"]
        sums["static_torque"] += torque * own["static_torque"]
        sums["viscous_friction"] += torque * rate * own["viscous_friction"]
        if own["static_torque"] != own["coulomb_torque"]:
            # NaN, which equals nothing: of another curve than Stribeck's.
            velocity = own.get("stribeck_velocity", math.nan)
            shapes.append((velocity / rate, own.get("stribeck_exponent", math.nan)))
    if not bench.friction:
        return {}
    if shapes and all(_same(shape, shapes[0]) for shape in shapes):
        return {**sums, "stribeck_velocity": shapes[0][0], "stribeck_exponent": shapes[0][1]}
    return sums


def _same(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return all(math.isclose(a, b, rel_tol=SAME) for a, b in zip(one, other, strict=True))


def _bristles(bench: Bench) -> list[tuple[float, float]]:
    """Static torque (N m) and stiffness (N m/rad) of each interface that has bristles, at the load.

    Empty where an interface has friction without bristles, and so no stiffness to be found.
    """
    found = []
    for options in bench.friction.values():
        small_signal = friction_models()[options.model].small_signal
        stuck = None if small_signal is None else small_signal(options).stuck
        static = getattr(options, "static_torque", None)
        if stuck is None or static is None:
            return []
        torque, rate = at_load(options, bench)
        found.append((torque * static, torque * rate * stuck.stiffness))
    return found


def _stiffness(bench: Bench) -> float | None:
    """sigma0 of the interface that carries the largest torque (N m/rad)."""
    return max(_bristles(bench), default=(0.0, None))[1]


def _stiffness_at_rest(bench: Bench) -> float | None:
    """Slope of torque over angle where every interface sticks: the sum (N m/rad)."""
    bristles = _bristles(bench)
    return math.fsum(stiffness for _, stiffness in bristles) if bristles else None


def _damping_at_rest(bench: Bench) -> float | None:
    """Damping of small motions where every interface sticks: the sum of sigma1 and sigma2.

    Of a sigma2 that differs by direction its mean counts: half the difference makes |v|, an even
    function, which dampens nothing.
    """
    found = []
    for options in bench.friction.values():
        own = getattr(options, "bristle_damping", None)
        if own is None:
            return None
        torque, rate = at_load(options, bench)
        found.append(torque * rate * own + viscous_at_load(options, bench))
    return math.fsum(found) if found else None


_OF_ALL: dict[str, Callable[[Bench], float | None]] = {
    "bristle_stiffness": _stiffness,
    "stiffness_at_rest": _stiffness_at_rest,
    "damping_at_rest": _damping_at_rest,
    "inertia": lambda bench: bench.axis.inertia,
}


def true_of(bench: Bench, quantity: str) -> str:
    """Which part of a bench with several interfaces a true value is of; "" where it has one."""
    if len(bench.friction) < 2:
        return ""
    if quantity == "bristle_stiffness":
        found = dict(zip(bench.friction, _bristles(bench), strict=False))
        return f"friction.{max(found, key=lambda name: found[name])} alone" if found else ""
    interfaces = f"{len(bench.friction)} interfaces"
    if quantity in ("stiffness_at_rest", "damping_at_rest"):
        return f"the sum of {interfaces}, before any slips"
    if quantity in ("stribeck_velocity", "stribeck_exponent"):
        return f"each of {interfaces}"  # or there is none
    return f"the sum of {interfaces}" if quantity in _SLIDING else "the axis"


QUANTITIES = frozenset({*_OF_ALL, *_SLIDING})
"""Those of which a bench may have a true value."""
