"""How well a parameter could be known at all: the Cramer-Rao bound of a friction-velocity map.

The bound of a curve F(v; p) known at n speeds with independent normal deviations s_i is
(J^T diag(1/s^2) J)^-1. Of a point's deviation it counts what no analysis can take away: the scatter
of friction from trial to trial, and the white noise of the current sensor over the window. Ripple,
which could be modelled, costs the bound nothing.
"""

from __future__ import annotations

import math

import numpy as np

from campaign.arrays import Array
from campaign.physics.true_values import DIRECTIONS, stribeck_parameters
from campaign.physics.variation import of_its_day
from campaign.result import Finding
from tests.coverage.laboratory import Run

NAMES = (
    "viscous_friction",
    "coulomb_torque",
    "static_torque",
    "stribeck_velocity",
    "stribeck_exponent",
)


def bound_of(run: Run, finding: Finding) -> float | None:
    """Standard deviation (SI) that no unbiased estimate can be below; None where not worked out."""
    direction = str(finding.conditions.get("direction"))
    if run.kind != "velocity_map" or finding.quantity not in NAMES or direction not in DIRECTIONS:
        return None
    if finding.conditions.get("exponent", "free") != "free":
        return None  # the bound of a model that is wrong
    bench = of_its_day(run.case.truth)
    p = stribeck_parameters(bench, DIRECTIONS[direction])
    if not set(NAMES) <= p.keys():
        return None
    speeds, deviations = [], []
    scatter = _scatter(run)
    noise = run.case.truth.sensors.current.noise * run.case.truth.torque_per_current
    for done in run.done:
        speed = done.trial.point.get("speed")
        if not isinstance(speed, float):
            continue
        torque = _curve(p, np.array([speed]))[0]
        # Half a trial is one direction, and its window is some half of that.
        samples = 0.25 * done.trial.task.duration * done.trial.task.sample_rate
        speeds.append(speed)
        deviations.append(math.hypot(scatter * torque, noise / math.sqrt(samples), 1e-9 * torque))
    v, s = np.array(speeds), np.array(deviations)
    jacobian = np.stack([_slope(p, name, v) for name in NAMES], axis=1) / s[:, None]
    covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-30, hermitian=True)
    variance = covariance[NAMES.index(finding.quantity), NAMES.index(finding.quantity)]
    return math.sqrt(variance) if variance > 0.0 else None


def _scatter(run: Run) -> float:
    """Relative deviation of the torques from trial to trial."""
    variation = run.case.truth.variation
    lines = variation.trials if variation is not None else ()
    return max((line.relative for line in lines), default=0.0)


def _curve(p: dict[str, float], v: Array) -> Array:
    fall = np.exp(-((v / p["stribeck_velocity"]) ** p["stribeck_exponent"]))
    return np.asarray(
        p["coulomb_torque"]
        + (p["static_torque"] - p["coulomb_torque"]) * fall
        + p["viscous_friction"] * v
    )


def _slope(p: dict[str, float], name: str, v: Array) -> Array:
    step = 1e-5 * p[name]
    more, less = {**p, name: p[name] + step}, {**p, name: p[name] - step}
    return (_curve(more, v) - _curve(less, v)) / (2.0 * step)
