"""Modes from the lines of a response without a fitted function.

With few realisations the variance cannot weight a fit. But the response shows between which of
its lines the gain has an extremum. The interval ends at the nearest lines whose gain differs
significantly from that of the extremum. It is never narrower than the spacing of the lines, needs
no model of the drive and has no standard error.
"""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.estimate import Estimate
from campaign.estimation.frequency.best_linear import BestLinear
from campaign.estimation.frequency.modes import Mode
from campaign.estimation.intervals import LEVEL
from campaign.reason import Cause, Reason

PROMINENCE = 1.5
"""Least prominence of an extremum: ratio of gains, each over that of a free inertia."""
SURELY = 2.0
"""Standard deviations of a difference of two gains above which they differ."""
BESIDE = 1.1
"""Ratio of gains within which the undamped frequency may lie beside the extremum. A damping ratio z
shifts the extremum by about z²; the gains have this ratio at a distance of z / 2."""
TOGETHER = 3
"""Number of neighboring lines over which relative scatter is averaged."""
METHOD = "extremum of the measured gain, between the nearest lines whose gain surely differs"
NO_SCATTER = Cause(
    "scatter of the lines not known",
    "without odd lines left out, and two periods or more, nothing shows how far the lines of so "
    "few realisations scatter",
)
NO_EXTREMUM = Cause(
    "no extremum stands out",
    "no extremum of the response stands out of the scatter of its lines",
)
NEEDS_A_FIT = Cause("needs a fitted function", "only a fitted function has a damping")


def extrema(frequency: Array, gain: Array, scatter: Array | None) -> tuple[Mode, Mode]:
    """Resonance, and antiresonance below it; not determined where none is prominent.

    Args:
        frequency: of the lines (Hz), ascending, shape (n,).
        gain: from torque to rate, shape (n,).
        scatter: standard deviation of its logarithm, shape (n,); None: unknown.
    """
    if scatter is None:
        return _none(NO_SCATTER(), is_zero=False), _none(NO_SCATTER(), is_zero=True)
    level = np.log(np.maximum(gain, 1e-300) * frequency)  # flat for a free inertia
    peak = _extremum(level, scatter)
    if peak is None:
        return _none(NO_EXTREMUM(), is_zero=False), _none(NO_EXTREMUM(), is_zero=True)
    below = slice(None, peak[1] + 1)
    dip = _extremum(-level[below], scatter[below])
    return _mode(frequency, peak, is_zero=False), _mode(frequency, dip, is_zero=True)


def relative_scatter(best: BestLinear) -> Array | None:
    """Standard deviation of the logarithm of the gain at each line, shape (n,); None: unknown.

    Noise and distortion together, from the odd lines that the excitation omits.
    """
    distortion = best.distortion
    if distortion is None or distortion.mixed or not len(distortion.odd.frequency):
        return None
    beside = np.interp(distortion.odd.frequency, best.response.frequency, distortion.excited)
    square = np.mean(distortion.odd.power, axis=0) / beside / best.excitation.realisations
    around = np.pad(square, TOGETHER // 2, mode="edge")
    alike = np.convolve(around, np.full(TOGETHER, 1.0 / TOGETHER), "valid")
    # Only one of the two parts of a complex error changes the logarithm of the gain.
    return np.interp(best.response.frequency, distortion.odd.frequency, np.sqrt(0.5 * alike))


def _extremum(level: Array, scatter: Array) -> tuple[int, int, int] | None:
    """Most prominent maximum and the nearest surely lower lines, as (below, maximum, above)."""
    from scipy.signal import find_peaks

    peaks, sizes = find_peaks(level, prominence=math.log(PROMINENCE))
    if not len(peaks):
        return None
    most = int(np.argmax(sizes["prominences"]))
    peak = int(peaks[most])
    if sizes["prominences"][most] < math.log(PROMINENCE) + SURELY * scatter[peak]:
        return None
    apart = math.log(BESIDE) + SURELY * np.hypot(scatter, scatter[peak])
    lower = level + apart < level[peak]
    left, right = np.flatnonzero(lower[:peak]), np.flatnonzero(lower[peak + 1 :])
    if not len(left) or not len(right):
        return None
    return int(left[-1]), peak, peak + 1 + int(right[0])


def _mode(frequency: Array, found: tuple[int, int, int] | None, *, is_zero: bool) -> Mode:
    if found is None:
        return _none(NO_EXTREMUM(), is_zero=is_zero)
    low, value, high = (float(frequency[line]) for line in found)
    without = _none(NEEDS_A_FIT(), is_zero=is_zero)
    name = without.frequency.name
    return Mode(Estimate(name, value, "Hz", low, high, LEVEL, METHOD), without.damping, is_zero)


def _none(reason: Reason, *, is_zero: bool) -> Mode:
    name = "antiresonance" if is_zero else "resonance"
    return Mode(
        Estimate.without_interval(name, math.nan, "Hz", reason),
        Estimate.without_interval(f"{name}_damping", math.nan, "", reason),
        is_zero,
    )
