"""Even and odd distortion of the output, at lines where the excitation has none.

What an amplifier or a loop puts at those lines itself is taken off through the response there
(Pintelon and Schoukens (2012), 4.3.2). At odd lines left out the distortion is that of the excited
ones beside them, as far as neither is special: one of every few was drawn at random.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from campaign.estimate import Estimate
from campaign.identification.frequency.line_spectra import LineSpectra
from campaign.identification.frequency.multisine import Lines
from campaign.identification.frequency_response import Array, ComplexArray
from campaign.identification.intervals import LEVEL, student

Parity = Literal["even", "odd"]


@dataclass(frozen=True)
class Level:
    """The output at detection lines of one parity, corrected for the input there.

    Attributes:
        frequency: (Hz), shape (n,).
        power: squared rms of each line in each realisation, noise included, shape (m, n).
        noise: squared rms of the noise in one realisation, shape (n,).
        noise_freedom: real degrees of freedom behind `noise` at each line.
        shared: how many lines share what tells their noise.
        share: detection lines over all lines of that parity in the band.
    """

    frequency: Array
    power: Array
    noise: Array
    noise_freedom: float
    shared: float
    share: float

    @property
    def rms(self) -> Array:
        """Of each line without noise, zero where there is not more than that, shape (n,)."""
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
        """Where there is more than noise, at 1 % for each line, shape (n,) of bool."""
        from scipy.stats import f

        most = f.ppf(0.99, 2 * len(self.power), self.noise_freedom)
        return np.asarray(np.mean(self.power, axis=0) > most * self.noise)


@dataclass(frozen=True)
class Distortion:
    """Both parities, and the output beside them.

    Attributes:
        output: squared rms of the output at all excited lines together, shape (m,).
        excited: mean squared rms of the output at each excited line, shape (k,).
    """

    even: Level
    odd: Level
    output: Array
    excited: Array


def detected(
    found: LineSpectra, covariance: ComplexArray, excited: Lines, values: ComplexArray
) -> Distortion:
    """Levels at the lines between the first and the last excited one.

    Args:
        found: input and output are its first two signals.
        covariance: of their noise, `found.noise`.
        excited: lines, shape (k,); `values`: the response there, shape (k,).
    """
    within = np.arange(excited[0] + 1, excited[-1], dtype=np.int64)
    odd = np.setdiff1d(within[within % 2 == 1], excited)
    even = np.setdiff1d(within[within % 2 == 0], excited)
    all_odd = len(odd) + len(excited)
    answered = 0.5 * np.abs(found.lines[1][:, excited - 1]) ** 2

    def level(lines: Lines, share: float) -> Level:
        there = np.interp(lines, excited, values.real) + 1j * np.interp(lines, excited, values.imag)
        left = found.lines[1][:, lines - 1] - there * found.lines[0][:, lines - 1]
        row = np.stack([-there, np.ones_like(there)], axis=1)
        noise = np.einsum("ka,kab,kb->k", row, covariance[lines - 1, :2, :2], np.conj(row)).real
        power = 0.5 * np.abs(left) ** 2
        known = found.freedom, found.shared
        return Level(found.frequency[lines - 1], power, 0.5 * noise, *known, share)

    return Distortion(
        level(even, 1.0),
        level(odd, len(odd) / max(all_odd, 1)),
        np.sum(answered, axis=1),
        np.mean(answered, axis=0),
    )


def total(distortion: Distortion, parity: Parity) -> Estimate:
    """Rms of all even or odd distortion in the band over that of the output, by its logarithm.

    Odd distortion is measured at the lines left out and counts for all odd ones. Where the interval
    of its power holds zero, it is a bound: at most that.
    """
    level = distortion.even if parity == "even" else distortion.odd
    name = f"{parity}_distortion"
    method = f"power at {parity} detection lines less noise, over that of the output"
    count = len(level.power)
    if not len(level.frequency):
        return _none(name, f"there is no {parity} detection line")
    ratio = (np.sum(level.power, axis=1) - np.sum(level.noise)) / (
        max(level.share, 1e-300) * distortion.output
    )
    mean = float(np.mean(ratio))
    if count < 2:
        # Lines of one set of phases are no independent draws: what they scatter holds too little.
        if mean <= 0:
            return _none(name, "not more than the noise shows, in a single realisation")
        reason = "a single realisation does not show how distortion scatters with the phases"
        return Estimate.without_interval(name, math.sqrt(mean), "", reason, method=method)
    scatter = float(np.std(ratio, ddof=1)) / math.sqrt(count)
    # The noise that is taken off is the same in all realisations.
    unsure = math.sqrt(float(np.sum(level.noise**2)) * 2.0 * level.shared / level.noise_freedom)
    whole = max(level.share, 1e-300) * float(np.mean(distortion.output))
    noise = unsure / whole
    half = student(count - 1) * math.hypot(scatter, noise)
    if mean - half <= 0 or np.any(ratio <= 0):
        most = math.sqrt(max(mean, 0.0) + half)
        reason = "not more than the noise shows; a bound"
        return Estimate(name, most, "", method=method, kind="at most", reason=reason)
    lines = student(math.inf) * _by_lines(level) / whole / mean
    ends = _ends(ratio, mean, math.hypot(scatter, noise) / mean, lines)
    return Estimate(name, math.sqrt(mean), "", *ends, LEVEL, method, freedom=count - 1)


def _by_lines(level: Level) -> float:
    """What another draw of detection lines would change of their power together (1 sigma).

    Of every few lines one was drawn: strata of one draw each, whose variance neighbours tell, as
    far as their means are alike, and with what the means differ by otherwise (collapsed strata:
    Cochran, "Sampling Techniques" (1977), 5A.12). None is left where all lines are detection lines.
    """
    power = np.mean(level.power, axis=0) - level.noise
    if level.share >= 1.0 or len(power) < 2:
        return 0.0
    pairs = power[: len(power) // 2 * 2].reshape(-1, 2)
    apart = float(np.sum((pairs[:, 0] - pairs[:, 1]) ** 2))
    if len(power) % 2:
        apart += 0.5 * float((power[-1] - power[-2]) ** 2)
    return math.sqrt((1.0 - level.share) * apart)


def _ends(ratio: Array, mean: float, error: float, lines: float) -> tuple[float, float]:
    """Of the root of the mean of positive powers, shape (m,), with its relative error.

    `lines`: what another draw of lines may change besides, as a half-width.

    Powers of few realisations are skewed: their mean lies low more often than high. So beside the
    mean there is Cox's estimate of that of a log-normal distribution, and the hull of both
    intervals counts (Zhou and Gao, Statistics in Medicine 16 (1997) 783).
    """
    count, logarithm = len(ratio), np.log(ratio)
    spread = float(np.var(logarithm, ddof=1))
    centre = float(np.mean(logarithm)) + 0.5 * spread
    own = math.sqrt(spread / count + 0.5 * spread**2 / (count - 1))
    half = math.hypot(student(count - 1) * max(own, error), lines)
    low = min(centre, math.log(mean)) - half
    high = max(centre, math.log(mean)) + half
    return math.exp(0.5 * low), math.exp(0.5 * high)


def _none(name: str, reason: str) -> Estimate:
    return Estimate.without_interval(name, math.nan, "", reason)
