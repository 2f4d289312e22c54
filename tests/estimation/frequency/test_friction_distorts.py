"""Coulomb friction in a two-mass drive: odd distortion rises as the excitation falls, and the best
linear approximation moves away from the drive without friction.
"""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.frequency.best_linear import BestLinear, best_linear
from campaign.estimation.frequency.distortion import total
from campaign.estimation.frequency.multisine import odd_grid, random_phases
from campaign.estimation.frequency.two_mass import two_mass
from tests.estimation.frequency.drives import Drive, with_coulomb

DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 1.0)
FRICTION, PERIOD, RATE = 1.0, 4.0, 1024
GRID = odd_grid(0.75, 60.0, PERIOD, 1)


def measured(rms: float) -> BestLinear:
    """At half of `RATE`; the simulation needs the torque between its samples."""
    count = int(PERIOD * 2 * RATE)
    half = np.arange(2 * count + 2) / (2 * RATE)
    torque = np.array([random_phases(GRID, rms, m).sample(half) for m in range(7)])
    rate = with_coulomb(
        [DRIVE], FRICTION, lambda time: torque[:, round(time * 2 * RATE)], count, RATE
    )[:, ::2]
    rate += 1e-4 * np.random.default_rng(1).standard_normal(rate.shape)
    return best_linear(torque[:, : 2 * count : 4], rate, RATE / 2, 2, GRID.excited)


@pytest.mark.slow
def test_distortion_rises_and_the_response_bends_as_the_excitation_falls() -> None:
    strong, weak = measured(24.0), measured(3.0)
    told = [[total(each.distortion, part) for part in ("odd", "even")] for each in (strong, weak)]
    assert told[0][0].value < 0.05
    assert told[1][0].value > 0.2
    # Friction that is alike in both directions has no even part.
    assert all(even.value < 0.1 * odd.value for odd, even in told[1:])
    gains = []
    for each in (strong, weak):
        frequency = each.response.frequency
        linear = DRIVE.response(frequency, "motor")
        gains.append(np.abs(each.response.values / linear))
    assert gains[0][1] == pytest.approx(1.0, abs=0.03)
    assert gains[1][1] < 0.75
    assert gains[1][-1] == pytest.approx(1.0, abs=0.03)  # inertia is all there is up there
    drives = [two_mass({"motor": each.response}) for each in (strong, weak)]
    assert drives[0].estimates["motor_inertia"].value == pytest.approx(DRIVE.motor, rel=0.002)
    assert drives[0].estimates["resonance"].value == pytest.approx(DRIVE.resonance, rel=0.002)
    # The weak one has an interval that holds for its excitation, not for the drive.
    assert drives[1].estimates["motor_inertia"].low > DRIVE.motor
