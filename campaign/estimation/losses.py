"""Robust losses, as in `scipy.optimize.least_squares`.

Residuals are in standard deviations: at about one the robust losses begin to curb them.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from campaign.arrays import Array

Loss = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]


def cost(loss: Loss, residuals: Array) -> float:
    """Half the sum of the losses: what a fit makes smallest. ValueError for an unknown loss."""
    z = residuals**2
    match loss:
        case "linear":
            rho = z
        case "soft_l1":
            rho = 2 * (np.sqrt(1 + z) - 1)
        case "huber":
            rho = np.where(z <= 1, z, 2 * np.sqrt(z) - 1)
        case "cauchy":
            rho = np.log1p(z)
        case "arctan":
            rho = np.arctan(z)
        case _:
            raise ValueError(f"no loss is called {loss!r}")
    return 0.5 * float(np.sum(rho))


def weights(loss: Loss, residuals: Array) -> Array:
    """Derivative of each loss by its squared residual, 1 where that counts in full; shape (n,)."""
    z = residuals**2
    match loss:
        case "linear":
            return np.ones_like(z)
        case "soft_l1":
            return np.asarray(1 / np.sqrt(1 + z))
        case "huber":
            return np.where(z <= 1, 1.0, 1 / np.sqrt(np.maximum(z, 1.0)))
        case "cauchy":
            return 1 / (1 + z)
        case "arctan":
            return 1 / (1 + z**2)
        case _:
            raise ValueError(f"no loss is called {loss!r}")
