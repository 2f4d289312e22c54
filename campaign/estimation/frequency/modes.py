"""Resonances and antiresonances of a fitted response, with intervals by the delta method."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimate import Estimate, Origin
from campaign.estimation.frequency.orders import ChosenOrder, root_jacobian, with_order
from campaign.estimation.frequency.rational import RationalFit
from campaign.estimation.gate import admitted, refused
from campaign.estimation.intervals import MODEL_MISFIT, with_error
from campaign.reason import Cause, Reason

LEAST_IMAGINARY = 1e-6
"""Share of a root's size below which its imaginary part is a rounding error."""
SAME = 0.1
"""Distance in the logarithm of frequency within which modes of two orders are the same."""
METHOD = "root of a rational function with a delay, delta method"
NOTHING_CHANGES_IT = Cause("value at bound", "it is at its bound: no parameter changes it there")
OUTSIDE = Cause("outside of the band", "it lies outside of the measured frequencies")


@dataclass(frozen=True)
class Mode:
    """A pair of complex poles or zeros.

    Attributes:
        frequency: natural frequency |root| / 2 pi (Hz).
        damping: damping ratio.
        is_zero: whether it is an antiresonance.
    """

    frequency: Estimate
    damping: Estimate
    is_zero: bool = False


def modes(fit: RationalFit) -> tuple[Mode, ...]:
    """Resonances, then antiresonances, each by frequency.

    A mode outside the measured frequencies is not determined; a mode of a misfit has no interval.
    """
    up = len(fit.numerator)
    parts = (
        (fit.poles, fit.denominator, up, False),
        (fit.zeros, fit.numerator, 0, True),
    )
    modes_of_both = []
    for roots, coefficients, first, is_zero in parts:
        pairs = [each for each in roots if each.imag > LEAST_IMAGINARY * abs(each)]
        part = slice(first, first + len(coefficients))
        for root in sorted(pairs, key=abs):
            by = root_jacobian(coefficients, fit.scale, complex(root))
            modes_of_both.append(_mode(fit, complex(root), by, fit.scatter[part, part], is_zero))
    return tuple(modes_of_both)


def chosen_modes(chosen: ChosenOrder) -> tuple[Mode, ...]:
    """Modes of the chosen order, with the difference to other likely orders as a systematic part.

    The nearest mode of each other order is used, if its distance is below `SAME`.
    """
    others = [modes(each) for each in chosen.near]

    def told(mode: Mode) -> Mode:
        near = []
        for each in others:
            alike = [other for other in each if other.is_zero == mode.is_zero]
            nearest = min(alike, key=lambda other: _apart(other, mode), default=None)
            if nearest is not None and _apart(nearest, mode) < SAME:
                near.append(nearest)
        return replace(
            mode,
            frequency=with_order(mode.frequency, [each.frequency.value for each in near]),
            damping=with_order(mode.damping, [each.damping.value for each in near]),
        )

    return tuple(told(each) for each in modes(chosen.fit))


def _apart(one: Mode, other: Mode) -> float:
    return abs(math.log(one.frequency.value / other.frequency.value))


def _mode(
    fit: RationalFit, root: complex, by: ComplexArray, covariance: Array, is_zero: bool
) -> Mode:
    size = abs(root)
    frequency, damping = size / (2.0 * math.pi), -root.real / size
    # Derivatives of |r| and of -Re r / |r|, by the coefficients.
    by_size = np.real(np.conj(root) * by) / size
    by_damping = -np.real(by) / size + root.real * by_size / size**2
    prefix = "antiresonance" if is_zero else "resonance"

    def estimate(name: str, value: float, unit: str, gradient: Array) -> Estimate:
        error = math.sqrt(max(float(gradient @ covariance @ gradient), 0.0))
        return of_fit(name, value, unit, error, fit.misfit, METHOD)

    mode = Mode(
        estimate(prefix, frequency, "Hz", by_size / (2.0 * math.pi)),
        estimate(f"{prefix}_damping", damping, "", by_damping),
        is_zero,
    )
    if fit.lowest <= frequency <= fit.highest:
        return mode
    return replace(
        mode,
        frequency=refused(mode.frequency, OUTSIDE()),
        damping=refused(mode.damping, OUTSIDE()),
    )


def of_fit(
    name: str, value: float, unit: str, error: float, misfit: Reason, method: str
) -> Estimate:
    """Estimate from a fit; it has no interval for a misfit, or at a bound.

    A value with a standard error of 0 is at its bound: no parameter changes it.
    """
    if misfit:
        return Estimate.without_interval(name, value, unit, MODEL_MISFIT(why=misfit), method=method)
    if error == 0.0:
        return Estimate.without_interval(
            name, value, unit, NOTHING_CHANGES_IT(), method=method, origin=Origin.AT_BOUND
        )
    return admitted(with_error(name, value, unit, error, math.inf, method))
