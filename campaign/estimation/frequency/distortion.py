"""Even and odd distortion of the output at lines without excitation.

An amplifier or a loop also causes input at those lines. Its effect, input times response, is
subtracted (Pintelon and Schoukens (2012), 4.3.2). Odd distortion also occurs at the excited lines,
where it scatters over realisations. A single realisation does not show that scatter: then the
omitted lines represent all lines, with an error of several dB if one mode has most of the power.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.frequency.line_spectra import LineSpectra
from campaign.estimation.frequency.multisine import Lines
from campaign.estimation.intervals import LEVEL, student
from campaign.reason import Cause, Reason

Parity = Literal["even", "odd"]
SHARED_LINES = Cause(
    "shared lines", "even lines are excited, too: even and odd distortion share lines"
)
NO_LINE = Cause("no detection line", "there is no {parity} detection line")
HIDDEN_IN_ONE = Cause(
    "noise of a single realisation", "not more than the noise shows, in a single realisation"
)
SINGLE_REALISATION = Cause(
    "single realisation",
    "a single realisation does not show how distortion scatters with the phases",
)
SINGLE_ODD = Cause(
    "single realisation of odd lines",
    SINGLE_REALISATION.text
    + ", nor what of it is at the excited lines: those left out stand for all",
)
WITHIN_NOISE = Cause("within noise", "not more than the noise shows; a bound")


@dataclass(frozen=True)
class Level:
    """Output at detection lines of one parity, corrected for the input there.

    Attributes:
        frequency: (Hz), shape (n,).
        power: squared rms of each line in each realisation, noise included, shape (m, n).
        noise: squared rms of the noise in one realisation, shape (n,).
        noise_freedom: real degrees of freedom of `noise` at each line.
        shared: number of lines with a common noise estimate.
        share: detection lines over all lines of that parity in the band.
        recorded: squared rms of the output without the correction, shape (n,).
    """

    frequency: Array
    power: Array
    noise: Array
    noise_freedom: float
    shared: float
    share: float
    recorded: Array

    @property
    def rms(self) -> Array:
        """Rms of each line without noise, zero where noise exceeds it, shape (n,)."""
        return np.asarray(np.sqrt(np.maximum(np.mean(self.power, axis=0) - self.noise, 0.0)))

    def interval(self, level: float = LEVEL) -> tuple[Array, Array]:
        """Low and high of `rms`, each of shape (n,): power follows chi-square with 2 m."""
        from scipy.stats import chi2

        twice = 2 * len(self.power)
        power = np.mean(self.power, axis=0)
        low = power * twice / chi2.ppf(0.5 + 0.5 * level, twice) - self.noise
        high = power * twice / chi2.ppf(0.5 - 0.5 * level, twice) - self.noise
        return np.sqrt(np.maximum(low, 0.0)), np.sqrt(np.maximum(high, 0.0))

    @property
    def significant(self) -> np.ndarray:
        """Whether each line exceeds noise, at 1 %, shape (n,) of bool."""
        from scipy.stats import f

        most = f.ppf(0.99, 2 * len(self.power), self.noise_freedom)
        return np.asarray(np.mean(self.power, axis=0) > most * self.noise)


@dataclass(frozen=True)
class Distortion:
    """Distortion of both parities, with the output.

    Attributes:
        between: odd distortion at the excited lines, from the scatter over realisations; None for a
            single realisation.
        mixed: whether even lines are also excited; then the parities share lines.
        output: squared rms of the output at all excited lines together, shape (m,).
        excited: mean squared rms of the output at each excited line, shape (k,).
    """

    even: Level
    odd: Level
    output: Array
    excited: Array
    between: Level | None = None
    mixed: bool = False


def detected(
    found: LineSpectra, covariance: ComplexArray, excited: Lines, values: ComplexArray
) -> Distortion:
    """Levels at the lines between the first and the last excited one.

    Args:
        found: its first two signals are input and output.
        covariance: of their noise, `found.noise`.
        excited: lines, shape (k,). values: response at these lines, shape (k,).
    """
    within = np.arange(excited[0] + 1, excited[-1], dtype=np.int64)
    odd = np.setdiff1d(within[within % 2 == 1], excited)
    even = np.setdiff1d(within[within % 2 == 0], excited)
    all_odd = len(odd) + len(excited)
    answered = 0.5 * np.abs(found.lines[1][:, excited - 1]) ** 2

    def level(lines: Lines, share: float, grown: float = 1.0) -> Level:
        gain = np.interp(lines, excited, values.real) + 1j * np.interp(lines, excited, values.imag)
        rest = found.lines[1][:, lines - 1] - gain * found.lines[0][:, lines - 1]
        row = np.stack([-gain, np.ones_like(gain)], axis=1)
        noise = np.einsum("ka,kab,kb->k", row, covariance[lines - 1, :2, :2], np.conj(row)).real
        power = 0.5 * grown * np.abs(rest) ** 2
        known = found.freedom, found.shared
        recorded = np.mean(0.5 * np.abs(found.lines[1][:, lines - 1]) ** 2, axis=0)
        return Level(found.frequency[lines - 1], power, 0.5 * noise, *known, share, recorded)

    count = len(answered)
    return Distortion(
        level(even, 1.0),
        level(odd, len(odd) / max(all_odd, 1)),
        np.sum(answered, axis=1),
        np.mean(answered, axis=0),
        # The response contains the mean distortion of the realisations.
        level(excited, 1.0, count / (count - 1)) if count > 1 else None,
        bool(np.any(excited % 2 == 0)),
    )


def _all_odd(distortion: Distortion) -> Level:
    """Odd distortion at the omitted lines, and at the excited lines with several realisations."""
    odd, between = distortion.odd, distortion.between
    if between is None:
        return odd
    return replace(
        odd,
        frequency=np.concatenate([odd.frequency, between.frequency]),
        power=np.concatenate([odd.power, between.power], axis=1),
        noise=np.concatenate([odd.noise, between.noise]),
        share=1.0,
    )


def total(distortion: Distortion, parity: Parity) -> Estimate:
    """Rms of all even or odd distortion in the band over rms of the output.

    It is an upper bound if the interval of its power, or a realisation, is not above zero.
    """
    level = distortion.even if parity == "even" else _all_odd(distortion)
    name = f"{parity}_distortion"
    where = "detection lines" if level.share < 1.0 or parity == "even" else "lines"
    method = f"power at {parity} {where} less noise, over that of the output"
    count = len(level.power)
    if distortion.mixed:
        return _none(name, SHARED_LINES())
    if not len(level.frequency):
        return _none(name, NO_LINE(parity=parity))
    ratio = (np.sum(level.power, axis=1) - np.sum(level.noise)) / (
        max(level.share, 1e-300) * distortion.output
    )
    mean = float(np.mean(ratio))
    if count < 2:
        # Lines of one set of phases are not independent: their scatter is too small.
        if mean <= 0:
            return _none(name, HIDDEN_IN_ONE())
        reason = SINGLE_ODD() if parity == "odd" else SINGLE_REALISATION()
        return Estimate.without_interval(name, math.sqrt(mean), "", reason, method=method)
    scatter = float(np.std(ratio, ddof=1)) / math.sqrt(count)
    # The noise estimate is common to all realisations.
    unsure = math.sqrt(float(np.sum(level.noise**2)) * 2.0 * level.shared / level.noise_freedom)
    noise = unsure / (max(level.share, 1e-300) * float(np.mean(distortion.output)))
    half = student(count - 1) * math.hypot(scatter, noise)
    if mean - half <= 0 or np.any(ratio <= 0):
        most = math.sqrt(max(mean, 0.0) + half)
        reason = WITHIN_NOISE()
        return Estimate(name, most, "", method=method, kind="at most", reason=reason)
    ends = _ends(ratio, mean, math.hypot(scatter, noise) / mean)
    return Estimate(name, math.sqrt(mean), "", *ends, LEVEL, method, freedom=count - 1)


def _ends(ratio: Array, mean: float, error: float) -> tuple[float, float]:
    """Interval of the root of the mean of positive powers, shape (m,), with its relative error.

    Powers of few realisations are skewed: their mean is more often too low than too high. The
    result is the hull of the intervals around the mean and around Cox's estimate for a log-normal
    distribution (Zhou and Gao, Statistics in Medicine 16 (1997) 783).
    """
    count, logarithm = len(ratio), np.log(ratio)
    spread = float(np.var(logarithm, ddof=1))
    centre = float(np.mean(logarithm)) + 0.5 * spread
    own = math.sqrt(spread / count + 0.5 * spread**2 / (count - 1))
    half = student(count - 1) * max(own, error)
    low = min(centre, math.log(mean)) - half
    high = max(centre, math.log(mean)) + half
    return math.exp(0.5 * low), math.exp(0.5 * high)


def _none(name: str, reason: Reason) -> Estimate:
    return Estimate.without_interval(name, math.nan, "", reason)
