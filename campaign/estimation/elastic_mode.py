"""First elastic mode of a torque-to-rate response: resonance and antiresonance.

An elastic part on the load multiplies the smooth response of the rigid axis by

    (wz^2 - w^2 + 2 i dz wz w) / (wp^2 - w^2 + 2 i dp wp w) * wp^2 / wz^2

The antiresonance wz is the natural frequency of the part alone, the resonance wp that of part and
load together. Intervals follow from the residuals of the fit (noise and friction): Student's t,
with the degrees of freedom reduced by the correlation of neighboring residuals.

Friction in phase with the rate, D times the reaction of the inertia, divides the part's share of
the inertia by 1 - iD. The distance of resonance and antiresonance falls by 1 / (1 + D^2), and D
times the remaining distance adds to the damping of the resonance. Apart from a delay, the smooth
response leads that of an inertia by arctan D. Viscous friction leads by up to twice that angle:
therefore both effects are systematic parts, not corrections.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array, ComplexArray, Flags
from campaign.estimate import Estimate
from campaign.estimation.frequency_response import Response, held_by_spring
from campaign.estimation.gate import admitted, refused
from campaign.estimation.intervals import shifted_by, with_error

SPAN = 2.0
"""Factor from a candidate frequency to both ends of its window. There, the response without the
mode is a complex parabola over the logarithm of frequency."""
FEWEST_POINTS = 12
"""Fewest points in the window of a fit."""
EVIDENCE = 4.0
"""Least factor by which a mode reduces the squared residual of a smooth response."""
SMALLEST_PEAK = 0.03
"""Least height of a mode, relative to the smooth response."""
APART = 0.3
"""Largest logarithm of antiresonance over resonance: up to it the parabola fits the rest."""
WIDE = 0.5
"""Largest damping ratio: up to it a mode is narrower than the window of its fit."""
NEARLY = 0.99
"""Share of these from which a fit is at a bound: no small mode on top of a smooth response."""


@dataclass(frozen=True)
class ElasticMode:
    """An elastic mode.

    Attributes:
        frequency: resonance (Hz).
        damping_ratio: of the resonance.
        antiresonance: (Hz); below the resonance for a part that hangs on the load.
    """

    frequency: Estimate
    damping_ratio: Estimate
    antiresonance: Estimate


def elastic_mode(response: Response) -> ElasticMode | None:
    """Most prominent mode of a response.

    None for a smooth response, and where antiresonance and resonance are too far apart or not
    separable. Not determined where a spring holds the axis at the lowest frequencies.
    """
    frequency = response.frequency
    logarithm = np.log(np.maximum(np.abs(response.values), 1e-300)) + 1j * response.phase
    best: tuple[float, float] | None = None
    for candidate in frequency:
        window = _window(frequency, float(candidate))
        if np.count_nonzero(window) < FEWEST_POINTS or not window[:-1].any():
            continue
        for damping in (0.01, 0.03, 0.1):
            gain = _evidence(frequency[window], logarithm[window], float(candidate), damping)
            if best is None or gain > best[0]:
                best = gain, float(candidate)
    mode = None if best is None else _refine(frequency, logarithm, best[1])
    why = held_by_spring(response)
    if mode is None or not why:
        return mode
    return replace(
        mode,
        frequency=refused(mode.frequency, why),
        damping_ratio=refused(mode.damping_ratio, why),
        antiresonance=refused(mode.antiresonance, why),
    )


def _window(frequency: Array, centre: float) -> Flags:
    inside: Flags = (frequency >= centre / SPAN) & (frequency <= centre * SPAN)
    # A mode at the edge of the sweep cannot be separated from the smooth part.
    whole = frequency[0] <= centre / SPAN**0.5 and frequency[-1] >= centre * SPAN**0.5
    return inside if whole else np.zeros_like(inside)


def _smooth(frequency: Array) -> ComplexArray:
    log = np.log(frequency / frequency[len(frequency) // 2])
    return np.column_stack([np.ones_like(log), log, log**2]).astype(complex)


def _left(basis: ComplexArray, values: ComplexArray) -> ComplexArray:
    """Residuals of `values` after the best combination of `basis`."""
    coefficients, *_ = np.linalg.lstsq(basis, values, rcond=None)
    return np.asarray(values - basis @ coefficients)


def _evidence(frequency: Array, values: ComplexArray, centre: float, damping: float) -> float:
    """Factor by which a small mode at `centre` reduces the squared residual."""
    basis = _smooth(frequency)
    small = frequency**2 / (centre**2 - frequency**2 + 2j * damping * centre * frequency)
    without = np.sum(np.abs(_left(basis, values)) ** 2)
    with_mode = np.sum(np.abs(_left(np.column_stack([basis, small]), values)) ** 2)
    return float(without / max(with_mode, 1e-30))


def _mode(frequency: Array, p: Array) -> ComplexArray:
    """Logarithm of the factor above; p: wp, dp, ln(wz / wp), dz."""
    pole, zero = p[0], p[0] * np.exp(p[2])
    up = zero**2 - frequency**2 + 2j * p[3] * zero * frequency
    down = pole**2 - frequency**2 + 2j * p[1] * pole * frequency
    return np.asarray(np.log(up / down * (pole / zero) ** 2))


def _refine(frequency: Array, values: ComplexArray, centre: float) -> ElasticMode | None:
    from scipy.optimize import least_squares

    window = _window(frequency, centre)
    f, y = frequency[window], values[window]
    basis = _smooth(f)

    def residual(p: Array) -> Array:
        left = _left(basis, np.asarray(y - _mode(f, p)))
        return np.concatenate([left.real, left.imag])

    lower, upper = [centre / 1.3, 1e-4, -APART, 1e-4], [centre * 1.3, WIDE, APART, WIDE]
    fits = [
        least_squares(residual, [centre, 0.03, shift, 0.03], bounds=(lower, upper))
        for shift in (-0.01, 0.01)
    ]
    fit = min(fits, key=lambda each: float(each.cost))
    smooth = float(np.sum(np.abs(_left(basis, y)) ** 2))
    explained = smooth / max(2.0 * float(fit.cost), 1e-30)
    peak = float(np.max(np.abs(np.exp(_mode(np.linspace(f[0], f[-1], 2000), fit.x)) - 1.0)))
    at_bound = np.any(np.abs(fit.x[1:]) > NEARLY * np.array([WIDE, APART, WIDE]))
    if explained < EVIDENCE or peak < SMALLEST_PEAK or at_bound:
        return None
    drag = float(np.tan(_lead(f, (y - _mode(f, fit.x)).imag)))
    return _mode_found(fit.x, fit.jac, fit.fun, drag)


def _lead(frequency: Array, phase: Array) -> float:
    """Angle (rad) by which a smooth response of this phase (rad) leads that of an inertia.

    A delay adds a phase proportional to the frequency (Hz). Both have shape (n,).
    """
    basis = np.column_stack([np.ones_like(frequency), frequency])
    constant, _ = np.linalg.lstsq(basis, phase, rcond=None)[0]
    return float(constant) + np.pi / 2.0


def _mode_found(p: Array, jacobian: Array, left: Array, drag: float) -> ElasticMode | None:
    """Mode with intervals, from the parameters `p` of `_mode`.

    None where the antiresonance is not significantly below the resonance: an elastic part on the
    load has it there, and friction that yields at falling amplitude has neither.

    drag: friction over the reaction of the inertia, D above.

    The linear smooth part is projected out of residuals and Jacobian: J^T J is the information on
    the mode alone.
    """
    freedom = _freedom(left, len(p) + 6)  # the parabola has six real numbers
    variance = float(left @ left) / freedom if freedom > 0 else np.nan
    covariance = np.linalg.pinv(jacobian.T @ jacobian) * variance
    pole, damping, shift = (float(value) for value in p[:3])
    zero = pole * float(np.exp(shift))
    by_zero = np.array([zero / pole, 0.0, zero, 0.0])

    def estimate(name: str, value: float, unit: str, gradient: Array) -> Estimate:
        error = float(np.sqrt(gradient @ covariance @ gradient))
        return with_error(name, value, unit, error, freedom, "mode on top of a smooth response")

    high = estimate("apart", shift, "", np.eye(4)[2]).high
    if high is None or high >= 0.0:
        return None
    resonance = estimate("elastic_mode_frequency", pole, "Hz", np.eye(4)[0])
    ratio = estimate("damping_ratio", damping, "", np.eye(4)[1])
    return ElasticMode(
        admitted(shifted_by(resonance, "friction", abs((pole - zero) * drag**2))),
        admitted(shifted_by(ratio, "friction", abs(shift * drag))),
        estimate("antiresonance", zero, "Hz", by_zero),
    )


def _freedom(left: Array, parameters: int) -> float:
    """Degrees of freedom of residuals over frequency (real parts, then imaginary parts).

    The correlation r of neighbors reduces them by the factor (1 - r) / (1 + r).
    """
    halves = left.reshape(2, -1)
    power = float(np.sum(halves**2))
    correlation = float(np.sum(halves[:, 1:] * halves[:, :-1])) / power if power > 0 else 0.0
    alike = min(max(correlation, 0.0), 0.95)
    return (len(left) - parameters) * (1.0 - alike) / (1.0 + alike)
