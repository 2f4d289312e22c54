"""Parallel Maxwell-slip elements: springs, each with its own slip torque.

They are listed as shares, or follow from a number N and a shape p: torques are equal, and element i
slips after a displacement in proportion to i^p. Their total stiffness and torque are those of the
model, so scatter and preload change these, and the shares are constant.
"""

from __future__ import annotations

from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from campaign.options import Options
from campaign.physics.friction.interface import Array

Share = Annotated[float, Field(gt=0, le=1)]
EXACT = 1e-6
"""Tolerance of the sum of shares, which is then scaled to 1."""


class ElementOptions(Options):
    """The elements of a model."""

    elements: int = Field(default=10, ge=1, le=50)
    """N: number of elements."""
    element_shape: float = Field(default=1.0, ge=0, le=10)
    """p: element i slips at a displacement proportional to i^p; with 0 all slip together."""
    torque_shares: tuple[Share, ...] = Field(default=(), max_length=50)
    """alpha: share of the torque of each element, instead of N and p; their sum is 1."""
    stiffness_shares: tuple[Share, ...] = Field(default=(), max_length=50)
    """Share of the stiffness of each element; as many as `torque_shares`."""

    def without_effect(self) -> frozenset[str]:
        """N and p where the shares are listed."""
        return frozenset(("elements", "element_shape") if self.torque_shares else ())

    @model_validator(mode="after")
    def _shares(self) -> Self:
        if len(self.torque_shares) != len(self.stiffness_shares):
            raise ValueError("torque_shares and stiffness_shares must be equally many")
        for name in ("torque_shares", "stiffness_shares"):
            total = sum(getattr(self, name))
            if self.torque_shares and abs(total - 1.0) > EXACT:
                raise ValueError(f"{name} sum up to {total:.9g}, and must to 1")
        return self


def count_of(options: ElementOptions) -> int:
    """Number N of elements."""
    return len(options.torque_shares) or options.elements


def shares_of(options: ElementOptions) -> tuple[Array, Array]:
    """Shares of torque and of stiffness, shape (N,) each; both sum up to 1."""
    if options.torque_shares:
        torques, stiffnesses = map(np.array, (options.torque_shares, options.stiffness_shares))
    else:
        torques = np.ones(options.elements)
        stiffnesses = np.arange(1.0, options.elements + 1.0) ** -options.element_shape
    return torques / np.sum(torques), stiffnesses / np.sum(stiffnesses)


def virgin_torque(options: Any, torque: float, stiffness: float, way: Array) -> Array:
    """Torque (N m) after a first displacement `way` (rad, >= 0), (n,); all slip at `torque`."""
    torques, stiffnesses = shares_of(options)
    bent = np.minimum(stiffness * np.outer(way, stiffnesses), torque * torques)
    return np.asarray(np.sum(bent, axis=1))
