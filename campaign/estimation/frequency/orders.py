"""Model order of a response by Schwarz' criterion, without unstable poles.

Orders with a similar fit result in different values. Intervals include this difference, which
scatter does not show (`ChosenOrder.near`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.rational import RationalFit, delays_to_try, rational_fit
from campaign.estimation.intervals import shifted_by

HIGHEST = 6
"""Default highest order of the denominator."""
FEWER_ZEROS = 3
"""Largest difference of the orders of denominator and numerator."""
NEAR = 2.0
"""Difference of Schwarz' criterion within which the order with fewer parameters is chosen."""
POSSIBLE = 10.0
"""Difference from the best criterion within which an order is possible (Kass and Raftery, 1995)."""
SURE = 2.0
"""Least real part of an unstable pole, in standard errors."""
INTEGRATOR = 0.5
"""Share of the lowest frequency below which a pole counts as an integrator."""


@dataclass(frozen=True)
class ChosenOrder:
    """The chosen fit, and the others that the data do not exclude (`near`)."""

    fit: RationalFit
    near: tuple[RationalFit, ...]


def order_of(fit: RationalFit) -> tuple[int, int]:
    """Orders of numerator and denominator."""
    return len(fit.numerator) - 1, len(fit.denominator) - 1


def chosen_order(measured: MeasuredResponse, highest: int = HIGHEST) -> ChosenOrder:
    """Fit all orders up to `highest` and choose one by Schwarz' criterion.

    The search ends after two consecutive orders of the denominator without a better criterion.
    Raises ValueError if no order has a usable fit (an unstable pole makes a fit unusable).
    """
    tried: dict[tuple[int, int], RationalFit] = {}
    refused: dict[tuple[int, int], str] = {}
    delays = delays_to_try(measured)
    best, without = math.inf, 0
    for down in range(1, highest + 1):
        better = False
        for order in [(up, down) for up in range(max(0, down - FEWER_ZEROS), down + 1)]:
            try:
                fit = rational_fit(measured, order, delays)
            except (ValueError, np.linalg.LinAlgError) as error:
                refused[order] = str(error)
                continue
            tried[order] = fit
            why = _unusable(fit)
            if why:
                refused[order] = why
            elif fit.criterion < best - NEAR:
                best, better = fit.criterion, True
        without = 0 if better else without + 1
        if without >= 2 and math.isfinite(best):
            break
    usable = [order for order in tried if order not in refused]
    if not usable:
        reasons = "; ".join(sorted(set(refused.values()))) or "too few frequencies"
        raise ValueError(f"no order fits: {reasons}")
    near = [order for order in usable if tried[order].criterion <= best + NEAR]
    order = min(near or usable, key=lambda each: (tried[each].parameters, tried[each].criterion))
    possible = [each for each in usable if each != order and not tried[each].misfit]
    close = [each for each in possible if tried[each].criterion <= best + POSSIBLE]
    return ChosenOrder(tried[order], tuple(tried[each] for each in close))


def with_order(estimate: Estimate, others: Sequence[float]) -> Estimate:
    """Add the difference from the values of other possible orders as a systematic part.

    The largest difference is the half-width of a uniform distribution.
    """
    shifts = [abs(each - estimate.value) for each in others if math.isfinite(each)]
    if not shifts or not estimate.has_interval:
        return estimate
    return shifted_by(estimate, "order of the function", max(shifts) / math.sqrt(3.0))


def _unusable(fit: RationalFit) -> str:
    if not np.all(np.isfinite(fit.covariance)):
        return "its covariance is not finite"
    first = len(fit.numerator)
    part = slice(first, first + len(fit.denominator))
    covariance = fit.scatter[part, part]
    for pole in fit.poles[fit.poles.real > 0]:
        by = np.real(root_jacobian(fit.denominator, fit.scale, complex(pole)))
        surely = SURE * math.sqrt(max(float(by @ covariance @ by), 0.0))
        if pole.real > surely and abs(pole) > INTEGRATOR * 2.0 * np.pi * fit.lowest:
            return "a pole is unstable"
    return ""


def root_jacobian(coefficients: Array, scale: float, root: complex) -> ComplexArray:
    """Derivative of a root (rad/s) by the coefficients of powers of s / (2 pi scale), (k,)."""
    unit = 2.0 * np.pi * scale
    x = root / unit
    slope = np.polynomial.polynomial.polyval(x, np.polynomial.polynomial.polyder(coefficients))
    safe = complex(slope) if abs(slope) > 0 else 1e-300
    return np.asarray(-(x ** np.arange(len(coefficients))) / safe * unit)
