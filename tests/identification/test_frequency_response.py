"""Sine fits, margins and elastic modes against closed forms."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from campaign.identification.elastic_mode import elastic_mode
from campaign.identification.frequency_response import (
    Response,
    bandwidth,
    characteristics,
    make_response,
    margins,
    open_loop,
    sine_point,
)

SWEEP = np.arange(0.5, 100.01, 0.5)


def response(
    of: Callable[[np.ndarray], np.ndarray], at: np.ndarray = SWEEP, error: float = 0.0
) -> Response:
    """The exact response of a transfer function of s."""
    values = of(2j * np.pi * at)
    return Response(at, values, np.full(len(at), error), np.ones(len(at)))


def closed(loop: Callable[[np.ndarray], np.ndarray]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda s: loop(s) / (1.0 + loop(s))


def test_a_sine_is_measured_beside_offset_drift_and_harmonics() -> None:
    time = np.arange(0, 16 / 7.3, 1e-3)  # cycles that are no whole number of samples
    angle = 2 * np.pi * 7.3 * time
    drive = 2.0 * np.cos(angle + 0.4)
    answer = 0.6 * np.cos(angle - 0.8) + 5.0 - 0.3 * time + 0.1 * np.sin(3 * angle)
    point = sine_point(time, drive, answer, 7.3)
    assert point.response == pytest.approx(0.3 * np.exp(-1.2j), rel=1e-9)
    # 0.6^2 of 0.6^2 + 0.1^2 is at the excitation frequency.
    assert point.coherence == pytest.approx(0.36 / 0.37, rel=5e-3)


def test_ten_samples_per_cycle_are_enough() -> None:
    time = np.arange(160) * 1e-3
    angle = 2 * np.pi * 100.0 * time
    point = sine_point(time, np.sin(angle), 0.25 * np.sin(angle - 2.0), 100.0)
    assert point.response == pytest.approx(0.25 * np.exp(-2j), rel=1e-9)


def test_the_error_of_a_point_is_the_scatter_of_repeated_measurements() -> None:
    random = np.random.default_rng(1)
    time = np.arange(400) * 1e-3
    drive = np.sin(2 * np.pi * 40.0 * time)
    points = [
        sine_point(time, drive, drive + 0.1 * random.standard_normal(400), 40.0) for _ in range(300)
    ]
    scatter = np.std([point.response.real for point in points])
    assert np.mean([point.error for point in points]) == pytest.approx(scatter, rel=0.1)
    assert make_response(points).error[0] == pytest.approx(scatter / np.sqrt(300), rel=0.1)


@pytest.mark.parametrize(
    ("samples", "frequency", "why"),
    [(200, 600.0, "samples at"), (200, 0.5, "less than one cycle")],
)
def test_what_cannot_be_seen_is_refused(samples: int, frequency: float, why: str) -> None:
    time = np.arange(samples) * 1e-3
    with pytest.raises(ValueError, match=why):
        sine_point(time, np.sin(time), np.sin(time), frequency)


def test_no_input_at_the_frequency_is_refused() -> None:
    time = np.arange(200) * 1e-3
    with pytest.raises(ValueError, match="no part"):
        sine_point(time, np.zeros(200), np.sin(time), 20.0)


def test_margins_of_a_third_order_loop() -> None:
    """L = 10 / (s/w (1 + s/w)^2), w = 2 pi 30: phase crossover at w, gain margin w-normalised 2/K.

    At s = i w the phase is -90 - 2 * 45 deg and |L| = K / 2.
    """
    w = 2 * np.pi * 30.0
    gain, phase = margins(response(lambda s: 0.4 / (s / w * (1 + s / w) ** 2)))
    assert gain.frequency == pytest.approx(30.0, rel=1e-3)
    assert gain.margin == pytest.approx(20 * np.log10(2 / 0.4), abs=0.02)
    assert not gain.extrapolated
    # 0 dB where x (1 + x^2) = 0.4.
    x = np.real(next(r for r in np.roots([1, 0, 1, -0.4]) if abs(r.imag) < 1e-9))
    assert phase.frequency == pytest.approx(30.0 * x, rel=2e-3)
    assert phase.margin == pytest.approx(np.pi / 2 - 2 * np.arctan(x), abs=0.005)


def test_a_crossover_above_the_sweep_is_extrapolated_and_says_so() -> None:
    """A PI-controlled axis with a current-loop lag and a delay; phase crossover near 170 Hz."""

    def loop(s: np.ndarray) -> np.ndarray:
        return 35.0 * (1 + 17 / s) / (s + 1.0) / (1 + s / 3300) * np.exp(-1.2e-3 * s)

    fine = np.geomspace(100, 300, 200_000)
    phase = np.unwrap(np.angle(loop(2j * np.pi * fine)))
    at = fine[np.argmax(phase < phase[0] - np.angle(loop(2j * np.pi * fine[:1]))[0] - np.pi)]
    expected = -20 * np.log10(abs(loop(2j * np.pi * at)))
    gain, _ = margins(response(loop))
    assert gain.extrapolated
    assert 150 < at < 190
    assert gain.frequency == pytest.approx(at, rel=0.01)
    assert gain.margin == pytest.approx(expected, abs=0.1)


def test_a_loop_that_never_reaches_half_a_turn_has_no_gain_margin() -> None:
    gain, phase = margins(response(lambda s: 30.0 / s))
    assert np.isnan(gain.margin)
    assert phase.margin == pytest.approx(np.pi / 2)
    assert phase.frequency == pytest.approx(30 / (2 * np.pi), rel=1e-6)


def test_the_open_loop_of_a_closed_one() -> None:
    def loop(s: np.ndarray) -> np.ndarray:
        return 40.0 * (s + 12.0) / s**2 * np.exp(-1e-3 * s)

    found = open_loop(response(closed(loop)))
    assert found.values == pytest.approx(loop(2j * np.pi * SWEEP), rel=1e-9)


def test_bandwidth_of_a_first_order_loop() -> None:
    """T = 1 / (1 + s/w): -3 dB exactly is w sqrt(10^0.3 - 1)."""
    w = 2 * np.pi * 8.0
    found = bandwidth(response(lambda s: 1 / (1 + s / w)))
    assert found == pytest.approx(8.0 * np.sqrt(10**0.3 - 1), rel=1e-3)


def test_deviations_are_those_of_repeated_noise() -> None:
    """The stated deviation of the bandwidth is the scatter over independent noisy sweeps."""
    exact = response(lambda s: 45.0 / (s + 45.0) * np.exp(-1e-3 * s))
    random = np.random.default_rng(3)
    scattered = []
    for _ in range(200):
        noise = 0.002 * random.standard_normal((2, len(SWEEP)))
        noisy = Response(
            SWEEP, exact.values + noise[0] + 1j * noise[1], exact.error + 0.002, exact.coherence
        )
        scattered.append(bandwidth(noisy))
    stated = characteristics(noisy).bandwidth_error
    assert stated == pytest.approx(np.std(scattered), rel=0.35)


def hung(s: np.ndarray, share: float = 0.02, damping: float = 0.03) -> np.ndarray:
    """Rate per torque of 65 kg m^2 of which a share hangs elastically, 11 Hz when held."""
    w, total = 2 * np.pi * 11.0, 65.0
    own = s**2 + 2 * damping * w * s + w**2
    coupled = (1 - share) * own + share * (w**2 + 2 * damping * w * s)
    return own / (total * s * coupled)


def test_an_elastic_mode_is_found_at_its_frequency() -> None:
    """Antiresonance at the part's own frequency, resonance 1 / sqrt(1 - share) above it."""
    mode = elastic_mode(response(lambda s: hung(s) / (1 + 2.0 / s)))
    assert mode is not None
    assert mode.frequency == pytest.approx(11.0 / np.sqrt(0.98), rel=1e-3)
    assert mode.antiresonance == pytest.approx(11.0, rel=1e-3)
    assert mode.damping_ratio == pytest.approx(0.03 / np.sqrt(0.98), rel=0.05)


def test_a_rigid_axis_has_no_mode() -> None:
    random = np.random.default_rng(5)
    rigid = response(lambda s: 1 / (65.0 * s + 300.0))
    noise = 1 + 0.002 * random.standard_normal(len(SWEEP))
    assert elastic_mode(rigid) is None
    assert elastic_mode(Response(SWEEP, rigid.values * noise, rigid.error, rigid.coherence)) is None
