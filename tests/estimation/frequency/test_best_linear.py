"""Odd random-phase multisines, against static nonlinearities whose levels have closed forms.

Of Gaussian u with line spectrum S: b u² puts 2 b² (S * S) beside the mean, a u³ a gain of
3 a s² and 6 a² (S * S * S) beside it (Hermite polynomials; Bussgang).
"""

from __future__ import annotations

import numpy as np
import pytest

from campaign.estimation.frequency.best_linear import best_linear
from campaign.estimation.frequency.distortion import SHARED_LINES, SINGLE_REALISATION, total
from campaign.estimation.frequency.multisine import OddGrid, odd_grid, random_phases, repetition
from tests.estimation.coverage import holds, rejected
from tests.estimation.frequency.drives import Drive, loop_of, random_drive, simulated
from tests.estimation.frequency.measured import radius

RATE, PERIOD = 256.0, 4.0
SAMPLES = int(RATE * PERIOD)
GRID = odd_grid(0.5, 30.0, PERIOD, seed=1)
QUADRATIC, CUBIC, RMS = 0.1, 0.05, 0.8


def inputs(
    realisations: int, periods: int, seed: int = 0, grid: OddGrid = GRID, rms: float = RMS
) -> np.ndarray:
    time = np.arange(SAMPLES * periods) / RATE
    made = [random_phases(grid, rms, 1000 * seed + m) for m in range(realisations)]
    return np.array([each.sample(time) for each in made])


def left_out(grid: OddGrid, parity: int) -> np.ndarray:
    """Lines of that parity (1: odd) between the first and the last that are not excited."""
    between = np.arange(grid.excited[0], grid.excited[-1])
    return np.setdiff1d(between[between % 2 == parity], grid.excited)


def powers(lines: np.ndarray, quadratic: float, cubic: float) -> tuple[np.ndarray, np.ndarray]:
    """Squared rms of even and odd distortion at the lines of a period, by closed form."""
    spectrum = np.zeros(SAMPLES)
    spectrum[lines] = spectrum[-lines] = RMS**2 / len(lines) / 2
    transformed = np.fft.fft(spectrum)
    twice, thrice = (np.fft.ifft(transformed**k).real for k in (2, 3))
    return 2 * 2 * quadratic**2 * twice, 2 * 6 * cubic**2 * thrice


def distorted(u: np.ndarray, noise: float, seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    return u + QUADRATIC * u**2 + CUBIC * u**3 + noise * random.standard_normal(u.shape)


def test_design() -> None:
    assert np.all(GRID.excited % 2 == 1)
    together = np.sort(np.concatenate([GRID.excited, left_out(GRID, 1)]))
    assert np.array_equal(together, np.arange(3, 120, 2))
    # One of each three, drawn anew for each.
    groups = together[: len(together) // 3 * 3].reshape(-1, 3)
    assert np.all(np.isin(groups, left_out(GRID, 1)).sum(axis=1) == 1)
    places = [int(np.flatnonzero(np.isin(group, left_out(GRID, 1)))[0]) for group in groups]
    assert set(places) == {0, 1, 2}
    signal = random_phases(GRID, 2.0, 7).sample(np.arange(SAMPLES) / RATE)
    assert np.std(signal) == pytest.approx(2.0)
    lines = np.abs(np.fft.rfft(signal))
    assert set(np.flatnonzero(lines > 1e-6 * lines.max())) == set(GRID.excited)


def test_of_many_draws_the_lowest_crest_factor_is_kept() -> None:
    time = np.arange(SAMPLES) / RATE

    def crest(signal: np.ndarray) -> float:
        return float(np.max(np.abs(signal)) / np.std(signal))

    one = [crest(random_phases(GRID, 1.0, k).sample(time)) for k in range(20)]
    best = [crest(random_phases(GRID, 1.0, k, draws=30).sample(time)) for k in range(20)]
    assert max(best) < np.mean(one)


def test_a_multisine_is_told_by_its_repetition() -> None:
    time = np.arange(5 * SAMPLES // 2) / RATE
    noise = np.random.default_rng(1).standard_normal(len(time))
    multisine = random_phases(GRID, 1.0, 3).sample(time)
    assert repetition(multisine) == SAMPLES
    assert repetition(multisine + 0.01 * noise) == SAMPLES
    assert repetition(multisine[: 3 * SAMPLES // 2]) is None  # seen once
    sine = np.sin(2 * np.pi * 0.5 * time)
    ramps = np.arcsin(sine)
    for other in (noise, sine, ramps, np.clip(ramps, -1.0, 1.0), np.sign(sine), 0.0 * time):
        assert repetition(other) is None


def test_parities_are_not_told_where_even_lines_are_excited() -> None:
    lines = np.arange(2, 100)
    grid = OddGrid(PERIOD, lines)
    found = best_linear(u := inputs(2, 2, grid=grid), distorted(u, 0.002, 1), RATE, 2, lines[::2])
    for parity in ("even", "odd"):
        told = total(found.distortion, parity)  # type: ignore[arg-type]
        assert np.isnan(told.value)
        assert told.reason in SHARED_LINES


def test_static_nonlinearity_has_its_closed_form() -> None:
    """Gain, and levels at each detection line and over the band."""
    grid = odd_grid(0.5, 120.0, PERIOD, seed=1)
    u = inputs(40, 2, grid=grid)
    found = best_linear(u, distorted(u, 0.002, 1), RATE, 2, grid.excited)
    assert np.mean(found.response.values).real == pytest.approx(1 + 3 * CUBIC * RMS**2, abs=0.004)
    even, odd = powers(grid.excited, QUADRATIC, CUBIC)
    seen = np.mean(found.distortion.even.rms**2)
    assert seen == pytest.approx(np.mean(even[left_out(grid, 0)]), rel=0.05)
    seen = np.mean(found.distortion.odd.rms**2)
    assert seen == pytest.approx(np.mean(odd[left_out(grid, 1)]), rel=0.1)
    # At the excited lines odd distortion is the scatter over realisations; of few lines a part of
    # it is synchronous with the input, and belongs to the gain.
    amplitude = RMS * np.sqrt(2 / len(grid.excited))
    scatter = 40 * np.mean(found.response.variance - found.noise) * amplitude**2 / 2
    assert scatter == pytest.approx(np.mean(odd[grid.excited]), rel=0.1)
    noise = 0.002**2 * 4 / (2 * SAMPLES) / amplitude**2 / 40
    assert np.mean(found.noise) == pytest.approx(noise, rel=0.25)
    assert "rms 0.8" in str(found.excitation)
    assert "40 realisations of 2 periods" in str(found.excitation)


def test_levels_and_gain_hold_the_truth_as_often_as_they_say() -> None:
    held: dict[str, list[bool]] = {"even": [], "odd": [], "gain": []}
    for seed in range(40):
        grid = odd_grid(0.5, 30.0, PERIOD, seed)
        u = inputs(7, 2, seed, grid)
        y = distorted(u, 10 ** np.random.default_rng(seed).uniform(-3, -1.5), seed)
        found = best_linear(u, y, RATE, 2, grid.excited)
        even, odd = powers(grid.excited, QUADRATIC, CUBIC)
        gain = 1 + 3 * CUBIC * RMS**2
        band = np.arange(grid.excited[0], grid.excited[-1] + 1)
        output = gain**2 * RMS**2 + np.sum(odd[grid.excited])
        truth = {
            "even": np.sqrt(np.sum(even[band[band % 2 == 0]]) / output),
            "odd": np.sqrt(np.sum(odd[band[band % 2 == 1]]) / output),
        }
        for parity in ("even", "odd"):
            told = total(found.distortion, parity)  # type: ignore[arg-type]
            held[parity].append(
                truth[parity] <= told.value
                if told.kind == "at most"
                else holds(told, truth[parity])
            )
        held["gain"] += list(
            np.abs(found.response.values - gain)[::6] < radius(found.response)[::6]
        )
    assert not rejected(held)


def test_without_distortion_there_is_a_bound() -> None:
    u = inputs(7, 2)
    y = u + 0.1 * np.random.default_rng(3).standard_normal(u.shape)
    found = best_linear(u, y, RATE, 2, GRID.excited)
    for parity in ("even", "odd"):
        told = total(found.distortion, parity)  # type: ignore[arg-type]
        assert told.kind == "at most" or told.low == pytest.approx(0, abs=0.02)
    assert np.mean(found.distortion.even.significant) < 0.05


def test_harmonics_of_the_input_are_no_distortion() -> None:
    """An amplifier that distorts, and a linear drive: levels after correction are noise."""
    u = inputs(8, 2)
    bent = u + 0.05 * u**2 + 0.05 * u**3
    y = simulated(np.array([[-30.0]]), np.array([[30.0]]), np.array([[1.0]]), bent[None], RATE)[0]
    y += 1e-4 * np.random.default_rng(1).standard_normal(y.shape)
    found = best_linear(bent, y, RATE, 2, GRID.excited, "reference", u)
    corrected = np.mean(found.distortion.even.power)
    lines = np.abs(np.fft.rfft(y[:, SAMPLES:], axis=1)) * 2 / SAMPLES
    raw = np.mean(0.5 * lines[:, left_out(GRID, 0)] ** 2)
    assert corrected < 1e-2 * raw


def test_a_transient_is_taken_off() -> None:
    """From rest, with a mode that rings for long: the lines are those of the steady state."""
    random = np.random.default_rng(9)
    drive = random_drive(random)
    fine = 8
    time = np.arange(SAMPLES * 2 * fine) / (RATE * fine)
    grid = odd_grid(0.5, 70.0, PERIOD, 2)
    u = np.array([random_phases(grid, 1.0, m).sample(time) for m in range(7)])
    y = drive.rates(u, RATE * fine)[0][:, ::fine]
    noise = 0.01 * np.std(y)
    y += noise * random.standard_normal(y.shape)
    found = best_linear(u[:, ::fine], y, RATE, 2, grid.excited)
    truth = drive.response(found.response.frequency, "motor")
    lines = 2 * grid.excited
    raw = np.fft.rfft(y)[:, lines] / np.fft.rfft(u[:, ::fine])[:, lines]
    assert np.max(np.abs(raw / truth - 1.0)) > 0.05
    error = np.abs(found.response.values - truth)
    assert np.mean(error < radius(found.response)) > 0.85
    assert np.median(error / np.abs(truth)) < 0.01


def test_in_a_loop_the_reference_is_needed_and_suffices() -> None:
    drive = Drive(2.0, 1.0, 4000.0, 3.0, 9.0)
    a, b, c = loop_of(drive, 60.0, 100.0)
    fine = 16
    time = np.arange(SAMPLES * 2 * fine) / (RATE * fine)
    r = np.array([random_phases(GRID, 1.0, m).sample(time) for m in range(7)])
    random = np.random.default_rng(4)
    held = np.repeat(random.standard_normal((7, SAMPLES * 2)), fine, axis=1)
    out = simulated(a, b, c, np.array([r, 40.0 * held, 0 * r]), RATE * fine)[..., ::fine]
    torque, rate = out[0] + 60.0 * r[:, ::fine], out[1]
    with pytest.raises(ValueError, match="mixture of the plant and its controller"):
        best_linear(torque, rate, RATE, 2, GRID.excited, "reference")
    found = best_linear(torque, rate, RATE, 2, GRID.excited, "reference", r[:, ::fine])
    truth = drive.response(found.response.frequency, "motor")
    assert np.mean(np.abs(found.response.values - truth) < radius(found.response)) > 0.85


@pytest.mark.parametrize(
    ("realisations", "periods", "told"),
    [(1, 2, "single realisation"), (5, 2, "5 realisations"), (7, 1, "single period"), (7, 2, "")],
)
def test_what_too_little_leaves_open_is_said(realisations: int, periods: int, told: str) -> None:
    u = inputs(realisations, periods)
    found = best_linear(u, distorted(u, 0.002, 1), RATE, periods, GRID.excited)
    assert (told in " ".join(found.undetermined)) if told else not found.undetermined
    assert (found.distortion is None) == (periods == 1)
    if realisations == 1 and found.distortion is not None:
        even = total(found.distortion, "even")
        assert not even.has_interval
        assert even.reason in SINGLE_REALISATION
        v = inputs(7, 2)
        several = best_linear(v, distorted(v, 0.002, 1), RATE, 2, GRID.excited).distortion
        assert even.value == pytest.approx(total(several, "even").value, rel=0.2)


def test_refused() -> None:
    u = inputs(2, 2)
    with pytest.raises(ValueError, match="differ in shape"):
        best_linear(u, u[:, 1:], RATE, 2, GRID.excited)
    with pytest.raises(ValueError, match="not 3 whole periods"):
        best_linear(u, u, RATE, 3, GRID.excited)
    with pytest.raises(ValueError, match="no input"):
        best_linear(u, u, RATE, 2, left_out(GRID, 0))
    with pytest.raises(ValueError, match="lengthen the period"):
        odd_grid(1.0, 2.0, 1.0, 1)
