"""A second slipping interface that is hidden by the noise of a ramp.

An interface that is stiffer and slips first changes only the rate of the early part of a ramp. If
the gyro does not resolve that part, the curve of one interface also fits. Its stiffness is then too
low as stiffness at rest, and too high as that of the interface that continues to deflect. With a
rigid interface that slips at the torque Th, the rate is exactly that of a single interface, with a
stiffness that is too high by the factor Tb / (Tb - Th).
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from campaign.estimation.autocorrelated_errors import whitened
from campaign.estimation.bristle_fit import BristleFit
from campaign.estimation.intervals import student
from campaign.estimation.presliding_curve import Interface, angle_derivatives, presliding_angle

SHARES = (0.1, 0.15, 0.2, 0.3, 0.4)
"""Shares of the torque of a hidden interface. A smaller share is never resolved: half of the first
lies before the first fitted bin. With larger shares neither interface would be the stronger one."""
EARLIER = (4.0, 6.0, 10.0, 20.0, 50.0, 300.0)
"""Ratios of the slip angles of both interfaces. With smaller ratios no ramp separates them; the
last one is almost rigid."""


class Shift(NamedTuple):
    """Largest relative errors of a fit's stiffness by hidden interfaces, not negative.

    Attributes:
        stiffness: of the interface that carries the largest torque.
        at_rest: of the sum of all interfaces.
    """

    stiffness: float
    at_rest: float


class _Candidate(NamedTuple):
    """Residual sum of squares, and both stiffnesses over that of the single interface."""

    squares: float
    stiffness: float
    at_rest: float


def hidden_shift(one: BristleFit) -> Shift:
    """Largest shift among the pairs of interfaces that agree with the data.

    Each pair of `SHARES` and `EARLIER` is refitted. A pair agrees with the data if its sum of
    squares exceeds the least by at most Student's t squared times the residual variance (profile
    likelihood: Venzon and Moolgavkar, Appl. Statist. 37, 1988), with residuals whitened by the
    coefficient of `errors_of`.
    """
    alone = _fitted(one, 0.0, 1.0)
    pairs = [_fitted(one, share, earlier) for share, earlier in product(SHARES, EARLIER)]
    freedom = one.errors.freedom
    least = min(each.squares for each in (alone, *pairs) if each.stiffness > 0)
    limit = least + student(freedom) ** 2 * alone.squares / freedom
    left = [each for each in pairs if each.stiffness > 0 and each.squares <= limit]
    return Shift(
        max((abs(each.stiffness - 1.0) for each in left), default=0.0),
        max((abs(each.at_rest - 1.0) for each in left), default=0.0),
    )


def _fitted(one: BristleFit, share: float, earlier: float) -> _Candidate:
    """Fit of a pair to the bins of a single interface: one linear step.

    At given `share` and `earlier` the rate is linear in the bias and in 1 / stiffness, and almost
    linear in the logarithm of the total torque.
    """
    ((stiffness, torque),) = one.interfaces
    # The same late part of the curve, so that the step is small.
    parts = [Interface(stiffness * (1.0 - share), torque * (1.0 - share))]
    if share:
        parts.append(Interface(earlier * stiffness * share, torque * share))
    ramp, coefficient = one.ramp, one.errors.correlation
    angle = presliding_angle(ramp.torque, parts)
    by_torque = angle_derivatives(angle, parts)[:, 1::2] @ [part.torque for part in parts]
    columns = np.stack([angle, by_torque, ramp.edges], axis=1)
    rates = (np.diff(columns, axis=0) / np.diff(ramp.edges)[:, None])[one.used]
    design, data = whitened(rates, coefficient), whitened(ramp.rate[one.used], coefficient)
    scale = np.linalg.norm(design, axis=0)
    step = np.linalg.lstsq(design / scale, data, rcond=None)[0] / scale
    left = data - design @ step
    factor = 1.0 / float(step[0]) if step[0] > 0 else 0.0
    total = sum(part.stiffness for part in parts)
    return _Candidate(
        float(left @ left), factor * parts[0].stiffness / stiffness, factor * total / stiffness
    )
