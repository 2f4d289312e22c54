"""Loops close to or beyond instability, from archived benches."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pydantic import ValidationError

from campaign.api.analysis import one_line
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import BOTH_ROTARY, axis_terms, in_axis_terms, sides_in
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.physics.plan_loops import LoopUse, loops_used
from campaign.reason import Cause
from campaign.result import Column, Table, Value
from campaign.trial import Task, canonical_json

COMPUTED = Cause("computed", "computed from the description of the bench, and not measured")
NOTE = (
    "The loop is opened at the rate error, or under a torque command at the compensation torque. "
    "Motions are small: stuck, with every interface in presliding, and in fast sliding. Below 20° "
    "or 3 dB a small change of the bench makes it unstable. Of each test, compensation and regime "
    "the trial with the least margin is shown."
)


def low_margin_table(run: RunReader) -> tuple[Table, list[str]]:
    """Table of loops with low margin or instability, and problems; most runs have no rows."""
    rows: list[dict[str, Value]] = []
    problems: list[str] = []
    benches: dict[str, Bench] = {}
    sides = {trial.trial.test: sides_in(trial.trial.bench) for trial in run.trials}
    for test in sides:
        try:
            uses = loops_used(_trials_of(run, test, benches))
        except ValidationError as error:
            problems.append(f"the loops of {test}: {one_line(error)}")
            continue
        low = (use for use in uses if use.margins.low or not use.margins.stable)
        with axis_terms(sides[test]):
            rows += [{"test": test, **_row(use)} for use in low]
    columns = (
        Column("test", "Test"),
        Column("trial", "Trial", exact=True),
        Column("compensation", "Compensation"),
        Column("regime", "Regime"),
        Column("state", "Loop"),
        Column("crossover", "Crossover", "rad/s", "rad/s", reason=COMPUTED()),
        Column("phase", "Phase margin", "rad", "deg", reason=COMPUTED()),
        Column("gain", "Gain margin (dB)", reason=COMPUTED()),
        Column("growth", "Fastest pole (1/s)", reason=COMPUTED()),
    )
    kinds = set(sides.values())
    note = in_axis_terms(NOTE, kinds.pop() if len(kinds) == 1 else BOTH_ROTARY)
    table = Table("low-margins", "Loops with little margin", columns, tuple(rows), note=note)
    return table, problems


def _trials_of(
    run: RunReader, test: str, benches: dict[str, Bench]
) -> Iterator[tuple[int, Task, Bench]]:
    for item in run.trials_of(test):
        trial = item.trial
        key = canonical_json(trial.bench)
        if key not in benches:
            benches[key] = bench_of(trial)
        yield trial.number, trial.task, benches[key]


def _row(use: LoopUse) -> dict[str, Any]:
    margins, stable = use.margins, use.margins.stable
    mode = in_axis_terms(" (torque command)") if use.mode == "torque" else ""
    return {
        "trial": use.trial,
        "compensation": use.compensation,
        "regime": use.regime + mode,
        "state": "low margin" if stable else "unstable",
        "crossover": margins.crossover,
        "phase": margins.phase_margin if stable else None,
        "gain": margins.gain_margin_db if stable else None,
        "growth": margins.growth,
    }
