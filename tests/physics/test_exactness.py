"""The stabilization error at a step of 1 ms, against scipy: what should cancel cancels."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from campaign.physics.rows import OUT_POINTING
from campaign.physics.simulate import simulate
from campaign.signals import Sine
from tests.physics.bench_reference import reference
from tests.physics.benches import LOAD, MOTOR, RATIO, Tree, bench, run, task

FREQUENCY, ACCELERATION = 0.24, math.radians(18.0)
SETTLE, CYCLES = 1, 4
MEASURED = slice(round(SETTLE / FREQUENCY * 1000), round((SETTLE + CYCLES) / FREQUENCY * 1000))


def wrong(parameter: str, factor: float) -> Callable[[Tree], None]:
    """The compensation's model, off by a factor in one parameter."""

    def edit(tree: Tree) -> None:
        for interface in tree["compensation"]["lugre"]["friction"].values():
            number, unit = interface[parameter].split(" ", 1)
            interface[parameter] = f"{float(number) * factor!r} {unit}"

    return edit


def filtered(tree: Tree) -> None:
    tree["controller"]["relative_rate_filter"] = "1 ms"


CASES: dict[str, tuple[str, Callable[[Tree], None] | None, float, float]] = {
    "none": ("none", None, 1e-3, 1e-5),
    "LuGre, the model is exact": ("lugre", None, 1e-3, 1e-4),
    "LuGre, Tc 15 % too small": ("lugre", wrong("coulomb_torque", 0.85), 1e-3, 1e-4),
    "LuGre, sigma0 a third too small": ("lugre", wrong("bristle_stiffness", 2 / 3), 1e-3, 1e-4),
    "observer": ("observer", None, 1e-3, 1e-4),
    # A low-pass of 1 ms bends within a step of 1 ms what the model takes for a straight line.
    "LuGre, filtered": ("lugre", filtered, 1e-3 / 16, 1e-4),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_the_stabilization_error_is_that_of_scipy(case: str) -> None:
    compensation, edit, step, bound = CASES[case]
    on = bench(edit)
    swinging = task(
        base_acceleration=Sine(amplitude=ACCELERATION, frequency=FREQUENCY),
        compensation=compensation,
        duration=(SETTLE + CYCLES) / FREQUENCY,
    )
    expected = np.std(reference(on, swinging)["pointing_angle"][MEASURED])
    out = np.hstack([block for _, block in simulate(on, swinging, 1, step)])
    assert np.std(out[OUT_POINTING][MEASURED]) == pytest.approx(expected, rel=bound)


def test_the_first_torque_is_that_of_bristles_that_nothing_has_bent_yet() -> None:
    """The hull is under way and the load at rest: T = (sigma1 + sigma2) v of both interfaces."""
    swinging = Sine(amplitude=ACCELERATION, frequency=FREQUENCY)
    _, found = run(bench(), task(base_acceleration=swinging, duration=0.01), 1e-3)
    rate = ACCELERATION / (2.0 * math.pi * FREQUENCY)
    damping = sum(
        share * (model["s1"] + model["s2"]) for share, model in ((1.0, LOAD), (RATIO, MOTOR))
    )
    assert found["friction_torque"][0] == pytest.approx(damping * rate, rel=1e-5)
