"""Extrema of few realisations hold the modes of drives, and a free inertia has none."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np
import pytest

from campaign.estimation.frequency.best_linear import BestLinear, best_linear
from campaign.estimation.frequency.extrema import NO_EXTREMUM, NO_SCATTER, extrema, relative_scatter
from campaign.estimation.frequency.modes import Mode
from campaign.estimation.frequency.multisine import odd_grid, random_phases
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.drives import Drive, random_drive, with_coulomb

RATE, PERIOD = 512, 4.0
SAMPLES = int(RATE * PERIOD)


def measured(
    drives: Sequence[Drive], realisations: int = 1, periods: int = 2, friction: float = 0.0
) -> list[BestLinear]:
    """Motor rates with 1 % of noise, a period after rest; friction as a share of the rms torque."""
    count = (periods + 1) * SAMPLES
    half_time = np.arange(2 * SAMPLES) / (2 * RATE)
    grids = [odd_grid(1.0, 120.0, PERIOD, seed) for seed in range(len(drives))]
    halves = [
        [random_phases(grid, 1.0, 1000 * seed + k).sample(half_time) for k in range(realisations)]
        for seed, grid in enumerate(grids)
    ]
    period = np.array(halves)  # of each drive and each realisation
    half = np.take(period, np.arange(2 * count + 2) % (2 * SAMPLES), axis=-1)
    if friction:
        each = [drive for drive in drives for _ in range(realisations)]
        torques = half.reshape(len(each), -1).T.copy()
        made = with_coulomb(each, friction, lambda at: torques[round(at * 2 * RATE)], count, RATE)
        rates = made.reshape(len(drives), realisations, -1)
    else:
        made = [d.rates(h, 2 * RATE)[0] for d, h in zip(drives, half, strict=True)]
        rates = np.array(made)[..., : 2 * count : 2]
    found = []
    for seed, (grid, rate) in enumerate(zip(grids, rates[..., SAMPLES:], strict=True)):
        random = np.random.default_rng(seed)
        noisy = rate + 0.01 * np.std(rate) * random.standard_normal(rate.shape)
        torque = half[seed, :, 2 * SAMPLES : 2 * count : 2]
        found.append(best_linear(torque, noisy, RATE, periods, grid.excited))
    return found


def modes(best: BestLinear) -> tuple[Mode, Mode]:
    gain = np.abs(best.response.values)
    return extrema(best.response.frequency, gain, relative_scatter(best))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("benches", "realisations", "friction"), [(40, 1, 0.0), (40, 3, 0.0), (40, 1, 0.03)]
)
def test_intervals_hold_the_modes_of_two_mass_drives(
    benches: int, realisations: int, friction: float
) -> None:
    """Those of the axis, also with friction of 3 % of the torque."""
    held: dict[str, list[bool]] = defaultdict(list)
    random = np.random.default_rng(31)
    drives = [random_drive(random) for _ in range(benches)]
    for drive, best in zip(drives, measured(drives, realisations, friction=friction), strict=True):
        for mode in modes(best):
            if not mode.frequency.has_interval:
                continue
            low, value, high = mode.frequency.low, mode.frequency.value, mode.frequency.high
            assert low < value < high
            lines = best.response.frequency
            assert np.count_nonzero((lines >= low) & (lines <= high)) >= 3
            truth = drive.antiresonance if mode.is_zero else drive.resonance
            held[mode.frequency.name].append(holds(mode.frequency, truth))
    assert all(len(each) > 0.7 * benches for each in held.values())
    assert rejected(held, "less") == {}


@pytest.mark.parametrize(("realisations", "friction"), [(1, 0.0), (3, 0.0), (1, 0.3)])
def test_a_free_inertia_has_no_extremum(realisations: int, friction: float) -> None:
    """Nor where friction makes its lines scatter."""
    drive = Drive(1.0, 1e-6, 0.01, 1e-5, 1.0)
    for best in measured([drive] * 20, realisations, friction=friction):
        for mode in modes(best):
            assert mode.frequency.reason in NO_EXTREMUM


def test_one_period_of_one_realisation_does_not_show_its_scatter() -> None:
    drive = random_drive(np.random.default_rng(1))
    for mode in modes(measured([drive], periods=1)[0]):
        assert mode.frequency.reason in NO_SCATTER
        assert not mode.frequency.has_interval
