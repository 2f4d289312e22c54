"""Torque over angle below breakaway in closed form, and its inverse.

For slow sliding, s(v) is Ts and the bristle equation dz/dq = 1 - sigma0 z / Ts has a closed form:
T = Tb (1 - exp(-sigma0 q / Tb)). The curves of parallel interfaces add. Each interface slips at its
own torque, so that the slope decreases in steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from campaign.arrays import Array

STEPS = 100
"""Most Newton steps; usually about five."""


class Interface(NamedTuple):
    """One sticking interface: initial stiffness (N m/rad), slip torque (N m)."""

    stiffness: float
    torque: float


def presliding_torque(angle: Array, interfaces: Sequence[Interface]) -> Array:
    """Sum of Tb (1 - exp(-sigma0 q / Tb)) at angles q (rad), shape (n,), in N m."""
    total = np.zeros_like(angle)
    for stiffness, limit in interfaces:
        total -= limit * np.expm1(-stiffness * angle / limit)
    return total


def presliding_stiffness(angle: Array, interfaces: Sequence[Interface]) -> Array:
    """Slope of the curve at angles q (rad), shape (n,), in N m/rad."""
    total = np.zeros_like(angle)
    for stiffness, limit in interfaces:
        total += stiffness * np.exp(-stiffness * angle / limit)
    return total


def presliding_angle(torque: Array, interfaces: Sequence[Interface]) -> Array:
    """Angle (rad) at torques from 0 to below the sum of the slip torques, shape (n,)."""
    if len(interfaces) == 1:
        ((stiffness, limit),) = interfaces
        return np.asarray(-limit / stiffness * np.log1p(-torque / limit))
    # The curve is concave: from below, Newton's steps never exceed the solution.
    angle = torque / sum(stiffness for stiffness, _ in interfaces)
    for _ in range(STEPS):
        missing = torque - presliding_torque(angle, interfaces)
        step = missing / presliding_stiffness(angle, interfaces)
        angle = angle + step
        if (np.abs(step) <= 1e-11 * angle).all():
            break
    return np.asarray(angle)


def angle_derivatives(angle: Array, interfaces: Sequence[Interface]) -> Array:
    """Derivatives of the angle at a torque by the parameters, shape (n, 2 interfaces).

    Columns: stiffness of the first interface, its slip torque, stiffness of the second ... By the
    implicit function theorem: dq/dp = -(dT/dp) / (dT/dq).
    """
    columns = []
    for stiffness, limit in interfaces:
        bent = stiffness * angle / limit
        left = np.exp(-bent)
        columns += [angle * left, 1.0 - left * (1.0 + bent)]
    slope = presliding_stiffness(angle, interfaces)
    return np.asarray(-np.stack(columns, axis=1) / slope[:, None])
