"""The simulated plant below breakaway: an inertia on bristles, with an elastic part.

    J dv/dt = T - sum of (sigma0 z + sigma1 dz/dt) - sigma2 v,    dq/dt = v
    dz/dt = v - sigma0 |v| z / s(v),    s(v) = Ts (c + (1 - c) exp(-(|v| / vs)^delta)), c = Tc / Ts

LuGre friction (Canudas de Wit, Olsson, Astrom and Lischinsky, IEEE Trans. Autom. Control 40, 1995),
of one or several interfaces with a common angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Bristles:
    """One friction interface below breakaway.

    Attributes:
        stiffness: sigma0 (N m/rad).
        damping: sigma1 (N m s/rad).
        compliance: 1 / Ts (1/(N m)), yielding of the bristles; 0: linear spring.
        coulomb_share: c = Tc / Ts.
        stribeck_velocity: vs (rad/s); infinite: s does not depend on the rate.
        stribeck_exponent: delta.
    """

    stiffness: float
    damping: float
    compliance: float = 0.0
    coulomb_share: float = 1.0
    stribeck_velocity: float = np.inf
    stribeck_exponent: float = 2.0


@dataclass(frozen=True)
class Appendage:
    """An elastic part of the load, without a sensor.

    Attributes:
        inertia: of this part, included in that of the plant (kg m^2).
        frequency: natural frequency with a fixed load (Hz).
        damping_ratio: of this mode.
    """

    inertia: float
    frequency: float
    damping_ratio: float


@dataclass(frozen=True)
class Plant:
    """An axis below breakaway.

    Attributes:
        inertia: J, appendage included (kg m^2).
        bristles: its friction interfaces.
        viscous: sigma2 of all interfaces (N m s/rad).
        appendage: elastic part; None: without.
    """

    inertia: float
    bristles: tuple[Bristles, ...]
    viscous: float = 0.0
    appendage: Appendage | None = None

    @property
    def stiffness(self) -> float:
        """Stiffness of all bristles together (N m/rad)."""
        return sum(each.stiffness for each in self.bristles)

    @property
    def natural_frequency(self) -> float:
        """Natural frequency of the load on its bristles (Hz)."""
        return float(np.sqrt(self.stiffness / self.inertia) / (2.0 * np.pi))
