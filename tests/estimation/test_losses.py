"""The losses against scipy's own, and their slopes against differences."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from campaign.estimation.losses import Loss, cost, weights


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy", "arctan"])
def test_losses_are_scipys(loss: Loss) -> None:
    residuals = np.array([0.0, -0.3, 0.9, 1.1, -4.0, 60.0])
    solution = least_squares(lambda x: residuals + 0 * x[0], [1.0], loss=loss, max_nfev=1)
    assert cost(loss, residuals) == pytest.approx(solution.cost, rel=1e-12)


@pytest.mark.parametrize("loss", ["linear", "soft_l1", "huber", "cauchy", "arctan"])
def test_weights_are_the_slopes_of_the_losses(loss: Loss) -> None:
    for r in (0.3, 0.9, 1.1, 4.0):
        z, h = r * r, 1e-6
        above, below = (2 * cost(loss, np.array([math.sqrt(z + d)])) for d in (h, -h))
        assert weights(loss, np.array([r]))[0] == pytest.approx((above - below) / (2 * h), rel=1e-6)
