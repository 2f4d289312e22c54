"""Least squares from several starts; Ctrl-C keeps the best point.

    objective = Objective(unknowns, residuals)
    found = search(objective, Settings(starts=8))
    found.values, found.agreeing, found.estimates({"inertia": "kg m^2"})

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
"""Costs of starts that found the same optimum differ by less than this share."""
EXACT = 1e-9
"""Share of the cost at the start below which residuals of no stated deviation count as none."""
MARGIN = 0.05
"""Share of each range, from its ends, in which no random start lies."""


@dataclass(frozen=True)
class Settings:
    """How a search is done.

    Attributes:
        starts: how many fits; the first from where the unknowns start, the others at random. With
            0 nothing is fitted, and the point where the unknowns start is linearised.
        seed: of the random starts.
        loss: how a residual counts.
        tolerance: relative change of cost or shares below which a fit has converged.
        max_evaluations: steps of each fit at most; those for derivatives are not counted.
        stated: whether residuals are in standard deviations that were stated, which are widened
            where the residuals are larger and never narrowed; otherwise their size is all that is
            known of the deviation, and their unit decides nothing.
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
    """Where a search is.

    Attributes:
        phase: what is being done, e.g. `start 2 of 4`.
        evaluations: of the residuals so far, those for differences included.
        cost: of the latest step of this phase.
        best: the lowest cost of this phase and those like it.
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
    """One fit.

    Attributes:
        begin, end: shares of the unknowns' ranges, shape (k,).
        cost: at the end.
        reason: why it ended there.
    """

    begin: Array
    end: Array
    cost: float
    reason: str


@dataclass
class Lowest:
    """The best point seen: its cost, shares (k,) and residuals (n,)."""

    cost: float = np.inf
    shares: Array = field(default_factory=lambda: np.empty(0))
    residuals: Array = field(default_factory=lambda: np.empty(0))

    def see(self, cost: float, shares: Array, residuals: Array) -> None:
        """Keep a point if it is better."""
        if cost < self.cost:
            self.cost, self.shares, self.residuals = cost, shares.copy(), residuals


@dataclass(frozen=True)
class SearchResult:
    """What a search found.

    Attributes:
        unknowns, settings: what was fitted, and how.
        shares: the best point seen, in shares of their ranges, shape (k,).
        cost, residuals: there; residuals of shape (n,).
        cost_before: at the unknowns' start.
        starts: the fits that came to their end, in order.
        jacobian: of the residuals by the shares at the best point, shape (n, k).
        uncertainty: of the shares there; it and `jacobian` are None where it was interrupted.
        interrupted: whether somebody stopped it.
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
        """The best point, SI, by name."""
        names = [unknown.name for unknown in self.unknowns]
        return dict(zip(names, values_at(self.unknowns, self.shares), strict=True))

    @property
    def agreeing(self) -> int:
        """How many starts ended as low as the best one."""
        return agreeing(self.starts, 1.0 if self.settings.stated else EXACT * self.cost_before)

    def estimates(self, units: Mapping[str, str]) -> dict[str, Estimate]:
        """The unknowns with their intervals, by name; `units`: SI units by name."""
        return {
            unknown.name: estimate_of(
                unknown, float(share), self.uncertainty, index, units.get(unknown.name, "")
            )
            for index, (unknown, share) in enumerate(zip(self.unknowns, self.shares, strict=True))
        }


def search(objective: Objective, settings: Settings, display: Display = no_display) -> SearchResult:
    """Fit from every start, then linearise at the best point.

    A KeyboardInterrupt after the first evaluation ends it with the best point so far.
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
    """One fit.

    Args:
        begin: shares, shape (k,).
        lowest: keeps the best point seen, and is told of every step.
        used: which residuals count, shape (n,); all when absent.
    """
    from scipy.optimize import least_squares

    seen = Lowest() if lowest is None else lowest
    rows = slice(None) if used is None else used
    first = np.clip(begin, 0.0, 1.0)
    # One of the tolerances is absolute: residuals in any unit are made of order 1.
    size = 1.0 if settings.stated else float(np.linalg.norm(objective.at(first)[rows])) or 1.0

    def residuals(shares: Array) -> Array:
        found = objective.at(shares)[rows]
        now = cost(settings.loss, found)
        seen.see(now, shares, found)
        display(Progress(phase, objective.evaluations, now, seen.cost))
        return found / size

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
    return Start(begin, solution.x, float(solution.cost) * size**2, reason)


def make_starts(first: Array, count: int, seed: int) -> list[Array]:
    """`first`, then random points in the unit cube that only `seed` decides."""
    random = np.random.Generator(np.random.PCG64(seed))
    others = MARGIN + (1 - 2 * MARGIN) * random.random((count - 1, len(first)))
    return [first, *others]


def agreeing(starts: Sequence[Start], least: float = 1.0) -> int:
    """How many starts ended as low as the best one.

    least: the cost that the difference is held against where the best one is lower: a residual of
        about one standard deviation.
    """
    if not starts:
        return 0
    best = min(start.cost for start in starts)
    return sum(start.cost - best <= AGREE * max(least, best) for start in starts)
