"""Uncertainty of reproduced numbers that results from the calibration.

The covariance of the unknowns is carried to each published cell by simulation: the bench is moved
by one standard deviation both ways along each principal axis of the covariance, and everything is
analysed anew. Half the difference is one of k independent parts of the cell's uncertainty. So a
ratio, a growth or a threshold needs no derivative by hand, and correlations need no bookkeeping.

Steps of one sigma bridge what a sampled loop rounds, and see as much of a curve as matters. On
another bench the noise of a simulation falls differently: that is in the halves, too, and makes the
part of a number that hardly depends on the unknowns somewhat too large.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.arrays import Array
from campaign.calibration.objective import Simulation
from campaign.calibration.problem import CalibrationProblem
from campaign.calibration.targets import DEFAULT_WEIGHT, make_target
from campaign.estimation.linear_uncertainty import Uncertainty
from campaign.estimation.multi_start import Display, Progress
from campaign.experiments.interface import Experiment
from campaign.protocol.schema import Test
from campaign.published.values import NO_SIZE

NEGLIGIBLE = 1e-12
"""Variance along a principal axis, as a share of the largest, below which nothing is moved."""


@dataclass(frozen=True)
class Propagation:
    """Uncertainty of reproduced numbers by the calibration alone.

    Attributes:
        protocol: file name of the protocol whose tests were simulated.
        freedom: degrees of freedom of the standard uncertainties.
        uncertainty: cell path to standard uncertainty (1 sigma), in the printed unit.
        lost: cells that the bench reproduces, but not any more somewhere within one sigma.
    """

    protocol: str
    freedom: int
    uncertainty: Mapping[str, float]
    lost: tuple[str, ...]


def principal_steps(covariance: Array) -> Array:
    """Steps of one standard deviation along the principal axes, in rows: shape (m, k), m <= k.

    Their outer products add up to `covariance`, shape (k, k).
    """
    variance, axes = np.linalg.eigh(covariance)
    kept = variance > NEGLIGIBLE * variance.max(initial=0.0)
    return np.asarray((np.sqrt(variance[kept]) * axes[:, kept]).T)


def tests_of(problem: CalibrationProblem, tests: Iterable[Test]) -> tuple[Test, ...]:
    """Those of another protocol that stand for published tables on the bench that was fitted."""
    bench = problem.calibration.bench.tree
    return tuple(test for test in tests if test.entry.reproduces and test.bench == bench)


def propagate(
    problem: CalibrationProblem,
    tests: Sequence[Test],
    protocol: str,
    shares: Array,
    certainty: Uncertainty,
    experiments: Mapping[str, Experiment],
    *,
    cost: float,
    workers: int,
    display: Display,
) -> Propagation | None:
    """The uncertainty of each cell that `tests` find; None where an unknown is not determined.

    Of several tests that find a cell the first counts, as on a scoreboard.

    Args:
        shares: the optimum, in shares of the ranges, shape (k,).
        certainty, cost: there.
    """
    covariance = certainty.covariance
    if covariance is None:
        return None
    steps = principal_steps(covariance)
    points = [shares, *(shares + sign * step for step in steps for sign in (1.0, -1.0))]
    uncertainty: dict[str, float] = {}
    lost: dict[str, None] = {}
    done = 0
    for test in tests:
        simulation = Simulation(_of(problem, test), experiments, workers)
        found = []
        for point in points:
            display(Progress(f"propagation: {test.entry.name}", done, cost, cost))
            found.append(simulation.evaluate(problem.space.values(point)).found)
            done += 1
        here, moved = found[0], found[1:]
        for path in here.keys() - uncertainty.keys():
            values = np.array([each.get(path, np.nan) for each in moved])
            if np.all(np.isfinite(values)):
                halves = 0.5 * (values[::2] - values[1::2])
                uncertainty[path] = float(np.linalg.norm(halves))
            else:
                lost[path] = None
    gone = tuple(sorted(lost.keys() - uncertainty.keys()))
    return Propagation(protocol, certainty.freedom, dict(sorted(uncertainty.items())), gone)


def _of(problem: CalibrationProblem, test: Test) -> CalibrationProblem:
    """The same unknowns, with one test and every number of the tables that it stands for."""
    cells = (
        cell
        for name, table in problem.published.items()
        if name in test.entry.reproduces
        for cell in table.cells
        if cell.relation not in NO_SIZE
    )
    unit = (make_target(c, DEFAULT_WEIGHT if c.value else f"1 {c.unit}".strip()) for c in cells)
    return replace(problem, tests=(test,), targets=tuple(unit))
