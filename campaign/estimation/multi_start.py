"""Least squares from several starts; Ctrl-C keeps the best point.

    objective = Objective(unknowns, residuals)
    result = search(objective, Settings(starts=8))
    result.values, result.agreeing, result.estimates({"inertia": "kg m^2"})

Each fit is `scipy.optimize.least_squares`: trust region reflective, between bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from campaign.arrays import Array, Flags
from campaign.estimate import Estimate
from campaign.estimation.linear_uncertainty import Uncertainty, estimate_of, uncertainty
from campaign.estimation.losses import Loss, cost
from campaign.estimation.objective import Objective
from campaign.estimation.unknowns import Unknown, values_at

AGREE = 0.01
"""Largest relative difference in cost of starts that end at the same optimum."""
EXACT = 1e-9
"""Share of the start cost below which residuals without a stated deviation count as zero."""
MARGIN = 0.05
"""Share of each range at both ends without random starts."""


@dataclass(frozen=True)
class Settings:
    """Settings of a search.

    Attributes:
        starts: number of fits; the first from the start of the unknowns, the others at random. With
            0 there is no fit, and the start of the unknowns is linearized.
        seed: of the random starts.
        loss: loss function of a residual.
        tolerance: relative change of cost or shares below which a fit has converged.
        max_evaluations: most evaluations of each fit, without those for derivatives.
        stated: whether residuals are in stated standard deviations, which are increased where the
            residuals are larger and never reduced; otherwise the residuals alone determine the
            deviation, and their unit is arbitrary.
    """

    starts: int = 4
    seed: int = 1
    loss: Loss = "linear"
    tolerance: float = 1e-4
    max_evaluations: int = 60
    stated: bool = True

    def __post_init__(self) -> None:
        if not self.stated and self.loss != "linear":
            raise ValueError(f"{self.loss} needs residuals in standard deviations that were stated")


@dataclass(frozen=True)
class Progress:
    """Progress of a search.

    Attributes:
        phase: current phase, such as `start 2 of 4`.
        evaluations: of the residuals so far, including those for differences.
        cost: of the latest step of this phase.
        best: lowest cost so far.
    """

    phase: str
    evaluations: int
    cost: float
    best: float


Display = Callable[[Progress], None]


def no_display(progress: Progress) -> None:
    """Show nothing."""


@dataclass(frozen=True)
class Start:
    """Fit from one start.

    Attributes:
        end: shares of the unknowns' ranges, shape (k,).
        cost: at the end.
        reason: why it ended.
    """

    end: Array
    cost: float
    reason: str


@dataclass
class Lowest:
    """Best point so far: its cost, shares (k,) and residuals (n,)."""

    cost: float = np.inf
    shares: Array = field(default_factory=lambda: np.empty(0))
    residuals: Array = field(default_factory=lambda: np.empty(0))

    def see(self, cost: float, shares: Array, residuals: Array) -> None:
        """Keep a point if it is better."""
        if cost < self.cost:
            self.cost, self.shares, self.residuals = cost, shares.copy(), residuals


@dataclass(frozen=True)
class SearchResult:
    """Result of a search.

    Attributes:
        unknowns, settings: inputs of the search.
        shares: best point, in shares of the unknowns' ranges, shape (k,).
        cost, residuals: at the best point; residuals of shape (n,).
        cost_before: at the unknowns' start.
        starts: the completed fits, in order.
        jacobian: of the residuals by the shares at the best point, shape (n, k).
        uncertainty: of these shares; it and `jacobian` are None after an interrupt.
        interrupted: whether the user stopped the search.
    """

    unknowns: tuple[Unknown, ...]
    settings: Settings
    shares: Array
    cost: float
    residuals: Array
    cost_before: float
    starts: tuple[Start, ...]
    jacobian: Array | None
    uncertainty: Uncertainty | None
    interrupted: bool

    @property
    def values(self) -> dict[str, float]:
        """Best point, SI, by name."""
        names = [unknown.name for unknown in self.unknowns]
        return dict(zip(names, values_at(self.unknowns, self.shares), strict=True))

    @property
    def agreeing(self) -> int:
        """Number of starts that ended as low as the best one."""
        return agreeing(self.starts, 1.0 if self.settings.stated else EXACT * self.cost_before)

    def estimates(self, units: Mapping[str, str]) -> dict[str, Estimate]:
        """Estimates of the unknowns, by name; `units`: SI units by name."""
        return {
            unknown.name: estimate_of(
                unknown, float(share), self.uncertainty, index, units.get(unknown.name, "")
            )
            for index, (unknown, share) in enumerate(zip(self.unknowns, self.shares, strict=True))
        }


def search(objective: Objective, settings: Settings, display: Display = no_display) -> SearchResult:
    """Fit from every start, then linearize at the best point.

    A KeyboardInterrupt after the first evaluation ends the search with the best point so far.
    """
    begin = objective.start
    residuals = objective.at(begin)
    cost_before = cost(settings.loss, residuals)
    lowest = Lowest(cost_before, begin, residuals)
    starts: list[Start] = []
    jacobian: Array | None = None
    certainty: Uncertainty | None = None
    interrupted = False
    try:
        begins = make_starts(begin, settings.starts, settings.seed) if settings.starts else []
        for number, each in enumerate(begins, 1):
            phase = f"start {number} of {len(begins)}"
            starts.append(fit_from(objective, each, settings, phase, display, lowest))
        jacobian = objective.jacobian(lowest.shares, central=True)
        certainty = uncertainty(
            jacobian, lowest.residuals, lowest.shares, settings.loss, stated=settings.stated
        )
    except KeyboardInterrupt:
        interrupted = True
    return SearchResult(
        unknowns=objective.unknowns,
        settings=settings,
        shares=lowest.shares,
        cost=lowest.cost,
        residuals=lowest.residuals,
        cost_before=cost_before,
        starts=tuple(starts),
        jacobian=jacobian,
        uncertainty=certainty,
        interrupted=interrupted,
    )


def fit_from(
    objective: Objective,
    begin: Array,
    settings: Settings,
    phase: str = "",
    display: Display = no_display,
    lowest: Lowest | None = None,
    used: Flags | None = None,
) -> Start:
    """Fit from one start.

    Args:
        begin: shares, shape (k,).
        lowest: best point, updated at every step.
        used: mask of the residuals that count, shape (n,); default: all.
    """
    from scipy.optimize import least_squares

    seen = Lowest() if lowest is None else lowest
    rows = slice(None) if used is None else used
    first = np.clip(begin, 0.0, 1.0)
    # One tolerance is absolute: residuals of arbitrary unit are scaled to order 1.
    size = 1.0 if settings.stated else float(np.linalg.norm(objective.at(first)[rows])) or 1.0

    def residuals(shares: Array) -> Array:
        errors = objective.at(shares)[rows]
        now = cost(settings.loss, errors)
        seen.see(now, shares, errors)
        display(Progress(phase, objective.evaluations, now, seen.cost))
        return errors / size

    solution = least_squares(
        residuals,
        first,
        jac=lambda shares: objective.jacobian(shares, central=False)[rows] / size,
        bounds=(0.0, 1.0),
        method="trf",
        loss=settings.loss,
        max_nfev=settings.max_evaluations,
        ftol=settings.tolerance,
        xtol=settings.tolerance,
        gtol=1e-10,
    )
    reason = "converged" if solution.status > 0 else "stopped after max_evaluations"
    return Start(solution.x, float(solution.cost) * size**2, reason)


def make_starts(first: Array, count: int, seed: int) -> list[Array]:
    """`first`, then random points in the unit cube, determined by `seed`."""
    random = np.random.Generator(np.random.PCG64(seed))
    others = MARGIN + (1 - 2 * MARGIN) * random.random((count - 1, len(first)))
    return [first, *others]


def agreeing(starts: Sequence[Start], least: float = 1.0) -> int:
    """Number of starts that ended as low as the best one.

    least: reference of the difference where the best cost is lower: by default the cost of a
        residual of about one standard deviation.
    """
    if not starts:
        return 0
    best = min(start.cost for start in starts)
    return sum(start.cost - best <= AGREE * max(least, best) for start in starts)
