"""The interface of a compensation: linear dynamics and friction models.

Every method here, and every combination of them, is built of the same two parts. A linear block
(an observer, a filter) reads what the controller can measure. Friction models run on the measured
relative rate. Both add to the torque command, so the engine needs to know no method by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from campaign.options import Options
from campaign.physics.friction.interface import FrictionOptions

Array = NDArray[np.float64]


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
    """A compensation method made ready for one bench.

    Attributes:
        linear: its linear dynamics, or None.
        friction: friction models whose output is added, each with its gain.
    """

    linear: LinearBlock | None = None
    friction: tuple[tuple[FrictionOptions, float], ...] = ()


@dataclass(frozen=True)
class CompensationMethod:
    """A compensation method.

    Attributes:
        name: what a bench's `method` says.
        options: its parameters; `method: Literal[name]` is one of them.
        build: the compensator, from validated options, inertia J (kg m^2) and gear ratio N.
    """

    name: str
    summary: str
    options: type[Options]
    build: Callable[[Any, float, float], Compensator]
