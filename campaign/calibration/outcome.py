"""A whole calibration: check, search, uncertainty, leave-one-out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from campaign.calibration.leave_out import LeftOut, leave_one_out
from campaign.calibration.objective import Evaluation, Simulation
from campaign.calibration.problem import CalibrationProblem
from campaign.calibration.search import Display, Search, Start
from campaign.calibration.uncertainty import Array, Uncertainty, uncertainty
from campaign.experiments.interface import Experiment


@dataclass(frozen=True)
class CalibrationOutcome:
    """What a calibration found.

    Attributes:
        shares: the best point, in shares of the parameters' ranges, shape (n,).
        cost: there, and `cost_before` with the bench as it was.
        fitted, before: what the bench reproduces at both.
        starts: those that came to their end, in order.
        uncertainty: None when the calibration was interrupted.
        left_out: empty when it was not asked for or cannot be had.
        evaluations: of the bench, derivatives included.
        interrupted: whether somebody stopped it; the best point so far is kept.
    """

    problem: CalibrationProblem
    shares: Array
    cost: float
    cost_before: float
    fitted: Evaluation
    before: Evaluation
    starts: tuple[Start, ...]
    uncertainty: Uncertainty | None
    left_out: tuple[LeftOut, ...]
    evaluations: int
    interrupted: bool

    @property
    def values(self) -> tuple[float, ...]:
        """The parameters, SI."""
        return self.problem.space.values(self.shares)


def calibrate(
    problem: CalibrationProblem,
    experiments: Mapping[str, Experiment],
    *,
    workers: int,
    display: Display,
    leave_out: bool = True,
) -> CalibrationOutcome:
    """Fit the problem's parameters. A KeyboardInterrupt ends it with the best point so far.

    Raises UsageError, or ProtocolError, when the tests do not find what the cells are.
    """
    simulation = Simulation(problem, experiments, workers)
    before = simulation.check()
    search = Search(simulation, problem.space, problem.options, display)
    cost_before = search.begin(problem.space.present)
    certainty: Uncertainty | None = None
    left: list[LeftOut] = []
    interrupted = False
    try:
        search.run()
        shares = search.best[1]
        jacobian = search.jacobian(shares, central=True)
        certainty = uncertainty(jacobian, search.residuals(shares), shares, problem.options.loss)
        if leave_out and problem.options.leave_out:
            left = leave_one_out(search, problem.targets, shares)
    except KeyboardInterrupt:
        interrupted = True
    shares = search.best[1]
    return CalibrationOutcome(
        problem=problem,
        shares=shares,
        cost=search.best[0],
        cost_before=cost_before,
        fitted=simulation.evaluate(problem.space.values(shares)),
        before=before,
        starts=tuple(search.starts),
        uncertainty=certainty,
        left_out=tuple(left),
        evaluations=search.evaluations,
        interrupted=interrupted,
    )
