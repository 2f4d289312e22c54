"""Output error of a fitted response for a recorded input.

The spectrum of the input times the response is the output for a periodic input. Any other output
differs from it by free motions of the function's poles (Pintelon and Schoukens (2012), 2.6.3). They
are fitted with an offset and a drift. Both sides have the same zero-phase filter over the fitted
band, because at lower frequencies friction and offsets of the torque dominate the motion.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.intervals import of_positive_repeats

ORDER = 3
"""Order of the Butterworth filter, which runs forward and backward."""
FEWEST_PARTS = 8
"""Fewest parts of the recordings for an interval."""
PERIODS = 3.0
"""Least length of a part, in periods of the lowest frequency."""
LONGEST = 700.0
"""Largest exponent of a free motion."""


@dataclass(frozen=True)
class Simulated:
    """A recorded output and the simulated one within the band, shape (n,).

    Attributes:
        time: (s).
        measured, simulated: after the same filter, without the ends.
    """

    time: Array
    measured: Array
    simulated: Array

    @property
    def relative(self) -> float:
        """Norm of the difference over that of the measured output."""
        left = np.linalg.norm(self.measured - self.simulated)
        return float(left / max(float(np.linalg.norm(self.measured)), 1e-300))


def simulated_output(
    input_: Array,
    output: Array,
    rate: float,
    response: Callable[[Array], ComplexArray],
    poles: ComplexArray,
    lowest: float,
    highest: float,
) -> Simulated:
    """Simulate the output of an input, evenly sampled at `rate` (Hz), shape (n,).

    Args:
        response: output over input at frequencies (Hz), shape (n,).
        poles: of the response (rad/s).
        lowest, highest: of the band (Hz).

    Raises ValueError for a recording shorter than six periods of `lowest`, or a band above half
    the sampling rate.
    """
    from scipy.signal import butter, sosfiltfilt

    n = len(output)
    if n < 2.0 * PERIODS * rate / lowest:
        raise ValueError(f"it is shorter than {2.0 * PERIODS:g} periods of {lowest:.3g} Hz")
    highest = min(highest, 0.45 * rate)
    if not lowest < highest:
        raise ValueError("the band lies above half the sampling rate")
    frequency = np.asarray(np.fft.rfftfreq(n, 1.0 / rate), dtype=np.float64)
    inside = frequency > 0.1 * lowest
    spectrum = np.fft.rfft(input_ - np.mean(input_))
    spectrum[~inside] = 0.0
    spectrum[inside] *= response(frequency[inside])
    time = np.arange(n) / rate
    columns = np.column_stack(
        [np.fft.irfft(spectrum, n), output - np.mean(output), *_free(poles, time)]
    )
    band = butter(ORDER, (lowest, highest), "bandpass", fs=rate, output="sos")
    filtered = sosfiltfilt(band, columns, axis=0)
    # The ends contain transients of the filter and of the assumed period.
    cut = round(PERIODS * rate / lowest / 2.0)
    inner = filtered[cut : n - cut]
    periodic, measured, free = inner[:, 0], inner[:, 1], inner[:, 2:]
    sizes, *_ = np.linalg.lstsq(free, measured - periodic, rcond=1e-8)
    return Simulated(time[cut : n - cut], measured, periodic + free @ sizes)


def _free(poles: ComplexArray, time: Array) -> list[Array]:
    """Offset, drift and free motions, each with the largest value 1."""
    motions = [np.ones_like(time), time / time[-1]]
    for pole in poles[poles.imag >= 0.0]:
        begin = time if pole.real <= 0.0 else time - time[-1]
        motion = np.exp(np.clip(pole.real * begin, -LONGEST, 0.0)) * np.exp(1j * pole.imag * time)
        motions += [motion.real, motion.imag] if pole.imag > 0.0 else [motion.real]
    return motions


def output_error(name: str, simulated: Sequence[Simulated], lowest: float) -> Estimate:
    """Relative error of the output over all recordings, with an interval over parts of them.

    lowest: of the band (Hz); a part has at least three periods of it, if the recording has.
    """
    parts = []
    for each in simulated:
        step = float(each.time[1] - each.time[0])
        longest = max(int(len(each.time) * step * lowest / PERIODS), 1)
        count = min(longest, max(1, -(-FEWEST_PARTS // len(simulated))))
        parts += [
            Simulated(each.time[rows], each.measured[rows], each.simulated[rows])
            for rows in np.array_split(np.arange(len(each.time)), count)
        ]
    shares = [max(each.relative, 1e-12) for each in parts]
    return of_positive_repeats(name, shares, "", "parts of recordings")
