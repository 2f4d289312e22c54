"""Crossovers, margins and bandwidth of a loop, from a fitted function or from its points.

Of a fit they have intervals by the delta method, or from functions drawn from its scatter where
those say otherwise (`drawn_margins`): a crossing near the end of the band may lie beyond it. What
does is a bound: no fit is followed there.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.frequency.drawn_margins import METHOD as DRAWN
from campaign.estimation.frequency.drawn_margins import (
    Drawn,
    drawn_margins,
    fall,
    least,
    with_draws,
    zeros,
)
from campaign.estimation.frequency.measured import MeasuredResponse, closed_from_open
from campaign.estimation.frequency.modes import of_fit
from campaign.estimation.frequency.orders import Chosen, with_order
from campaign.estimation.frequency.rational import RationalFit
from campaign.estimation.frequency_response import Array, ComplexArray
from campaign.estimation.servo import (
    BOUND,
    Crossing,
    ServoCharacteristics,
    characteristics,
)
from campaign.reason import Cause, Reason

GRID = 8000
"""Frequencies between the first and the last at which crossings are looked for."""
DECIBEL = 20.0 / math.log(10.0)
METHOD = "rational function with a delay, delta method"
STEP = 1e-5
"""of the logarithm of frequency, for slopes."""
GAIN_UP_TO = Cause(
    "gain up to last frequency", "the gain up to {frequency:.4g} Hz, if it rises no more behind"
)
NO_FALL = Cause("gain not below 1", "the gain does not fall below 1 in the band")
NO_WIDTH = Cause("gain not through -3 dB", "the gain does not fall through -3 dB in the band")
BAND_ENDS = Cause("band ends before", "the band ends before it")
BAND_BEGINS = Cause("band begins after", "the band begins after it")
NOT_CROSSED = Cause(
    "0 dB not in band",
    "the open loop does not cross 0 dB in the band: its gain is {side} 1 all along",
)


def measured_margins(loop: MeasuredResponse) -> ServoCharacteristics:
    """Of a measured open loop, between its points; the interval holds noise and interpolation."""
    return characteristics(closed_from_open(loop).response)


@dataclass(frozen=True)
class _Loop:
    """Log L and its derivatives by the parameters, of a fit of L or of T = L / (1 + L)."""

    fit: RationalFit
    closed: bool

    def logarithm(self, frequency: Array) -> ComplexArray:
        """Log L, its phase between -pi and pi, shape (n,)."""
        value = self.fit.value(frequency)
        if self.closed:
            value = value / (1.0 - value)
        return np.asarray(np.log(np.where(np.abs(value) > 0, value, 1e-300)))

    def drawn(self, frequency: Array, normal: Array) -> ComplexArray:
        """Log L of functions that the scatter allows, shape (m, n), by normal numbers (m, p).

        Log of the fitted function is drawn along its derivatives: of parameters that only together
        mean something no draw is asked apart.
        """
        size, axes = np.linalg.eigh(self.fit.scatter)
        apart = normal * np.sqrt(np.maximum(size, 0.0)) @ axes.T
        log = np.log(self.fit.value(frequency)) + apart @ self.fit.log_jacobian(frequency).T
        if self.closed:
            log = log - np.log(1.0 - np.exp(log))
        return np.asarray(log)

    def jacobian(self, frequency: float) -> ComplexArray:
        """Derivative of log L by the parameters, shape (p,)."""
        at = np.array([frequency])
        by = self.fit.log_jacobian(at)[0]
        return np.asarray(by / (1.0 - self.fit.value(at)[0]) if self.closed else by)

    def slope(self, frequency: float) -> complex:
        """Derivative of log L by log frequency."""
        at = frequency * np.exp(np.array([-STEP, STEP]))
        before, after = self.logarithm(at)
        change = complex(after - before)
        turn = math.remainder(change.imag, 2.0 * math.pi)
        return complex(change.real, turn) / (2.0 * STEP)


def fitted_margins(
    fit: RationalFit, closed: bool = False, draws: bool = True
) -> ServoCharacteristics:
    """Bandwidth, crossovers and margins of the loop.

    Args:
        fit: of the open loop L with unit feedback; `closed`: of T = L / (1 + L).
        draws: whether intervals are held against functions drawn from the scatter; without, bounds
            are where the band ends, whatever scatter says.

    A gain margin is read wherever L is real and negative above the first gain crossover; without
    one it is bounded by the gain at the last frequency. Without a gain crossover it is said on
    which side of the band it lies.
    """
    loop = _Loop(fit, closed)
    frequency = np.geomspace(fit.lowest, fit.highest, GRID)
    log = loop.logarithm(frequency)
    gain = [
        _crossing(loop, "0 dB", at, _gain, _phase, ("gain_crossover", "phase_margin", "rad"))
        for at in zeros(frequency, log.real)
    ]
    widths = [
        _crossing(loop, "-3 dB", at, fall, None, ("bandwidth", "", ""))
        for at in zeros(frequency, fall(log), falling=True)
    ]
    half = []
    if gain:
        names = ("phase_crossover", "gain_margin", "dB")
        half = [
            _crossing(loop, "-180 deg", at, _phase, _margin, names)
            for at in zeros(frequency, np.imag(-np.exp(log)))
            if at > gain[0].frequency.value and math.cos(loop.logarithm(np.array([at]))[0].imag) < 0
        ]
    phases = [each.margin for each in gain if each.margin is not None]
    smallest = min(phases, key=lambda each: abs(each.value), default=None)
    margins = [each.margin for each in half if each.margin is not None]
    drawn = None
    if draws and not fit.misfit:
        drawn = drawn_margins(loop, len(fit.scatter), fit.lowest, fit.highest)
    bound = None if half or not gain else _gain_bound(loop, drawn)
    gain_margin = min(margins, key=lambda each: each.value, default=None) or bound
    bandwidth = widths[0].frequency if widths else _outside(fit, fall(log), drawn)
    found = ServoCharacteristics(
        bandwidth,
        gain_margin or _none("gain_margin", "dB", NO_FALL()),
        smallest or _none("phase_margin", "rad", _where(log.real)),
        bound,
        (*widths, *gain, *half),
    )
    return found if drawn is None else _as_drawn(found, drawn)


def _as_drawn(found: ServoCharacteristics, drawn: Drawn) -> ServoCharacteristics:
    """With intervals of draws where the delta method does not hold."""
    turned = np.where(drawn.turned, drawn.gain_margin, np.inf)  # else it is beyond the band
    return replace(
        found,
        bandwidth=with_draws(found.bandwidth, drawn.bandwidth),
        phase_margin=with_draws(found.phase_margin, drawn.phase_margin),
        gain_margin=with_draws(found.gain_margin, turned),
    )


def chosen_margins(chosen: Chosen, closed: bool = False) -> ServoCharacteristics:
    """Those of the order chosen, with what others say that are not ruled out."""
    best = fitted_margins(chosen.fit, closed)
    others = [fitted_margins(each, closed, draws=False) for each in chosen.near]

    def told(estimate: Estimate, name: str) -> Estimate:
        values = [getattr(each, name) for each in others]
        numbers = [each.value for each in values if each.kind == "number"]
        if estimate.kind == "at least":
            return replace(estimate, value=min([estimate.value, *numbers]))
        return with_order(estimate, numbers) if estimate.kind == "number" else estimate

    return replace(
        best,
        bandwidth=told(best.bandwidth, "bandwidth"),
        gain_margin=told(best.gain_margin, "gain_margin"),
        phase_margin=told(best.phase_margin, "phase_margin"),
    )


Quantity = Callable[[ComplexArray], Array]


def _gain(log: ComplexArray) -> Array:
    return np.asarray(log.real)


def _phase(log: ComplexArray) -> Array:
    """Over -180 deg, within half a turn."""
    return np.asarray(np.angle(-np.exp(1j * log.imag)))


def _margin(log: ComplexArray) -> Array:
    return np.asarray(-DECIBEL * log.real)


def _crossing(
    loop: _Loop,
    level: str,
    at: float,
    zero: Quantity,
    value: Quantity | None,
    names: tuple[str, str, str],
) -> Crossing:
    """With intervals: the place moves until `zero` vanishes again, the value with it."""
    log, by, slope = loop.logarithm(np.array([at])), loop.jacobian(at), loop.slope(at)
    covariance, misfit = loop.fit.scatter, loop.fit.misfit

    def derivative(quantity: Quantity, change: ComplexArray) -> Array:
        step = 1e-6
        sides = [quantity(log + 1j * step * k) for k in (-1.0, 1.0)]
        by_phase = float(sides[1][0] - sides[0][0]) / (2.0 * step)
        sides = [quantity(log + step * k) for k in (-1.0, 1.0)]
        by_gain = float(sides[1][0] - sides[0][0]) / (2.0 * step)
        return np.asarray(by_gain * change.real + by_phase * change.imag)

    along = float(derivative(zero, np.array(slope)))
    moved = -derivative(zero, by) / (along if abs(along) > 0 else 1e-300)

    def error(gradient: Array) -> float:
        return math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))

    place = of_fit(names[0], at, "Hz", at * error(moved), misfit, METHOD)
    if value is None:
        return Crossing(level, place)
    total = derivative(value, by) + float(derivative(value, np.array(slope))) * moved
    margin = of_fit(names[1], float(value(log)[0]), names[2], error(total), misfit, METHOD)
    return Crossing(level, place, margin)


def _gain_bound(loop: _Loop, drawn: Drawn | None) -> Estimate | None:
    """-|L| at the last frequency (dB), or less, by what 95 % of draws have there or before.

    None where that is no margin.
    """
    if drawn is None:
        return None
    last = loop.fit.highest
    value = float(_margin(loop.logarithm(np.array([last])))[0])
    value = min(value, least(drawn.gain_margin, math.inf))
    if value <= 0:
        return None
    reason = BOUND(why=GAIN_UP_TO(frequency=last))
    return Estimate("gain_margin", value, "dB", method=DRAWN, kind="at least", reason=reason)


def _outside(fit: RationalFit, above: Array, drawn: Drawn | None) -> Estimate:
    """A bandwidth that lies beyond the band, or before it; scatter moves the bound inwards."""
    if np.all(above > 0):
        value = fit.highest if drawn is None else least(drawn.bandwidth, fit.highest)
        return _bound(value, "at least", BAND_ENDS())
    if np.all(above < 0):
        value = fit.lowest if drawn is None else -least(-drawn.bandwidth, -fit.lowest)
        return _bound(value, "at most", BAND_BEGINS())
    return _none("bandwidth", "Hz", NO_WIDTH())


def _bound(value: float, kind: Any, why: Reason) -> Estimate:
    return Estimate("bandwidth", value, "Hz", method=DRAWN, kind=kind, reason=BOUND(why=why))


def _none(name: str, unit: str, reason: Reason) -> Estimate:
    return Estimate.without_interval(name, math.nan, unit, reason)


def _where(gain: Array) -> Reason:
    return NOT_CROSSED(side="above" if np.all(gain > 0) else "below")
