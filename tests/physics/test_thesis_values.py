"""The converged stabilization errors of the thesis' simulation (Tables 5.2 and 5.8).

Expected: 0.488412958 and 0.000594855 mrad by an order-8 Runge-Kutta method with located reversals;
0.0660 and 0.000813 from an independent fixed-step integration.
"""

from __future__ import annotations

import numpy as np
import pytest

from campaign.signals import Sine
from tests.physics.benches import bench, run, task

SWING = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24)


def error_mrad(compensation: str, step: float = 0.25e-3) -> float:
    settle, stop = 2 / 0.24, 8 / 0.24
    time, out = run(
        bench(), task(base_acceleration=SWING, compensation=compensation, duration=stop), step
    )
    return 1e3 * float(np.std(out["pointing_angle"][time >= settle]))


@pytest.mark.parametrize(
    ("compensation", "expected", "tolerance"),
    [
        ("none", 0.488412958, 2e-3),
        ("static", 0.0660, 2e-3),
        ("lugre", 0.000594855, 2e-2),
        ("observer", 0.000813, 2e-2),
    ],
)
def test_stabilization_error(compensation: str, expected: float, tolerance: float) -> None:
    assert error_mrad(compensation) == pytest.approx(expected, rel=tolerance)
