"""How often the interval that a calibration leaves of a reproduced number holds the truth.

Run with `python -m benchmarks.verdict_coverage [--draws 20] [--deviate 1]`. A true bench is drawn
from the covariance of `platform`; what it finds is printed with the thesis' digits, each number off
by the deviation that the calibration states of it (`--deviate 0`: rounded only). The bench is
fitted anew to that table, by Gauss-Newton steps with the Jacobian of `platform`, and the intervals
of its shipped calibration, scaled to the table's own scatter, are held against what the true bench
finds: of cells that were fitted, and of Table 5.13, to whose raised preload nothing was fitted.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binomtest

from benchmarks.document import table
from campaign.calibration.objective import Simulation
from campaign.calibration.problem import CalibrationProblem, make_problem
from campaign.calibration.propagation import principal_steps
from campaign.calibration.targets import Target, residuals
from campaign.estimation.linear_uncertainty import uncertainty
from campaign.estimation.objective import Objective
from campaign.experiments import experiments
from campaign.protocol import load_protocol
from campaign.protocol.schema import Test
from campaign.published.calibration_covariance import FOLDER, calibration_part
from campaign.published.values import published_values
from campaign.resources import protocols_folder

Array = NDArray[np.float64]
STEPS = 4
"""Gauss-Newton steps of a fit, which begins at the bench as it is."""
PREDICTED = "preload-frequency"
TABLE = "5.13"
"""The test and the table that nothing is fitted to."""


def problem_and_prediction() -> tuple[CalibrationProblem, Test]:
    """The calibration of `platform`, and the test that it is to predict."""
    folder = protocols_folder()
    calibration, preload = (
        load_protocol(folder / name, experiments(), shipped=folder)
        for name in ("calibrate-platform.toml", "preload.toml")
    )
    (test,) = (test for test in preload.tests if test.entry.name == PREDICTED)
    return make_problem(calibration, published_values()), test


def printed(target: Target, value: float, deviation: float) -> Target:
    """The target with `value` in its cell, off by so many sigma, with its printed digits."""
    off = value * np.exp(target.sigma * deviation)
    if not target.relative:
        off = value + target.sigma * deviation
    decimals = 12 if target.cell.decimals is None else target.cell.decimals
    return replace(target, cell=replace(target.cell, value=round(float(off), decimals)))


class Draws:
    """Calibrations of drawn benches.

    Attributes:
        scatter: by how much cells deviate more than their stated sigma, as on the real tables.
        unfinished: the last step of each fit, as a share of a standard deviation, the largest.
    """

    def __init__(self, workers: int, seed: int) -> None:
        self._random = np.random.default_rng(seed)
        self._workers = workers
        self._problem, self._test = problem_and_prediction()
        bench = self._problem.calibration.bench
        stated = bench.tree["known"]["fingerprint"]["bench"]
        folder = bench.file.parent / FOLDER
        text = (folder / bench.file.name).read_text(encoding="utf-8")
        self._part = calibration_part({f"{FOLDER}/{bench.file.name}": text}, stated)
        simulation = Simulation(self._problem, experiments(), workers)
        calls = simulation.residuals, simulation.residuals_of_all
        step = self._problem.options.difference_step
        objective = Objective(self._problem.space.unknowns, *calls, step=step)
        self._start = objective.start
        jacobian = objective.jacobian(self._start, central=True)
        known = uncertainty(jacobian, objective.at(self._start), self._start, "linear")
        assert known.covariance is not None
        self._steps, self.scatter = principal_steps(known.covariance), known.scatter
        self._solve = np.linalg.pinv(jacobian)
        self._sigma = np.sqrt(np.diag(known.covariance))
        self.unfinished = 0.0

    def _found(self, shares: Array, test: Test | None = None) -> dict[str, float]:
        """What a bench finds of the fitted cells, or of a test."""
        problem = self._problem
        if test is not None:
            cells = problem.published[TABLE].cells
            targets = tuple(Target(cell, 1.0, relative=False) for cell in cells)
            problem = replace(problem, tests=(test,), targets=targets)
        simulation = Simulation(problem, experiments(), self._workers)
        return dict(simulation.evaluate(problem.space.values(shares)).found)

    def _true(self) -> Array:
        while True:
            normal = self._random.standard_normal(len(self._steps))
            true = self._start + self._steps.T @ normal
            if np.all((true > 0.0) & (true < 1.0)):
                return np.asarray(true)

    def one(self, deviate: float) -> list[tuple[bool, float]]:
        """Per cell of one draw: whether it was fitted, and (found - true) over the half-width."""
        true = self._true()
        of_true = self._found(true) | self._found(true, self._test)
        off = deviate * self.scatter * self._random.standard_normal(len(self._problem.targets))
        targets = tuple(
            printed(target, of_true[target.cell.path], float(n))
            for target, n in zip(self._problem.targets, off, strict=True)
        )
        shares = self._start
        for _ in range(STEPS):
            found = self._found(shares)
            left = residuals(targets, found)
            step = -self._solve @ left
            shares = np.clip(shares + step, 0.001, 0.999)
        self.unfinished = max(self.unfinished, float(np.max(np.abs(step) / self._sigma)))
        found = self._found(shares)
        left = residuals(targets, found)
        scatter = max(1.0, float(np.sqrt(left @ left / self._part.freedom)))
        found |= self._found(shares, self._test)
        fitted = {target.cell.path for target in targets}
        return [
            (path in fitted, (found[path] - of_true[path]) / (half * scatter / self.scatter))
            for path in found.keys() & of_true.keys()
            if (half := self._part.half_width(path))
        ]


def main() -> None:
    """Print how many intervals hold, of fitted and of predicted cells."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--deviate", type=float, default=1.0)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    draws = Draws(options.workers, options.seed)
    print(f"cells deviate by {options.deviate * draws.scatter:.2f} of their stated sigma")
    counts = {True: [0, 0], False: [0, 0]}
    for number in range(options.draws):
        for fitted, off in draws.one(options.deviate):
            counts[fitted][0] += abs(off) <= 1.0
            counts[fitted][1] += 1
        shares = ", ".join(f"{name}: {counts[own][0]} of {counts[own][1]}" for own, name in NAMES)
        print(f"{number + 1} draws; {shares}", flush=True)
    rows = []
    for own, name in NAMES:
        held, tried = counts[own]
        share = binomtest(held, tried).proportion_ci()
        ends = f"{100 * share.low:.0f} to {100 * share.high:.0f} %"
        rows.append([name, str(tried), f"{100 * held / tried:.1f} %", ends])
    print(f"last step of a fit: at most {draws.unfinished:.2f} sigma")
    print(table(["cells", "intervals", "hold", "as if independent"], rows))


NAMES = ((True, "fitted"), (False, "predicted"))

if __name__ == "__main__":
    main()
