"""Responses from averaged spectra: H1, H2, Hv, or with a loop's reference.

The caller must state the excited signal, because no recording shows it. In a closed loop without an
external signal, output over input lies between the response of the plant and the negative inverse
of that of the controller (Bendat and Piersol, "Random Data" (2010), 9.3; Ljung, "System
Identification" (1999), 13.4). With an external signal r it is S_yr / S_ur for any controller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.measured_response import MeasuredResponse

Estimator = Literal["H1", "H2", "Hv"]
Excited = Literal["input", "reference"]
SEGMENTS = 16
"""Default number of segment lengths in all recordings."""
FEWEST_AVERAGES = 4.0
"""Effective averages below which spectra do not determine their own scatter."""
WINDOW, OVERLAP = "hann", 0.5
"""Window of the segments by its name in `scipy.signal`; share of a segment in the next one."""
FIRST_LINE = 2
"""First line used: the lines below contain the mean, spread by the window."""
STRONG = 10.0
"""First-stage F above which a reference excites the input at a line (Staiger, Stock)."""

NO_REFERENCE = (
    "a closed loop without its reference: output over input would be a mixture of the plant and "
    "its controller; record what comes into the loop from outside"
)


@dataclass(frozen=True)
class Record:
    """One recording: evenly sampled at `rate` (Hz), signals of shape (n,).

    `reference`: external signal of a loop (a command, an added torque).
    """

    rate: float
    input_: Array
    output: Array
    reference: Array | None = None


@dataclass(frozen=True)
class Spectra:
    """Averaged auto and cross spectra at n frequencies (Hz), on a common scale, shape (n,).

    Attributes:
        cross: S_yu, output times the conjugate of the input.
        of_reference: S_rr, S_yr and S_ur where there is a reference.
        averages: effective number of independent segments.
        segment: length of a segment in samples.
    """

    frequency: Array
    input_: Array
    output: Array
    cross: ComplexArray
    of_reference: tuple[Array, ComplexArray, ComplexArray] | None
    averages: float
    segment: int
    method: str

    @property
    def coherence(self) -> Array:
        """|S_yu|² / (S_uu S_yy), shape (n,)."""
        return _coherence(self.cross, self.output, self.input_)


def _coherence(cross: ComplexArray, one: Array, other: Array) -> Array:
    product = np.maximum(one * other, 1e-300)
    return np.asarray(np.minimum(np.abs(cross) ** 2 / product, 1.0))


def spectra(records: Sequence[Record], segment: int | None = None) -> Spectra:
    """Spectra averaged over the segments of all records (Welch, IEEE Trans. AU-15 (1967) 70).

    segment: length in samples; the resolution is rate / segment. Default: 1/16 of all samples, at
        most the length of the shortest record.

    Raises ValueError for records of different rates, or too short for enough averages.
    """
    from scipy.signal import get_window

    if not records:
        raise ValueError("there is no record")
    rates = {record.rate for record in records}
    if len(rates) > 1:
        raise ValueError("the records were sampled at different rates")
    shortest, total = (of(len(record.output) for record in records) for of in (min, sum))
    length = segment or min(max(total // SEGMENTS, 8), shortest)
    if length < 8 or length > shortest:
        raise ValueError(f"a segment of {length} samples; the shortest record has {shortest}")
    shape = get_window(WINDOW, length)
    step = round(length * (1.0 - OVERLAP))
    with_reference = all(record.reference is not None for record in records)
    parts = [_segments(record, shape, step, with_reference) for record in records]
    weight = _worth(shape, step, [part.shape[1] for part in parts])
    if weight < FEWEST_AVERAGES:
        raise ValueError(
            f"{weight:.1f} independent segments; {FEWEST_AVERAGES:g} are the fewest: shorten the "
            "segments or record longer"
        )
    lines = np.concatenate(parts, axis=1)[:, :, FIRST_LINE : (length + 1) // 2]
    u, y = lines[0], lines[1]
    rate = records[0].rate
    frequency = np.arange(FIRST_LINE, (length + 1) // 2) * rate / length

    def mean(one: ComplexArray, other: ComplexArray) -> ComplexArray:
        return np.asarray(np.mean(one * np.conj(other), axis=0))

    of_reference = None
    if with_reference:
        r = lines[2]
        of_reference = (mean(r, r).real, mean(y, r), mean(u, r))
    method = (
        f"{WINDOW} segments of {length / rate:.4g} s, overlap {100 * OVERLAP:.0f} %, "
        f"{weight:.1f} effective averages"
    )
    autos = mean(u, u).real, mean(y, y).real
    return Spectra(frequency, *autos, mean(y, u), of_reference, weight, length, method)


def _segments(record: Record, shape: Array, step: int, with_reference: bool) -> ComplexArray:
    """Spectra of the windowed segments of input, output and reference, shape (2 or 3, m, lines)."""
    signals = [record.input_, record.output]
    if with_reference and record.reference is not None:
        signals.append(record.reference)
    stacked = np.stack([np.asarray(each, dtype=float) for each in signals])
    if not np.all(np.isfinite(stacked)):
        raise ValueError("a signal has samples that are no numbers")
    cut = np.lib.stride_tricks.sliding_window_view(stacked, len(shape), axis=1)[:, ::step]
    level = np.mean(cut, axis=2, keepdims=True)
    return np.asarray(np.fft.rfft((cut - level) * shape, axis=2))


def _worth(shape: Array, step: int, counts: Sequence[int]) -> float:
    """Effective number of overlapping segments, for white signals (Welch 1967)."""
    total = 0.0
    power = float(np.sum(shape**2))
    for count in counts:
        shared = 0.0
        for k in range(1, min(count, -(-len(shape) // step))):
            alike = float(np.sum(shape[k * step :] * shape[: -k * step])) / power
            shared += 2.0 * (1.0 - k / count) * alike**2
        total += count / (1.0 + shared)
    return total


def welch_response(
    records: Sequence[Record],
    excited: Excited,
    estimator: Estimator = "H1",
    segment: int | None = None,
) -> MeasuredResponse:
    """Output over input; scatter from coherence and averages, bias from half the segment length.

    Args:
        excited: `input`: the input is set from outside, without feedback; `reference`: a loop
            generates the input, and `Record.reference` is the external signal of the loop.
        estimator: for an excited input: H1 = S_yu / S_uu (noise on the output only), H2 = S_yy /
            S_uy (on the input only), Hv: their geometric mean (on both). With a reference the
            estimator is always S_yr / S_ur.

    Lines that the reference does not excite (first-stage F below 10) are omitted.
    Raises ValueError for a loop without its reference, and as `spectra` does.
    """
    if excited == "reference" and any(record.reference is None for record in records):
        raise ValueError(NO_REFERENCE)
    whole = spectra(records, segment)
    response = _of_spectra(whole, excited, estimator)
    if whole.segment // 2 >= 8:
        half = _of_spectra(spectra(records, whole.segment // 2), excited, estimator)
        response = _with_bias(response, half)
    if excited == "input" or whole.of_reference is None:
        return response
    _, _, of_input = whole.of_reference
    alike = _coherence(of_input, whole.of_reference[0], whole.input_)
    strength = (whole.averages - 1.0) * alike / np.maximum(1.0 - alike, 1e-300)
    return response.at(strength > STRONG)


def _of_spectra(whole: Spectra, excited: Excited, estimator: Estimator) -> MeasuredResponse:
    n = whole.averages
    uu, yy, yu = whole.input_, whole.output, whole.cross
    tiny = 1e-300
    if excited == "input" or whole.of_reference is None:
        h1 = yu / np.maximum(uu, tiny)
        h2 = yy / np.where(np.abs(yu) > 0, np.conj(yu), tiny)
        ratio = np.sqrt(np.abs(h1) * np.abs(h2)) * np.exp(1j * np.angle(yu))
        values = {"H1": h1, "H2": h2, "Hv": ratio}[estimator]
        coherence = whole.coherence
        residual = (1.0 - coherence) / np.maximum(coherence, tiny)
        variance = np.abs(values) ** 2 * residual / (n - 1.0)
        if estimator == "H1":  # the same, without a division by a coherence of zero
            variance = yy * (1.0 - coherence) / np.maximum(uu, tiny) / (n - 1.0)
        name: str = estimator
    else:
        rr, yr, ur = whole.of_reference
        values = yr / np.where(np.abs(ur) > 0, ur, tiny)
        # Residual of the output: the reference causes no part of it.
        residual = yy - 2.0 * np.real(np.conj(values) * yu) + np.abs(values) ** 2 * uu
        residual = np.maximum(residual, 0.0) * n / (n - 1.0)
        variance = residual * rr / np.maximum(np.abs(ur) ** 2, tiny) / n
        coherence = _coherence(yr, yy, rr)
        name = "S_yr / S_ur"
    freedom = np.full(len(values), 2.0 * (n - 1.0))
    zero = np.zeros(len(values))
    method = f"{name}: {whole.method}"
    return MeasuredResponse(
        whole.frequency, np.asarray(values), variance, freedom, coherence, zero, method
    )


def _with_bias(found: MeasuredResponse, half: MeasuredResponse) -> MeasuredResponse:
    """Add the bias that the length of the segments causes.

    It decreases with the square of the length (Hann). Therefore it is a third of the change at half
    the length. Scatter is subtracted from that change, which is then averaged over five lines.
    """
    coarse = np.interp(found.frequency, half.frequency, half.values.real) + 1j * np.interp(
        found.frequency, half.frequency, half.values.imag
    )
    change = np.abs(coarse - found.values) ** 2
    # With half the length a line has half the variance; both lengths share most of it.
    chance = np.interp(found.frequency, half.frequency, half.variance)
    kernel = np.full(5, 0.2)
    smooth = np.convolve(np.pad(change - chance, 2, mode="edge"), kernel, "valid")
    return replace(found, bias=np.sqrt(np.maximum(smooth, 0.0)) / 3.0)
