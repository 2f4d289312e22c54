"""Averaged spectra: against closed forms, in loops, and how often their intervals hold."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import butter, coherence, csd, sosfilt, welch

from campaign.estimation.frequency.welch import Record, spectra, welch_response
from tests.estimation.coverage import rejected
from tests.estimation.frequency.drives import Drive, loop_of, random_drive, simulated
from tests.estimation.frequency.measured import radius

FINE, RATE, EVERY = 8192, 256, 32
DRIVE = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)


def band_noise(random: np.random.Generator, seconds: float) -> np.ndarray:
    """At `FINE`, without anything above half of `RATE`."""
    held = np.repeat(random.standard_normal(int(seconds * RATE)), EVERY)
    return sosfilt(butter(12, 75, fs=FINE, output="sos"), held)


def test_spectra_are_those_of_scipy() -> None:
    random = np.random.default_rng(1)
    u, e = random.standard_normal((2, 20_000))
    y = np.convolve(u, [0.5, 0.3, 0.1])[: len(u)] + 0.3 * e
    found = spectra([Record(100.0, u, y)], segment=500)
    options = {"nperseg": 500, "noverlap": 250, "detrend": "constant"}
    frequency, suu = welch(u, 100.0, **options)
    _, suy = csd(u, y, 100.0, **options)  # of scipy: conjugate of the first
    _, gamma = coherence(u, y, 100.0, **options)
    assert np.allclose(found.frequency, frequency[2:250])
    assert np.allclose(found.cross / found.input_, (suy / suu)[2:250])
    assert np.allclose(found.coherence, gamma[2:250])
    # Hann, half overlapping: (2/3)² / 4 ... of Welch's formula, 79 segments are worth 75.
    assert found.averages == pytest.approx(79 / (1 + 2 * 78 / 79 / 36), rel=0.01)


@pytest.mark.parametrize("estimator", ["H1", "H2", "Hv"])
def test_noise_biases_only_the_estimator_that_is_not_made_for_it(estimator: str) -> None:
    random = np.random.default_rng(2)
    u, e, n = random.standard_normal((3, 400_000))
    values = {
        "output": welch_response([Record(1.0, u, u + e)], "input", estimator, 400).values,
        "input": welch_response([Record(1.0, u + n, u)], "input", estimator, 400).values,
        "both": welch_response([Record(1.0, u + n, u + e)], "input", estimator, 400).values,
    }
    gains = {name: float(np.mean(found.real)) for name, found in values.items()}
    # Signal and noise alike: H1 is 1/2 with noise on the input, H2 is 2 with noise on the output.
    expected = {
        "H1": {"output": 1.0, "input": 0.5, "both": 0.5},
        "H2": {"output": 2.0, "input": 1.0, "both": 2.0},
        "Hv": {"output": 2**0.5, "input": 0.5**0.5, "both": 1.0},
    }[estimator]
    assert gains == pytest.approx(expected, rel=0.02)


def test_discs_hold_the_truth_as_often_as_they_say() -> None:
    held = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        u, e = random.standard_normal((2, 4000))
        y = np.convolve(u, [1.0, 0.5])[: len(u)] + random.uniform(0.1, 3.0) * e
        found = welch_response([Record(1.0, u, y)], "input", segment=200)
        truth = 1.0 + 0.5 * np.exp(-2j * np.pi * found.frequency)
        held.append(np.abs(found.values - truth)[::7] < radius(found)[::7])
    assert not rejected({"disc": np.concatenate(held)})


def test_resonance_of_a_drive_from_noise() -> None:
    random = np.random.default_rng(3)
    u = band_noise(random, 100.0)
    y = DRIVE.rates(u, FINE)[0, ::EVERY]
    y += 0.03 * np.std(y) * random.standard_normal(len(y))
    found = welch_response([Record(RATE, u[::EVERY], y)], "input", segment=RATE * 8)
    found = found.between(1.0, 60.0)
    truth = DRIVE.response(found.frequency, "motor")
    held = np.abs(found.values - truth) < radius(found)
    assert np.mean(held) > 0.9
    peak = found.frequency[np.argmax(np.abs(found.values) * found.frequency)]
    assert peak == pytest.approx(DRIVE.resonance, rel=0.02)


def test_a_loop_needs_its_reference() -> None:
    """Output over input is far off under a strong disturbance; by the reference it is not."""
    random = np.random.default_rng(4)
    a, b, c = loop_of(DRIVE, 60.0, 100.0)
    r = band_noise(random, 200.0)
    disturbance = 150.0 * band_noise(random, 200.0)
    out = simulated(a, b, c, np.array([r, disturbance, 0 * r]), FINE)[:, ::EVERY]
    # The disturbance is nobody's to know: the controller's torque is what is recorded.
    torque, rate = out[0] + 60.0 * r[::EVERY], out[1]
    record = Record(RATE, torque, rate, r[::EVERY])
    by_reference = welch_response([record], "reference", segment=RATE * 4).between(1.0, 40.0)
    direct = welch_response([record], "input", segment=RATE * 4).between(1.0, 40.0)

    def off(found) -> float:  # type: ignore[no-untyped-def]
        return float(np.median(np.abs(found.values / DRIVE.response(found.frequency, "motor") - 1)))

    truth = DRIVE.response(by_reference.frequency, "motor")
    assert np.mean(np.abs(by_reference.values - truth) < radius(by_reference)) > 0.9
    assert off(direct) > 0.5
    assert off(by_reference) < 0.3 * off(direct)
    with pytest.raises(ValueError, match="mixture of the plant and its controller"):
        welch_response([Record(RATE, torque, rate)], "reference")


def test_lines_that_the_reference_does_not_move_are_left_out() -> None:
    random = np.random.default_rng(5)
    slow = sosfilt(butter(8, 10, fs=200, output="sos"), random.standard_normal(20_000))
    w = random.standard_normal(20_000)
    u = slow + 0.3 * w
    found = welch_response([Record(200.0, u, u, slow)], "reference", segment=400)
    assert found.frequency[0] <= 2.0
    assert found.frequency[-1] < 20.0


@pytest.mark.parametrize(
    ("records", "options", "message"),
    [
        ([], {}, "no record"),
        ([Record(1.0, np.ones(50), np.ones(50))], {"segment": 40}, "independent segments"),
        ([Record(1.0, np.ones(50), np.ones(50))], {"segment": 60}, "shortest record"),
        ([Record(1.0, np.full(500, np.nan), np.ones(500))], {}, "no numbers"),
        (
            [Record(1.0, np.ones(500), np.ones(500)), Record(2.0, np.ones(500), np.ones(500))],
            {},
            "different rates",
        ),
    ],
)
def test_refused(records: list[Record], options: dict[str, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        welch_response(records, "input", **options)  # type: ignore[arg-type]


def test_bias_of_short_segments_is_told() -> None:
    """A sharp mode seen through short segments is off by more than scatter, and says so."""
    random = np.random.default_rng(6)
    sharp = random_drive(random)
    u = band_noise(random, 240.0)
    y = sharp.rates(u, FINE)[0, ::EVERY]
    record = Record(RATE, u[::EVERY], y)
    found = welch_response([record], "input", segment=RATE).between(3.0, 50.0)
    truth = sharp.response(found.frequency, "motor")
    error = np.abs(found.values - truth)
    scatter = np.sqrt(found.variance)
    near = np.abs(found.frequency - sharp.resonance) < 2.5
    assert np.max((error / scatter)[near]) > 3.0
    assert np.all(found.bias[near] > scatter[near] * 0.3)
    assert np.mean(error < radius(found)) > 0.85
