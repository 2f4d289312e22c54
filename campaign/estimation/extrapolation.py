"""Whether the speeds of a map suffice to read Ts and Tc without extrapolation."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array
from campaign.reason import NONE, Cause, Reason

FEWEST_BELOW = 3
"""speeds below vs, for Ts not to be extrapolated."""
FAR = 3.0
"""times vs, where a twentieth of the fall from Ts is left (delta = 1): without a speed beyond that
Tc is extrapolated."""
EXTRAPOLATED = Cause("extrapolated", "{symbol} is extrapolated: {why}")
FEW_BELOW = Cause("too few speeds below vs", "{counted} below vs")
NONE_ABOVE = Cause("no speed far above vs", "no speed is above {times:g} times vs")


def extrapolated(parameter: str, speed: Array, velocity: float) -> Reason:
    """Why a parameter is extrapolated; none where it is not.

    speed: of the points (rad/s), shape (n,); velocity: the Stribeck velocity (rad/s).
    """
    below = int(np.sum(speed < velocity))
    if parameter == "static_torque" and below < FEWEST_BELOW:
        return EXTRAPOLATED(symbol="Ts", why=FEW_BELOW(counted=_speeds(below), speeds=below))
    if parameter == "coulomb_torque" and not np.any(speed > FAR * velocity):
        return EXTRAPOLATED(symbol="Tc", why=NONE_ABOVE(times=FAR))
    return NONE


def _speeds(count: int) -> str:
    return "1 speed is" if count == 1 else f"{count or 'no'} speeds are"
