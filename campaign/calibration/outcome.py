"""A complete calibration: checks, search, uncertainty, leave-one-out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from campaign.arrays import Array
from campaign.calibration.leave_out import LeftOut, leave_one_out
from campaign.calibration.objective import Evaluation, Simulation
from campaign.calibration.problem import CalibrationProblem
from campaign.calibration.propagation import Propagation, propagate, tests_of
from campaign.estimation.linear_uncertainty import Uncertainty
from campaign.estimation.multi_start import Display, Settings, Start, search
from campaign.estimation.objective import Objective
from campaign.experiments.interface import Experiment
from campaign.protocol import Protocol


@dataclass(frozen=True)
class CalibrationOutcome:
    """Result of a calibration.

    Attributes:
        shares: best point, in shares of the parameters' ranges, shape (n,).
        cost, cost_before: at the best point, and with the original bench.
        fitted, before: values that the bench reproduces at both.
        starts: completed starts, in order.
        uncertainty: None when the calibration was interrupted.
        left_out: empty if not requested or not possible.
        propagation: None when it was interrupted, or an unknown is not determined.
        was_fitted: false if the bench was used unchanged.
        evaluations: of the bench, derivatives included.
        interrupted: whether the user stopped it; the best point so far is kept.
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
    propagation: Propagation | None = None
    was_fitted: bool = True

    @property
    def values(self) -> tuple[float, ...]:
        """Fitted parameters, SI."""
        return self.problem.space.values(self.shares)


def calibrate(
    problem: CalibrationProblem,
    experiments: Mapping[str, Experiment],
    *,
    workers: int,
    display: Display,
    leave_out: bool = True,
    fit: bool = True,
    propagated: Protocol | None = None,
) -> CalibrationOutcome:
    """Fit the problem's parameters. A KeyboardInterrupt ends it with the best point so far.

    Args:
        fit: false: keep the bench and only estimate its uncertainty.
        propagated: protocol with the tests for the propagation; None: the problem's own tests.

    Raises UsageError, or ProtocolError, if the tests do not reproduce the cells.
    """
    options = problem.options
    simulation = Simulation(problem, experiments, workers)
    before = simulation.check()
    objective = Objective(
        problem.space.unknowns,
        simulation.residuals,
        simulation.residuals_of_all,
        step=options.difference_step,
    )
    settings = Settings(
        starts=options.starts if fit else 0,
        seed=options.seed,
        loss=options.loss,
        tolerance=options.tolerance,
        max_evaluations=options.max_evaluations,
    )
    optimum = search(objective, settings, display)
    left: list[LeftOut] = []
    propagation: Propagation | None = None
    interrupted = optimum.interrupted
    try:
        if fit and leave_out and options.leave_out and not interrupted:
            left = leave_one_out(problem, simulation, objective, settings, display, optimum.shares)
        if optimum.uncertainty is not None:
            source = propagated or problem.protocol
            tests = tests_of(problem, source.tests) if propagated else problem.tests
            propagation = propagate(
                problem,
                tests,
                source.path.name,
                optimum.shares,
                optimum.uncertainty,
                experiments,
                cost=optimum.cost,
                workers=workers,
                display=display,
            )
    except KeyboardInterrupt:
        interrupted = True
    return CalibrationOutcome(
        problem=problem,
        shares=optimum.shares,
        cost=optimum.cost,
        cost_before=optimum.cost_before,
        fitted=simulation.evaluate(problem.space.values(optimum.shares)),
        before=before,
        starts=optimum.starts,
        uncertainty=optimum.uncertainty,
        left_out=tuple(left),
        evaluations=objective.evaluations,
        interrupted=interrupted,
        propagation=propagation,
        was_fitted=fit,
    )
