"""Whether a map's speeds reach as far as what is read of it: else Ts or Tc is extrapolated."""

from __future__ import annotations

import numpy as np

from campaign.identification.least_squares import Array

FEWEST_BELOW = 3
"""speeds below vs, for Ts not to be extrapolated."""
FAR = 3.0
"""times vs, where a twentieth of the fall from Ts is left (delta = 1): without a speed beyond that
Tc is extrapolated."""


def extrapolated(parameter: str, speed: Array, velocity: float) -> str:
    """Why a parameter is extrapolated; "" where it is not.

    speed: of the points (rad/s), shape (n,); velocity: the Stribeck velocity (rad/s).
    """
    below = int(np.sum(speed < velocity))
    if parameter == "static_torque" and below < FEWEST_BELOW:
        return f"Ts is extrapolated: {_speeds(below)} below vs"
    if parameter == "coulomb_torque" and not np.any(speed > FAR * velocity):
        return f"Tc is extrapolated: no speed is above {FAR:g} times vs"
    return ""


def _speeds(count: int) -> str:
    return "1 speed is" if count == 1 else f"{count or 'no'} speeds are"
