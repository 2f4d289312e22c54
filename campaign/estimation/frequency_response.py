"""Frequency responses measured sine by sine: closed loop, open loop, level and phase.

Other modules evaluate them: `crossings` (crossings of a level, and their significance), `servo`
(bandwidth and margins), `continuation` (extrapolation of a loop above its sweep), `refinement`
(frequencies of a second sweep).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.sine_point import SinePoint, mean_point
from campaign.reason import NONE, Cause, Reason

MOST_ERROR = 0.2
"""Largest error of a usable point, relative to its size; above it, phase and level are useless."""
NEIGHBOURS = 2
"""Points on each side of a point that its median size includes."""
SPRING = 0.25 * np.pi
"""Lead (rad) of the rate above which the reaction of a spring, less that of the inertia, exceeds
that of damping. Sliding dry friction acts mainly in phase with the rate. The lead is four standard
deviations of the phase of a point with `MOST_ERROR`."""
HELD = Cause(
    "held by a spring",
    "the rate leads the torque by {degrees:.0f}° at {frequency:.3g} Hz: a spring holds the axis, "
    "as friction does before it slides (excite until it slides)",
)
BESIDE = 2.0**0.5
"""Ratio of frequencies within which a load on a spring changes the inertia, and friction little."""
DRY = 0.5 * np.pi - 4.0 / np.pi
"""Largest part of dry friction in phase with the acceleration, over the part in phase with the
rate, for a sine torque that almost stops the axis (Den Hartog, Trans. ASME 53 (1931) 107)."""
SURELY = 3.0
"""Standard deviations by which the inertia must fall. The largest of some hundred differences of
noisy points exceeds it in about one of twenty cases."""
NO_LOAD = Cause(
    "no load on a spring",
    "at {frequency:.3g} Hz the inertia in the response does not fall by more than friction "
    "explains (excite until the axis slides)",
)


@dataclass(frozen=True)
class Response:
    """Frequency response: arrays of shape (n,), by rising frequency (Hz); see `SinePoint`."""

    frequency: Array
    values: ComplexArray
    error: Array
    coherence: Array

    @property
    def level(self) -> Array:
        """Magnitude (dB), shape (n,)."""
        return np.asarray(20.0 * np.log10(np.maximum(np.abs(self.values), 1e-300)))

    @property
    def phase(self) -> Array:
        """Unwrapped phase (rad), shape (n,); its first value lies within half a turn of zero."""
        return np.asarray(np.unwrap(np.angle(self.values)))

    @property
    def relative_error(self) -> Array:
        """Standard deviation of the log magnitude and of the phase (rad), shape (n,)."""
        return np.asarray(self.error / np.maximum(np.abs(self.values), 1e-300))

    @property
    def size(self) -> Array:
        """Magnitude: median over each point and its neighbors, shape (n,).

        For weights and thresholds: with its own magnitude, a point that noise increases would seem
        more certain than one that noise reduces.
        """
        padded = np.pad(np.abs(self.values), NEIGHBOURS, constant_values=np.nan)
        near = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
        return np.asarray(np.nanmedian(near, axis=1))

    @property
    def told(self) -> Response:
        """Usable points: their error is below `MOST_ERROR` of their size."""
        if not len(self.frequency):
            return self
        kept = self.error < MOST_ERROR * self.size
        return Response(
            self.frequency[kept], self.values[kept], self.error[kept], self.coherence[kept]
        )


def held_by_spring(response: Response) -> Reason:
    """Reason why a torque-to-rate response is not that of a free axis; false where it may be.

    The rate of a free axis lags below its first antiresonance, with any elastic parts. Where
    bristles or another spring hold the axis, the rate leads below the first resonance, and the gain
    rises up to it. For a free axis with reversed sign the gain falls.
    """
    usable = response.told
    if len(usable.frequency) < 2:
        return NONE
    size, lead = np.abs(usable.values), float(np.angle(usable.values[0]))
    if np.max(size) <= size[0] or not SPRING < lead < np.pi - SPRING:
        return NONE
    return HELD(frequency=float(usable.frequency[0]), degrees=float(np.degrees(lead)))


def no_load_at(response: Response, frequency: float) -> Reason:
    """Reason why no load on a spring resonates at `frequency` (Hz); false where one does.

    The imaginary part of torque over rate, divided by w, is the moving inertia. A load increases it
    below its natural frequency and reduces it above. A spring to the ground, such as bristles,
    only reduces it, and less at higher frequencies: there the inertia rises with frequency.
    Sliding dry friction adds up to `DRY` of its damping.
    """
    usable = response.told
    rate, square = 2.0 * np.pi * usable.frequency, np.maximum(np.abs(usable.values) ** 2, 1e-300)
    resistance, error = usable.values.conj() / square, SURELY * usable.error / square / rate
    inertia, damping = resistance.imag / rate, np.maximum(resistance.real, 0.0) / rate
    below, above = usable.frequency < frequency, usable.frequency > frequency
    if not below.any() or not above.any():
        return NO_LOAD(frequency=frequency)
    nearest = usable.frequency[below][-1], usable.frequency[above][0]
    below &= usable.frequency >= min(frequency / BESIDE, nearest[0])
    above &= usable.frequency <= max(frequency * BESIDE, nearest[1])
    before, after = inertia[below] - DRY * damping[below], inertia[above]
    fall = np.subtract.outer(before, after) - np.hypot.outer(error[below], error[above])
    return NONE if np.max(fall) > 0 else NO_LOAD(frequency=frequency)


def make_response(points: Sequence[SinePoint]) -> Response:
    """Response from points, by rising frequency; repetitions of a frequency are averaged."""
    groups: dict[float, list[SinePoint]] = {}
    for point in points:
        groups.setdefault(point.frequency, []).append(point)
    rows = [mean_point(group) for _, group in sorted(groups.items())]
    return Response(
        np.array([row.frequency for row in rows], dtype=float),
        np.array([row.response for row in rows], dtype=complex),
        np.array([row.error for row in rows], dtype=float),
        np.array([row.coherence for row in rows], dtype=float),
    )


def open_loop(closed: Response) -> Response:
    """L = T / (1 - T), error to output, from a closed loop T with unit feedback."""
    rest = 1.0 - closed.values
    rest = np.where(np.abs(rest) > 0, rest, 1e-300)
    return replace(closed, values=closed.values / rest, error=closed.error / np.abs(rest) ** 2)
