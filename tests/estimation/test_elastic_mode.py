"""Elastic modes against closed forms."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimation.elastic_mode import _freedom, elastic_mode
from campaign.estimation.frequency_response import Response
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.drives import Drive
from tests.estimation.loops import SWEEP, response


def hung(s: np.ndarray, share: float = 0.02, damping: float = 0.03) -> np.ndarray:
    """Rate per torque of 65 kg m^2 of which a share hangs elastically, 11 Hz when held."""
    w, total = 2 * np.pi * 11.0, 65.0
    own = s**2 + 2 * damping * w * s + w**2
    coupled = (1 - share) * own + share * (w**2 + 2 * damping * w * s)
    return own / (total * s * coupled)


def test_an_elastic_mode_is_found_at_its_frequency() -> None:
    """Antiresonance at the part's own frequency, resonance 1 / sqrt(1 - share) above it."""
    mode = elastic_mode(response(lambda s: hung(s) / (1 + 2.0 / s)))
    assert mode.frequency.value == pytest.approx(11.0 / np.sqrt(0.98), rel=1e-3)
    assert mode.antiresonance.value == pytest.approx(11.0, rel=1e-3)
    assert mode.damping_ratio.value == pytest.approx(0.03 / np.sqrt(0.98), rel=0.05)


def test_a_rigid_axis_has_no_mode() -> None:
    random = np.random.default_rng(5)
    rigid = response(lambda s: 1 / (65.0 * s + 300.0))
    noise = 1 + 0.002 * random.standard_normal(len(SWEEP))
    assert elastic_mode(rigid) is None
    assert elastic_mode(replace(rigid, values=rigid.values * noise)) is None


def test_two_masses_of_like_size_are_no_small_mode() -> None:
    """The antiresonance lies at 0.69 of the resonance: a fit that ends at its bound is none."""
    drive = Drive(1.0, 1.1, 1.1 * (2 * np.pi * 53.0) ** 2, 20.0, 5.0)
    frequency = np.arange(20.0, 200.0)
    found = drive.response(frequency, "motor")
    error = 1e-4 * np.abs(found)
    assert elastic_mode(Response(frequency, found, error, np.ones(len(found)))) is None


TRUE = (11.0 / np.sqrt(0.98), 0.03 / np.sqrt(0.98), 11.0)
"""Resonance (Hz), its damping ratio, antiresonance (Hz) of `hung`."""


def held(draws: int, seed: int) -> dict[str, list[bool]]:
    """Whether each interval holds the truth, with 0.3 % of noise on every point."""
    exact = response(lambda s: hung(s) / (1 + 2.0 / s))
    random = np.random.default_rng(seed)
    inside: dict[str, list[bool]] = defaultdict(list)
    for _ in range(draws):
        noise = random.standard_normal((2, len(SWEEP)))
        values = exact.values * (1 + 0.003 * (noise[0] + 1j * noise[1]))
        mode = elastic_mode(replace(exact, values=values))
        for found, true in zip(
            (mode.frequency, mode.damping_ratio, mode.antiresonance), TRUE, strict=True
        ):
            inside[found.name].append(holds(found, true))
    return inside


@pytest.mark.slow
@pytest.mark.parametrize(
    ("draws", "seed"), [(40, 1201), pytest.param(4000, 1202, marks=pytest.mark.statistics)]
)
def test_intervals_of_a_mode_hold_its_truth(draws: int, seed: int) -> None:
    assert rejected(held(draws, seed)) == {}


@pytest.mark.parametrize("power", [0.0, 1.0])  # of the rate: as of bristles, of dry friction
def test_friction_that_holds_the_axis_widens_the_interval_of_its_mode(power: float) -> None:
    """Resonance of 20 % hung at 30 Hz, with friction of 0.8 of the inertia's reaction there."""
    f, own, total = np.geomspace(8.0, 120.0, 80), 2 * np.pi * 30.0, 65.0
    s = 2j * np.pi * f
    part = 0.2 * total * s * (own**2 + 0.04 * own * s) / (s**2 + 0.04 * own * s + own**2)
    drag = 0.8 * 0.8 * total * own * (f / 30.0) ** power
    true = 30.0 / np.sqrt(0.8)
    for friction, widest in ((0.0, 0.1), (drag, 60.0)):
        found = np.exp(-3e-4 * s) / (0.8 * total * s + part + friction)
        mode = elastic_mode(Response(f, found, 1e-4 * np.abs(found), np.ones(len(f))))
        low, high = mode.frequency.combined
        assert low <= true <= high
        assert high - low < widest
        assert holds(mode.damping_ratio, 0.02 / np.sqrt(0.8))


def test_residuals_that_resemble_their_neighbours_count_less() -> None:
    """White ones all count; in equal pairs, of correlation one half, a third of them does."""
    white = np.tile([1.0, -1.0, -1.0, 1.0], 50)  # products of neighbours cancel
    pairs = np.repeat(np.tile([1.0, -1.0, -1.0, 1.0], 50), 2)
    assert _freedom(white, 10) == pytest.approx(190.0, rel=0.01)
    assert _freedom(pairs, 10) == pytest.approx(390.0 / 3.0, rel=0.02)
