"""True values of a simulated bench for findings.

Torques are at the load, summed over the interfaces, at the mean of the ripple over position. They
include the preload and scatter of the given bench: `variation.of_its_day` and `variation.as_it_is`
return the bench of a day and of one trial.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from campaign.physics.bench import Bench
from campaign.physics.friction import small_signal_of
from campaign.physics.friction.stribeck import in_direction
from campaign.physics.loop import viscous_at_load

DIRECTIONS = {"positive": +1.0, "negative": -1.0}
COULOMB = ("viscous_friction", "negative")
"""Options that every model of sliding friction has besides a Coulomb torque."""
SAME = 1e-9
"""Relative difference up to which two interfaces have the same Stribeck velocity."""


def true_value(bench: Bench, quantity: str, conditions: Mapping[str, Any]) -> float | None:
    """True value (SI) for a finding; None if its quantity is no parameter of the bench.

    Args:
        quantity: quantity of the finding, e.g. `coulomb_torque`, `bristle_stiffness`.
        conditions: of the finding; `direction` is `positive`, `negative` or `nominal` (the mean of
            both), `exponent` is `2` if the fit fixed the Stribeck exponent at 2.
    """
    if conditions.get("component") is not None or conditions.get("statistic") not in (None, "mean"):
        return None  # a part of the bench, or the scatter of a number
    if quantity in _OF_ALL:
        return _OF_ALL[quantity](bench)
    if quantity not in _SLIDING:
        return None
    direction = str(conditions.get("direction", "nominal"))
    if direction == "nominal":
        both = [_sliding(bench, quantity, sign, conditions) for sign in DIRECTIONS.values()]
        values = [value for value in both if value is not None]
        return math.fsum(values) / 2.0 if len(values) == 2 else None
    if direction not in DIRECTIONS:
        return None
    return _sliding(bench, quantity, DIRECTIONS[direction], conditions)


def _sliding(
    bench: Bench, quantity: str, sign: float, conditions: Mapping[str, Any]
) -> float | None:
    """Parameter of the Stribeck curve of the whole bench; None without such a curve."""
    values = stribeck_parameters(bench, sign)
    value = values.get(quantity)
    held = str(conditions.get("exponent", "free")) != "free"
    if not held or quantity == "stribeck_exponent":
        return None if held else value
    exponent = values.get("stribeck_exponent", math.nan)
    # A fit with a wrong exponent estimates the parameters of another curve, not of the bench.
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

    Torques of the interfaces add up. Stribeck velocity and exponent are absent if the interfaces
    with a Stribeck effect do not share them: the sum is then no Stribeck curve.
    Empty for a bench without friction, or with another friction model.
    """
    sums = dict.fromkeys(("coulomb_torque", "static_torque", "viscous_friction"), 0.0)
    shapes: list[tuple[float, float]] = []
    for options in bench.friction.values():
        if not all(hasattr(options, name) for name in ("coulomb_torque", *COULOMB)):
            return {}
        torque, rate = bench.at_load(options)
        known = [name for name in _SLIDING if hasattr(options, name)]
        own = {name: in_direction(options, name, sign) for name in known}
        own.setdefault("static_torque", own["coulomb_torque"])
        sums["coulomb_torque"] += torque * own["coulomb_torque"]
        sums["static_torque"] += torque * own["static_torque"]
        sums["viscous_friction"] += torque * rate * own["viscous_friction"]
        if own["static_torque"] != own["coulomb_torque"]:
            # NaN for a curve other than Stribeck's: it equals no other value.
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
    """Static torque (N m) and stiffness (N m/rad) of each interface with bristles, at the load.

    Empty if an interface has friction without bristles, because it has no stiffness.
    """
    bristles = []
    for options in bench.friction.values():
        stuck = small_signal_of(options).stuck
        static = getattr(options, "static_torque", None)
        if stuck is None or static is None:
            return []
        torque, rate = bench.at_load(options)
        bristles.append((torque * static, torque * rate * stuck.stiffness))
    return bristles


def _stiffness(bench: Bench) -> float | None:
    """sigma0 of the interface with the largest torque (N m/rad)."""
    return max(_bristles(bench), default=(0.0, None))[1]


def _stiffness_at_rest(bench: Bench) -> float | None:
    """Slope of torque over angle while all interfaces stick: sum of sigma0 (N m/rad)."""
    bristles = _bristles(bench)
    return math.fsum(stiffness for _, stiffness in bristles) if bristles else None


def _damping_at_rest(bench: Bench) -> float | None:
    """Damping of small motions while all interfaces stick: sum of sigma1 and sigma2.

    If sigma2 differs by direction, its mean counts: half the difference multiplies |v|, an even
    function, which does not damp.
    """
    dampings = []
    for options in bench.friction.values():
        own = getattr(options, "bristle_damping", None)
        if own is None:
            return None
        torque, rate = bench.at_load(options)
        dampings.append(torque * rate * own + viscous_at_load(options, bench))
    return math.fsum(dampings) if dampings else None


_OF_ALL: dict[str, Callable[[Bench], float | None]] = {
    "bristle_stiffness": _stiffness,
    "stiffness_at_rest": _stiffness_at_rest,
    "damping_at_rest": _damping_at_rest,
    "inertia": lambda bench: bench.axis.inertia,
}


def true_of(bench: Bench, quantity: str) -> str:
    """Part of a bench that a true value describes; "" with fewer than two interfaces."""
    if len(bench.friction) < 2:
        return ""
    if quantity == "bristle_stiffness":
        pairs = dict(zip(bench.friction, _bristles(bench), strict=False))
        return f"friction.{max(pairs, key=lambda name: pairs[name])} alone" if pairs else ""
    interfaces = f"{len(bench.friction)} interfaces"
    if quantity in ("stiffness_at_rest", "damping_at_rest"):
        return f"the sum of {interfaces}, before any slips"
    if quantity in ("stribeck_velocity", "stribeck_exponent"):
        return f"each of {interfaces}"  # otherwise no true value exists
    return f"the sum of {interfaces}" if quantity in _SLIDING else "the axis"


QUANTITIES = frozenset({*_OF_ALL, *_SLIDING})
"""Quantities for which a bench can have a true value."""
