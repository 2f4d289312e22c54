"""Stabilization error of a recording, and of several trials.

It is the standard deviation s of the pointing error, about the mean of the whole record. In a
sinusoidal motion each half cycle has one reversal, and gives one value of s. Intervals are
calculated in ln s, because the scatter of s is proportional to s. The interval of one trial
applies to that trial: only several trials show how friction differs between trials.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from campaign.arrays import Array
from campaign.estimate import OF_ONE_TRIAL, Estimate
from campaign.estimation.intervals import exponential, of_positive_repeats, ratio, with_error
from campaign.estimation.sampled_curve import LOST
from campaign.reason import Cause, Reason

NAME, UNIT = "stabilization_error", "rad"
ALIKE = 1e-5
"""Relative standard error below which there is no scatter: the size of the numerical error of a
simulation without noise."""
HARDLY = 10 * ALIKE
"""Relative standard error up to which the scatter of one side of a quotient is negligible."""
IDENTICAL = 1e-12
"""As `ALIKE`, for two values, which may agree by chance, and for trials of one seed."""
NO_SCATTER = Cause("not scattering", "repeats agree to the fifth digit: the bench has no scatter")
SHORT = Cause("record too short", "less than one cycle was recorded")
TOO_FEW_FOR_BLOCKS = Cause("too few samples for blocks", "too few samples for {blocks} blocks")
SHORT_BLOCK = Cause(
    "blocks too short",
    "a block is only {times:.2g} times as long as what the error remembers",
)
SHORTFALL = 1.5 + 1e-3
"""Samples that a window of whole cycles may lack, including the rounding of its times."""
BLOCKS = 6
"""Blocks of an irregular record; with ten, coverage is 90 % for 37 periods of narrow-band noise."""
MEMORY = 4.0
"""Least length of a block, in correlation times of the squared deviation."""


def over_cycles(samples: Array, per_cycle: float) -> Estimate:
    """Standard deviation over whole cycles; t over half cycles, in the logarithm.

    With the mean squares m of n half cycles about the common mean, ln s has the standard error
    sd(m) / (2 mean(m) sqrt(n)) and n - 1 degrees of freedom. Valid for a correlation time of the
    noise that is short against a half cycle: at a fifth of it, coverage is 94 %. Whole cycles in
    place of half cycles have a coverage of 80 to 86 %.

    Args:
        samples: pointing error, shape (k,); samples after the last whole cycle are not used.
        per_cycle: samples in one cycle of the motion; need not be an integer.
    """
    whole = whole_cycles(len(samples), per_cycle)
    if not whole:
        return _without(samples, NAME, UNIT, SHORT())
    used = samples[: round(whole * per_cycle)]
    edges = np.round(np.linspace(0, len(used), 2 * whole + 1)).astype(int)
    return _of_parts(used, edges, NAME, UNIT, "half cycles")


def whole_cycles(samples: int, per_cycle: float) -> int:
    """Number of whole cycles in `samples`; the last one may lack up to one and a half samples.

    Whole cycles seldom are whole samples: 2 cycles of 0.24 Hz are 8333.3 samples at 1 kHz. A window
    begins within half a sample, and a recording ends up to one sample early.
    """
    return int((samples + SHORTFALL) / per_cycle)


def over_blocks(samples: Array, name: str = NAME, unit: str = UNIT) -> Estimate:
    """Standard deviation of an irregular record, shape (k,); t over blocks, in the logarithm.

    Applies to any segment of a similar motion; coverage is 91 % for narrow-band noise with six
    periods in a block. No interval where a block is shorter than `MEMORY` correlation times of the
    squared deviation: then neighboring blocks are correlated.
    """
    if len(samples) < 2 * BLOCKS or not np.all(np.isfinite(samples)):
        return _without(samples, name, unit, TOO_FEW_FOR_BLOCKS(blocks=BLOCKS))
    block = len(samples) / BLOCKS
    memory = correlation_time((samples - np.mean(samples)) ** 2, int(block))
    if block < MEMORY * memory:
        reason = SHORT_BLOCK(times=block / memory)
        return _without(samples, name, unit, reason)
    edges = np.round(np.linspace(0, len(samples), BLOCKS + 1)).astype(int)
    return _of_parts(samples, edges, name, unit, "blocks")


def _of_parts(samples: Array, edges: NDArray[np.int_], name: str, unit: str, what: str) -> Estimate:
    """Standard deviation of all samples, with the scatter of the parts between `edges`."""
    if not np.all(np.isfinite(samples)):
        return _without(samples, name, unit, LOST())
    squares = (samples - np.mean(samples)) ** 2
    means = np.add.reduceat(squares, edges[:-1]) / np.diff(edges)
    mean = float(np.mean(squares))
    if not mean > 0:
        return Estimate.without_interval(name, 0.0, unit, NO_SCATTER())
    error = float(np.std(means, ddof=1)) / (2 * mean * math.sqrt(len(means)))
    if error < (ALIKE if len(means) > 2 else IDENTICAL):
        return Estimate.without_interval(name, math.sqrt(mean), unit, NO_SCATTER())
    method = f"standard deviation, Student's t over {len(means)} {what}, in the logarithm"
    inner = with_error(name, 0.5 * math.log(mean), "", error, len(means) - 1, method)
    deviation = exponential(inner, unit)
    return replace(deviation, reason=OF_ONE_TRIAL()) if deviation.has_interval else deviation


def _without(samples: Array, name: str, unit: str, reason: Reason) -> Estimate:
    """Standard deviation without an interval; NaN where samples are missing."""
    if not len(samples) or not np.all(np.isfinite(samples)):
        why = LOST() if len(samples) else SHORT()
        return Estimate.without_interval(name, math.nan, unit, why)
    return Estimate.without_interval(name, float(np.std(samples)), unit, reason)


def correlation_time(samples: Array, longest: int) -> float:
    """Correlation time of a series (k,), in samples: 1 for white noise.

    The largest sum 1 + 2 sum of the autocorrelations up to a lag, over all lags up to `longest`:
    the autocorrelation of an oscillation rises again after a zero.
    """
    deviation = samples - np.mean(samples)
    size = 1 << (2 * len(deviation) - 1).bit_length()
    power = np.abs(np.fft.rfft(deviation, size)) ** 2
    correlation = np.fft.irfft(power)[: longest + 1]
    if not correlation[0] > 0:
        return 1.0
    sums = np.cumsum(correlation[1:] / correlation[0])
    return float(1.0 + 2.0 * np.max(sums, initial=0.0))


def over_trials(found: Sequence[Estimate]) -> Estimate:
    """Geometric mean of repetitions of one trial, t in the logarithm.

    Its interval applies to the mean of such trials. A single estimate is returned unchanged, with
    the interval of that trial. Raises ValueError for no estimate.
    """
    if not found:
        raise ValueError("no trial to estimate it from")
    known = [one for one in found if math.isfinite(one.value)]
    if len(known) < 2:
        return known[0] if known else found[0]
    values = np.array([one.value for one in known])
    if not np.all(values > 0) or np.ptp(np.log(values)) < IDENTICAL:
        mean = float(np.mean(values))
        return Estimate.without_interval(found[0].name, mean, found[0].unit, NO_SCATTER())
    return of_positive_repeats(found[0].name, values, found[0].unit, "trials", kind=found[0].kind)


def quotient(name: str, one: Estimate, other: Estimate) -> Estimate:
    """`one` over `other`, by Welch in the logarithm, with the reason of a single-trial side.

    Its reason is "not scattering" only if neither side has a larger scatter.
    """
    share = ratio(name, one, other)
    sides = (one, other)
    scatter = [e.reason for e in sides if (e.standard_error or 0.0) > HARDLY * abs(e.value)]
    without = [e.reason for e in sides if e.standard_error is None]
    varying = [reason for reason in without if reason not in NO_SCATTER]
    if len(varying) < len(without) and any(scatter):
        without = varying + scatter
    reasons = [*filter(None, without)] or [e.reason for e in sides if e.reason]
    return replace(share, reason=reasons[0]) if reasons else share


def decrease(name: str, one: Estimate, other: Estimate) -> Estimate:
    """Relative decrease from `other` to `one`: 1 - one / other."""
    share = quotient(name, one, other)
    return replace(
        share,
        value=1.0 - share.value,
        low=None if share.high is None else 1.0 - share.high,
        high=None if share.low is None else 1.0 - share.low,
    )
