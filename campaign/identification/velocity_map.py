"""Static friction parameters from a friction-velocity map (Equation 4.6)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from campaign.identification.least_squares import Array, Fit, Parameter, fit

PARAMETERS = (
    "viscous_friction",
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "stribeck_exponent",
)
UNITS = {
    "viscous_friction": "N m s/rad",
    "coulomb_torque": "N m",
    "static_torque": "N m",
    "stribeck_velocity": "rad/s",
    "stribeck_exponent": "",
}


def stribeck(speed: Array, values: Mapping[str, float]) -> Array:
    """Friction torque (N m) of steady sliding at `speed` >= 0 (rad/s), shape (n,)."""
    fall = np.exp(-((speed / values["stribeck_velocity"]) ** values["stribeck_exponent"]))
    drop = values["static_torque"] - values["coulomb_torque"]
    return np.asarray(values["coulomb_torque"] + drop * fall + values["viscous_friction"] * speed)


def fit_stribeck(speed: Array, torque: Array, exponent: float | None = None) -> Fit:
    """Fit Equation 4.6 to one direction of a map: `speed` > 0 (rad/s), `torque` > 0 (N m), (n,).

    `exponent` fixes delta (2 for the LuGre model); None fits it too. Ts is not forced above Tc,
    because real axes with Ts < Tc exist.  Raises ValueError for fewer points than parameters.
    """
    if len(speed) < len(PARAMETERS):
        raise ValueError(f"{len(speed)} points are too few for {len(PARAMETERS)} parameters")
    low, high = float(torque.min()), float(torque.max())
    slope = max((high - low) / float(np.ptp(speed) or 1.0), 1e-9)
    first = float(torque[np.argmin(speed)])
    parameters = [
        Parameter("viscous_friction", 0.0, 100.0 * slope + 1.0, (slope,)),
        Parameter("coulomb_torque", 0.0, 10.0 * high, (low,)),
        Parameter("static_torque", 0.0, 10.0 * high, (first,)),
        Parameter(
            "stribeck_velocity",
            0.1 * float(speed.min()),
            10.0 * float(speed.max()),
            tuple(np.geomspace(3.0 * float(speed.min()), 0.3 * float(speed.max()), 4)),
        ),
    ]
    if exponent is None:
        parameters.append(Parameter("stribeck_exponent", 0.2, 5.0, (1.0, 2.0)))
        return _doubting(fit(stribeck, speed, torque, parameters))
    fixed = {"stribeck_exponent": exponent}
    found = fit(lambda v, values: stribeck(v, {**values, **fixed}), speed, torque, parameters)
    return _doubting(
        replace(
            found,
            values={**found.values, **fixed},
            errors={**found.errors, "stribeck_exponent": 0.0},
        )
    )


def _doubting(found: Fit) -> Fit:
    """The fit, with a doubt where the map is too flat to show a Stribeck effect."""
    drop = abs(found.values["static_torque"] - found.values["coulomb_torque"])
    error = float(np.hypot(found.errors["static_torque"], found.errors["coulomb_torque"]))
    if drop >= 2.0 * error:  # an undetermined torque (NaN) is a doubt too
        return found
    doubt = "static_torque and coulomb_torque are the same within their errors: no Stribeck effect"
    return replace(
        found,
        doubts=(*found.doubts, f"{doubt} shows, and stribeck_velocity is not determined"),
    )
