"""A costly residual function over the unit cube, with derivatives and a counter.

The caller provides it, e.g. as a simulation of trials that is compared with measured data.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from campaign.arrays import Array
from campaign.estimation.unknowns import Unknown, shares_of, values_at

Values = tuple[float, ...]


@dataclass
class Objective:
    """Residuals and their derivatives at points of the unit cube, shape (k,).

    Attributes:
        unknowns: their bounds span the cube.
        residuals: function of SI values in the order of the unknowns, shape (n,); finite everywhere
            between the bounds, in standard deviations for a loss other than `linear`.
        residuals_of_all: the same for several sets of values, where that is faster than one by one.
        derivatives: of the residuals by the values (SI), shape (n, k); None: by differences.
        step: of these differences, as a share of each range; larger than the steps that sampling
            and quantization cause in the residuals.
        evaluations: of the residuals so far, including those for differences.
    """

    unknowns: tuple[Unknown, ...]
    residuals: Callable[[Values], Array]
    residuals_of_all: Callable[[Sequence[Values]], Sequence[Array]] | None = None
    derivatives: Callable[[Values], Array] | None = None
    step: float = 0.005
    evaluations: int = field(default=0, init=False)
    _latest: tuple[bytes, Array] = field(default=(b"", np.empty(0)), init=False, repr=False)

    @property
    def start(self) -> Array:
        """Start of the first fit."""
        return shares_of(self.unknowns, [unknown.start for unknown in self.unknowns])

    def at(self, shares: Array) -> Array:
        """Residuals, shape (n,); those of the latest point are cached."""
        key = shares.tobytes()
        if key != self._latest[0]:
            self._latest = (key, self.residuals(values_at(self.unknowns, shares)))
            self.evaluations += 1
        return self._latest[1]

    def jacobian(self, shares: Array, *, central: bool) -> Array:
        """Derivatives of the residuals by the shares, shape (n, k).

        Differences stay within the bounds: central, or one-sided, upward if possible.
        """
        if self.derivatives is not None:
            slopes = [u.slope(float(s)) for u, s in zip(self.unknowns, shares, strict=True)]
            return np.asarray(self.derivatives(values_at(self.unknowns, shares)) * slopes)
        here, k = self.at(shares), len(shares)
        above, below = np.minimum(shares + self.step, 1.0), np.maximum(shares - self.step, 0.0)
        if not central:
            up = shares + self.step <= 1.0
            above, below = np.where(up, above, shares), np.where(up, shares, below)
        points: list[Array] = []
        for i in range(k):
            for end in (above[i], below[i]):
                point = shares.copy()
                point[i] = end
                points.append(point)
        moved = [j for j, point in enumerate(points) if not np.array_equal(point, shares)]
        results = dict.fromkeys(range(len(points)), here)
        results |= zip(moved, self._at_all([points[j] for j in moved]), strict=True)
        differences = [results[2 * i] - results[2 * i + 1] for i in range(k)]
        return np.asarray(np.stack(differences, axis=1) / (above - below))

    def _at_all(self, points: Sequence[Array]) -> Sequence[Array]:
        sets = [values_at(self.unknowns, point) for point in points]
        if self.residuals_of_all is not None:
            results = self.residuals_of_all(sets)
        else:
            results = [self.residuals(values) for values in sets]
        self.evaluations += len(sets)
        return results
