"""A complete calibration: checks, search, uncertainty, leave-one-out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

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
from campaign.protocol.calibration import CalibrationOptions


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
        propagation: None when it was interrupted, or an unknown is not determined.
        was_fitted: false where the bench was taken as it is.
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
    propagation: Propagation | None = None
    was_fitted: bool = True

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
    fit: bool = True,
    propagated: Protocol | None = None,
) -> CalibrationOutcome:
    """Fit the problem's parameters. A KeyboardInterrupt ends it with the best point so far.

    Args:
        fit: else the bench stays as it is, and only what is known of it is worked out.
        propagated: whose tests the uncertainty is carried to; the problem's own ones when None.

    Raises UsageError, or ProtocolError, when the tests do not find what the cells are.
    """
    simulation = Simulation(problem, experiments, workers)
    before = simulation.check()
    objective = Objective(
        problem.space.unknowns,
        simulation.residuals,
        simulation.residuals_of_all,
        step=problem.options.difference_step,
    )
    settings = _settings(problem.options)
    if not fit:
        settings = replace(settings, starts=0)
    found = search(objective, settings, display)
    left: list[LeftOut] = []
    carried: Propagation | None = None
    interrupted = found.interrupted
    try:
        if fit and leave_out and problem.options.leave_out and not interrupted:
            left = leave_one_out(problem, simulation, objective, settings, display, found.shares)
        if found.uncertainty is not None:
            source = propagated or problem.protocol
            tests = tests_of(problem, source.tests) if propagated else problem.tests
            carried = propagate(
                problem,
                tests,
                source.path.name,
                found.shares,
                found.uncertainty,
                experiments,
                cost=found.cost,
                workers=workers,
                display=display,
            )
    except KeyboardInterrupt:
        interrupted = True
    return CalibrationOutcome(
        problem=problem,
        shares=found.shares,
        cost=found.cost,
        cost_before=found.cost_before,
        fitted=simulation.evaluate(problem.space.values(found.shares)),
        before=before,
        starts=found.starts,
        uncertainty=found.uncertainty,
        left_out=tuple(left),
        evaluations=objective.evaluations,
        interrupted=interrupted,
        propagation=carried,
        was_fitted=fit,
    )


def _settings(options: CalibrationOptions) -> Settings:
    return Settings(
        starts=options.starts,
        seed=options.seed,
        loss=options.loss,
        tolerance=options.tolerance,
        max_evaluations=options.max_evaluations,
    )
