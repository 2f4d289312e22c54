"""Bristles that snap: F = sum of sigma0 (x_i - b_i) (Eq. 2.3, 2.4, Figure 2.3).

D. A. Haessig and B. Friedland, *On the modeling and simulation of friction*, J. Dyn. Syst. Meas.
Control 113 (1991) 354. Each of N bristles is a spring from its bond b_i to the moving surface. At a
deflection of delta_s the bond snaps, and a new one forms in the direction of motion, at a random
distance from the old one:

    b_i + d sgn(x - b_i),    d uniform in (0, Delta),    Delta <= 2 delta_s

so that the new deflection is smaller. In long sliding, the displacement u to the next snap has the
density 2/Delta (1 - u/Delta). Hence the mean torque is N sigma0 (delta_s - Delta/3), and its
standard deviation Delta sigma0 sqrt(N/18), at any rate. While no bond snaps, the torque is elastic
with the stiffness N sigma0: from rest over delta_s, and after a reversal over at least
2 delta_s - Delta.

The paper states delta_s. Here it follows from the mean torque Tc, an option as in other models.

Scheme: exact. A bond depends only on the path: draw k of bristle i is the same with any samples.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field

from campaign.options import Options
from campaign.physics.specimens.interface import Array, Specimen
from campaign.units import RotationalStiffness, Torque

DRAWS = 64
"""Initial draws of each bristle; their number doubles when they are used up."""


class RandomBristleOptions(Options):
    """Parameters of the random bristle model."""

    model: Literal["random-bristle"]
    """Random bristles."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: mean torque of sliding."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """N sigma0: stiffness of all bristles together."""
    bristles: int = Field(default=25, ge=1, le=10_000)
    """N: number of bristles."""
    spacing: float = Field(default=1.0, ge=0.1, le=2)
    """Delta / delta_s: largest distance from the old bond to a new one, in deflections of a
    snap."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of the new bonds."""


def snap_deflection(options: RandomBristleOptions) -> float:
    """delta_s (rad): deflection at which a bond snaps."""
    return options.coulomb_torque / (options.bristle_stiffness * (1.0 - options.spacing / 3.0))


def _torque(options: RandomBristleOptions, time: Array, angle: Array) -> Array:
    most, count = snap_deflection(options), options.bristles
    random = np.random.default_rng(options.seed)
    draws = random.random((DRAWS, count))
    snaps, bonds = np.zeros(count, dtype=int), np.full(count, angle[0])
    total = np.empty(len(angle))
    for index, x in enumerate(angle):
        while (broken := np.flatnonzero(np.abs(x - bonds) > most)).size:
            if snaps[broken].max() >= len(draws):
                draws = np.vstack((draws, random.random(draws.shape)))
            further = options.spacing * most * draws[snaps[broken], broken]
            bonds[broken] += np.sign(x - bonds[broken]) * further
            snaps[broken] += 1
        total[index] = np.mean(x - bonds)
    return options.bristle_stiffness * total


def _steady_state(options: RandomBristleOptions, rates: Array) -> Array:
    return options.coulomb_torque * np.sign(rates)


SPECIMEN = Specimen(
    name="random-bristle",
    summary="springs that snap to random new bonds, a sum of N (Eq. 2.3, 2.4)",
    options=RandomBristleOptions,
    torque=_torque,
    steady_state=_steady_state,
)
