"""Presliding parameters from a slow torque ramp (section 4.3.3).

Where sliding is slow, s(v) is Ts and the bristle equation dz/dq = 1 - sigma0 z / Ts has a closed
form: T = Tb (1 - exp(-sigma0 q / Tb)). A straight chord through such a curve is always too low as
an estimate of sigma0, so the curve itself is fitted. Interfaces in parallel add such curves; each
slips at its own torque, and the slope falls step by step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from campaign.identification.least_squares import Array, Fit, Parameter, fit

SMOOTHING = 0.1
"""s; window over which the acceleration is taken: short against a ramp of many seconds."""
SLACK = 0.03
"""relative uncertainty of the measured breakaway torque as the curve's asymptote: the peak of a
ramp lies a little below it."""
FITTED_SAMPLES = 4000
"""that a presliding curve is fitted to, at most."""
SMALLEST_SHARE = 0.02
"""of the breakaway torque that a second interface must carry to be believed: the ramp's own start
(the load must first be accelerated) bends the curve by less."""


@dataclass(frozen=True)
class Presliding:
    """What one ramp says.

    Attributes:
        breakaway: torque at which sliding began (N m).
        interfaces: (stiffness N m/rad, its standard error, torque N m) of each interface that the
            curve shows, the one that carries the largest torque first.
        chord: slope of a straight line over the same window (N m/rad), for comparison.
        window: torques between which the curve was fitted (N m).
        by_window: stiffness of the first interface when the window ends at other shares of the
            breakaway torque, share to N m/rad: how much the choice matters.
        doubts: sentences.
    """

    breakaway: float
    interfaces: tuple[tuple[float, float, float], ...]
    chord: float
    window: tuple[float, float]
    by_window: Mapping[float, float]
    doubts: tuple[str, ...]

    @property
    def stiffness(self) -> float:
        """Stiffness of the interface that carries the largest torque (N m/rad)."""
        return self.interfaces[0][0]

    @property
    def stiffness_at_rest(self) -> float:
        """Slope at the very start, where all interfaces still stick: the sum (N m/rad)."""
        return sum(stiffness for stiffness, _, _ in self.interfaces)


def breakaway_torque(
    time: Array, rate: Array, torque: Array, inertia: float, threshold: float
) -> tuple[float, int]:
    """Largest friction torque (N m) of a torque ramp, and the sample where sliding began.

    Friction is the drive torque less what accelerates the load (Eq. 4.1); the acceleration is the
    slope of the rate over SMOOTHING. Sliding begins where the rate passes `threshold` (rad/s).
    All arrays (n,). Raises ValueError when the load never moved that fast.
    """
    from scipy.signal import savgol_filter

    moving = np.abs(rate) >= threshold
    if not moving.any():
        raise ValueError(
            f"the rate never reached {threshold:.4g} rad/s: the ramp ended below breakaway"
        )
    interval = float(np.ptp(time)) / (len(time) - 1)
    length = max(3, 2 * round(0.5 * SMOOTHING / interval) + 1)
    if length >= len(time):
        raise ValueError(f"only {len(time)} samples: too short a recording for a breakaway torque")
    acceleration = savgol_filter(rate, length, 1, deriv=1, delta=interval)
    friction = savgol_filter(torque, length, 1) - inertia * acceleration
    # Within half a window of either end the slope belongs to another moment: it would leave some
    # of the acceleration at the end of the ramp in the friction.
    inner = friction[length // 2 : len(friction) - length // 2]
    return float(np.max(np.abs(inner))), int(np.argmax(moving))


def fine_angle(time: Array, rate: Array, angle: Array) -> Array:
    """Angle relative to a hull at rest, from gyro and angle sensor together, shape (n,).

    The integrated gyro rate (rad/s) has the resolution that an encoder (rad) lacks, the encoder
    knows no drift: the straight line between the two is taken off the integral.
    """
    interval = float(np.ptp(time)) / max(len(time) - 1, 1)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]))]) * interval
    if len(time) < 3:
        return angle
    drift = np.polynomial.Polynomial.fit(time, angle - integral, 1)
    return np.asarray(integral + drift(time))


def presliding_curve(angle: Array, values: Mapping[str, float]) -> Array:
    """Sum of Tb (1 - exp(-sigma0 q / Tb)) over interfaces 1, 2 ... present in `values`; (n,)."""
    total = np.zeros_like(angle)
    for k in (1, 2):
        if f"stiffness_{k}" in values:
            limit = values[f"torque_{k}"]
            total -= limit * np.expm1(-values[f"stiffness_{k}"] * angle / limit)
    return total


def fit_presliding(angle: Array, torque: Array, breakaway: float, share: float = 0.8) -> Presliding:
    """Fit the curve up to `share` of the breakaway torque; angle (rad) and torque (N m), (n,).

    Angle and torque are positive and begin near zero. One interface is assumed, unless two explain
    the curve clearly better (Bayesian information criterion lower by more than 10).
    Raises ValueError when too few samples lie in the window.
    """
    start = 0.02 * breakaway
    window = (start, share * breakaway)
    best, chord = _fit_window(angle, torque, breakaway, window)
    interfaces = _interfaces(best)
    by_window: dict[float, float] = {}
    for other in (0.5, 0.65, 0.8, 0.9):
        try:
            found, _ = _fit_window(angle, torque, breakaway, (start, other * breakaway))
        except ValueError:
            continue
        by_window[other] = _interfaces(found)[0][0]
    return Presliding(breakaway, interfaces, chord, window, by_window, best.doubts)


def _fit_window(
    angle: Array, torque: Array, breakaway: float, window: tuple[float, float]
) -> tuple[Fit, float]:
    inside = (torque >= window[0]) & (torque <= window[1])
    past = int(np.argmax(torque > window[1])) if (torque > window[1]).any() else len(torque)
    inside[past:] = False
    q, t = angle[inside], torque[inside]
    if len(q) < 10 or float(np.ptp(q)) <= 0.0:
        raise ValueError(
            f"only {len(q)} samples lie between {window[0]:.3g} and {window[1]:.3g} N m"
        )
    # Evenly spread: a slow ramp has far more samples than information.
    pick = np.unique(np.linspace(0, len(q) - 1, min(len(q), FITTED_SAMPLES)).astype(int))
    q, t = q[pick], t[pick]
    slope = max(float(np.polyfit(q, t, 1)[0]), 1e-6)
    first = max(float((t[3] - t[0]) / max(q[3] - q[0], 1e-12)), slope)
    # All interfaces together carry the breakaway torque; it is measured, so it is nearly known.
    total = Parameter("total", (1 - SLACK) * breakaway, (1 + SLACK) * breakaway, (breakaway,))
    stiffness = Parameter("stiffness_1", 0.01 * slope, 1e4 * slope, (slope, first))
    one = fit(_one_interface, q, t, [stiffness, total])
    two = fit(
        _two_interfaces,
        q,
        t,
        [
            stiffness,
            total,
            Parameter("stiffness_2", 0.01 * slope, 1e4 * slope, (first, 5.0 * first)),
            Parameter("torque_2", SMALLEST_SHARE * breakaway, 0.5 * breakaway, (0.15 * breakaway,)),
        ],
    )
    # How stiff the weaker interface is may stay open (it slips within the sensor's resolution),
    # and the total may lean on its measurement; the rest may not.
    certain = all(doubt.startswith(("stiffness_2", "total")) for doubt in two.doubts)
    return (two if certain and two.bic < one.bic - 10.0 else one), slope


def _one_interface(angle: Array, values: Mapping[str, float]) -> Array:
    return presliding_curve(angle, {**values, "torque_1": values["total"]})


def _two_interfaces(angle: Array, values: Mapping[str, float]) -> Array:
    return presliding_curve(angle, {**values, "torque_1": values["total"] - values["torque_2"]})


def _interfaces(found: Fit) -> tuple[tuple[float, float, float], ...]:
    values, errors = found.values, found.errors
    weaker = values.get("torque_2", 0.0)
    rows = [(values["stiffness_1"], errors["stiffness_1"], values["total"] - weaker)]
    if "stiffness_2" in values:
        rows.append((values["stiffness_2"], errors["stiffness_2"], weaker))
    return tuple(sorted(rows, key=lambda row: -row[2]))


def damping_by_ratio(stiffness: float, inertia: float, viscous: float, ratio: float) -> float:
    """sigma1 (N m s/rad) from an *assumed* damping ratio (Equation 4.12): not a measurement."""
    return 2.0 * ratio * float(np.sqrt(stiffness * inertia)) - viscous
