"""Uncertainty of reproduced numbers that results from the calibration.

Simulation propagates the covariance of the unknowns to each published cell. The bench moves by one
standard deviation in both directions along each principal axis of the covariance. Half the
difference of the two analyses is one of k independent parts of the cell's uncertainty. This needs
no derivatives, e.g. of ratios or thresholds, and includes correlations.

Steps of one sigma are larger than the rounding of a sampled loop and include the relevant
nonlinearity. Simulation noise differs between the moved benches and adds to the halves. It makes
the uncertainty of a number that hardly depends on the unknowns somewhat too large.
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
"""Least variance along a principal axis for a step, relative to the largest."""


@dataclass(frozen=True)
class Propagation:
    """Uncertainty of reproduced numbers by the calibration alone.

    Attributes:
        protocol: file name of the protocol whose tests were simulated.
        freedom: degrees of freedom of the standard uncertainties.
        uncertainty: cell path to standard uncertainty (1 sigma), in the printed unit.
        lost: cells that the bench reproduces, but not at all steps of one sigma.
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
    """Tests of another protocol that reproduce published tables on the fitted bench."""
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
    """Uncertainty of each cell that `tests` reproduce; None if an unknown is not determined.

    If several tests reproduce a cell, the first counts, as on a scoreboard.

    Args:
        shares: optimum, in shares of the ranges, shape (k,).
        certainty, cost: at the optimum.
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
        reproduced = []
        for point in points:
            display(Progress(f"propagation: {test.entry.name}", done, cost, cost))
            reproduced.append(simulation.evaluate(problem.space.values(point)).found)
            done += 1
        central, moved = reproduced[0], reproduced[1:]
        for path in central.keys() - uncertainty.keys():
            values = np.array([each.get(path, np.nan) for each in moved])
            if np.all(np.isfinite(values)):
                halves = 0.5 * (values[::2] - values[1::2])
                uncertainty[path] = float(np.linalg.norm(halves))
            else:
                lost[path] = None
    gone = tuple(sorted(lost.keys() - uncertainty.keys()))
    return Propagation(protocol, certainty.freedom, dict(sorted(uncertainty.items())), gone)


def _of(problem: CalibrationProblem, test: Test) -> CalibrationProblem:
    """Problem with the same unknowns, one test, and all numbers of its tables as targets."""
    cells = (
        cell
        for name, table in problem.published.items()
        if name in test.entry.reproduces
        for cell in table.cells
        if cell.relation not in NO_SIZE
    )
    unit = (make_target(c, DEFAULT_WEIGHT if c.value else f"1 {c.unit}".strip()) for c in cells)
    return replace(problem, tests=(test,), targets=tuple(unit))
