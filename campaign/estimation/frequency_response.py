"""Frequency responses measured sine by sine: closed loop, open loop, level and phase.

What they say about a loop is read elsewhere: `crossings` (where a level is passed, and how surely),
`servo` (bandwidth and margins), `continuation` (how a loop goes on above its sweep), `refinement`
(where a second sweep should measure).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.sine_point import SinePoint, mean_point
from campaign.reason import NONE, Cause, Reason

MOST_ERROR = 0.2
"""of a point's own size: with more its phase is hardly known, nor its level."""
NEIGHBOURS = 2
"""Points on each side whose median size with it stands for its own."""
SPRING = 0.25 * np.pi
"""Lead (rad) of rate before torque from which on the spring's reaction, less that of the inertia,
exceeds that of damping. Dry friction that slides acts in phase with the rate above all. It is four
standard deviations of the phase of a point with `MOST_ERROR`."""
HELD = Cause(
    "held by a spring",
    "the rate leads the torque by {degrees:.0f}° at {frequency:.3g} Hz: a spring holds the axis, "
    "as friction does before it slides (excite until it slides)",
)
BESIDE = 2.0**0.5
"""Ratio of frequencies within which a load on a spring changes the inertia, and friction little."""
DRY = 0.5 * np.pi - 4.0 / np.pi
"""Largest share of dry friction in phase with the acceleration, over that in phase with the rate,
under a sine of torque: where the axis is about to stop (Den Hartog, Trans. ASME 53 (1931) 107)."""
SURELY = 3.0
"""Standard deviations by which the inertia must fall: the largest of some hundred differences of
noisy points exceeds it about once in twenty times."""
NO_LOAD = Cause(
    "no load on a spring",
    "at {frequency:.3g} Hz the inertia in the response does not fall by more than friction "
    "explains (excite until the axis slides)",
)


@dataclass(frozen=True)
class Response:
    """A frequency response: arrays of shape (n,), by rising frequency (Hz); see `SinePoint`."""

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
        """Magnitude, the median of a point's and its neighbours', shape (n,).

        What weights and thresholds go by: a point that noise makes large would else seem surer than
        one that noise makes small.
        """
        padded = np.pad(np.abs(self.values), NEIGHBOURS, constant_values=np.nan)
        near = np.lib.stride_tricks.sliding_window_view(padded, 2 * NEIGHBOURS + 1)
        return np.asarray(np.nanmedian(near, axis=1))

    @property
    def told(self) -> Response:
        """The points whose error is below `MOST_ERROR` of their size."""
        if not len(self.frequency):
            return self
        kept = self.error < MOST_ERROR * self.size
        return Response(
            self.frequency[kept], self.values[kept], self.error[kept], self.coherence[kept]
        )


def held_by_spring(response: Response) -> Reason:
    """Why a response of torque to rate is none of a free axis; false where it may be one.

    A free axis lags below its first antiresonance, whatever is elastic in it. Where bristles or any
    other spring hold it, the rate leads below the first resonance, and the gain rises up to it. Of
    a free axis with the sign reversed it falls.
    """
    told = response.told
    if len(told.frequency) < 2:
        return NONE
    size, lead = np.abs(told.values), float(np.angle(told.values[0]))
    if np.max(size) <= size[0] or not SPRING < lead < np.pi - SPRING:
        return NONE
    return HELD(frequency=float(told.frequency[0]), degrees=float(np.degrees(lead)))


def no_load_at(response: Response, frequency: float) -> Reason:
    """Why no load swings on a spring at `frequency` (Hz); false where one shows in the response.

    The imaginary part of torque over rate, divided by w, is the inertia that moves. Below its own
    frequency a load adds to it, above it takes from it. A spring to the ground, as of bristles,
    only takes from it, and less the higher the frequency: there the inertia rises. Dry friction
    that slides adds up to `DRY` of its damping.
    """
    told = response.told
    rate, square = 2.0 * np.pi * told.frequency, np.maximum(np.abs(told.values) ** 2, 1e-300)
    resistance, error = told.values.conj() / square, SURELY * told.error / square / rate
    inertia, damping = resistance.imag / rate, np.maximum(resistance.real, 0.0) / rate
    below, above = told.frequency < frequency, told.frequency > frequency
    if not below.any() or not above.any():
        return NO_LOAD(frequency=frequency)
    nearest = told.frequency[below][-1], told.frequency[above][0]
    below &= told.frequency >= min(frequency / BESIDE, nearest[0])
    above &= told.frequency <= max(frequency * BESIDE, nearest[1])
    before, after = inertia[below] - DRY * damping[below], inertia[above]
    fall = np.subtract.outer(before, after) - np.hypot.outer(error[below], error[above])
    return NONE if np.max(fall) > 0 else NO_LOAD(frequency=frequency)


def make_response(points: Sequence[SinePoint]) -> Response:
    """Points by rising frequency; repetitions of a frequency are averaged."""
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
    """L = T / (1 - T): error to output, of a closed loop T with unit feedback."""
    rest = 1.0 - closed.values
    rest = np.where(np.abs(rest) > 0, rest, 1e-300)
    return replace(closed, values=closed.values / rest, error=closed.error / np.abs(rest) ** 2)
