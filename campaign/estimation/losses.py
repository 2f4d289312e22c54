"""Robust losses, as in `scipy.optimize.least_squares`.

Residuals are in standard deviations; robust losses reduce the weight of those above about one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

import numpy as np

from campaign.arrays import Array

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]
Curve = Callable[[Array], Array]
CURVES: Mapping[str, tuple[Curve, Curve]] = {
    "linear": (lambda z: z, np.ones_like),
    "soft_l1": (lambda z: 2 * (np.sqrt(1 + z) - 1), lambda z: 1 / np.sqrt(1 + z)),
    "huber": (
        lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
        lambda z: np.where(z <= 1, 1.0, 1 / np.sqrt(np.maximum(z, 1.0))),
    ),
    "cauchy": (np.log1p, lambda z: 1 / (1 + z)),
    "arctan": (np.arctan, lambda z: 1 / (1 + z**2)),
}
"""Loss of a squared residual, and its derivative, by name."""


def cost(loss: Loss, residuals: Array) -> float:
    """Half the sum of the losses, which a fit minimizes."""
    return 0.5 * float(np.sum(CURVES[loss][0](residuals**2)))


def weights(loss: Loss, residuals: Array) -> Array:
    """Derivative of each loss by its squared residual, shape (n,); 1 is full weight."""
    return np.asarray(CURVES[loss][1](residuals**2))
