"""Sine fits against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.frequency_response import make_response
from campaign.estimation.sine_point import SinePoint, sine_point


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
    ("samples", "frequency", "why"), [(200, 600.0, "samples at"), (200, 0.5, "less than one cycle")]
)
def test_what_cannot_be_seen_is_refused(samples: int, frequency: float, why: str) -> None:
    time = np.arange(samples) * 1e-3
    with pytest.raises(ValueError, match=why):
        sine_point(time, np.sin(time), np.sin(time), frequency)


def test_no_input_at_the_frequency_is_refused() -> None:
    time = np.arange(200) * 1e-3
    with pytest.raises(ValueError, match="no part"):
        sine_point(time, np.zeros(200), np.sin(time), 20.0)


def test_repetitions_that_scatter_more_than_they_say_are_believed_less() -> None:
    """Three trials that differ by 1 % while each claims 0.01 %: the mean is known to 0.6 %.

    Four degrees of freedom: t is 2.776445 where the normal quantile is 1.959964.
    """
    points = [SinePoint(5.0, complex(1.0 + shift, 0.0), 1e-4, 1.0) for shift in (-0.01, 0.0, 0.01)]
    error = make_response(points).error[0]
    # The real parts scatter by 0.01, the imaginary parts not at all: half the power each.
    few = 2.776445 / 1.959964
    assert error == pytest.approx(few * 0.01 / np.sqrt(2) / np.sqrt(3), rel=1e-6)
    alike = [SinePoint(5.0, 1.0 + 0j, 1e-4, 1.0)] * 3
    assert make_response(alike).error[0] == pytest.approx(1e-4 / np.sqrt(3))
