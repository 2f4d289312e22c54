"""Optimal speeds of a velocity map for Equation 4.6 from rough parameters.

A point at speed v adds j jᵀ to the information of the parameters, with j the derivative of the
torque by each of them over the torque's deviation; their covariance C, the inverse, loses
C j jᵀ C / (1 + jᵀ C j) (Sherman and Morrison). Points are added one by one, each where it makes the
product of the parameters' variances smallest, so that no unit and no size counts; Ts and vs, which
a map is for, count twice. Only roughly is known what a design depends on: the logarithm of that
product is averaged over several curves (Chaloner and Verdinelli, "Bayesian experimental design",
Statist. Sci. 10 (1995)).

Beside 40 speeds evenly in their logarithm, 10 such speeds and 30 that are chosen leave 0.77 of the
standard deviation of Ts and 0.80 of that of vs, as the median over 41 benches; on none of them is
that of Ts, vs or delta larger, and on 8 that of Tc or sigma2, by up to 7 %: speeds go up to the
rate limit, far above vs, where a line needs fewer points.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.arrays import Array
from campaign.estimation.stribeck import PARAMETERS, stribeck

COUNTED = {"static_torque": 2.0, "stribeck_velocity": 2.0}
"""How often the variance of a parameter counts; the others once."""
WIDEST = 2.0
"""Factor by which vs and delta of the curves differ from what was found, at most."""
ROUNDING = 1e-12
"""Least share that a logarithm is taken of."""
RIDGE = 1e-9
"""of the information, for measured speeds that leave a parameter open."""


def telling_speeds(
    curves: Sequence[Mapping[str, float]], measured: Array, candidates: Array, count: int
) -> Array:
    """Most informative speeds (rad/s) of further points, ascending; shape (at most `count`,).

    Args:
        curves: parameters of Equation 4.6 by name (SI), any of which may be the true one.
        measured: speeds (rad/s) that are points of the map already, shape (m,).
        candidates: speeds (rad/s) to choose among, shape (n,); each is taken once at most, so that
            the distance between them decides how closely points may lie.

    Every torque counts with the same relative deviation: friction that scatters from trial to trial
    does so in proportion.
    """
    weight = np.array([COUNTED.get(name, 1.0) for name in PARAMETERS])
    # One axis each: curve, speed, parameter.
    offered = np.stack([sensitivity(curve, candidates) for curve in curves])
    covariance = np.stack([_covariance(sensitivity(curve, measured)) for curve in curves])
    left = np.ones(len(candidates), dtype=bool)
    for _ in range(min(count, len(candidates))):
        moved = np.einsum("cpq,cnq->cnp", covariance, offered)
        whole = 1.0 + np.einsum("cnp,cnp->cn", offered, moved)[:, :, None]
        variance = np.einsum("cpp->cp", covariance)[:, None, :]
        share = moved**2 / (whole * variance)  # of the variance that goes: below 1 but for rounding
        gain = -np.log1p(-np.minimum(share, 1.0 - ROUNDING)) @ weight
        best = int(np.argmax(np.where(left, gain.mean(axis=0), -np.inf)))
        left[best] = False
        lost = moved[:, best, :, None] * moved[:, best, None, :]
        covariance = covariance - lost / whole[:, best, :, None]
    return np.sort(candidates[~left])


def _covariance(rows: Array) -> Array:
    """Of the parameters, from the sensitivities (n, p) of points that all deviate alike."""
    information = rows.T @ rows
    floor = RIDGE * np.diag(information) + np.finfo(float).tiny
    return np.asarray(np.linalg.inv(information + np.diag(floor)))


def curves_around(
    values: Mapping[str, float], velocity_error: float, exponent_error: float
) -> Iterator[dict[str, float]]:
    """The curve that was found, and those with vs or delta one relative deviation off.

    values: parameters by name (SI). The errors are relative (1 sigma); larger ones than a factor of
    `WIDEST` count as that.
    """
    yield dict(values)
    for name, error in (
        ("stribeck_velocity", velocity_error),
        ("stribeck_exponent", exponent_error),
    ):
        factor = min(1.0 + error, WIDEST)
        yield {**values, name: values[name] * factor}
        yield {**values, name: values[name] / factor}


def sensitivity(values: Mapping[str, float], speed: Array) -> Array:
    """Derivative of the torque by sigma2, Tc, Ts, ln vs and ln delta, over the torque; (n, 5).

    values: parameters by name (SI); speed: rad/s, shape (n,).
    """
    power = (speed / values["stribeck_velocity"]) ** values["stribeck_exponent"]
    fall = np.exp(-power)
    bend = (values["static_torque"] - values["coulomb_torque"]) * fall * power
    delta = values["stribeck_exponent"]
    ratio = np.log(speed / values["stribeck_velocity"])
    columns = [speed, 1.0 - fall, fall, bend * delta, -bend * delta * ratio]
    return np.asarray(np.stack(columns, axis=1) / np.abs(stribeck(speed, values))[:, None])
