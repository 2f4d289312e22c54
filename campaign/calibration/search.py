"""Least squares from several starts, each kept; Ctrl-C keeps the best point seen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from campaign.calibration.loss import cost
from campaign.calibration.objective import Simulation
from campaign.calibration.space import Space
from campaign.protocol.calibration import CalibrationOptions

Array = NDArray[np.float64]
AGREE = 0.01
"""Costs of starts that found the same optimum differ by less, or by less than this share."""
MARGIN = 0.05
"""Share of each range, from its ends, in which no random start lies."""


@dataclass(frozen=True)
class Progress:
    """Where a calibration is.

    Attributes:
        phase: what is being done, e.g. `start 2 of 4`.
        evaluations: of the bench so far, derivatives included.
        cost: of the latest step of this phase.
        best: the lowest cost of this phase and those like it.
    """

    phase: str
    evaluations: int
    cost: float
    best: float


Display = Callable[[Progress], None]


@dataclass(frozen=True)
class Start:
    """One fit.

    Attributes:
        begin, end: shares of the parameters' ranges, shape (n,).
        cost: at the end.
        reason: why it ended there.
    """

    begin: Array
    end: Array
    cost: float
    reason: str


@dataclass
class Search:
    """The state of a calibration while it runs: what was evaluated, and the best of it."""

    simulation: Simulation
    space: Space
    options: CalibrationOptions
    display: Display
    evaluations: int = 0
    best: tuple[float, Array] = (np.inf, np.empty(0))
    starts: list[Start] = field(default_factory=list)
    _latest: tuple[bytes, Array] = (b"", np.empty(0))

    def begin(self, present: Array) -> float:
        """Cost of the bench as it is, so that there is a best point from the beginning."""
        self.best = (cost(self.options.loss, self.residuals(present)), present)
        return self.best[0]

    def run(self) -> None:
        """Fit from every start. On KeyboardInterrupt, `best` and `starts` hold what there is."""
        begins = make_starts(self.space.present, self.options.starts, self.options.seed)
        for number, begin in enumerate(begins, 1):
            phase = f"start {number} of {len(begins)}"
            end, final, reason = self.fit(begin, phase, self.options.max_evaluations)
            self.starts.append(Start(begin, end, final, reason))

    def fit(
        self, begin: Array, phase: str, most: int, mask: Array | None = None
    ) -> tuple[Array, float, str]:
        """End, cost and reason of one fit; `mask` (bool, of the cells) leaves some out."""
        from scipy.optimize import least_squares

        whole = mask is None
        lowest = np.inf

        def fun(shares: Array) -> Array:
            nonlocal lowest
            residuals = self.residuals(shares)
            used = residuals if mask is None else residuals[mask]
            now = cost(self.options.loss, used)
            lowest = min(lowest, now)
            if whole and now < self.best[0]:
                self.best = (now, shares.copy())
            best = self.best[0] if whole else lowest
            self.display(Progress(phase, self.evaluations, now, best))
            return used

        def jac(shares: Array) -> Array:
            jacobian = self.jacobian(shares, central=False)
            return jacobian if mask is None else jacobian[mask]

        tolerance = self.options.tolerance
        solution = least_squares(
            fun,
            np.clip(begin, 0.0, 1.0),
            jac=jac,
            bounds=(0.0, 1.0),
            method="trf",
            loss=self.options.loss,
            max_nfev=most,
            ftol=tolerance,
            xtol=tolerance,
            gtol=1e-10,
        )
        return solution.x, float(solution.cost), _REASONS.get(solution.status, solution.message)

    def residuals(self, shares: Array) -> Array:
        """Residuals of all cells, shape (cells,); those of the latest point are remembered."""
        key = shares.tobytes()
        if key != self._latest[0]:
            self._latest = (key, self.simulation.residuals(self.space.values(shares)))
            self.evaluations += 1
        return self._latest[1]

    def jacobian(self, shares: Array, *, central: bool) -> Array:
        """Derivatives of all residuals by the shares, shape (cells, parameters).

        Differences stay within the bounds; the step is wide enough to bridge the steps that a
        sampled and quantised loop makes.
        """
        step, n = self.options.difference_step, len(shares)
        here = self.residuals(shares)
        above, below = np.minimum(shares + step, 1.0), np.maximum(shares - step, 0.0)
        if not central:  # to the side with more room
            up = shares + step <= 1.0
            above, below = np.where(up, above, shares), np.where(up, shares, below)
        points: list[Array] = []
        for i in range(n):
            for end in (above[i], below[i]):
                point = shares.copy()
                point[i] = end
                points.append(point)
        moved = [k for k, point in enumerate(points) if not np.array_equal(point, shares)]
        results = dict.fromkeys(range(len(points)), here)
        values = [self.space.values(points[k]) for k in moved]
        results |= zip(moved, self.simulation.residuals_of_all(values), strict=True)
        self.evaluations += len(moved)
        differences = [results[2 * i] - results[2 * i + 1] for i in range(n)]
        return np.asarray(np.stack(differences, axis=1) / (above - below))


def make_starts(present: Array, count: int, seed: int) -> list[Array]:
    """`present`, then random points in the unit cube that only `seed` decides."""
    random = np.random.Generator(np.random.PCG64(seed))
    others = MARGIN + (1 - 2 * MARGIN) * random.random((count - 1, len(present)))
    return [present, *others]


def agreeing(starts: Sequence[Start]) -> int:
    """How many starts ended as low as the best one."""
    if not starts:
        return 0
    best = min(start.cost for start in starts)
    return sum(start.cost - best <= AGREE * max(1.0, best) for start in starts)


_REASONS = {
    0: "stopped after max_evaluations",
    1: "converged",
    2: "converged",
    3: "converged",
    4: "converged",
}
