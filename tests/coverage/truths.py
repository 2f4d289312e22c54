"""What is true of what an analysis found: of a parameter, of a response, of a trial."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimation.stribeck import fit_stribeck, stribeck
from campaign.experiments import experiments
from campaign.experiments.friction_map.curves import Curves, fit_map
from campaign.experiments.friction_map.points import points_of, steady
from campaign.physics.bench import Bench
from campaign.physics.complete import complete, control_rate
from campaign.physics.lanes import Lane
from campaign.physics.rows import OUTPUTS
from campaign.physics.simulate import simulate_together
from campaign.physics.true_values import DIRECTIONS, stribeck_parameters, true_value
from campaign.physics.truth import plant_of, simulated
from campaign.physics.variation import as_it_is, of_its_day
from campaign.result import Finding
from campaign.trial import Task, Tree, Trial, canonical_json
from tests.coverage.benches import Case, make_case
from tests.coverage.laboratory import Run, plan

IN_TORQUE = frozenset(
    {
        "coulomb_torque",
        "static_torque",
        "viscous_friction",
        "bristle_stiffness",
        "stiffness_at_rest",
        "breakaway_torque",
    }
)
"""Quantities that are proportional to the torque constant that was stated."""
_LOOPS: dict[tuple[str, str], Mapping[str, float]] = {}
"""Of a bench and the options of a sweep; the draws of one bench share them."""
HIGHEST = 0.395
"""of the controller's sample rate: up to there crossings of a loop are looked for."""
SEEDS = 48
"""trials whose mean is the true stabilization error: 48 times as many as in one."""


class Truths:
    """The true values of one run's findings; what costs a simulation is worked out once."""

    def __init__(self, run: Run) -> None:
        self._run, self._case = run, run.case
        self._ramps: dict[int, tuple[float, float]] = {}
        self._closest: dict[tuple[float, str], Mapping[str, float]] = {}

    def of(self, finding: Finding) -> float | None:
        """None where nothing is true: a rule, a change of a number."""
        if finding.recomputed:
            return None
        if finding.conditions.get("exponent", "free") != "free":
            return self._of_wrong_curve(finding)
        match finding.quantity:
            case "breakaway_torque":
                return self._ramp_mean(finding, 0)
            case "bandwidth" | "phase_margin" | "gain_margin":
                return self._loop().get(finding.quantity)
            case "stabilization_error":
                return _error_of(self._case.number)
        own = self._trials_of(finding)
        bench = self._case.truth
        there = as_it_is(bench, own[0].seed) if len(own) == 1 else of_its_day(bench)
        return true_value(there, finding.quantity, finding.conditions)

    def _of_wrong_curve(self, finding: Finding) -> float | None:
        """With an exponent that is not the bench's: of the curve of that kind closest to the truth.

        Closest as the fit has it, at its speeds and with its weights.
        """
        exponent = float(str(finding.conditions["exponent"]))
        direction = str(finding.conditions["direction"])
        ways = list(DIRECTIONS) if direction == "nominal" else [direction]
        found = [self._closest_curve(exponent, way).get(finding.quantity) for way in ways]
        told = [value for value in found if value is not None]
        return math.fsum(told) / len(ways) if len(told) == len(ways) else None

    def _closest_curve(self, exponent: float, direction: str) -> Mapping[str, float]:
        if (exponent, direction) not in self._closest:
            own = stribeck_parameters(of_its_day(self._case.truth), DIRECTIONS[direction])
            true = {"stribeck_velocity": 1.0, "stribeck_exponent": 1.0, **own}  # without effect
            fit = self._map().fits[direction]
            curve = stribeck(fit.speed, true)
            closest = fit_stribeck(fit.speed, curve, fit.deviation, exponent)
            self._closest[exponent, direction] = {n: closest.values[n] for n in closest.free}
        return self._closest[exponent, direction]

    def _map(self) -> Curves:
        notes: list[str] = []
        kept, _ = steady(points_of(self._run.done, notes), notes)
        return fit_map(kept, self._run.done[0])

    def by_stated(self, finding: Finding) -> float | None:
        """What would be found without scatter of what depends on the stated inertia; else None."""
        return self._ramp_mean(finding, 1) if finding.quantity == "breakaway_torque" else None

    def _ramp_mean(self, finding: Finding, which: int) -> float | None:
        own = [self._ramp(trial)[which] for trial in self._trials_of(finding)]
        return float(np.mean(own)) if own else None

    def _trials_of(self, finding: Finding) -> list[Trial]:
        told = finding.conditions
        trials = [done.trial for done in self._run.done]
        return [t for t in trials if all(told.get(k, v) == v for k, v in t.point.items())]

    def _loop(self) -> Mapping[str, float]:
        options = self._run.done[0].trial.options
        key = self._case.name, canonical_json(options)
        if key not in _LOOPS:
            _LOOPS[key] = loop_numbers(self._case, options)
        return _LOOPS[key]

    def _ramp(self, trial: Trial) -> tuple[float, float]:
        if trial.number not in self._ramps:
            self._ramps[trial.number] = largest_friction(self._case, trial)
        return self._ramps[trial.number]


@cache
def _error_of(number: int) -> float:
    return mean_error(make_case(number))


def largest_friction(case: Case, trial: Trial) -> tuple[float, float]:
    """The largest friction torque of a ramp (N m), from the engine's own friction.

    Beside it the largest of what a drive torque less J dw/dt comes to with the stated J, of exact
    sensors: it has the systematic part that a wrong inertia leaves, and no scatter.
    """
    bench = _whole(case.truth, case)
    lane = Lane.of(bench, trial.task, trial.seed, None, complete(case.stated))
    blocks = [out for _, (out,) in simulate_together([lane])]
    rows = dict(zip(OUTPUTS, np.concatenate(blocks, axis=1), strict=True))
    rate = rows["load_rate"]
    fast = np.abs(rate) > (trial.task.stop_rate or math.inf)
    stop = max(2, int(np.argmax(fast)) if fast.any() else len(rate))
    friction = rows["friction_torque"][:stop]
    wrong = case.truth.axis.inertia - case.torque_ratio * case.stated.axis.inertia
    reckoned = friction + wrong * np.gradient(rate[:stop], 1.0 / trial.task.sample_rate)
    return float(np.max(np.abs(friction))), float(np.max(np.abs(reckoned)))


def _whole(truth: Bench, case: Case) -> Bench:
    return simulated(plant_of(truth), case.stated)


def _quiet(case: Case) -> Bench:
    """The truth with exact sensors, and without scatter; delays stay."""
    tree = case.truth.model_dump(mode="json")
    for sensor in tree["sensors"].values():
        sensor |= {"noise": 0.0, "resolution": 0.0}
    return _whole(
        of_its_day(Bench.model_validate(tree, context={"si": True})).model_copy(
            update={"variation": None}
        ),
        case,
    )


def loop_numbers(case: Case, options: Tree) -> dict[str, float]:
    """Bandwidth (Hz), phase margin (rad), gain margin (dB) of the noise-free loop.

    At the amplitudes of the test (`options`, SI), on a grid that is ever finer around each
    crossing. The bandwidth is the first frequency at which the gain falls through -3 dB, the
    margins are the least of all crossings.
    """
    highest = HIGHEST * (control_rate(case.stated) or 1000.0)
    grid = np.geomspace(options["frequencies"][0], highest, 60)
    response = _response(case, options, grid)
    found: dict[str, float] = {}
    for name, level in {
        "bandwidth": lambda t: np.abs(t) - 10.0 ** (-3.0 / 20.0),
        "phase_margin": lambda t: np.abs(t / (1.0 - t)) - 1.0,
        "gain_margin": lambda t: _lead_over_half_turn(t),
    }.items():
        values = level(response)
        places = np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0))
        places = [k for k in places if response[k] and response[k + 1]]  # 0: it sticks
        crossings = [_refined(case, options, grid[k], grid[k + 1], level) for k in places]
        if not crossings:
            continue
        if name == "bandwidth":
            found[name] = crossings[0][0]
            continue
        loops = [t / (1.0 - t) for _, t in crossings]
        if name == "phase_margin":
            found[name] = min(math.pi + float(np.angle(loop)) for loop in loops)
        else:
            gains = [abs(loop) for loop in loops if loop]
            found |= {name: -20.0 * math.log10(max(gains))} if gains else {}
    return found


def _lead_over_half_turn(t: Array) -> Array:
    """Phase of the open loop above -180 degrees (rad), unwrapped from the first frequency on."""
    return np.asarray(np.unwrap(np.angle(t / (1.0 - t))) + math.pi)


def _refined(
    case: Case, options: Tree, low: float, high: float, level: Any
) -> tuple[float, complex]:
    """Frequency and response where `level` crosses zero, on 9 points between two frequencies."""
    grid = np.geomspace(low, high, 9)
    response = _response(case, options, grid)
    values = level(response)
    if _is_phase(values):
        values = values - 2.0 * math.pi * np.round(values / (2.0 * math.pi))
    k = int(np.flatnonzero((values[:-1] > 0.0) & (values[1:] <= 0.0))[0])
    share = values[k] / (values[k] - values[k + 1])
    frequency = float(grid[k] * (grid[k + 1] / grid[k]) ** share)
    return frequency, complex(response[k] + share * (response[k + 1] - response[k]))


def _is_phase(values: Array) -> bool:
    return bool(np.max(np.abs(values)) > math.pi)


def _response(case: Case, tree: Tree, frequencies: Array) -> Array:
    """Closed-loop response gyro over command (complex), of the quiet bench, shape (n,)."""
    experiment = experiments()["frequency_response"]
    options = experiment.options.model_validate(
        {**tree, "frequencies": list(map(float, frequencies))}, context={"si": True}
    )
    bench = _quiet(case)
    tasks = [request.task for request in experiment.trials(options, case.stated)]
    return np.array(
        [_sine(bench, case, task, f) for task, f in zip(tasks, frequencies, strict=True)]
    )


def _sine(bench: Bench, case: Case, task: Task, frequency: float) -> complex:
    time, rate = _simulated(bench, case, task, 1)
    inside = (time >= task.window[0] - 1e-9) & (time < task.window[1] - 1e-9)
    t = time[inside]
    basis = np.stack(
        [np.cos(2 * np.pi * frequency * t), np.sin(2 * np.pi * frequency * t), np.ones_like(t), t],
        axis=1,
    )
    a, b = (
        np.linalg.lstsq(basis, signal, rcond=None)[0][:2]
        for signal in (rate[inside], task.command.sample(t))
    )
    return complex(a[0] - 1j * a[1]) / complex(b[0] - 1j * b[1])


def _simulated(bench: Bench, case: Case, task: Task, seed: int) -> tuple[Array, Array]:
    lane = Lane.of(bench, task, seed, None, complete(case.stated))
    blocks = [(time, out) for time, (out,) in simulate_together([lane])]
    row = OUTPUTS.index("gyro_rate")
    return (
        np.concatenate([time for time, _ in blocks]),
        np.concatenate([out[row] for _, out in blocks]),
    )


def mean_error(case: Case) -> float:
    """Standard deviation of the pointing error (rad), mean over `SEEDS` trials of other seeds."""
    task = plan(case, "stabilization")[0].task
    bench, row = _whole(case.truth, case), OUTPUTS.index("pointing_angle")
    errors: list[float] = []
    for first in range(0, SEEDS, 8):
        lanes = [
            Lane.of(bench, task, 10_000 + first + k, None, complete(case.stated)) for k in range(8)
        ]
        blocks = list(simulate_together(lanes))
        time = np.concatenate([time for time, _ in blocks])
        inside = (time >= task.window[0] - 1e-9) & (time < task.window[1] - 1e-9)
        for k in range(8):
            error = np.concatenate([outs[k][row] for _, outs in blocks])
            errors.append(float(np.std(error[inside])))
    return float(np.mean(errors))
