"""Band-limited Gaussian noise."""

from __future__ import annotations

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.excitation_design.multisines import first_passage
from campaign.estimation.frequency.multisine import Lines


def band_noise(
    lowest: float, highest: float, duration: float, rate: float, seed: int, order: int = 0
) -> Array:
    """Samples at `rate` (Hz), shape (duration * rate + 1,), of rms 1 and of no mean.

    White Gaussian noise behind a filter without phase and with straight edges, which one transform
    of the whole makes. The first and the last sample are one: it begins where its `order`-th
    integral passes zero.

    Raises ValueError where the band has fewer than two lines of the duration, or reaches beyond
    half the rate.
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
        noise[0] = 0.0  # of which rounding leaves something, and a jump asks for any acceleration
    return np.append(noise, noise[0])


def _passage(spectrum: ComplexArray, lines: Lines, count: int) -> float:
    """Share of the period at which a signal of these lines passes zero, exactly."""
    whole = np.zeros(count // 2 + 1, dtype=complex)
    whole[lines] = spectrum
    course = np.fft.irfft(whole, count)

    def value(share: float) -> float:
        return float(np.real(np.sum(spectrum * np.exp(2j * np.pi * lines * share))))

    return first_passage(course, value)
