"""The engine against scipy's LSODA on the same equations, written a second time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.signals import Polyline, Sine
from tests.physics.bench_reference import reference
from tests.physics.benches import Tree, bench, task
from tests.physics.engine_errors import error_of

# With this phase the hull starts from rest, so that nothing jumps at t = 0.
SWING = {"base_acceleration": Sine(amplitude=1.5, frequency=1.0, phase=np.pi / 2)}
RAMP = Polyline(times=(0.0, 1.0), values=(0.0, 60.0))
COMPARED = ("load_rate", "pointing_angle", "relative_angle", "motor_current")
# Relative rms error at 0.25 ms. Compensation leaves a residue 500 times smaller than the
# uncompensated error, and it is that residue's own size the error of the rate is compared with.
CASES: dict[str, tuple[dict[str, Any], float, float]] = {
    "none": (SWING, 0.0, 2e-5),
    "lugre": ({**SWING, "compensation": "lugre"}, 0.0, 2.5e-4),
    "observer": ({**SWING, "compensation": "observer"}, 0.0, 2.5e-4),
    "lugre, relative rate filtered": ({**SWING, "compensation": "lugre"}, 2e-3, 3e-4),
    "torque ramp through breakaway": ({"mode": "torque", "command": RAMP}, 0.0, 2e-5),
}


@pytest.mark.parametrize("case", CASES)
def test_trajectories_agree_and_converge_with_second_order(case: str) -> None:
    fields, low_pass, tolerance = CASES[case]

    def filtered(tree: Tree) -> None:
        tree["controller"]["relative_rate_filter"] = f"{low_pass} s"

    on, of = bench(filtered), task(**fields)
    expected = reference(on, of)
    coarse, fine = (error_of(on, of, step, expected) for step in (0.25e-3, 0.125e-3))
    assert max(coarse[name] for name in COMPARED) < tolerance
    for name in COMPARED:
        order = np.log2(coarse[name] / fine[name])
        assert 1.8 < order < 2.3, f"{name}: order {order:.2f}"
    assert coarse["relative_rate"] < 1e-4  # behind the low-pass, where there is one
