"""Responses of two inertias on a spring, and start values of their fit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

import numpy as np

from campaign.arrays import Array, ComplexArray
from campaign.estimation.frequency.measured_response import MeasuredResponse
from campaign.estimation.frequency.rational import delays_to_try

Side = Literal["motor", "load"]
STARTS = 8
"""Number of points, the best of a grid, from which a fit starts."""
RATIOS = (0.25, 0.4, 0.55, 0.7, 0.82, 0.92, 0.97)
"""Antiresonance over resonance on the grid."""
DAMPINGS = (0.01, 0.05, 0.2)
"""Damping ratios of the antiresonance on the grid."""


def model(frequency: Array, point: Array, side: Side, delay: float) -> ComplexArray:
    """Rate over torque at `frequency` (Hz), shape (n,).

    `point` begins with log J1, log (J2 / J1), log k, d, b1, b2, kg (SI). For m points, shape
    (7, m, 1), the responses have the shape (m, n).
    """
    s = 2j * np.pi * frequency
    first, ratio, spring = np.exp(np.clip(point[:3], -100.0, 100.0))
    second = first * ratio
    coupling = spring / s + point[3]
    motor, load = first * s + point[4] + point[6] / s, second * s + point[5]
    under = motor * load + coupling * (motor + load)
    under = np.where(np.abs(under) > 0, under, 1e-300)
    over = load + coupling if side == "motor" else coupling
    return np.asarray(over / under * np.exp(-s * delay))


def model_jacobian(
    frequency: Array, point: Array, sides: tuple[Side, ...], side: Side
) -> ComplexArray:
    """Derivative of `model` by all parameters, (n, p): the 7 of `point`, then delays of `sides`."""
    s = 2j * np.pi * np.asarray(frequency, dtype=float)
    first, ratio, spring = np.exp(np.clip(point[:3], -100.0, 100.0))
    coupling = spring / s + point[3]
    motor, load = first * s + point[4] + point[6] / s, first * ratio * s + point[5]
    under = motor * load + coupling * (motor + load)
    over = load + coupling if side == "motor" else coupling
    value = over / under * np.exp(-s * float(point[7 + sides.index(side)]))
    of_motor, of_load, of_coupling = load + coupling, motor + coupling, motor + load
    first_s, second_s, spring_s = first * s, first * ratio * s, spring / s
    slopes = np.zeros((len(s), 7 + len(sides)), dtype=complex)
    for column, below, above in (
        (0, first_s * of_motor + second_s * of_load, second_s),
        (1, second_s * of_load, second_s),
        (5, of_load, 1.0),
    ):
        raised = above / over if side == "motor" else 0.0
        slopes[:, column] = value * (raised - below / under)
    slopes[:, 2] = value * (spring_s / over - spring_s * of_coupling / under)
    slopes[:, 3] = value * (1.0 / over - of_coupling / under)
    slopes[:, 4] = value * (-of_motor / under)
    slopes[:, 6] = value * (-(1.0 / s * of_motor) / under)
    slopes[:, 7 + sides.index(side)] = -s * value
    return slopes


def polynomials(point: Array, side: Side) -> tuple[Array, Array]:
    """Numerator and denominator of `model` without delay, by powers of s (1/s), lowest first."""
    first, ratio, spring = np.exp(point[:3])
    coupling = np.array([spring, point[3]])  # times s
    motor = np.array([point[6], point[4], first])  # times s
    load = np.array([0.0, point[5], first * ratio])  # times s
    product = np.polynomial.polynomial
    both = product.polymul(coupling, product.polyadd(motor, load))
    under = product.polyadd(product.polymul(motor, load), both)  # times s²
    over = product.polyadd(coupling, load) if side == "motor" else coupling
    return product.polymul(over, [0.0, 1.0]), under


def sizes(responses: Mapping[Side, MeasuredResponse], sides: tuple[Side, ...]) -> Array:
    """Scale of each parameter.

    1 for logarithms, 0.1 J w for damping, J w² for the ground stiffness, 0.1 / w for delays. J is
    the total inertia, w the middle frequency (rad/s).
    """
    measured = responses[sides[0]]
    middle = 2.0 * np.pi * float(np.sqrt(measured.frequency[0] * measured.frequency[-1]))
    inertia = float(np.median(1.0 / (2.0 * np.pi * measured.frequency * np.abs(measured.values))))
    rest = inertia * middle
    sizes = [1.0, 1.0, 1.0, 0.1 * rest, 0.1 * rest, 0.1 * rest, rest * middle]
    return np.array([*sizes, *[0.1 / middle] * len(sides)])


def starts(responses: Mapping[Side, MeasuredResponse], sides: tuple[Side, ...]) -> list[Array]:
    """Best grid points by the log of gain; half of them again with delays of the responses."""
    frequency = np.concatenate([responses[side].frequency for side in sides])
    candidates = np.geomspace(frequency.min() * 1.05, frequency.max() * 1.2, 48)
    ratio, damping = np.meshgrid(RATIOS, DAMPINGS, indexing="ij")
    second = 1.0 / ratio.ravel() ** 2 - 1.0  # J2 over J1 = 1
    points, costs = [], []
    for resonance in candidates:
        zero = 2.0 * np.pi * resonance * ratio.ravel()
        spring = second * zero**2
        some = np.zeros((7 + len(sides), len(second)))
        some[1], some[2] = np.log(second), np.log(spring)
        some[3] = 2.0 * damping.ravel() * np.sqrt(spring * second)
        over = [
            np.abs(model(responses[side].frequency, some[:, :, None], side, 0.0))
            / np.maximum(np.abs(responses[side].values), 1e-300)
            for side in sides
        ]
        off = np.log(np.concatenate(over, axis=1))
        scale = np.median(off, axis=1)  # the model's gain is proportional to 1 / inertia
        some[[0, 2]] += scale
        some[3] *= np.exp(scale)
        points.append(some.T)
        costs.append(np.mean(np.minimum(np.abs(off - scale[:, None]), 1.0), axis=1))
    best = np.argsort(np.concatenate(costs), kind="stable")[:STARTS]
    kept = list(np.concatenate(points)[best])
    delays = [float(np.median(delays_to_try(responses[side]))) for side in sides]
    delayed = []
    for point in kept[: STARTS // 2]:
        later = point.copy()
        later[7:] = delays
        delayed.append(later)
    return kept + delayed


def mode_damping(point: Array) -> float:
    """Damping ratio of the poles of `model` with the largest frequency; 1 without a pair."""
    roots = np.polynomial.polynomial.polyroots(polynomials(point, "motor")[1])
    pairs = roots[np.abs(roots.imag) > 0]
    if not len(pairs):
        return 1.0
    root = pairs[np.argmax(np.abs(pairs))]
    return float(-root.real / abs(root))
