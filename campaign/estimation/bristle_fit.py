"""Least-squares fit of the bristle curve to the binned rate of a torque ramp.

The parameters are logarithms, so that stiffness, torque and their intervals stay positive: ln
stiffness and ln of the total torque; ln stiffness and ln torque of a second interface; last the
gyro's bias, in units of the rate's deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, Flags
from campaign.estimation.autocorrelated_errors import FitErrors, errors_of
from campaign.estimation.presliding_curve import Interface, angle_derivatives, presliding_angle
from campaign.estimation.torque_ramp import FEWEST_BINS, Ramp

EVALUATIONS = 100
"""Most evaluations of a fit; a curve that needs more is not determined."""


@dataclass(frozen=True)
class Start:
    """Start vectors and bounds of a fit, without the bias."""

    vectors: tuple[tuple[float, ...], ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]


def one_interface(ramp: Ramp, breakaway: float) -> Start:
    """Start of the fit of a single interface that slips near `breakaway` (N m).

    Raises ValueError where the rate is almost always zero.
    """
    if not ramp.typical_rate > np.finfo(float).tiny:
        raise ValueError("the rate of this ramp is zero nearly everywhere before it slides")
    stiffness = float(np.log(ramp.slope / ramp.typical_rate))
    lowest, highest = float(np.log(1.02 * ramp.torque[-1])), float(np.log(4.0 * breakaway))
    torque = max(float(np.log(breakaway)), lowest + 0.01)
    return Start(((stiffness, torque),), (stiffness - 7.0, lowest), (stiffness + 7.0, highest))


def two_interfaces(ramp: Ramp, breakaway: float, smallest: float) -> Start:
    """Start of the fit of two interfaces; the second carries at least `smallest` (N m)."""
    one = one_interface(ramp, breakaway)
    ((stiffness, torque),) = one.vectors
    parts = (float(np.log(share * breakaway)) for share in (0.1, 0.35))
    return Start(
        tuple((stiffness, torque, stiffness + 3.0, part) for part in parts),
        (*one.lower, stiffness - 7.0, float(np.log(smallest))),
        (*one.upper, stiffness + 10.0, float(np.log(0.6 * breakaway))),
    )


@dataclass(frozen=True)
class BristleFit:
    """A fitted curve.

    Attributes:
        ramp: the fitted ramp.
        used: mask of the fitted bins, shape (n,).
        vector: the parameters, shape (k,).
        interfaces: the one that carries the largest torque first.
        of_stiffness: index of each interface's ln stiffness in the vector.
        bias: of the gyro (rad/s).
        jacobian: of the rates (rad/s), shape (bins used, k).
        errors: of the parameters.
        criterion: Bayesian information criterion; lower is better.
    """

    ramp: Ramp
    used: Flags
    vector: Array
    interfaces: tuple[Interface, ...]
    of_stiffness: tuple[int, ...]
    bias: float
    jacobian: Array
    errors: FitErrors
    criterion: float

    def again(self, ramp: Ramp, breakaway: float, smallest: float) -> Start:
        """Start of a fit of the same curve to another part of the ramp."""
        alone = len(self.interfaces) == 1
        start = (
            one_interface(ramp, breakaway) if alone else two_interfaces(ramp, breakaway, smallest)
        )
        return Start((tuple(self.vector[:-1]),), start.lower, start.upper)

    def change_by_damping(self) -> Array:
        """Change of the rates of the used bins (rad/s) by 1 N m s/rad of damping.

        The damping carries a part of the torque, so that the bristles bend less.
        """
        ramp = self.ramp
        angle = presliding_angle(ramp.torque, self.interfaces)
        carried = np.gradient(angle, ramp.edges)
        return self._change(np.clip(ramp.torque - carried, 0.0, None), self.interfaces)

    def change_by(self, interfaces: Sequence[Interface]) -> Array:
        """Change of the rates of the used bins (rad/s) by other interfaces."""
        return self._change(self.ramp.torque, interfaces)

    def _change(self, torque: Array, interfaces: Sequence[Interface]) -> Array:
        here = presliding_angle(self.ramp.torque, self.interfaces)
        other = presliding_angle(torque, interfaces)
        return np.asarray((np.diff(other - here) / np.diff(self.ramp.edges))[self.used])


def fit_bristles(ramp: Ramp, smallest: float, start: Start) -> BristleFit | None:
    """Fit of the curve to the bins at rest and those from the torque `smallest` (N m) on.

    None where the bins do not determine it: too few or at rest, no convergence, a stiffness or a
    second interface at its bound, dependent parameters.
    """
    from scipy.optimize import least_squares

    used = ramp.used(smallest)
    if int(used[ramp.resting :].sum()) < FEWEST_BINS:
        return None
    scale = float(np.std(ramp.rate))
    if scale == 0.0:  # no motion
        return None
    data = ramp.rate[used] / scale
    bias = float(np.mean(data[: ramp.resting])) if ramp.resting else 0.0
    lower, upper = np.array([*start.lower, -np.inf]), np.array([*start.upper, np.inf])
    bent = _Bent(ramp)
    solutions = [
        least_squares(
            lambda vector: bent.rates(vector)[used] / scale + vector[-1] - data,
            np.clip([*vector, bias], lower + 1e-9, upper - 1e-9),
            jac=lambda vector: bent.derivatives(vector, scale)[used] / scale,
            bounds=(lower, upper),
            x_scale="jac",
            max_nfev=EVALUATIONS,
        )
        for vector in start.vectors
    ]
    best = min(solutions, key=lambda solution: float(solution.cost))
    if best.status == 0 or np.any(np.delete(best.active_mask, 1) != 0):
        return None
    try:
        errors = errors_of(best.jac * scale, best.fun * scale)
    except ValueError:
        return None
    square = max(float(np.mean(best.fun**2)), float(np.finfo(float).tiny))
    criterion = len(data) * float(np.log(square)) + len(best.x) * float(np.log(len(data)))
    unsorted = _interfaces(best.x)
    order = sorted(range(len(unsorted)), key=lambda k: -unsorted[k].torque)
    return BristleFit(
        ramp,
        used,
        best.x,
        tuple(unsorted[k] for k in order),
        tuple(2 * k for k in order),
        float(best.x[-1]) * scale,
        best.jac * scale,
        errors,
        criterion,
    )


def _interfaces(vector: Array) -> tuple[Interface, ...]:
    total = float(np.exp(vector[1]))
    if len(vector) == 3:
        return (Interface(float(np.exp(vector[0])), total),)
    second = float(np.exp(vector[3]))
    return (
        Interface(float(np.exp(vector[0])), total - second),
        Interface(float(np.exp(vector[2])), second),
    )


class _Bent:
    """Rates of a ramp's bins and their derivatives; the angles of the last vector are kept."""

    def __init__(self, ramp: Ramp) -> None:
        self._ramp = ramp
        self._width = np.diff(ramp.edges)
        self._last: tuple[bytes, Array] = (b"", np.empty(0))

    def _angle(self, vector: Array) -> Array:
        """Angle, cached: a search needs it for the rates and then for their derivatives."""
        key = vector.tobytes()
        if self._last[0] != key:
            self._last = key, presliding_angle(self._ramp.torque, _interfaces(vector))
        return self._last[1]

    def rates(self, vector: Array) -> Array:
        """Mean rate of every bin without bias (rad/s), shape (n,)."""
        return np.asarray(np.diff(self._angle(vector)) / self._width)

    def derivatives(self, vector: Array, scale: float) -> Array:
        """Derivatives of the rates by the parameters, shape (n, k)."""
        parts = _interfaces(vector)
        slopes = np.diff(angle_derivatives(self._angle(vector), parts), axis=0)
        slopes /= self._width[:, None]
        columns = [slopes[:, 0] * parts[0].stiffness, slopes[:, 1] * float(np.exp(vector[1]))]
        if len(parts) > 1:  # the torque of the second reduces that of the first
            of_torque = (slopes[:, 3] - slopes[:, 1]) * parts[1].torque
            columns += [slopes[:, 2] * parts[1].stiffness, of_torque]
        return np.stack([*columns, np.full(len(slopes), scale)], axis=1)
