"""Optimal speeds of a velocity map for Equation 4.6 from rough parameters.

A point at speed v adds j jᵀ to the information on the parameters; j is the derivative of the torque
by each of them, over the torque's deviation. It reduces their covariance C by
C j jᵀ C / (1 + jᵀ C j) (Sherman and Morrison). Points are added one by one. Each next point
minimizes the product of the parameters' variances, which is independent of units and sizes. Ts and
vs, the purpose of a map, count twice. The parameters are known only roughly: the logarithm of the
product is averaged over several curves (Chaloner and Verdinelli, "Bayesian experimental design",
Statist. Sci. 10 (1995)).

Compared with 40 speeds, evenly spaced in their logarithm, 10 such speeds and 30 chosen ones reduce
the standard deviation of Ts to 0.77 and that of vs to 0.80 (medians over 41 benches). On no bench
is that of Ts, vs or delta larger. On 8 benches that of Tc or sigma2 is larger, by up to 7 %: evenly
spaced speeds up to the rate limit, far above vs, are more than a line needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from campaign.arrays import Array
from campaign.estimation.stribeck import PARAMETERS, stribeck

COUNTED = {"static_torque": 2.0, "stribeck_velocity": 2.0}
"""Weight of a parameter's variance in the product; 1 for other parameters."""
WIDEST = 2.0
"""Largest factor by which vs and delta of the curves differ from their estimates."""
ROUNDING = 1e-12
"""Least remaining share of a variance, so that its logarithm is finite."""
RIDGE = 1e-9
"""Share of the information that is added, for measured speeds that leave a parameter open."""


def telling_speeds(
    curves: Sequence[Mapping[str, float]], measured: Array, candidates: Array, count: int
) -> Array:
    """Most informative speeds (rad/s) of further points, ascending; shape (at most `count`,).

    Args:
        curves: parameters of Equation 4.6 by name (SI); each curve may be the true one.
        measured: speeds (rad/s) of existing points of the map, shape (m,).
        candidates: speeds (rad/s) to choose from, shape (n,); each is used at most once, so that
            their spacing is the least distance of points.

    All torques have the same relative deviation: scatter from trial to trial is proportional to
    friction.
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
        share = moved**2 / (whole * variance)  # removed from the variance: below 1 but for rounding
        gain = -np.log1p(-np.minimum(share, 1.0 - ROUNDING)) @ weight
        best = int(np.argmax(np.where(left, gain.mean(axis=0), -np.inf)))
        left[best] = False
        lost = moved[:, best, :, None] * moved[:, best, None, :]
        covariance = covariance - lost / whole[:, best, :, None]
    return np.sort(candidates[~left])


def _covariance(rows: Array) -> Array:
    """Covariance of the parameters, from sensitivities (n, p) of points with equal deviations."""
    information = rows.T @ rows
    floor = RIDGE * np.diag(information) + np.finfo(float).tiny
    return np.asarray(np.linalg.inv(information + np.diag(floor)))


def curves_around(
    values: Mapping[str, float], velocity_error: float, exponent_error: float
) -> Iterator[dict[str, float]]:
    """Estimated curve, and those with vs or delta changed by one relative deviation.

    values: parameters by name (SI). The errors are relative (1 sigma), limited to a factor of
    `WIDEST`.
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
