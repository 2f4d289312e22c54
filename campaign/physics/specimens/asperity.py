"""Asperities that stick and slip on spots whose adhesion grows with time (Eq. 2.1 to 2.6).

F. Al-Bender, V. Lampaert and J. Swevers, *A novel generic model at asperity level for dry friction
force dynamics*, Tribology Letters 16 (2004) 81. An asperity of the moving surface meets spots of a
fixed one (Figures 2.4, 2.5). On a spot

    Fn = kn zeta,  Ft = kt xi        normal and tangential force (Eq. 2.5, 2.6)
    |Ft| <= mu(t) Fn                 it sticks below, and slips at it (second Eq. 2.6)

with the time t since the asperity touched the spot. At the end of the spot it loses the energy of
xi, and is free up to the next one. Torques of all contacts add up. The friction of rested contacts
is mu(inf) times the load (Eq. 2.1, 2.2).

**Caution.** Equation 2.6 is printed twice, with errors: read Ft = kt xi and F_mu = mu Fn. The print
has no mu(t); here creep is exponential, the simplest law with a limit:

    mu(t) = mu(inf) - (mu(inf) - mu(0)) exp(-t/tau)

Only products of mu and Fn matter: Ts is mu(inf) and Tc mu(0) times the mean load. Here the tip has
no mass, and zeta is constant on a spot (exponential over spots: J. A. Greenwood and J. B. P.
Williamson, Proc. R. Soc. A 295 (1966) 300). Spots have one length l and are l apart. tau = l/vs:
at vs, the duration of a contact is that of the creep. With A(t) = Ts - (Ts - Tc) exp(-t/tau), the
expected torque is

    mean of A(t) (1 - exp(-sigma0 u / A(t)))     over u = 0 to l, t = u/v

in sliding at the rate v, and Ts (1 - exp(-sigma0 x / Ts)) from rest: Dahl's curve.

Scheme: exact for an angle that is a straight line in each step. As mu is concave in time, an
asperity that slips in a step of one direction slips to its end.
"""

from __future__ import annotations

from typing import Literal, Self

import numpy as np
from pydantic import Field, model_validator

from campaign.options import Options
from campaign.physics.specimens.interface import Array, Specimen
from campaign.units import AngularRate, RotationalStiffness, Torque

SPOTS = 64
"""Period of the fixed surface, in spots."""
PITCH = 2.0
"""Distance of spots in lengths of a spot: half of the asperities are in contact."""
POINTS = 64
"""Number of points of the quadrature for the steady state."""


class AsperityOptions(Options):
    """Parameters of the generic asperity model."""

    model: Literal["asperity"]
    """Generic asperity model."""
    coulomb_torque: Torque = Field(gt=0)
    """Tc: torque that all contacts hold when new."""
    static_torque: Torque = Field(gt=0)
    """Ts: torque that all contacts hold after a long rest; at least Tc."""
    stribeck_velocity: AngularRate = Field(gt=0)
    """vs: rate at which the contact time equals the creep time."""
    bristle_stiffness: RotationalStiffness = Field(gt=0)
    """sigma0: tangential stiffness of all contacts together."""
    asperities: int = Field(default=2000, ge=1, le=100_000)
    """Number of asperities; half of them are in contact."""
    spot_length: float = Field(default=20.0, gt=0, le=1000)
    """Length of a spot, in deflections Ts / sigma0."""
    seed: int = Field(default=1, ge=0, lt=2**63)
    """Seed of the places and heights of spots."""

    @model_validator(mode="after")
    def _creep_adds(self) -> Self:
        if self.static_torque < self.coulomb_torque:
            raise ValueError("static_torque must be no less than coulomb_torque: adhesion grows")
        return self


def length_of(options: AsperityOptions) -> float:
    """Length l of a spot (rad)."""
    return options.spot_length * options.static_torque / options.bristle_stiffness


def surface(options: AsperityOptions) -> tuple[Array, Array]:
    """Position of each asperity in its pitch at angle 0 (rad), shape (n,), and heights zeta.

    The heights have the mean 1, shape (SPOTS, n).
    """
    random, count = np.random.default_rng(options.seed), options.asperities
    places = PITCH * length_of(options) * random.random(count)
    return places, -np.log1p(-random.random((SPOTS, count)))


def _torque(options: AsperityOptions, time: Array, angle: Array) -> Array:
    length, count = length_of(options), options.asperities
    creep = length / options.stribeck_velocity
    places, heights = surface(options)
    each, zero = np.arange(count), np.zeros(count)
    # xi, and (mu(inf) - mu) / (mu(inf) - mu(0)): initially rested.
    xi, lacking, total = zero, zero, np.zeros(len(angle))
    spot, into = np.divmod(angle[0] + places, PITCH * length)
    touches = into < length
    grown = options.static_torque - options.coulomb_torque
    for index, (moved, lasted) in enumerate(zip(np.diff(angle), np.diff(time), strict=True), 1):
        before, touched = spot, touches
        spot, into = np.divmod(angle[index] + places, PITCH * length)
        touches = into < length
        new = touches & (~touched | (spot != before))
        since = np.where(new, into if moved > 0.0 else length - into, abs(moved))
        share = since / abs(moved) if moved else 1.0
        lacking = np.where(new, 1.0, lacking) * np.exp(-share * lasted / creep)
        xi = np.where(new, 0.0, xi) + np.sign(moved) * since
        height = heights[spot.astype(int) % SPOTS, each]
        most = height * (options.static_torque - grown * lacking) / options.bristle_stiffness
        xi = np.where(touches, np.clip(xi, -most, most), 0.0)
        total[index] = np.sum(xi)
    return options.bristle_stiffness * PITCH / count * total


def _steady_state(options: AsperityOptions, rates: Array) -> Array:
    nodes, weights = np.polynomial.legendre.leggauss(POINTS)
    path, weights = 0.5 * (1.0 + nodes), 0.5 * weights
    slow = options.stribeck_velocity / np.maximum(np.abs(rates), 1e-300)
    grown = options.static_torque - options.coulomb_torque
    holds = options.static_torque - grown * np.exp(-np.multiply.outer(slow, path))
    bent = options.bristle_stiffness * length_of(options) * path / holds
    return np.sign(rates) * ((-np.expm1(-bent) * holds) @ weights)


SPECIMEN = Specimen(
    name="asperity",
    summary="contacts that stick, creep, slip and break, a sum of N (Eq. 2.1 to 2.6)",
    options=AsperityOptions,
    torque=_torque,
    steady_state=_steady_state,
)
