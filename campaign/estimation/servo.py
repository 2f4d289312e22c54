"""Bandwidth and stability margins from the response of a closed servo loop.

Each is an estimate. Its interval includes the noise of the points. The error of interpolation is
the same in every repetition of the sweep; the estimate states it as a systematic part.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from campaign.arrays import Array, ComplexArray, Flags
from campaign.estimate import Estimate, Origin
from campaign.estimation.continuation import DECIBEL, gain_margin_beyond
from campaign.estimation.crossings import LevelCrossing, passings, sides
from campaign.estimation.difference import difference_of
from campaign.estimation.frequency_response import Response, open_loop
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import shifted_by, with_error
from campaign.estimation.local_fit import Quantity, Reading, read
from campaign.reason import Cause, Reason

MINUS_3_DB = 10.0 ** (-3.0 / 20.0)
"""Gain at the bandwidth."""
LARGEST = 600.0
"""Largest argument of exp without overflow; a polynomial far from its points may exceed it."""
ONE_SIDED = 1.645
"""Normal quantile of a one-sided 95 % bound."""
INTERPOLATION = "interpolation between the frequencies"


@dataclass(frozen=True)
class Crossing:
    """Crossing of -3 dB (by T), of 0 dB or of -180 deg (by L).

    Attributes:
        level: `-3 dB`, `0 dB` or `-180 deg`.
        frequency: (Hz).
        margin: phase margin (rad) at 0 dB, gain margin (dB) at -180 deg.
        extrapolated: whether it follows from an extrapolation of the loop beyond the sweep.
    """

    level: str
    frequency: Estimate
    margin: Estimate | None = None
    extrapolated: bool = False


@dataclass(frozen=True)
class ServoCharacteristics:
    """Bandwidth, stability margins and crossings of a closed loop.

    Attributes:
        bandwidth: lowest frequency at which the gain falls below -3 dB of unity (Hz). A rate loop
            with integral action has unit gain at zero frequency.
        gain_margin: (dB) the smallest above the gain crossover; beyond the sweep the hull of
            parametric orders, or the bound where those determine no margin.
        phase_margin: (rad) the smallest of all.
        gain_margin_bound: without a measured crossing of -180 deg: -|L| at the last phase surely
            above it, less 1.645 standard errors. It assumes a gain that no longer rises.
        crossings: all crossings, by level and frequency.
    """

    bandwidth: Estimate
    gain_margin: Estimate
    phase_margin: Estimate
    gain_margin_bound: Estimate | None
    crossings: tuple[Crossing, ...]

    def crossing(self, margin: Estimate) -> Crossing | None:
        """Crossing with this margin."""
        return next((each for each in self.crossings if each.margin == margin), None)


def characteristics(closed: Response) -> ServoCharacteristics:
    """Bandwidth and margins of a measured closed loop T, each with its interval."""
    loop, seen = open_loop(closed).told, closed.told
    widths = _minus_3_db(seen, loop)
    phase = _gain_crossovers(loop)
    gain, bound = _phase_crossovers(loop, phase)
    phases = [each.margin for each in phase if each.margin is not None]
    least = min(phases, key=lambda margin: abs(margin.value), default=None)
    return ServoCharacteristics(
        _bandwidth(seen, widths),
        _gain_margin(gain, bound, phase),
        least or _not_found("phase_margin", "rad", NO_CROSSOVER()),
        bound,
        (*widths, *phase, *gain),
    )


NO_CROSSOVER = Cause(
    "no gain crossover",
    "the open loop does not cross 0 dB within the sweep by more than its errors",
)
NO_HALF_TURN = Cause(
    "no phase crossover", "the phase does not cross -180 deg within or near the sweep"
)
TOO_FEW_AROUND = Cause("too few points", "too few points around -3 dB")
BOUND = Cause("bound", "a bound: {why}")
SWEEP_ENDS = Cause("sweep ends before", "the sweep ends before the gain falls")
FELL_BEFORE = Cause("gain fell before", "the gain fell before the sweep")
GAIN_AT_LAST = Cause(
    "gain at last frequency",
    "gain at {frequency:.4g} Hz less 1.645 standard errors, if it rises no more above that",
)


def _not_found(name: str, unit: str, reason: Reason) -> Estimate:
    return Estimate.without_interval(name, math.nan, unit, reason)


# Functions of z = log L, with T = 1 / (1 + exp(-z)).


def _fall(z: ComplexArray) -> Array:
    """Log of |T| over -3 dB."""
    inverse = np.exp(np.minimum(-z.real, LARGEST) - 1j * z.imag)
    return np.asarray(-np.log(np.abs(1.0 + inverse)) - math.log(MINUS_3_DB))


def _log_gain(z: ComplexArray) -> Array:
    return np.asarray(z.real)


def _phase(z: ComplexArray) -> Array:
    return np.asarray(z.imag)


def _minus_3_db(seen: Response, loop: Response) -> list[Crossing]:
    """Falling crossings of -3 dB by T, by frequency."""
    above = np.log(np.abs(seen.values) / MINUS_3_DB)
    crossings = []
    for passing in passings(above, seen.relative_error):
        reading = _read(seen.frequency, loop, passing, _fall, _fall) if passing.falling else None
        if reading is not None:
            crossings.append(Crossing("-3 dB", _frequency("bandwidth", reading)))
    return crossings


def _bandwidth(seen: Response, widths: list[Crossing]) -> Estimate:
    if widths:
        return widths[0].frequency
    side = sides(np.log(np.abs(seen.values) / MINUS_3_DB), seen.relative_error)
    decided = np.flatnonzero(side)
    if not decided.size or len(set(side[decided])) > 1:
        return _not_found("bandwidth", "Hz", TOO_FEW_AROUND())
    inside = side[decided[-1]] > 0
    last = seen.frequency[decided[-1]] if inside else seen.frequency[decided[0]]
    why = SWEEP_ENDS() if inside else FELL_BEFORE()
    return _bound("bandwidth", float(last), "Hz", "at least" if inside else "at most", why)


def _gain_crossovers(loop: Response) -> list[Crossing]:
    """Crossings of 0 dB by L, each with its phase margin, by frequency."""
    above, turns, crossings = np.log(np.abs(loop.values)), None, []
    for passing in passings(above, loop.relative_error):
        reading = _read(loop.frequency, loop, passing, _log_gain, _phase)
        if reading is None:
            continue
        if turns is None:  # the phase of the first one is between -270 and 90 deg
            turns = 2.0 * math.pi * math.ceil((reading.value - 0.5 * math.pi) / (2.0 * math.pi))
        margin = _value("phase_margin", "rad", reading, math.pi - turns)
        crossings.append(Crossing("0 dB", _frequency("gain_crossover", reading), margin))
    return crossings


def _phase_crossovers(
    loop: Response, gain: list[Crossing]
) -> tuple[tuple[Crossing, ...], Estimate | None]:
    """Crossings of -180 deg by L above the gain crossover with gain margins, or else a bound."""
    if not gain or gain[0].margin is None:
        return (), None
    first = gain[0].frequency.value
    phase_there = float(np.interp(math.log(first), np.log(loop.frequency), loop.phase))
    # Whole turns are arbitrary; the margin at the first crossover determines them.
    turn = 2.0 * math.pi * round((phase_there + math.pi - gain[0].margin.value) / (2.0 * math.pi))
    half_turn = turn - math.pi

    def off(z: ComplexArray) -> Array:
        return np.asarray(z.imag - half_turn)

    def margin(z: ComplexArray) -> Array:
        return np.asarray(-DECIBEL * z.real)

    crossings = []
    upper = loop.frequency > first
    passed = passings((loop.phase - half_turn)[upper], loop.relative_error[upper])
    for passing in passed:
        reading = _read(loop.frequency[upper], loop, passing, off, margin)
        if reading is not None:
            kept = _value("gain_margin", "dB", reading)
            crossings.append(Crossing("-180 deg", _frequency("phase_crossover", reading), kept))
    if passed:
        return tuple(crossings), None
    beyond = gain_margin_beyond(loop, first, half_turn)
    if beyond is not None:
        crossings.append(Crossing("-180 deg", beyond.crossover, beyond.margin, extrapolated=True))
    above = sides(loop.phase - half_turn, loop.relative_error) > 0
    return tuple(crossings), _gain_bound(loop, above, gain[-1].frequency.value)


def _gain_bound(loop: Response, above: Flags, crossover: float) -> Estimate | None:
    """-|L| at the last point surely above -180 deg, less 1.645 standard errors (dB).

    None where that point is below the gain crossover or the bound is not positive.
    """
    if not above.any():
        return None
    k = int(np.flatnonzero(above)[-1])
    last = float(loop.frequency[k])
    level = float(loop.level[k] + ONE_SIDED * DECIBEL * loop.relative_error[k])
    if last <= crossover or level >= 0:
        return None
    return _bound("gain_margin", -level, "dB", "at least", GAIN_AT_LAST(frequency=last))


def _bound(name: str, value: float, unit: str, kind: Any, why: Reason) -> Estimate:
    return Estimate(name, value, unit, method=str(why), kind=kind, reason=BOUND(why=why))


def _gain_margin(
    crossings: tuple[Crossing, ...], bound: Estimate | None, phase: list[Crossing]
) -> Estimate:
    """Smallest margin of the crossings; the bound replaces one that is not determined."""
    margins = [each.margin for each in crossings if each.margin is not None]
    least = min(margins, key=lambda margin: margin.value, default=None)
    if least is None or (bound is not None and least.origin is Origin.NOT_DETERMINED):
        least = bound or least
    why = NO_HALF_TURN() if phase else NO_CROSSOVER()
    return least or _not_found("gain_margin", "dB", why)


def _read(
    frequency: Array, loop: Response, passing: LevelCrossing, zero: Quantity, value: Quantity
) -> Reading | None:
    """Reading at a crossing; None where points are too few or the fit does not cross."""
    place = math.log(frequency[passing.before]), math.log(frequency[passing.after])
    try:
        return read(loop, place, zero, value)
    except ValueError:
        return None


METHOD = "Gaussian process through log L over log frequency"


def _frequency(name: str, reading: Reading) -> Estimate:
    value = math.exp(reading.log_frequency)
    frequency = with_error(name, value, "Hz", value * reading.frequency_error, math.inf, METHOD)
    return admitted(shifted_by(frequency, INTERPOLATION, value * reading.frequency_gap))


def _value(name: str, unit: str, reading: Reading, more: float = 0.0) -> Estimate:
    value = reading.value + more
    estimate = with_error(name, value, unit, reading.value_error, math.inf, METHOD)
    return admitted(shifted_by(estimate, INTERPOLATION, reading.value_gap))


def change(name: str, bare: Estimate, other: Estimate) -> Estimate | None:
    """Difference `other` less `bare`; None where one of them is a bound or not determined.

    They are from different trials; a common error of interpolation is not subtracted.
    """
    if {bare.kind, other.kind} != {"number"}:
        return None
    if Origin.NOT_DETERMINED in (bare.origin, other.origin):
        return None
    return replace(difference_of(bare, other).difference, name=name)
