"""Fit of a simulated model to several recordings at once, with intervals.

The caller provides the simulation: a friction model along measured motions, or a whole bench. The
search from several starts and the rule for bounds are those of calibrations (`multi_start`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array, Flags
from campaign.axis_kind import axis_unit
from campaign.estimate import Estimate, Origin
from campaign.estimation.gate import USELESS
from campaign.estimation.intervals import LEVEL
from campaign.estimation.inverse.regression import Piece, Regression, fitted
from campaign.estimation.least_squares import covariance
from campaign.estimation.multi_start import (
    Display,
    SearchResult,
    Settings,
    fit_from,
    no_display,
    search,
)
from campaign.estimation.objective import Objective, Values
from campaign.estimation.unknowns import Unknown, values_at
from campaign.reason import Cause

Residuals = Callable[[Values], Sequence[Array]]
METHOD = "least squares through the simulation; deviation with autocorrelation (Newey and West)"
NULL = 1e-6
"""Share of the largest singular value below which a direction is not determined."""
WENT_TO_BOUND = Cause("at bound", "it went to its {side} bound")
NOT_IN_MOTION = Cause("not in the motion", "the motion does not determine it")
LEFT_OPEN = Cause("left open by the motion", "the motion leaves it open")
LEFT_WIDE = Cause(
    "left wide by the motion",
    "the motion leaves it anywhere from {low:.2g} to {high:.2g}{in_unit}",
)


@dataclass(frozen=True)
class ModelFit:
    """A fitted model.

    Attributes:
        found: result of the search.
        estimates: of the unknowns, by name; their origin states a bound or "not determined".
        values: SI, in the order of the unknowns.
        residuals: of each recording, shape (n,).
        regression: of the residuals on the shares of the free unknowns; None without a free one.
        free: mask of the free unknowns.
    """

    found: SearchResult
    estimates: dict[str, Estimate]
    values: Values
    residuals: tuple[Array, ...]
    regression: Regression | None
    free: Flags

    @property
    def correlation(self) -> dict[tuple[str, str], float]:
        """Correlations of pairs of free unknowns, by their names."""
        if self.regression is None:
            return {}
        free = np.flatnonzero(self.free)
        names = [self.found.unknowns[i].name for i in free]
        matrix = self.regression.correlation
        return {
            (names[i], names[j]): float(matrix[i, j]) for i in range(len(names)) for j in range(i)
        }


def fit_model(
    unknowns: Sequence[Unknown],
    units: dict[str, str],
    residuals: Residuals,
    *,
    starts: int = 3,
    display: Display = no_display,
) -> ModelFit:
    """Fit from several starts, with the uncertainty of each unknown.

    Args:
        units: SI units by name.
        residuals: of each recording, shape (n,), evenly spaced and in one unit, for values (SI) in
            the order of the unknowns.

    Raises KeyboardInterrupt when interrupted: an incomplete fit is not used.
    """
    objective = _objective(unknowns, residuals)
    settings = Settings(starts=starts, stated=False, tolerance=1e-6)
    best = search(objective, settings, display)
    if best.interrupted or best.jacobian is None or best.uncertainty is None:
        raise KeyboardInterrupt
    values = tuple(values_at(unknowns, best.shares))
    left = tuple(residuals(values))
    at_bound = np.array([bool(side) for side in best.uncertainty.bound])
    free = ~at_bound & (np.linalg.norm(best.jacobian, axis=0) > 0.0)
    regression = _regression(best.jacobian[:, free], left) if free.any() else None
    open_ones = np.zeros(len(free), dtype=bool)
    if free.any():
        open_ones[free] = covariance(best.jacobian[:, free], NULL, NULL)[1]
    estimates = {
        unknown.name: _estimate(
            unknown, units.get(unknown.name, ""), i, best, regression, free, bool(open_ones[i])
        )
        for i, unknown in enumerate(unknowns)
    }
    return ModelFit(best, estimates, values, left, regression, free)


def moved_with(fit: ModelFit, name: str, shift: float) -> dict[str, float]:
    """Shifts of the other free unknowns (SI) for a shift of one unknown by `shift` (SI).

    Linearized at the optimum; empty where that unknown is not free.
    """
    unknowns, jacobian = fit.found.unknowns, fit.found.jacobian
    index = [unknown.name for unknown in unknowns].index(name)
    if jacobian is None or not fit.free[index]:
        return {}
    slopes = np.array([u.slope(float(s)) for u, s in zip(unknowns, fit.found.shares, strict=True)])
    others = [i for i in np.flatnonzero(fit.free) if i != index]
    change = jacobian[:, index] * shift / slopes[index]
    shares = -np.linalg.lstsq(jacobian[:, others], change, rcond=None)[0]
    moved = shares * slopes[others]
    return {unknowns[i].name: float(each) for i, each in zip(others, moved, strict=True)}


def refitted(
    unknowns: Sequence[Unknown], residuals: Residuals, begin: Array, used: Flags | None = None
) -> Values:
    """Values (SI) of a new fit to other or `used` residuals, from the shares `begin`."""
    settings = Settings(starts=1, stated=False, tolerance=1e-6)
    end = fit_from(_objective(unknowns, residuals), begin, settings, used=used)
    return values_at(unknowns, end.end)


def held_out(
    unknowns: Sequence[Unknown],
    residuals: Residuals,
    begin: Array,
    left_out: Sequence[Flags],
) -> tuple[Array, ...]:
    """Residuals of the rows that a new fit, from the shares `begin`, does not use.

    left_out: mask of these rows for each recording, shape (n,).
    """
    errors = residuals(refitted(unknowns, residuals, begin, ~np.concatenate(left_out)))
    return tuple(own[mask] for own, mask in zip(errors, left_out, strict=True))


def _objective(unknowns: Sequence[Unknown], residuals: Residuals) -> Objective:
    def whole(values: Values) -> Array:
        return np.concatenate(residuals(values))

    return Objective(tuple(unknowns), whole, step=1e-3)


def _regression(jacobian: Array, left: tuple[Array, ...]) -> Regression:
    cuts = np.cumsum([len(each) for each in left])[:-1]
    pieces = [
        Piece(-own, rest, np.arange(len(rest), dtype=float))
        for own, rest in zip(np.split(jacobian, cuts), left, strict=True)
    ]
    return fitted(pieces, np.asarray(np.linalg.pinv(-jacobian)), -jacobian, np.concatenate(left))


def _estimate(
    unknown: Unknown,
    unit: str,
    index: int,
    found: SearchResult,
    regression: Regression | None,
    free: Flags,
    left_open: bool,
) -> Estimate:
    name, share = unknown.name, float(found.shares[index])
    value = unknown.value(share)
    if not free[index] or regression is None:
        side = "" if found.uncertainty is None else found.uncertainty.bound[index]
        reason = WENT_TO_BOUND(side=side) if side else NOT_IN_MOTION()
        origin = Origin.AT_BOUND if side else Origin.NOT_DETERMINED
        return Estimate.without_interval(name, value, unit, reason, method=METHOD, origin=origin)
    place = int(np.count_nonzero(free[:index]))
    half = regression.quantile * float(regression.robust[place])
    reason = LEFT_OPEN()
    low, high = value, value
    if not left_open and half < 1.0:
        low, high = sorted((unknown.value(share - half), unknown.value(share + half)))
        reason = LEFT_WIDE(low=low, high=high, in_unit=f" {axis_unit(unit)}".rstrip())
    if not low < high or high - low > 2.0 * USELESS * abs(value):
        return Estimate.without_interval(
            name, value, unit, reason, method=METHOD, origin=Origin.NOT_DETERMINED
        )
    error = unknown.slope(share) * float(regression.robust[place])
    return Estimate(
        name, value, unit, low, high, LEVEL, METHOD,
        standard_error=error, freedom=max(regression.freedom, 1.0),
    )  # fmt: skip
