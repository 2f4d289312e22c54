"""Many runs of one protocol on the simulated bench, in memory: they differ in their seed alone."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from campaign.api.analysis import AnalysedTest
from campaign.backends.sim import SimBackend, SimOptions
from campaign.comparison.finding_pairs import Pair, pairs_of
from campaign.comparison.same_quantity import pair_tests
from campaign.comparison.shared_systematics import shared_sources
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData, bench_of
from campaign.protocol import load_protocol, make_plan
from campaign.recording import MemoryRecorder
from campaign.references.verdict import with_verdicts
from campaign.resources import protocols_folder
from campaign.trial import Trial
from tests.experiments.laboratory import Done

Run = tuple[AnalysedTest, ...]

PLATFORM = """
title = "The platform's friction"

[[test]]
name = "map"
kind = "velocity_map"
bench = "platform"
speeds = ["0.2 deg/s", "0.5 deg/s", "0.8 deg/s", "1 deg/s", "1.5 deg/s", "2 deg/s", "2.5 deg/s",
    "4 deg/s", "8 deg/s", "15 deg/s", "30 deg/s", "65 deg/s"]
warm_up_cycles = 0

[[test]]
name = "errors"
kind = "stabilization"
bench = "platform"
frequency = "0.5 Hz"
acceleration = "18 deg/s^2"
repeat = 3
cycles = 3
settle_cycles = 1

[test.matrix]
compensation = ["none", "lugre"]

[[test]]
name = "ramps"
kind = "breakaway"
bench = "platform"
positions = ["-40 deg", "-20 deg", "0 deg", "20 deg", "40 deg"]
directions = ["positive"]
"""


def simulated(
    folder: Path, text: str, seeds: Iterable[int], changes: Sequence[str] = ()
) -> list[Run]:
    """A run per seed, analysed; `changes` as `--set` takes them. Trials alike go side by side."""
    path = folder / "protocol.toml"
    path.write_text(text, encoding="utf-8")
    protocol = load_protocol(path, experiments(), overrides=changes, shipped=protocols_folder())
    plans = [make_plan(protocol, seed=seed).trials for seed in seeds]
    numbered = [
        trial.model_copy(update={"number": number})
        for number, trial in enumerate((t for plan in plans for t in plan), start=1)
    ]
    done = iter(executed(numbered))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return [tuple(_analysed([next(done) for _ in plan])) for plan in plans]


def executed(trials: Sequence[Trial]) -> Iterator[Done]:
    """In the order of `trials`, whose numbers are unique."""
    backend = SimBackend(SimOptions())
    groups: dict[Any, list[Trial]] = {}
    for trial in trials:
        groups.setdefault(backend.group(trial), []).append(trial)
    done: dict[int, Done] = {}
    for group in groups.values():
        group.sort(key=lambda trial: trial.task.duration)
        for first in range(0, len(group), backend.most_together):
            batch = group[first : first + backend.most_together]
            recorders = [MemoryRecorder() for _ in batch]
            flags = [lambda: False] * len(batch)
            for place, ending in backend.execute_together(batch, recorders, flags):
                recording = recorders[place].recording(ending)
                done[batch[place].number] = Done(batch[place], ending, recording)
    return (done[trial.number] for trial in trials)


def _analysed(done: Sequence[Done]) -> Iterator[AnalysedTest]:
    tests: dict[str, list[Done]] = {}
    for each in done:
        tests.setdefault(each.trial.test, []).append(each)
    for name, trials in tests.items():
        first = trials[0].trial
        data = TestData(name, first.kind, first.options, tuple(trials))
        yield analysed(data, result_of(experiments()[first.kind], data))


def analysed(data: TestData, result: Any, **more: Any) -> AnalysedTest:
    """What a report makes of a test, without an archive."""
    trials = [each.trial for each in data.trials]
    found = AnalysedTest(
        name=data.name,
        kind=data.kind,
        title=data.name,
        description="",
        reproduces=(),
        options=data.options,
        trials=data.trials,  # type: ignore[arg-type]
        experiment=experiments().get(data.kind) if data.kind in experiments() else None,
        bench=bench_of(trials[0]) if trials else None,
        result=result,
        source="simulation",
    )
    return replace(found, **more)


def compared(reference: Run, other: Run) -> tuple[Pair, ...]:
    """All pairs of two runs, judged as one family."""
    return with_verdicts(
        [
            pair
            for tested in pair_tests(reference, other).tests
            for pair in pairs_of(tested, shared_sources(tested.reference, tested.other, {}, {}))
        ]
    )
