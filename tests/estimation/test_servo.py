"""Bandwidth and margins against closed forms, beyond the sweep, and in noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from campaign.estimate import Estimate, Origin
from campaign.estimation.continuation import gain_margin_beyond
from campaign.estimation.frequency_response import Response, open_loop
from campaign.estimation.servo import change, characteristics
from tests.estimation.coverage import holds
from tests.estimation.loops import SWEEP, Array, Transfer, closed, noisy, response

W = 2 * np.pi * 30.0


X = np.real(next(r for r in np.roots([1, 0, 1, -0.4]) if abs(r.imag) < 1e-9))
"""0 dB where x (1 + x^2) = 0.4."""


def third_order(s: Array) -> Array:
    """L = 0.4 / (s/w (1 + s/w)^2), w = 2 pi 30: at s = i w -90 - 2 * 45 deg, |L| = 0.2."""
    return 0.4 / (s / W * (1 + s / W) ** 2)


def test_margins_of_a_third_order_loop() -> None:
    found = characteristics(response(closed(third_order)))
    gain, phase = found.crossing(found.gain_margin), found.crossing(found.phase_margin)
    assert not gain.extrapolated
    assert found.gain_margin_bound is None
    assert gain.frequency.value == pytest.approx(30.0, rel=1e-5)
    assert found.gain_margin.value == pytest.approx(20 * np.log10(5.0), abs=1e-4)
    assert phase.frequency.value == pytest.approx(30.0 * X, rel=1e-5)
    assert found.phase_margin.value == pytest.approx(np.pi / 2 - 2 * np.arctan(X), abs=1e-5)


@pytest.mark.parametrize("points", [10, 14, 30])
def test_the_interval_holds_what_lies_between_few_points(points: int) -> None:
    """Without noise: what is left is interpolation, and it is not claimed to be nothing."""
    few = np.geomspace(1.0, 100.0, points)
    found = characteristics(response(closed(third_order), few))
    assert holds(found.phase_margin, np.pi / 2 - 2 * np.arctan(X))
    assert holds(found.gain_margin, 20 * np.log10(5.0))
    assert found.phase_margin.low == found.phase_margin.high, "there is no noise"
    assert 0 < found.phase_margin.half_width < np.deg2rad(5)


def test_a_resonant_loop_between_few_points() -> None:
    """T = w^2 / (s^2 + 2 z w s + w^2), z = 0.2: -3 dB beyond a peak of 8 dB."""
    z, f0 = 0.2, 10.0
    few = np.geomspace(1.0, 60.0, 14)
    found = characteristics(response(lambda s: 1 / ((s / W0) ** 2 + 2 * z * s / W0 + 1), few))
    level = 10**0.3
    square = (1 - 2 * z**2) + np.sqrt((1 - 2 * z**2) ** 2 + level - 1)
    assert holds(found.bandwidth, f0 * np.sqrt(square))
    assert found.bandwidth.half_width < 0.05 * f0


W0 = 2 * np.pi * 10.0


def delayed(s: Array) -> Array:
    """A PI-controlled axis with a current-loop lag and a delay; phase crossover near 170 Hz."""
    return 35.0 * (1 + 17 / s) / (s + 1.0) / (1 + s / 3300) * np.exp(-1.2e-3 * s)


def margin_of(loop: Transfer, low: float, high: float) -> tuple[float, float]:
    """Phase crossover (Hz) between two frequencies, and gain margin (dB), from the formula."""

    def value(f: float) -> complex:
        return complex(loop(np.array([2j * np.pi * f]))[0])

    at = float(brentq(lambda f: np.angle(-value(f)), low, high))
    return at, float(-20 * np.log10(abs(value(at))))


def test_a_margin_beyond_the_sweep_is_a_hull_and_a_bound_stands_beside_it() -> None:
    at, margin = margin_of(delayed, 150, 190)
    error = 1e-4 * np.maximum(1.0, SWEEP / 10.0)
    sweep = noisy(closed(delayed), SWEEP, error, np.random.default_rng(61))
    found = characteristics(sweep)
    crossing = found.crossing(found.gain_margin)
    assert crossing.extrapolated
    assert holds(crossing.frequency, at)
    assert holds(found.gain_margin, margin)
    assert found.gain_margin.half_width < 3.0
    bound = found.gain_margin_bound
    assert bound.kind == "at least"
    assert "rises no more" in bound.method
    loop = open_loop(sweep)
    decibel = 20 * np.log10(1 + loop.error[-1] / abs(loop.values[-1]))
    measured = -20 * np.log10(abs(loop.values[-1]))
    assert bound.value == pytest.approx(measured - 1.645 * decibel, abs=0.1 * decibel)
    assert bound.value < margin


def test_a_sweep_that_ends_near_its_crossover_gives_a_bound_only() -> None:
    """Gain crossover at 5.5 Hz, sweep to 30 Hz: nothing tells how the loop goes on."""
    short = SWEEP[SWEEP <= 30]
    found = characteristics(
        noisy(closed(delayed), short, np.full(60, 1e-4), np.random.default_rng(1))
    )
    assert found.gain_margin.kind == "at least"
    assert found.gain_margin == found.gain_margin_bound
    assert found.crossing(found.gain_margin) is None
    assert found.gain_margin.value < margin_of(delayed, 150, 190)[1]


@pytest.mark.parametrize(("times", "told"), [(7.0, False), (9.0, True)])
def test_only_a_sweep_far_above_its_crossover_is_continued(times: float, told: bool) -> None:
    loop = open_loop(response(closed(delayed), SWEEP, 1e-5))
    assert (gain_margin_beyond(loop, 100.0 / times, -np.pi) is not None) == told


@pytest.mark.parametrize("place", [0.0, 0.25, 0.5, 0.75])
def test_a_response_that_wobbles_has_a_wide_interval_between_far_points(place: float) -> None:
    """A phase of +-0.6 deg over 3.1 points, as many small modes make it: no parabola shows it."""
    step = 0.2
    at = 30.0 * X * np.exp(step * (np.arange(-14, 14) + 0.5))  # the crossover lies in the middle

    def lead(s: Array) -> Array:
        steps = np.log(s.imag / (2 * np.pi * 30.0 * X)) / step
        return 0.01 * np.sin(2 * np.pi * (steps / 3.1 + place))

    def bent(s: Array) -> Array:
        return third_order(s) * np.exp(1j * lead(s))

    shift = lead(np.array([2j * np.pi * 30.0 * X]))[0]
    found = characteristics(response(closed(bent), at)).phase_margin
    assert holds(found, np.pi / 2 - 2 * np.arctan(X) + shift)
    assert found.half_width < 0.01
    smooth = characteristics(response(closed(third_order), at)).phase_margin
    assert smooth.half_width < 0.7 * found.half_width


def test_a_mode_an_octave_away_widens_nothing() -> None:
    """A point every 0.5 Hz, and an appendage of 2 % with its mode at 11 Hz: T = -3 dB near 5 Hz."""
    mode = 2 * np.pi * 11.0

    def appended(s: Array) -> Array:
        free = 1 + 0.04 * s / mode + (s / mode) ** 2
        return 30.0 / s * free / (1 + 0.04 * s / mode + (s / mode) ** 2 / 1.02)

    at = np.arange(0.5, 40.1, 0.5)
    sweep = noisy(closed(appended), at, np.full(len(at), 2e-4), np.random.default_rng(71))
    found = characteristics(sweep).bandwidth

    def level(f: float) -> float:
        return float(abs(closed(appended)(np.array([2j * np.pi * f]))[0]) - 10**-0.15)

    assert holds(found, brentq(level, 3.0, 8.0))
    assert found.half_width < 0.005 * found.value


@pytest.mark.parametrize("seed", range(620, 640))
def test_noise_cannot_fake_a_crossing(seed: int) -> None:
    """Noise of 0.02 of a command whose amplitude falls as 1/f makes the phase of L roam.

    Lines between such points cross -180 deg at many places, and the least margin of those was
    20.4 dB for 25.7. Nothing above may be told but what holds.
    """
    at = np.arange(2.0, 300.1, 2.0)
    error = 0.02 * np.maximum(1.0, at / 2.0) * np.sqrt(2.0 / 320)
    found = characteristics(noisy(closed(delayed), at, error, np.random.default_rng(seed)))
    _, margin = margin_of(delayed, 150, 190)
    assert sum(each.level == "-180 deg" for each in found.crossings) <= 1
    if found.gain_margin.kind == "at least":
        assert found.gain_margin.value < margin
    else:
        assert found.gain_margin.low < margin + 0.5


def test_a_loop_that_never_reaches_half_a_turn_has_no_gain_margin_but_a_bound() -> None:
    found = characteristics(response(closed(lambda s: 30.0 / s)))
    assert found.phase_margin.value == pytest.approx(np.pi / 2)
    crossing = found.crossing(found.phase_margin)
    assert crossing.frequency.value == pytest.approx(30 / (2 * np.pi), rel=1e-6)
    assert found.gain_margin.kind == "at least"
    # |L| at 100 Hz is 30 / (2 pi 100).
    assert found.gain_margin.value == pytest.approx(20 * np.log10(2 * np.pi * 100 / 30), abs=1e-6)


def test_every_crossing_is_listed() -> None:
    """A peak at 40 Hz that rises above -3 dB again: two bandwidths, the lowest counts."""

    def peaked(s: Array) -> Array:
        w = 2 * np.pi * 40.0
        return 1 / (1 + s / (2 * np.pi * 8)) * (s**2 + w * s + w**2) / (s**2 + 0.1 * w * s + w**2)

    found = characteristics(response(peaked))
    widths = [each.frequency.value for each in found.crossings if each.level == "-3 dB"]
    assert len(widths) == 2
    assert found.bandwidth.value == widths[0] < 12 < 40 < widths[1]


def test_where_a_sweep_ends_before_the_gain_falls_it_is_a_bound() -> None:
    lag = closed(lambda s: 30.0 / s)  # 4.8 Hz
    below = characteristics(response(lag, np.linspace(0.5, 3.0, 10)))
    assert (below.bandwidth.kind, below.bandwidth.value) == ("at least", 3.0)
    above = characteristics(response(lag, np.linspace(6.0, 30.0, 10)))
    assert (above.bandwidth.kind, above.bandwidth.value) == ("at most", 6.0)
    for found in (below, above):
        assert found.phase_margin.origin is Origin.NOT_DETERMINED
        assert found.phase_margin.reason


def test_a_margin_that_is_hardly_known_is_not_determined_and_keeps_its_interval() -> None:
    """6 points between 1 and 100 Hz: the phase margin is 51 deg, and may be 20 deg off."""
    few = response(closed(third_order), np.geomspace(1.0, 100.0, 6))
    few = replace(few, error=np.full(6, 0.03))
    found = characteristics(few).phase_margin
    assert found.half_width > 0.5 * found.value
    assert found.origin is Origin.NOT_DETERMINED
    assert found.has_interval


def test_bandwidth_of_a_first_order_loop() -> None:
    """T = 1 / (1 + s/w): -3 dB exactly is w sqrt(10^0.3 - 1)."""
    found = characteristics(response(lambda s: 1 / (1 + s / (2 * np.pi * 8.0)))).bandwidth
    assert found.value == pytest.approx(8.0 * np.sqrt(10**0.3 - 1), rel=1e-6)
    # Friction's 5e-4 of log L, which is -j w/f: log |T| follows its phase alone, by |1 - T| ...
    away = np.sqrt(1 - 10**-0.3)
    # ... and falls by |1 - T|^2 for each part of a frequency.
    assert found.half_width / found.value == pytest.approx(1.96 * 5e-4 / away, rel=0.01)


def test_points_that_noise_enlarges_are_not_kept_for_it() -> None:
    """Points whose error is near the threshold stay or go by their neighbours' size."""
    at = np.geomspace(1.0, 100.0, 200)
    values, random = 1.0 / at + 0j, np.random.default_rng(5)
    error = 0.004 * at**0
    noise = error * (random.standard_normal(200) + 1j * random.standard_normal(200))
    kept = Response(at, values + noise, error, np.ones(200)).told.frequency
    gone = sorted(set(at) - set(kept))
    # 0.004 is a fifth of 1/at at 50 Hz: below and above there is no mixture but near it.
    assert gone[0] > 35
    assert kept[-1] < 70


def number(value: float, low: float, high: float) -> Estimate:
    return Estimate("bandwidth", value, "Hz", low, high, 0.95)


def test_a_change_adds_half_widths_in_squares_and_a_bound_has_none() -> None:
    found = change("bandwidth_change", number(7.0, 6.7, 7.4), number(9.0, 8.7, 9.3))
    assert found.value == pytest.approx(2.0)
    assert found.low == pytest.approx(2.0 - np.hypot(0.3, 0.4))
    assert found.high == pytest.approx(2.0 + np.hypot(0.3, 0.3))
    bound = replace(number(7.0, 6.7, 7.4), kind="at least", low=None, high=None)
    assert change("bandwidth_change", bound, number(9.0, 8.7, 9.3)) is None
