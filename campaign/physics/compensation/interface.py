"""The interface of a compensation: linear dynamics and friction models.

Every method, and every combination of methods, consists of two parts. A linear block (an observer,
a filter) reads the measurements of the controller. Friction models use the measured relative rate.
Both add to the torque command, so the engine knows no method by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from campaign.arrays import Array
from campaign.options import Options
from campaign.physics.friction.interface import FrictionOptions


@dataclass(frozen=True)
class LinearBlock:
    """dx/dt = A x + B y, torque = C x + D y, with y = (gyro rate, motor torque, relative rate).

    Units: rad/s, N m at the load, rad/s; the torque is N m at the load. Shapes: A (n, n),
    B (n, 3), C (n,), D (3,).
    """

    a: Array
    b: Array
    c: Array
    d: Array


@dataclass(frozen=True)
class Compensator:
    """A compensation method prepared for one bench.

    Attributes:
        linear: its linear dynamics, or None.
        friction: friction models, each with its gain; their torques add up.
    """

    linear: LinearBlock | None = None
    friction: tuple[tuple[FrictionOptions, float], ...] = ()


@dataclass(frozen=True)
class CompensationMethod:
    """A compensation method.

    Attributes:
        name: value of a bench's `method`.
        options: its parameters, among them `method: Literal[name]`.
        build: returns the compensator from validated options, inertia J (kg m^2), gear ratio N.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Any, float, float], Compensator]
