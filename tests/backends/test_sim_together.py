"""Simulated trials together: to the bit what they are alone, whatever becomes of the others."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.backends.interface import ExecutesTogether, KnowsCost
from campaign.backends.sim import BACKEND, SimBackend, SimOptions
from campaign.cli import compile_engine
from campaign.cli.prepare import Request
from campaign.cli.run import run_protocol
from campaign.cli.run_options import RunOptions
from campaign.physics import lanes, machine_code
from campaign.physics import simulate as simulate_module
from campaign.physics.bench import Bench
from campaign.physics.grid import Grid
from campaign.physics.machine_code import Part
from campaign.physics.vector import LANES
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording
from campaign.signals import Polyline, Sine
from campaign.trial import Trial
from tests.backends.test_sim import WIDE, limited, trial
from tests.physics.benches import bench, task

SWING = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24)
PUSH = task(mode="torque", command=Polyline(times=(0.0, 1.0), values=(0.0, 400.0)))
NOBODY: Callable[[], bool] = lambda: False  # noqa: E731


def together(
    trials: list[Trial],
    stops: dict[int, Callable[[], bool]] | None = None,
    options: SimOptions = SimOptions(),  # noqa: B008
) -> tuple[list[tuple[int, Ending]], list[Recording]]:
    recorders = [MemoryRecorder() for _ in trials]
    flags = [(stops or {}).get(place, NOBODY) for place in range(len(trials))]
    backend = SimBackend(options)
    endings = list(backend.execute_together(trials, recorders, flags))
    ended = dict(endings)
    assert sorted(ended) == list(range(len(trials)))
    return endings, [each.recording(ended[place]) for place, each in enumerate(recorders)]


def alone(one: Trial, options: SimOptions = SimOptions()) -> Recording:  # noqa: B008
    recorder = MemoryRecorder()
    return recorder.recording(SimBackend(options).execute(one, recorder, NOBODY))


def assert_equal(one: Recording, other: Recording) -> None:
    assert one.ending == other.ending
    assert one.events == other.events
    assert one.time.tobytes() == other.time.tobytes()
    for name, channel in one.channels.items():
        assert channel.samples.tobytes() == other[name].tobytes(), name


def heavy(inertia: float) -> Bench:
    return bench(lambda tree: tree["axis"].update(inertia=f"{inertia} kg m^2"))


def test_each_is_what_it_is_alone() -> None:
    durations = (1.0, 0.25, 2.5, 1.0, 0.001)
    trials = [
        trial(heavy(35.0 + k), task(base_acceleration=SWING, duration=duration))
        for k, duration in enumerate(durations)
    ]
    _, recordings = together(trials)
    for one, recording in zip(trials, recordings, strict=True):
        assert_equal(alone(one), recording)
    assert [len(recording.time) for recording in recordings] == [1000, 250, 2500, 1000, 1]


@pytest.mark.parametrize(
    "change",
    [
        {"sensors": {"gyro": {"noise": "1e-4 rad/s"}}, "controller": {"sample_rate": "1 kHz"}},
        {"variation": {"seed": 1, "trial_to_trial": {"coulomb_torque": 0.1}}},
    ],
)
def test_repeats_differ_by_their_seeds_only(change: dict[str, Any]) -> None:
    """A backend prepares a bench once for all of them, unless its friction depends on the seed."""

    def edit(tree: Any) -> None:
        for name, table in change.items():
            tree.setdefault(name, {}).update(table)

    one = trial(bench(edit), task(base_acceleration=SWING, duration=0.5))
    trials = [one.model_copy(update={"seed": seed}) for seed in (1, 2, 1)]
    _, recordings = together(trials)
    for each, recording in zip(trials, recordings, strict=True):
        assert_equal(alone(each), recording)
    rates = [recording["gyro_rate"].tobytes() for recording in recordings]
    assert rates[0] == rates[2] != rates[1]


def test_a_trial_ends_when_it_has_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short one is told of before the long one goes on: its file can be closed."""
    monkeypatch.setattr(simulate_module, "BLOCK_SAMPLES", 100)
    short, long = (trial(bench(), task(base_acceleration=SWING, duration=d)) for d in (0.2, 1.0))
    recorders = [MemoryRecorder(), MemoryRecorder()]
    going = SimBackend(SimOptions()).execute_together([long, short], recorders, [NOBODY, NOBODY])
    place, ending = next(going)
    assert (place, ending.outcome) == (1, Outcome.COMPLETED)
    assert len(recorders[1].recording(ending).time) == 200
    assert len(recorders[0].recording(ending).time) == 200  # and it goes on
    assert [place for place, _ in going] == [0]


def test_a_limit_ends_its_own_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulate_module, "BLOCK_SAMPLES", 100)
    rates = ("1e9 deg/s", "0.2 deg/s", "1e9 deg/s")
    trials = [trial(limited(**{**WIDE, "rate": rate}), PUSH) for rate in rates]
    _, recordings = together(trials)
    assert [each.ending.outcome for each in recordings] == [
        Outcome.COMPLETED,
        Outcome.LIMIT,
        Outcome.COMPLETED,
    ]
    for one, recording in zip(trials, recordings, strict=True):
        assert_equal(alone(one), recording)


def test_one_that_diverges_harms_no_other() -> None:
    def observer(inertia: float) -> Trial:
        def change(tree: dict) -> None:
            tree["controller"]["sample_rate"] = "1 kHz"
            tree["limits"] |= WIDE
            tree["axis"]["inertia"] = f"{inertia} kg m^2"

        return trial(bench(change), task(base_acceleration=SWING, compensation="observer"))

    fixed = SimOptions(longest_step="0.5 ms")
    trials = [observer(inertia) for inertia in (40.0, 2e3, 40.0, 1e4)]
    _, recordings = together(trials, options=fixed)
    outcomes = [each.ending.outcome for each in recordings]
    assert outcomes[0] == outcomes[2] == Outcome.DIVERGED
    assert outcomes[3] == Outcome.COMPLETED
    for one, recording in zip(trials, recordings, strict=True):
        assert_equal(alone(one, fixed), recording)


def test_a_stop_ends_its_own_trial(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulate_module, "BLOCK_SAMPLES", 100)
    trials = [trial(heavy(j), task(base_acceleration=SWING)) for j in (35.0, 36.0, 37.0)]
    asked = iter([False, False, True])
    endings, recordings = together(trials, {1: lambda: next(asked)})
    assert [place for place, _ in endings] == [1, 0, 2]
    assert recordings[1].ending.outcome is Outcome.INTERRUPTED
    assert [len(recording.time) for recording in recordings] == [1000, 300, 1000]
    assert_equal(alone(trials[2]), recordings[2])


def test_the_rate_that_completes_a_trial_completes_its_own() -> None:
    rates = (None, 0.02, 0.05)
    trials = [trial(limited(**WIDE), PUSH.model_copy(update={"stop_rate": rate})) for rate in rates]
    _, recordings = together(trials)
    lengths = [len(recording.time) for recording in recordings]
    assert lengths[1] < lengths[2] < lengths[0] == 1000
    for one, recording in zip(trials, recordings, strict=True):
        assert_equal(alone(one), recording)


def test_groups_are_structures_and_cost_is_what_the_engine_does() -> None:
    backend = BACKEND.open(SimOptions())
    assert isinstance(backend, ExecutesTogether)
    assert isinstance(backend, KnowsCost)
    moving = task(base_acceleration=SWING)
    like, other = trial(heavy(40.0), moving), trial(heavy(41.0), moving)
    compensated = trial(heavy(41.0), moving.model_copy(update={"compensation": "lugre"}))
    assert backend.group(like) == backend.group(other) != backend.group(compensated)
    cost = backend.cost(like)
    assert cost.steps == round(like.task.duration / cost.step)
    assert cost.step == 1e-3 / 8
    assert "reversals" in cost.because
    chosen = BACKEND.open(SimOptions(longest_step="1 ms")).cost(like)
    assert (chosen.step, chosen.because) == (1e-3, "asked for")


PROTOCOL = """
title = "The same trials, together and alone"

[[test]]
name = "map"
kind = "velocity_map"
bench = "platform"
seed = 3
speeds = [
    "0.5 deg/s", "1 deg/s", "2 deg/s", "4 deg/s", "5 deg/s", "6 deg/s", "8 deg/s", "9 deg/s",
    "16 deg/s",
]
warm_up_cycles = 0

[[test]]
name = "sea"
kind = "stabilization"
bench = "simulink"
seed = 4
cycles = 1
settle_cycles = 1
"""


@pytest.mark.slow
def test_a_run_is_the_same_together_and_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of each trial of two archives: all samples, events and how it ended."""
    protocol = tmp_path / "protocol.toml"
    protocol.write_text(PROTOCOL, encoding="utf-8")
    blocks: list[int] = []
    execute_together = SimBackend.execute_together

    def counted(backend: SimBackend, trials: list[Trial], *others: Any) -> Any:
        blocks.append(len(trials))
        return execute_together(backend, trials, *others)

    monkeypatch.setattr(SimBackend, "execute_together", counted)
    monkeypatch.setattr(compile_engine, "WORTH_A_BLOCK", 0.0)
    runs, sizes = [], []
    for fewest, workers in ((4, 1), (4, 2), (1000, 2)):
        monkeypatch.setattr(SimBackend, "fewest_together", fewest)
        results = tmp_path / f"{fewest}-{workers}"
        assert run_protocol(Request(str(protocol)), results, RunOptions(workers=workers)) == 0
        runs.append(open_run(next(results.glob("*.nxs"))))
        sizes.append(sorted(blocks))
        blocks.clear()
    assert sizes == [[1, 9], [1, 1, 1, 1, 1, 5], [1] * 10]
    for run in runs[1:]:
        assert len(run.trials) == len(runs[0].trials)
        for one, other in zip(runs[0].trials, run.trials, strict=True):
            assert_equal(one.recording(), other.recording())


def test_what_is_made_ready_is_what_is_executed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Widths of friction models and of the prescribed engine; else each worker compiles them."""
    made: list[tuple[str, int]] = []
    motion = task(mode="prescribed", command=SWING, duration=0.01)
    loops = [trial(heavy(35.0 + k), task(base_acceleration=SWING)) for k in range(4)]
    motions = [trial(bench(), motion, seed=k) for k in range(4)]
    finer = trial(bench(), motion.model_copy(update={"sample_rate": 2000.0}))
    monkeypatch.setattr(lanes, "together", lambda trials, width: made.append(("models", width)))
    monkeypatch.setattr(
        machine_code,
        "engine",
        lambda width, _, mode: Part("", lambda: made.append((mode, width))),
    )
    SimBackend(SimOptions()).make_ready([*loops, *motions, finer])
    assert sorted(made) == [
        ("models", 1),
        ("models", LANES),
        ("models", LANES),
        ("prescribed", 1),
        ("prescribed", LANES),
    ]


@pytest.mark.parametrize("every", [1, 8, 200, 200_000])
def test_memory_and_patience_are_bounded_at_any_step(every: int) -> None:
    """However fine the steps of a slow recording are."""
    grid = Grid(step=1e-6, every=every, per_control=0, samples=10**9)
    for alone in (True, False):
        steps = every * simulate_module.samples_at_a_time(grid, alone=alone)
        assert steps <= max(20_000 if alone else 128_000, every)
