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
    # Evenly in torque: a slow ramp has far more samples than information.
    pick = np.unique(np.linspace(0, len(q) - 1, min(len(q), 400)).astype(int))
    q, t = q[pick], t[pick]
    slope = max(float(np.polyfit(q, t, 1)[0]), 1e-6)
    first = max(float((t[3] - t[0]) / max(q[3] - q[0], 1e-12)), slope)
    one = fit(
        presliding_curve,
        q,
        t,
        [
            Parameter("stiffness_1", 0.01 * slope, 1e4 * slope, (slope, first)),
            Parameter("torque_1", 0.3 * breakaway, 30.0 * breakaway, (breakaway,)),
        ],
    )
    two = fit(
        presliding_curve,
        q,
        t,
        [
            Parameter("stiffness_1", 0.01 * slope, 1e4 * slope, (slope,)),
            Parameter("torque_1", 0.3 * breakaway, 30.0 * breakaway, (0.8 * breakaway,)),
            Parameter("stiffness_2", 0.01 * slope, 1e4 * slope, (first, 5.0 * first)),
            Parameter("torque_2", SMALLEST_SHARE * breakaway, 0.5 * breakaway, (0.15 * breakaway,)),
        ],
    )
    return (two if two.bic < one.bic - 10.0 and not two.doubts else one), slope


def _interfaces(found: Fit) -> tuple[tuple[float, float, float], ...]:
    rows = [
        (
            found.values[f"stiffness_{k}"],
            found.errors[f"stiffness_{k}"],
            found.values[f"torque_{k}"],
        )
        for k in (1, 2)
        if f"stiffness_{k}" in found.values
    ]
    return tuple(sorted(rows, key=lambda row: -row[2]))


def damping_by_ratio(stiffness: float, inertia: float, viscous: float, ratio: float) -> float:
    """sigma1 (N m s/rad) from an *assumed* damping ratio (Equation 4.12): not a measurement."""
    return 2.0 * ratio * float(np.sqrt(stiffness * inertia)) - viscous
