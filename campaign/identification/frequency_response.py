"""Frequency responses measured with a stepped sine, and what a loop's response says about it.

One sine at a time is fitted to input and output by least squares, over whole cycles. From the
measured closed loop T follow its bandwidth, the open loop L = T / (1 - T), and its margins. Where
the phase of L crosses -180 deg above the sweep, its upper part is extrapolated and labelled so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

HARMONICS = 9
"""fitted beside the fundamental, as far as the sampling shows them: friction makes odd ones."""
MINUS_3_DB = 10.0 ** (-3.0 / 20.0)
UPPER_PART = 0.4
"""The sweep above this share of its highest frequency tells how the response goes on."""
FARTHEST = 3.0
"""times the highest frequency: how far a response is extrapolated at most."""
DRAWS = 200
"""of the noise, for the standard deviations of bandwidth and margins."""


@dataclass(frozen=True)
class SinePoint:
    """Response to one sine.

    Attributes:
        frequency: of the excitation (Hz).
        response: output over input at that frequency, complex.
        error: standard deviation of the real and of the imaginary part of `response`, from what is
            left in both signals after offset, drift, fundamental and harmonics.
        coherence: share of the output's power, drift apart, that is at the excitation frequency: 1
            for a linear system without noise.
    """

    frequency: float
    response: complex
    error: float
    coherence: float


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


@dataclass(frozen=True)
class Crossing:
    """Where a response crosses a level, and the margin there (dB or rad); NaN where it does not.

    Attributes:
        extrapolated: it lies above the highest frequency of the sweep.
    """

    frequency: float
    margin: float
    extrapolated: bool = False


@dataclass(frozen=True)
class ServoCharacteristics:
    """What a closed loop's response says about it; `*_error` are standard deviations.

    Attributes:
        bandwidth: lowest frequency at which the gain falls below -3 dB of unity (Hz). A rate loop
            with integral action has unit gain at zero frequency.
        gain: phase crossover and gain margin (dB): the smallest above the gain crossover.
        phase: gain crossover and phase margin (rad): the smallest of all.
    """

    bandwidth: float
    gain: Crossing
    phase: Crossing
    bandwidth_error: float = float("nan")
    gain_margin_error: float = float("nan")
    phase_margin_error: float = float("nan")


def sine_point(time: Array, input_: Array, output: Array, frequency: float) -> SinePoint:
    """Response at `frequency` (Hz) of signals sampled at `time` (s), all of shape (n,).

    Raises ValueError when there are too few samples, or no input at that frequency.
    """
    if len(time) < 8 or np.ptp(time) * frequency < 0.9:
        raise ValueError(f"less than one cycle of {frequency:.4g} Hz was recorded")
    rate = (len(time) - 1) / float(np.ptp(time))
    if frequency >= 0.5 * rate:
        raise ValueError(f"{frequency:.4g} Hz cannot be seen in samples at {rate:.4g} Hz")
    orders = [k for k in range(1, HARMONICS + 1) if k == 1 or k * frequency < 0.45 * rate]
    orders = orders[: max(1, (len(time) - 2) // 4)]
    angle = 2.0 * np.pi * frequency * (time - time[0])
    waves = [wave(k * angle) for k in orders for wave in (np.cos, np.sin)]
    basis = np.column_stack([np.ones_like(angle), angle / angle[-1] - 0.5, *waves])
    signals = np.column_stack([input_, output])
    found, *_ = np.linalg.lstsq(basis, signals, rcond=None)
    amplitude = found[2] - 1j * found[3]
    if not abs(amplitude[0]) > 0:
        raise ValueError(f"the input has no part at {frequency:.4g} Hz")
    freedom = max(len(time) - basis.shape[1], 1)
    noise = np.sum((signals - basis @ found) ** 2, axis=0) / freedom
    response = complex(amplitude[1] / amplitude[0])
    variance = (noise[1] + abs(response) ** 2 * noise[0]) * 2.0 / len(time)
    moving = output - basis[:, :2] @ found[:2, 1]
    power = float(np.mean(moving**2))
    share = 0.5 * abs(amplitude[1]) ** 2 / power if power > 0 else 0.0
    error = float(np.sqrt(variance) / abs(amplitude[0]))
    return SinePoint(frequency, response, error, min(float(share), 1.0))


def make_response(points: Sequence[SinePoint]) -> Response:
    """Points by rising frequency; repetitions of a frequency are averaged."""
    groups: dict[float, list[SinePoint]] = {}
    for point in points:
        groups.setdefault(point.frequency, []).append(point)
    rows = [_mean(group) for _, group in sorted(groups.items())]
    return Response(
        np.array([row.frequency for row in rows], dtype=float),
        np.array([row.response for row in rows], dtype=complex),
        np.array([row.error for row in rows], dtype=float),
        np.array([row.coherence for row in rows], dtype=float),
    )


def _mean(group: list[SinePoint]) -> SinePoint:
    """Mean of repetitions; their scatter is its error where there are enough to tell."""
    values = np.array([point.response for point in group])
    if len(group) > 2:
        error = float(np.sqrt(np.var(values, ddof=1) / 2.0 / len(group)))
    else:
        error = float(np.sqrt(np.sum([point.error**2 for point in group])) / len(group))
    coherence = float(np.mean([point.coherence for point in group]))
    return SinePoint(group[0].frequency, complex(np.mean(values)), error, coherence)


def open_loop(closed: Response) -> Response:
    """L = T / (1 - T): error to output, of a closed loop T with unit feedback."""
    rest = 1.0 - closed.values
    return replace(closed, values=closed.values / rest, error=closed.error / np.abs(rest) ** 2)


def characteristics(closed: Response, seed: int = 0) -> ServoCharacteristics:
    """Bandwidth and margins of a measured closed loop T.

    Their standard deviations come from `DRAWS` repetitions of the evaluation with noise of each
    point's own error; `seed` makes them reproducible.
    """
    found = _characteristics(closed)
    random = np.random.Generator(np.random.PCG64(seed))
    draws = []
    for _ in range(DRAWS if np.any(closed.error > 0) else 0):
        noise = random.standard_normal((2, len(closed.frequency))) * closed.error
        drawn = _characteristics(replace(closed, values=closed.values + noise[0] + 1j * noise[1]))
        draws.append((drawn.bandwidth, drawn.gain.margin, drawn.phase.margin))
    spread = _spread(np.array(draws))
    return replace(
        found,
        bandwidth_error=spread[0],
        gain_margin_error=spread[1],
        phase_margin_error=spread[2],
    )


def _spread(draws: Array) -> tuple[float, float, float]:
    """Standard deviation of each column; NaN where fewer than half of the draws found a value."""
    columns = [column[np.isfinite(column)] for column in draws.T] if draws.size else [draws] * 3
    bandwidth, gain, phase = (
        float(np.std(column)) if column.size > DRAWS // 2 else float("nan") for column in columns
    )
    return bandwidth, gain, phase


def _characteristics(closed: Response) -> ServoCharacteristics:
    loop = open_loop(closed)
    gain, phase = margins(loop)
    return ServoCharacteristics(bandwidth(closed), gain, phase)


def bandwidth(closed: Response) -> float:
    """Lowest frequency (Hz) at which the gain falls below -3 dB of unity; NaN if it never does."""
    falling = _crossings(closed.frequency, closed.level, 20.0 * np.log10(MINUS_3_DB), falling=True)
    return float(falling[0]) if falling.size else float("nan")


def margins(loop: Response) -> tuple[Crossing, Crossing]:
    """Gain margin (dB) and phase margin (rad) of an open loop L.

    Between the points level and phase are straight lines over the logarithm of frequency. The gain
    margin is the smallest of the phase crossovers above the first gain crossover; below it a gain
    may be lowered, which is another margin.
    """
    nowhere = Crossing(float("nan"), float("nan"))
    frequency, level, phase = loop.frequency, loop.level, loop.phase
    beyond = Continuation.of(loop)
    crossed = _crossings(frequency, level, 0.0)
    outside = not crossed.size and level[-1] > 0
    if outside and beyond is not None:
        crossed = beyond.crossings(beyond.level, 0.0)[:1]
    if not crossed.size:
        return nowhere, nowhere
    read_phase = beyond.phase if outside and beyond else _between(frequency, phase)
    turns = 2.0 * np.pi * np.ceil((read_phase(crossed[:1])[0] - 0.5 * np.pi) / (2.0 * np.pi))
    kept = np.pi + read_phase(crossed) - turns
    closest = int(np.argmin(np.abs(kept)))
    phase_margin = Crossing(float(crossed[closest]), float(kept[closest]), outside)
    half_turn = turns - np.pi
    turned = _crossings(frequency, phase, half_turn)
    turned = turned[turned > crossed[0]]
    if turned.size:
        lowest = -_between(frequency, level)(turned)
        least = int(np.argmin(lowest))
        return Crossing(float(turned[least]), float(lowest[least])), phase_margin
    turned = beyond.crossings(beyond.phase, half_turn) if beyond else np.empty(0)
    if beyond is None or not turned.size:
        return nowhere, phase_margin
    return Crossing(float(turned[0]), -float(beyond.level(turned[:1])[0]), True), phase_margin


@dataclass(frozen=True)
class Continuation:
    """How an open loop goes on above the sweep: an integrator, a delay, and their corrections.

    log(jw L) = k0 + i (-w delay + lead / w) + curvature w^2: far above its corners any rational
    loop with one more pole than zeros, and a delay, is the start of this series. It is fitted to
    the upper part of the sweep, each point weighted by its own error.

    Attributes:
        start: highest frequency of the sweep (Hz).
        k0, curvature: of the log magnitude (1, s^2).
        delay, lead: of the phase (s, rad/s).
        turns: whole turns of the unwrapped phase (rad).
    """

    start: float
    k0: float
    curvature: float
    delay: float
    lead: float
    turns: float

    @staticmethod
    def of(loop: Response) -> Continuation | None:
        """Fitted to the upper part of `loop`; None when there are fewer than four points."""
        upper = loop.frequency >= UPPER_PART * loop.frequency[-1]
        if np.count_nonzero(upper) < 4:
            return None
        omega = 2.0 * np.pi * loop.frequency[upper]
        values = loop.values[upper]
        relative = loop.error[upper] / np.abs(values)
        weight = 1.0 / np.maximum(relative, max(0.1 * float(np.median(relative)), 1e-12))
        log_gain = np.log(np.abs(values) * omega)
        phase = loop.phase[upper] + 0.5 * np.pi
        turns = 2.0 * np.pi * float(np.round(np.median(phase) / (2.0 * np.pi)))
        ones = np.ones_like(omega)
        k0, curvature = _weighted(np.column_stack([ones, omega**2]), log_gain, weight)
        slope, lead = _weighted(np.column_stack([omega, ones / omega]), phase - turns, weight)
        return Continuation(float(loop.frequency[-1]), k0, curvature, -slope, lead, turns)

    def level(self, frequency: Array) -> Array:
        """Magnitude (dB) at `frequency` (Hz), shape (n,)."""
        omega = 2.0 * np.pi * frequency
        log_gain = self.k0 + self.curvature * omega**2 - np.log(omega)
        return np.asarray(20.0 / np.log(10.0) * log_gain)

    def phase(self, frequency: Array) -> Array:
        """Phase (rad) at `frequency` (Hz), shape (n,), unwrapped like the sweep's."""
        omega = 2.0 * np.pi * frequency
        return np.asarray(self.turns - 0.5 * np.pi - self.delay * omega + self.lead / omega)

    def crossings(self, read: Callable[[Array], Array], value: float) -> Array:
        """Frequencies (Hz) above the sweep at which `read` falls through `value`."""
        grid = np.geomspace(self.start, FARTHEST * self.start, 400)
        return _crossings(grid, read(grid), value, falling=True)


def _weighted(basis: Array, values: Array, weight: Array) -> tuple[float, float]:
    scale = np.linalg.norm(basis, axis=0)
    weighted = basis / scale * weight[:, None]
    first, second = np.linalg.lstsq(weighted, values * weight, rcond=None)[0] / scale
    return float(first), float(second)


def _between(frequency: Array, values: Array) -> Callable[[Array], Array]:
    return lambda at: np.interp(np.log(at), np.log(frequency), values)


def _crossings(frequency: Array, values: Array, value: float, falling: bool = False) -> Array:
    """Frequencies at which straight lines over log frequency cross `value`, rising."""
    above = values - value
    changes = (above[:-1] > 0) & (above[1:] <= 0)
    if not falling:
        changes |= (above[:-1] < 0) & (above[1:] >= 0)
    left, right = above[:-1][changes], above[1:][changes]
    share = left / (left - right)
    log = np.log(frequency)
    return np.asarray(np.exp(log[:-1][changes] + share * np.diff(log)[changes]))
