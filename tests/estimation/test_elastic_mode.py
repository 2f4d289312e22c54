"""Elastic modes against closed forms."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Origin
from campaign.estimation.elastic_mode import _freedom, elastic_mode
from campaign.estimation.frequency_response import (
    DRY,
    HELD,
    NO_LOAD,
    Response,
    held_by_spring,
    no_load_at,
)
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


def on_spring(stiffness: float, damping: float = 6.0) -> Response:
    """Rate per torque of 1 kg m^2 on a spring to the ground."""
    return response(lambda s: s / (s**2 + damping * s + stiffness), np.arange(2.0, 40.0, 0.25))


def test_what_a_spring_holds_leads_below_its_resonance() -> None:
    """By atan((k / w - J w) / b); an axis that nothing holds lags, with a mode or without one."""
    bristles = on_spring((2 * np.pi * 10.7) ** 2)
    why = held_by_spring(bristles)
    assert why in HELD
    lead = np.arctan((10.7 / 2.0 - 2.0 / 10.7) * 2 * np.pi * 10.7 / 6.0)
    assert dict(why.values) == {"frequency": 2.0, "degrees": pytest.approx(np.degrees(lead))}
    for free in (hung, lambda s: 1 / (65.0 * s + 300.0), lambda s: -1 / (65.0 * s + 30.0)):
        assert not held_by_spring(response(free))


def test_a_spring_weaker_than_the_damping_beside_it_does_not_hold() -> None:
    """At the lowest point k / w - J w passes b between these two stiffnesses."""
    w = 2 * np.pi * 2.0
    both = w * (6.0 + w)
    assert held_by_spring(on_spring(1.01 * both)) in HELD
    assert not held_by_spring(on_spring(0.99 * both))


def test_a_mode_of_an_axis_on_bristles_is_not_determined() -> None:
    """With a response that begins where they hold it; above them the same mode is told."""
    own = 65.0 * (2 * np.pi * 2.3) ** 2
    for lowest, told in ((0.5, False), (3.0, True)):
        at = SWEEP[lowest <= SWEEP]
        mode = elastic_mode(response(lambda s: 1 / (1 / hung(s) + own / s), at))
        assert mode is not None
        for one in (mode.frequency, mode.damping_ratio, mode.antiresonance):
            assert (one.origin is Origin.MEASURED) is told
            assert (one.reason in HELD) is not told


def test_a_mode_as_wide_as_the_window_is_none() -> None:
    """Its damping ratio, of 0.6, ends at the bound of the fit."""

    def bent(s: np.ndarray) -> np.ndarray:
        w, own = 2 * np.pi * 20.0, 2 * np.pi * 18.0
        return (s**2 + own * s + own**2) / (s**2 + 1.2 * w * s + w**2) / (65.0 * s)

    assert elastic_mode(response(bent, np.arange(4.0, 60.0, 0.5))) is None


def test_a_resonance_below_its_antiresonance_is_no_part_that_hangs_on_the_load() -> None:
    assert elastic_mode(response(hung)) is not None
    assert elastic_mode(response(lambda s: 1 / hung(s) / (65.0 * s) ** 2)) is None


def test_a_load_shows_at_its_antiresonance_and_nowhere_else() -> None:
    """With friction of any size in phase with the rate, and not where a spring to the ground is."""
    for drag in (30.0, 300.0, 600.0):
        found = response(lambda s, drag=drag: 1 / (1 / hung(s) + drag))
        assert not no_load_at(found, 11.0)
        for other in (3.0, 7.0, 30.0):
            assert no_load_at(found, other) in NO_LOAD
    bristles = on_spring((2 * np.pi * 10.7) ** 2)
    for frequency in (3.0, 10.7, 30.0):
        why = no_load_at(bristles, frequency)
        assert why in NO_LOAD
        assert dict(why.values) == {"frequency": frequency}


def test_a_load_shows_beside_an_antiresonance_without_any_response() -> None:
    found = response(hung)
    values = found.values.copy()
    values[np.argmin(np.abs(found.frequency - 11.0))] = 0.0
    with np.errstate(all="raise"):
        assert not no_load_at(replace(found, values=values), 11.0)


@pytest.mark.parametrize("outside", [0.1, 1e4])
def test_no_load_shows_outside_of_the_sweep(outside: float) -> None:
    assert no_load_at(response(hung), outside) in NO_LOAD
    nothing = Response(np.array([]), np.array([], dtype=complex), np.array([]), np.array([]))
    assert no_load_at(nothing, 11.0) in NO_LOAD


def test_noise_is_no_load() -> None:
    """Lines of an inertia that scatter by 2 %: the largest of many differences is no evidence."""
    random, frequency = np.random.default_rng(8), np.arange(4.0, 40.0, 0.5)
    shown = 0
    for _ in range(200):
        noise = random.standard_normal((2, len(frequency)))
        values = (1 + 0.02 * (noise[0] + 1j * noise[1])) / (2j * np.pi * frequency)
        found = Response(frequency, values, 0.02 * np.abs(values), np.ones(len(frequency)))
        shown += not no_load_at(found, 12.2)
    assert shown <= 0.1 * 200


def test_dry_friction_that_slides_is_no_load() -> None:
    """Den Hartog: an inertia under T sin(wt + p), cos p = pi F / 2 T, and F sign(v) without a stop.

    Its fundamental is j w J V = T exp(jp) - 4 F / pi. Here F / T falls along the sweep.
    """
    frequency = np.geomspace(5.0, 10.0, 40)
    most = 1.0 / np.sqrt(1.0 + np.pi**2 / 4.0)  # of F over T: the axis is about to stop
    dry = most * (1.0 - (np.arange(40) >= 20))
    cosine = 0.5 * np.pi * dry
    torque = cosine + 1j * np.sqrt(1.0 - cosine**2)
    rate = (torque - 4.0 / np.pi * dry) / (2j * np.pi * frequency)
    found = Response(frequency, rate / torque, 1e-9 * np.abs(rate), np.ones(40))
    friction = 1 / found.values[0] - 2j * np.pi * frequency[0]
    assert friction.imag / friction.real == pytest.approx(DRY)
    assert no_load_at(found, 7.0) in NO_LOAD
