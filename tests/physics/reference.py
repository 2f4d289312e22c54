"""The stabilization loop a second time: the thesis' equations, given to scipy's solvers.

Nothing of `campaign.physics` is used. Symbols and gains are the appendix'; the rate error is in
deg/s, as the gyro constant 180/pi says.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from scipy.integrate import solve_ivp

from tests.physics.benches import (
    DEG,
    INERTIA,
    KE,
    KIC,
    KIV,
    KPC,
    KPV,
    KT,
    LOAD,
    MOTOR,
    RATIO,
    L,
    R,
)

K0 = 2000.0


def lugre(v: float, z: float, p: dict[str, float]) -> tuple[float, float]:
    """Torque and dz/dt of Equations 4.2 to 4.4."""
    s = p["tc"] + (p["ts"] - p["tc"]) * math.exp(-((v / p["vs"]) ** 2))
    dz = v - p["s0"] * abs(v) / s * z
    return p["s0"] * z + p["s1"] * dz + p["s2"] * v, dz


def trajectory(
    times: np.ndarray,
    base_rate: Callable[[float], float],
    compensation: str = "none",
    torque: Callable[[float], float] | None = None,
    low_pass: float = 0.0,
    rtol: float = 1e-10,
) -> dict[str, np.ndarray]:
    """States over `times`; the rate command is zero, or the loop is open when `torque` is given.

    State: w, its integral, relative angle, i, both PI integrals, z of load and motor, z of the
    compensation's load and motor, the observer's w', the filtered relative rate.
    """

    def rates(t: float, y: np.ndarray) -> list[float]:
        w, _, _, i, current_sum, rate_sum, zl, zm, zlc, zmc, observed, filtered = y
        v = w - base_rate(t)
        seen = filtered if low_pass else v
        load, dzl = lugre(v, zl, LOAD)
        motor, dzm = lugre(v, zm, MOTOR)
        added, dzlc, dzmc, dobserved = 0.0, 0.0, 0.0, 0.0
        if compensation == "lugre":
            load_c, dzlc = lugre(seen, zlc, LOAD)
            motor_c, dzmc = lugre(seen, zmc, MOTOR)
            added = load_c + RATIO * motor_c
        elif compensation == "observer":
            disturbance = RATIO * K0 * (w - observed)  # Equation 5.2
            dobserved = (RATIO * KT * i + disturbance) / INERTIA
            added = -disturbance
        error = -w * DEG
        wanted = KPV * (error + KIV * rate_sum) if torque is None else torque(t) / (RATIO * KT)
        current_error = wanted + added / (RATIO * KT) - i
        voltage = KPC * current_error + KIC * current_sum
        return [
            (RATIO * KT * i - load - RATIO * motor) / INERTIA,
            w,
            v,
            (voltage - R * i - KE * RATIO * v) / L,
            current_error,
            error if torque is None else 0.0,
            dzl,
            dzm,
            dzlc,
            dzmc,
            dobserved,
            (v - filtered) / low_pass if low_pass else 0.0,
        ]

    scale = np.array([1e-3, 1e-4, 1e-2, 1.0, 1e-2, 1e-2, 1e-3, 1e-5, 1e-3, 1e-5, 1e-3, 1e-2])
    found = solve_ivp(
        rates,
        (float(times[0]), float(times[-1])),
        np.zeros(12),
        method="LSODA",
        t_eval=times,
        rtol=rtol,
        atol=1e-9 * scale,
        max_step=2e-3,
    )
    assert found.success, found.message
    names = ("load_rate", "pointing_angle", "relative_angle", "motor_current")
    return dict(zip(names, found.y, strict=False)) | {"filtered_rate": found.y[11]}
