"""Bandwidth and margins of the virtual hardware: 23 sines to 300 Hz, noise, quantisation, friction.

The truth is that of the same bench with ideal sensors and friction that does not scatter, swept so
densely that straight lines between its points are right to a thousandth.
"""

from __future__ import annotations

from collections import defaultdict
from functools import cache

import numpy as np
import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.recording import MemoryRecorder
from campaign.result import Result
from campaign.trial import Trial
from tests.estimation.coverage import holds, rejected
from tests.experiments.laboratory import Done, analyse, finding, trials

KIND = "frequency_response"
NEAR_3_DB = (5.0, 5.4, 5.8, 6.2, 6.5, 6.8, 7.1, 7.4, 7.7, 8.0, 8.4)
NEAR_HALF_TURN = (100.0, 125.0, 150.0, 165.0, 180.0, 195.0, 210.0, 225.0, 240.0, 270.0, 300.0)
SWEEP = (2.0, *NEAR_3_DB, *NEAR_HALF_TURN)
TRUE = {"bandwidth": 7.157, "phase_margin": np.deg2rad(71.031), "gain_margin": 30.975}
"""Hz, rad, dB; `test_the_truth` finds them again."""


def executed(planned: list[Trial]) -> list[Done]:
    """In the batches that the program would make of them, where several are alike."""
    backend = SimBackend(SimOptions())
    groups = defaultdict(list)
    for trial in planned:
        groups[backend.group(trial)].append(trial)
    done = []
    for group in groups.values():
        for k in range(0, len(group), backend.most_together):
            batch = group[k : k + backend.most_together]
            recorders = [MemoryRecorder() for _ in batch]
            for place, ending in backend.execute_together(
                batch, recorders, [lambda: False] * len(batch)
            ):
                recording = recorders[place].recording(ending)
                done.append(Done(batch[place], ending, recording))
    return sorted(done, key=lambda each: each.trial.number)


def swept(bench: Bench, frequencies: tuple[float, ...], seed: int) -> Result:
    planned = trials(KIND, bench, {"frequencies": [f"{f} Hz" for f in frequencies]})
    return analyse(
        KIND, executed([t.model_copy(update={"seed": seed + t.number}) for t in planned])
    )


@cache
def platform() -> Bench:
    return load_bench("platform")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("draws", "seed"), [(2, 50_000), pytest.param(60, 60_000, marks=pytest.mark.statistics)]
)
def test_intervals_hold_on_the_virtual_hardware(draws: int, seed: int) -> None:
    held = defaultdict(list)
    for draw in range(draws):
        result = swept(platform(), SWEEP, seed + 1000 * draw)
        for name, true in TRUE.items():
            held[name].append(holds(finding(result, name).known, true))
    assert rejected(held, "less") == {}
    assert all(any(inside) for inside in held.values())


@pytest.mark.statistics
def test_the_truth() -> None:
    tree = platform().model_dump(mode="json")
    tree["sensors"] = {name: {} for name in tree["sensors"]}
    tree["variation"]["trial_to_trial"] = {}
    ideal = Bench.model_validate(tree, context={"si": True})
    at = (*np.arange(5.0, 8.0, 0.1).round(3), *np.arange(180.0, 221.0, 5.0))
    planned = trials(KIND, ideal, {"frequencies": [f"{f} Hz" for f in at]})
    measure = experiments()[KIND].measure
    assert measure is not None
    found = [{e.name: e.value for e in measure(each)} for each in executed(planned)]
    closed = np.array([each["response_real"] + 1j * each["response_imag"] for each in found])
    loop = closed / (1 - closed)
    low, x = np.array(at) < 100, np.log(np.array(at))
    bandwidth = np.exp(np.interp(3.0, -20 * np.log10(abs(closed[low])), x[low]))
    crossover = np.interp(0.0, -np.log(abs(loop[low])), x[low])
    phase_margin = np.pi + np.interp(crossover, x[low], np.unwrap(np.angle(loop[low])))
    turned = np.interp(0.0, -np.angle(-loop[~low]), x[~low])
    gain_margin = -20 * np.log10(np.exp(np.interp(turned, x[~low], np.log(abs(loop[~low])))))
    assert bandwidth == pytest.approx(TRUE["bandwidth"], abs=2e-3)
    assert phase_margin == pytest.approx(TRUE["phase_margin"], abs=np.deg2rad(0.02))
    assert gain_margin == pytest.approx(TRUE["gain_margin"], abs=0.01)
