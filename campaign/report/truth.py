"""True, found, interval: each test's findings beside the bench that its samples came from.

Only where that bench is known: of a run on `sim`. The report opens the truth when every analysis
is done; no analysis is given it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from pydantic import ValidationError

from campaign.archive import RunReader
from campaign.estimate import Estimate
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.physics.true_values import QUANTITIES, true_value
from campaign.physics.truth import simulated
from campaign.physics.variation import as_it_is, of_its_day
from campaign.report.analysis import AnalysedTest
from campaign.report.text import number
from campaign.result import Cell, Column, Finding, Table, Value
from campaign.trial import Tree, Trial, canonical_json

SIMULATED = "sim"


def truth_tables(run: RunReader, tests: Iterable[AnalysedTest]) -> dict[str, Table]:
    """By test, what it found of the parameters of the bench that was simulated."""
    if run.header.backend != SIMULATED:
        return {}
    found = ((test.name, _table(test, run.header.truth.plants)) for test in tests)
    return {name: table for name, table in found if table is not None}


@dataclass
class _Benches:
    """The bench that each trial was simulated on, made once for each that is different."""

    plants: Mapping[str, Tree]
    known: dict[tuple[str, str], Bench | None] = field(default_factory=dict)
    by_number: dict[int, Bench | None] = field(default_factory=dict)

    def of(self, trial: Trial) -> Bench | None:
        """On its day; None where the archive does not say any more, or nobody here knows it."""
        if trial.number not in self.by_number:
            key = (trial.truth, canonical_json(trial.bench))
            if key not in self.known:
                made = self._made(trial)
                self.known[key] = None if made is None else of_its_day(made)
            self.by_number[trial.number] = self.known[key]
        return self.by_number[trial.number]

    def own(self, trial: Trial) -> Bench | None:
        """As it was in this very trial, whose friction scatters."""
        made = self._made(trial)
        return None if made is None else as_it_is(made, trial.seed)

    def _made(self, trial: Trial) -> Bench | None:
        try:
            stated = bench_of(trial)
            return simulated(self.plants[trial.truth], stated) if trial.truth else stated
        except (LookupError, ValidationError, ValueError):
            return None


def _table(test: AnalysedTest, plants: Mapping[str, Tree]) -> Table | None:
    benches = _Benches(plants)
    trials = [archived.trial for archived in test.trials]
    rows = [
        row
        for finding in test.result.findings
        if finding.quantity in QUANTITIES
        and not finding.recomputed
        and (row := _row(finding, trials, benches)) is not None
    ]
    if not rows:
        return None
    inside = [row["inside"] for row in rows if row["inside"] != ""]
    note = (
        f"{inside.count('yes')} of {len(inside)} intervals hold the true value."
        if inside
        else "None of these numbers has an interval."
    )
    if any(trial.truth for trial in trials):
        note += " Plan and analysis were given the stated bench, not this one."
    return Table(
        key="truth",
        title="True and found",
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("true", "True", exact=True),
            Column("found", "Found"),
            Column("inside", "In the interval"),
        ),
        rows=tuple(rows),
        note=note,
    )


def _row(finding: Finding, trials: Sequence[Trial], benches: _Benches) -> Mapping[str, Cell] | None:
    """Quantity, true value and estimate; None where the bench has no such number, or several."""
    true = set(_true_values(finding, trials, benches))
    if len(true) != 1 or None in true:
        return None
    value = true.pop()
    estimate = finding.known
    return {
        "quantity": finding.quantity.replace("_", " "),
        "conditions": _conditions(finding.conditions),
        "unit": finding.unit,
        "true": value,
        "found": estimate,
        "inside": _inside(estimate, value),
    }


def _true_values(
    finding: Finding, trials: Sequence[Trial], benches: _Benches
) -> Iterator[float | None]:
    """Of each bench that a trial of the finding was executed on, on its day.

    Of a finding about one trial it is that trial's own value: friction scatters between trials.
    """
    own = [trial for trial in trials if _is_of(trial, finding)]
    found = [benches.own(own[0])] if len(own) == 1 else [benches.of(trial) for trial in own]
    for bench in {id(bench): bench for bench in found}.values():
        yield None if bench is None else true_value(bench, finding.quantity, finding.conditions)


def _is_of(trial: Trial, finding: Finding) -> bool:
    """Whether nothing of the trial's place contradicts the finding's conditions."""
    return all(
        finding.conditions[path] == value
        for path, value in trial.point.items()
        if path in finding.conditions
    )


def _conditions(conditions: Mapping[str, Value]) -> str:
    shown = (
        f"{name.replace('_', ' ')} {number(value) if isinstance(value, float) else value}"
        for name, value in conditions.items()
        if value is not None
    )
    return ", ".join(shown)


def _inside(estimate: Estimate, true: float | None) -> str:
    """Whether the combined interval holds the true value; empty where there is none."""
    if not estimate.has_interval or true is None:
        return ""
    low, high = estimate.combined
    below, above = low is not None and true < low, high is not None and true > high
    return "no" if below or above else "yes"
