"""What a report is told of a protocol that was only planned: its tests without results."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from types import SimpleNamespace

from campaign.api.analysis import AnalysedTest
from campaign.archive.layout.header import RunHeader
from campaign.experiments import experiments
from campaign.experiments.interface import bench_of
from campaign.protocol import load_protocol, make_plan
from campaign.recording import Ending, Outcome
from campaign.report.content.conditions import conditions_of
from campaign.report.content.written_units import units_of
from campaign.result import Result

SHIPPED = Path(__file__).resolve().parents[2] / "protocols"


def planned(path: Path, *overrides: str) -> tuple[dict[str, AnalysedTest], RunHeader]:
    """The tests by name, every trial of them completed, and the header of the run."""
    plan = make_plan(
        load_protocol(path, experiments(), overrides=overrides, shipped=SHIPPED), seed=1
    )
    tests = {}
    for test in plan.tests:
        trials = tuple(
            SimpleNamespace(trial=trial, ending=Ending(Outcome.COMPLETED))
            for trial in plan.trials
            if trial.test == test.name
        )
        tests[test.name] = AnalysedTest(
            name=test.name,
            kind=test.kind,
            title=test.title,
            description="",
            reproduces=(),
            options=test.options,
            trials=trials,  # type: ignore[arg-type]
            experiment=experiments()[test.kind],
            bench=bench_of(trials[0].trial),
            result=Result(),
            source="simulation",
        )
    header = RunHeader(
        name="run",
        created="2026-11-21T09:36:58Z",
        sources=dict(plan.protocol.sources),
        overrides={name: value for name, _, value in (each.partition("=") for each in overrides)},
    )
    return tests, header


@cache
def conditions(path: Path, *overrides: str) -> dict[str, dict[str, str]]:
    """By test: the conditions that its section lists; read only, of a file that stays as it is."""
    tests, header = planned(path, *overrides)
    units = units_of(tests.values(), header)
    return {name: dict(conditions_of(test, units[name])) for name, test in tests.items()}
