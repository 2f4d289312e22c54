"""Band-limited Gaussian noise."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.excitation_design.multisines import first_passage
from campaign.estimation.frequency.multisine import Lines


def band_noise(
    lowest: float, highest: float, duration: float, rate: float, seed: int, order: int = 0
) -> Array:
    """Samples at `rate` (Hz), shape (duration * rate + 1,), with rms 1 and zero mean.

    White Gaussian noise after an ideal zero-phase band-pass, by a Fourier transform of the whole
    signal. The signal is periodic: its last sample is equal to the first. It begins at a zero of
    its `order`-th integral.

    Raises ValueError if the band has fewer than two lines of the duration, or exceeds half the
    rate.
    """
    count = round(duration * rate)
    first, last = int(np.ceil(lowest * duration - 1e-9)), int(highest * duration + 1e-9)
    if last < first + 1 or first < 1:
        raise ValueError(
            f"noise from {lowest:g} to {highest:g} Hz needs a duration of "
            f"{max(1.0 / max(lowest, 1e-9), 2.0 / max(highest - lowest, 1e-9)):.3g} s or more"
        )
    if last > count // 2:
        raise ValueError(f"noise up to {highest:g} Hz needs more than {2 * highest:g} samples/s")
    random = np.random.default_rng(seed)
    spectrum = np.fft.rfft(random.standard_normal(count))
    lines = np.arange(len(spectrum))
    spectrum[(lines < first) | (lines > last)] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        integrated = np.where(lines > 0, spectrum / (2j * np.pi * lines) ** order, 0.0)
    turn = _passage(integrated[first : last + 1], lines[first : last + 1], count)
    noise = np.fft.irfft(spectrum * np.exp(2j * np.pi * lines * turn), count)
    noise /= np.sqrt(np.mean(noise**2))
    if order == 0:
        noise[0] = 0.0  # removes a rounding error: a jump of a rate is an infinite acceleration
    return np.append(noise, noise[0])


def _passage(spectrum: ComplexArray, lines: Lines, count: int) -> float:
    """First zero of the signal with these lines, as a share of its period."""
    whole = np.zeros(count // 2 + 1, dtype=complex)
    whole[lines] = spectrum
    course = np.fft.irfft(whole, count)

    def value(share: float) -> float:
        return float(np.real(np.sum(spectrum * np.exp(2j * np.pi * lines * share))))

    return first_passage(course, value)
