"""A test of a stated bench, executed on its truth, in memory: plan, backend, analysis."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from campaign.backends.sim import SimBackend, SimOptions
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData
from campaign.physics.truth import digest, plant_of
from campaign.protocol.expand import fields_of
from campaign.recording import MemoryRecorder
from campaign.result import Result
from campaign.trial import Trial
from tests.coverage.benches import Case
from tests.experiments.laboratory import Done

Tree = Mapping[str, Any]


@dataclass(frozen=True)
class Run:
    """A test that was executed and analysed."""

    case: Case
    kind: str
    done: tuple[Done, ...]
    result: Result


def options_for(case: Case, kind: str) -> tuple[dict[str, Any], int]:
    """Options that fit a bench (SI), and how often the test is repeated.

    They follow from sizes that an engineer would guess, not from what an analysis should find.
    """
    return {
        "velocity_map": _map,
        "breakaway": _ramps,
        "frequency_response": _sweep,
        "stabilization": _waves,
    }[kind](case)


KINDS = ("velocity_map", "breakaway", "frequency_response", "stabilization")


def _map(case: Case) -> tuple[dict[str, Any], int]:
    """16 speeds from a tenth to twenty times the Stribeck velocity.

    After a reversal the integrator of the rate loop has to turn its torque from one side's friction
    to the other's before the load moves at all: that takes 2 T / (Ki N Kt), as an angle.
    """
    scale, bench = case.scale, case.stated
    winding = scale.torque / (bench.controller.rate.integral_gain * bench.torque_per_current)
    speeds = [scale.velocity * 0.1 * 200.0 ** (k / 15.0) for k in range(16)]
    settle = 8.0 * scale.breakaway_angle + 2.5 * winding
    slowest = settle / speeds[0]
    return {
        "speeds": speeds,
        "settle_angle": settle,
        "settle_time": 3.0 / scale.bandwidth,
        "max_time": max(30.0, 2.0 * slowest),
        "max_travel": 2.0,
        "acceleration": _acceleration(case),
        "warm_up_cycles": 0,
        "sample_rate": 500.0,
    }, 1


def _ramps(case: Case) -> tuple[dict[str, Any], int]:
    """Five ramps of half a minute."""
    torque = case.scale.torque
    return {
        "positions": [-0.7, -0.3, 0.05, 0.35, 0.8],
        "torque_rate": torque / 30.0,
        "peak_torque": 2.5 * torque,
        "rest": 10.0,
        "sliding_rate": max(0.2 * case.scale.velocity, 0.002),
        "sample_rate": 1000.0,
    }, 1


def _sweep(case: Case) -> tuple[dict[str, Any], int]:
    """22 frequencies, logarithmic, from a quarter of the bandwidth to 200 Hz."""
    first = 0.25 * case.scale.bandwidth
    return {
        "frequencies": [first * (200.0 / first) ** (k / 21.0) for k in range(22)],
        "amplitude": max(20.0 * case.scale.velocity, 0.3),
        "cycles": 16,
    }, 1


def _waves(case: Case) -> tuple[dict[str, Any], int]:
    """Six cycles of a hull that moves five times as fast as the Stribeck velocity, three times."""
    frequency = 0.24
    return {
        "frequency": frequency,
        "acceleration": 5.0 * case.scale.velocity * 2.0 * math.pi * frequency,
        "cycles": 6,
        "settle_cycles": 2,
        "sample_rate": 500.0,
    }, 3


def _acceleration(case: Case) -> float:
    return float(min(0.5 * case.stated.limits.acceleration, 100.0 * case.scale.velocity))


def plan(case: Case, kind: str, draw: int = 0) -> list[Trial]:
    """The trials, with seeds that follow from bench, kind, draw and place alone."""
    experiment, (written, repeats) = experiments()[kind], options_for(case, kind)
    options = experiment.options.model_validate(written, context={"si": True})
    tree, bench = options.model_dump(mode="json"), case.stated.model_dump(mode="json")
    truth = digest(plant_of(case.truth))
    found: list[Trial] = []
    for repeat in range(1, repeats + 1):
        for request in experiment.trials(options, case.stated):
            number = len(found) + 1
            found.append(
                Trial(
                    number=number, test=kind, kind=kind, repeat=repeat, point=dict(request.point),
                    options=tree, seed=_seed(case, kind, draw, number), bench=bench, truth=truth,
                    **fields_of(experiment, request, bench, {}),
                )
            )  # fmt: skip
    return found


def _seed(case: Case, *place: object) -> int:
    text = repr((case.number, *place)).encode()
    return int.from_bytes(hashlib.sha256(text).digest()[:8], "big") >> 1


def execute(case: Case, trials: Iterable[Trial]) -> tuple[Done, ...]:
    """Every trial on the truth; those of one structure side by side."""
    backend = SimBackend(SimOptions())
    plant = plant_of(case.truth)
    backend.simulate_instead({digest(plant): plant})
    done: dict[int, Done] = {}
    for batch in _batches(backend, trials):
        recorders = [MemoryRecorder() for _ in batch]
        flags = [_never] * len(batch)
        for place, ending in backend.execute_together(batch, recorders, flags):
            trial = batch[place]
            done[trial.number] = Done(trial, ending, recorders[place].recording(ending))
    return tuple(done[number] for number in sorted(done))


def _never() -> bool:
    return False


def _batches(backend: SimBackend, trials: Iterable[Trial]) -> Iterator[list[Trial]]:
    groups: dict[Any, list[Trial]] = {}
    for trial in trials:
        why = backend.refuses(trial)
        if why is not None:
            raise ValueError(f"{trial.label}: {why}")
        groups.setdefault(backend.group(trial), []).append(trial)
    most = backend.most_together
    for group in groups.values():
        group.sort(key=lambda trial: trial.task.duration)
        for first in range(0, len(group), most):
            batch = group[first : first + most]
            if len(batch) < backend.fewest_together:
                yield from ([trial] for trial in batch)
            else:
                yield batch


def run(case: Case, kind: str, draw: int = 0) -> Run:
    """Plan, execute, analyse; the analysis is given no more than it is in the program."""
    done = execute(case, plan(case, kind, draw))
    options = done[0].trial.options
    result = result_of(experiments()[kind], TestData(kind, kind, options, done))
    return Run(case, kind, done, result)
