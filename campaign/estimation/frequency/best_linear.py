"""Best linear approximation from repeated multisines: the robust method.

The scatter over realisations of the phases contains noise and nonlinear distortion. The scatter
over periods contains only noise. Their comparison separates the two (Pintelon and Schoukens,
"System Identification: A Frequency Domain Approach" (2012), 4.3). A best linear approximation
applies to its excitation only. Therefore the result includes the rms, band and distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.distortion import Distortion, detected
from campaign.estimation.frequency.line_spectra import LineSpectra, line_spectra
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.multisine import Lines
from campaign.estimation.frequency.welch import NO_REFERENCE, Excited

FEWEST_REALISATIONS = 7
"""Least number of realisations whose variance can weight a fit (Pintelon, Schoukens: 4.3.1)."""


NOTHING = 1e-9
"""Share of the largest line below which a line has no input."""


@dataclass(frozen=True)
class Excitation:
    """Excitation to which a best linear approximation applies.

    Attributes:
        rms: of the input without its mean, in its unit.
        lowest, highest: frequencies of the excited lines (Hz).
        lines: number of excited lines.
        crest: largest value of the input over its rms, averaged over realisations.
        odd: whether only lines of odd number are excited.
        unit: unit of the input, for display.
    """

    rms: float
    realisations: int
    periods: int
    lowest: float
    highest: float
    lines: int
    crest: float
    odd: bool = True
    unit: str = ""

    def __str__(self) -> str:
        rms = f"{self.rms:.4g} {self.unit}".rstrip()
        kind = "odd random-phase" if self.odd else "odd and even"
        return (
            f"{kind} multisine, {self.lines} lines from "
            f"{self.lowest:.4g} to {self.highest:.4g} Hz, rms {rms}, crest factor "
            f"{self.crest:.3g}, {self.realisations} realisations of {self.periods} periods"
        )


@dataclass(frozen=True)
class BestLinear:
    """Response at the excited lines, with noise and distortion of the output.

    Attributes:
        response: its variance over realisations contains noise and stochastic nonlinear part.
            With a single realisation it contains only noise (see `undetermined`).
        noise: variance of the response by noise, shape (n,); NaN for a single period.
        distortion: output at the detection lines; None for a single period.
        undetermined: sentences on what this measurement does not determine, and why.
    """

    response: MeasuredResponse
    noise: Array
    distortion: Distortion | None
    excitation: Excitation
    undetermined: tuple[str, ...]


def best_linear(
    input_: Array,
    output: Array,
    rate: float,
    periods: int,
    excited: Lines,
    acts_on: Excited = "input",
    reference: Array | None = None,
) -> BestLinear:
    """Best linear approximation from whole periods of m realisations.

    The signals have the shape (m, periods * samples) at `rate` (Hz). The first period may contain
    the transient: the lines between the period's harmonics determine it.

    Args:
        excited: excited lines of the period, ascending, shape (k,).
        acts_on: `input`: the input is set from outside; `reference`: a loop generates the input,
            and `reference` is the external signal of the loop, shape (m, periods * samples).

    Raises ValueError for a loop without its reference, for different shapes, and for an excited
    line without input.
    """
    if acts_on == "reference" and reference is None:
        raise ValueError(NO_REFERENCE)
    signals = [np.atleast_2d(input_), np.atleast_2d(output)]
    if reference is not None:
        signals.append(np.atleast_2d(reference))
    if len({each.shape for each in signals}) > 1:
        raise ValueError("input, output and reference differ in shape")
    samples = signals[0].shape[1] // max(periods, 1)
    spectra = line_spectra(np.stack(signals), rate, periods, (excited[-1] + 1.5) * rate / samples)
    if len(spectra.frequency) < excited[-1]:
        raise ValueError("the highest excited line lies above half the sampling rate")
    leading = spectra.lines[2 if reference is not None else 0]
    phase = leading / np.maximum(np.abs(leading), 1e-300)
    response, noise = _response(spectra.conjugated(phase), excited - 1)
    described = _excitation(signals[0], spectra, excited)
    distortion = None
    if spectra.noise is not None:
        distortion = detected(spectra, spectra.noise, excited, response.values)
    return BestLinear(response, noise, distortion, described, _undetermined(described))


def _response(found: LineSpectra, at: Lines) -> tuple[MeasuredResponse, Array]:
    """Response at the lines `at`, and its variance by noise."""
    lines = found.lines[:2][..., at]
    realisations = lines.shape[1]
    mean = np.mean(lines, axis=1)
    largest = float(np.max(np.abs(found.lines[0])))
    if np.any(np.abs(mean[0]) <= NOTHING * largest):
        raise ValueError("an excited line has no input; are these its lines?")
    values = mean[1] / mean[0]
    noise = np.full(len(at), np.nan)
    if found.noise is not None:
        noise = _spread(values, found.noise[at, :2, :2], mean[0]) / realisations
    if realisations > 1:
        apart = lines - mean[:, None]
        spread = np.einsum("amk,bmk->kab", apart, np.conj(apart)) / (realisations - 1)
        variance = _spread(values, spread, mean[0]) / realisations
        freedom = 2.0 * (realisations - 1)
    else:
        variance, freedom = noise, found.freedom
    power = np.mean(np.abs(lines[1]) ** 2, axis=0)
    linear = np.abs(values) ** 2 * np.mean(np.abs(lines[0]) ** 2, axis=0)
    response = MeasuredResponse(
        found.frequency[at],
        values,
        variance,
        np.full(len(at), freedom),
        np.minimum(linear / np.maximum(power, 1e-300), 1.0),
        np.zeros(len(at)),
        "best linear approximation",
    )
    return response, noise


def _spread(values: ComplexArray, covariance: ComplexArray, input_: ComplexArray) -> Array:
    """Variance of output over input, from the covariance (k, 2, 2) of input and output."""
    row = np.stack([-values, np.ones_like(values)], axis=1)
    total = np.einsum("ka,kab,kb->k", row, covariance, np.conj(row)).real
    return np.asarray(np.maximum(total, 0.0) / np.abs(input_) ** 2)


def _excitation(input_: Array, found: LineSpectra, excited: Lines) -> Excitation:
    moving = input_ - np.mean(input_, axis=1, keepdims=True)
    rms = np.sqrt(np.mean(moving**2, axis=1))
    crest = np.max(np.abs(moving), axis=1) / np.maximum(rms, 1e-300)
    ends = found.frequency[excited[[0, -1]] - 1]
    return Excitation(
        float(np.sqrt(np.mean(rms**2))),
        input_.shape[0],
        found.periods,
        float(ends[0]),
        float(ends[1]),
        len(excited),
        float(np.mean(crest)),
        bool(np.all(excited % 2 == 1)),
    )


def _undetermined(excitation: Excitation) -> tuple[str, ...]:
    """Sentences on what too few realisations or periods do not determine."""
    sentences = []
    if excitation.periods < 2:
        sentences.append(
            "A single period determines neither noise nor distortion nor transient: record two "
            "periods or more of each realisation."
        )
    if excitation.realisations < 2:
        sentences.append(
            "The nonlinear part of the variance is not determined by a single realisation: the "
            "response holds for these phases, and its intervals hold noise alone."
        )
    elif excitation.realisations < FEWEST_REALISATIONS:
        sentences.append(
            f"{excitation.realisations} realisations estimate the variance too roughly for the "
            f"weights of a fit: intervals of modes, margins and parameters need "
            f"{FEWEST_REALISATIONS}."
        )
    return tuple(sentences)
