"""Which frequencies a coarse sweep lacks, from loops whose crossings are known in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.frequency_response import Response
from campaign.estimation.refinement import refinement
from campaign.estimation.servo import characteristics

WIDTH = 10.0  # Hz
TRIPLE = 20.0  # Hz


def response(frequency: np.ndarray, closed: np.ndarray) -> Response:
    return Response(frequency, closed, np.full(frequency.shape, 1e-3), np.ones(frequency.shape))


def first_order(frequency: np.ndarray) -> Response:
    """1 / (1 + j f / WIDTH): -3 dB at WIDTH / 0.997..., its phase never turns half way round."""
    return response(frequency, 1.0 / (1.0 + 1j * frequency / WIDTH))


def triple_lag(frequency: np.ndarray) -> Response:
    """T of L = 4 / (1 + j f / TRIPLE)^3, whose phase is -180 deg at sqrt(3) TRIPLE."""
    loop = 4.0 / (1.0 + 1j * frequency / TRIPLE) ** 3
    return response(frequency, loop / (1.0 + loop))


def test_seven_frequencies_lie_within_twelve_percent_of_the_bandwidth() -> None:
    """They serve the gain crossover at WIDTH, too."""
    coarse = first_order(np.array([1.0, 4.0, 7.0, 13.0, 25.0, 50.0]))
    found = refinement(coarse)
    assert len(found) == 7
    centre = characteristics(coarse).bandwidth.value
    assert found[[0, -1]] == pytest.approx([0.88 * centre, 1.12 * centre])
    # 10^0.3 - 1 is what f^2 / WIDTH^2 is at -3 dB.
    assert found[0] < WIDTH * np.sqrt(10**0.3 - 1.0) < found[-1]


def test_the_gain_crossover_is_looked_at_and_makes_the_phase_margin_narrow() -> None:
    """|L| = 4 / (1 + x^2)^1.5 is 1 at x = sqrt(4^(2/3) - 1), where its phase is -3 atan x."""
    coarse = triple_lag(np.geomspace(2.0, 100.0, 14))
    x = np.sqrt(4.0 ** (2.0 / 3.0) - 1.0)
    found = refinement(coarse)
    assert np.count_nonzero(np.abs(found / (x * TRIPLE) - 1.0) < 0.13) >= 7
    both = triple_lag(np.unique(np.concatenate([coarse.frequency, found])))
    before, after = (characteristics(each).phase_margin for each in (coarse, both))
    truth = np.pi - 3.0 * np.arctan(x)
    assert abs(after.value - truth) < after.half_width < 0.5 * before.half_width


def test_the_phase_crossover_is_looked_at_where_it_lies_in_the_sweep() -> None:
    crossover = np.sqrt(3.0) * TRIPLE
    found = refinement(triple_lag(np.array([2.0, 5.0, 10.0, 20.0, 30.0, 45.0, 70.0, 100.0])))
    around = found[(found > 0.8 * crossover) & (found < 1.2 * crossover)]
    assert len(around) >= 7
    assert around[0] < crossover < around[-1]
    short = refinement(triple_lag(np.array([2.0, 5.0, 10.0, 20.0, 25.0])))
    assert not np.any(short > 1.13 * 25.0)


def test_nothing_is_measured_twice_and_nothing_asked_of_a_loop_that_crosses_neither() -> None:
    fine = first_order(np.array([1.0, 4.0, 7.0, 13.0, 25.0, 50.0]))
    again = np.unique(np.concatenate([fine.frequency, refinement(fine)]))
    known = first_order(again)
    assert all(np.min(np.abs(known.frequency / f - 1.0)) > 1e-3 for f in refinement(known))
    assert refinement(first_order(np.array([0.1, 0.2, 0.5]))).size == 0


def test_every_crossing_of_minus_3_db_is_looked_at_but_none_that_noise_leaves_open() -> None:
    """A first-order fall at WIDTH, and a resonance at 40 Hz that comes up again."""
    frequency = np.geomspace(2.0, 80.0, 40)
    part = 1j * frequency / 40.0
    peak = (1.0 + part + part**2) / (1.0 + 0.1 * part + part**2)
    found = refinement(response(frequency, peak / (1.0 + 1j * frequency / WIDTH)))
    assert np.count_nonzero(found < 20.0) in (6, 7)  # one of them was measured already
    assert np.count_nonzero(found > 30.0) in (13, 14)  # -3 dB and 0 dB are 10 % apart there
    unsure = Response(frequency, np.full(40, 0.7 + 0j), np.full(40, 0.05), np.ones(40))
    assert refinement(unsure).size == 0
