"""Single-state disturbance observer (Equations 5.1 to 5.3, Figure 5.16).

J' dw'/dt = Tm + N K0 (w - w'), and N K0 (w - w') is the estimate of the total disturbance torque: a
first-order low-pass of J dw/dt - Tm with corner N K0 / J'. K0 is a motor-side torque per rate, so
it counts N times at the load (Equation 5.2).
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from campaign.options import Options
from campaign.physics.compensation.interface import CompensationMethod, Compensator, LinearBlock
from campaign.units import Inertia, ObserverGain


class ObserverOptions(Options):
    """Parameters of the disturbance observer."""

    method: Literal["observer"]
    """Single-state disturbance observer."""
    gain: ObserverGain = Field(gt=0)
    """K0: motor-side torque per rate error; N K0 / J is the corner frequency (rad/s)."""
    inertia: Inertia | None = Field(default=None, gt=0)
    """J': the inertia that the observer assumes; absent: the bench's own."""


def _build(options: ObserverOptions, inertia: float, ratio: float) -> Compensator:
    gain = ratio * options.gain
    assumed = options.inertia or inertia
    # x is w'. The disturbance estimate N K0 (w - w') equals minus the friction, hence the sign.
    return Compensator(
        linear=LinearBlock(
            a=np.array([[-gain / assumed]]),
            b=np.array([[gain / assumed, 1.0 / assumed, 0.0]]),
            c=np.array([gain]),
            d=np.array([-gain, 0.0, 0.0]),
        )
    )


COMPENSATION = CompensationMethod(
    name="observer",
    summary="single-state disturbance observer (Equations 5.1 to 5.5)",
    options=ObserverOptions,
    build=_build,
)
