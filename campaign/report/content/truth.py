"""True values, findings and intervals of simulated benches (runs on `sim` only).

The report reads the truth after all analyses; no analysis receives it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from campaign.api.analysis import AnalysedTest
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import axis_terms, in_axis_terms
from campaign.estimate import Estimate
from campaign.estimation.intervals import student
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.physics.true_values import QUANTITIES, true_of, true_value
from campaign.physics.truth import simulated
from campaign.physics.variation import as_it_is, of_its_day
from campaign.report.content.written_units import TestUnits
from campaign.result import Cell, Column, Finding, Table, Value, allow
from campaign.text import capitalized, number, path_words, quantity_words
from campaign.trial import Tree, Trial, canonical_json

Row = Mapping[str, Cell]
Array = NDArray[np.float64]
SIMULATED = "sim"
FEWEST = 3
"""Minimum number of estimates of a quantity for the test for bias."""
SURE = 0.995
"""Level of that test: one of 200 unbiased quantities is declared biased."""
NEGLIGIBLE = 0.5
"""Bias in percent of the true value below which it is not reported."""
MEANS = ("nominal", "both")
"""Directions of a mean of the positive and the negative direction."""
EXPONENT, FREE = "exponent", "free"
"""Condition of a parameter, and its value for a fit with a free Stribeck exponent."""
COUNTED = "counted"
"""Key of a row, not a cell: False for a number that repeats others of the table."""


def truth_tables(
    run: RunReader, tests: Iterable[AnalysedTest], units: Mapping[str, TestUnits]
) -> dict[str, Table]:
    """Table of true values and estimates of the simulated bench, by test."""
    if run.header.backend != SIMULATED:
        return {}
    plants = run.header.truth.plants
    tables = {}
    for test in tests:
        with axis_terms(test.sides):
            tables[test.name] = _table(test, plants, units[test.name])
    return {name: table for name, table in tables.items() if table is not None}


@dataclass
class Benches:
    """Cache of the benches on which trials were simulated."""

    plants: Mapping[str, Tree]
    known: dict[tuple[str, str], Bench | None] = field(default_factory=dict)
    by_number: dict[int, Bench | None] = field(default_factory=dict)

    def of(self, trial: Trial) -> Bench | None:
        """Bench of a trial on its day; None if the archive lacks it or it is invalid here."""
        if trial.number not in self.by_number:
            key = (trial.truth, canonical_json(trial.bench))
            if key not in self.known:
                made = self._made(trial)
                self.known[key] = None if made is None else of_its_day(made)
            self.by_number[trial.number] = self.known[key]
        return self.by_number[trial.number]

    def own(self, trial: Trial) -> Bench | None:
        """Bench with the scattered friction of this trial; None as for `of`."""
        made = self._made(trial)
        return None if made is None else as_it_is(made, trial.seed)

    def _made(self, trial: Trial) -> Bench | None:
        try:
            stated = bench_of(trial)
            return simulated(self.plants[trial.truth], stated) if trial.truth else stated
        except (LookupError, ValueError):
            return None


def _table(test: AnalysedTest, plants: Mapping[str, Tree], units: TestUnits) -> Table | None:
    benches = Benches(plants)
    trials = [archived.trial for archived in test.trials]
    known = [
        finding
        for finding in test.result.findings
        if finding.quantity in QUANTITIES and not finding.recomputed
    ]
    again = [duplicate_of(finding, known) for finding in known]
    found_rows = [_row(finding, trials, benches, units) for finding in known]
    pairs = [(row, why) for row, why in zip(found_rows, again, strict=True) if row is not None]
    rows = [{**row, COUNTED: not why} for row, why in pairs]
    if not rows:
        return None
    left_out = dict.fromkeys(why for row, why in pairs if why and row["inside"] != "")
    note = held(rows) or "None of these numbers has an interval"
    note += f"; {' and '.join(left_out)} are not counted." if left_out else "."
    note += "".join(f" {capitalized(each)}." for each in biases(rows))
    if any(trial.truth for trial in trials):
        note += " Plan and analysis were given the stated bench, not this one."
    return Table(
        key="truth",
        title="True and estimated values",
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("true", "True", exact=True),
            *([Column("of", "Applies to")] if any(row["of"] for row in rows) else []),
            Column("found", "Found"),
            Column("inside", "True value in the interval"),
        ),
        rows=tuple(rows),
        note=note,
    )


def held(rows: Sequence[Row]) -> str:
    """Count of intervals that contain the true value; "" without intervals.

    Means of counted numbers, and further fits of the same points, do not count.
    """
    inside = [row["inside"] for row in rows if row[COUNTED] and row["inside"] != ""]
    if not inside:
        return ""
    values = "value" if len(inside) == 1 else "values"
    return f"{inside.count('yes')} of {len(inside)} intervals hold the true {values}"


def biases(rows: Sequence[Row]) -> Iterator[str]:
    """Sentence on each biased quantity: size of the bias and largest systematic part.

    The test is Student's t of the relative deviations of the single numbers. A count of wide
    intervals that contain the true value does not show such a bias.
    """
    for quantity in dict.fromkeys(str(row["quantity"]) for row in rows):
        own = [row for row in rows if row[COUNTED] and row["quantity"] == quantity]
        off = np.array([each for row in own if (each := _deviation(row)) is not None])
        if len(off) < FEWEST or abs(np.mean(off)) < NEGLIGIBLE:
            continue
        error = float(np.std(off, ddof=1)) / math.sqrt(len(off))
        if abs(np.mean(off)) > student(len(off) - 1, SURE) * error:
            yield _bias(quantity, off, _largest_part(row["found"] for row in own))


def _bias(quantity: str, off: Array, source: str) -> str:
    """Sentence such as `stiffness at rest: bias −7 to −10 % (4 of 4; exceeds scatter)`.

    Deviations of both signs: the mean and the range.
    """
    mean, low, high = float(np.mean(off)), float(np.min(off)), float(np.max(off))
    if low > 0 or high < 0:
        ends = " to ".join(signed(end) for end in sorted((low, high), key=abs))
        where = f"bias {ends} % ({len(off)} of {len(off)}; exceeds scatter)"
    else:
        ends = f"{signed(low)} to {signed(high)} %"
        where = f"bias {signed(mean)} % (mean of {len(off)}, {ends}; exceeds scatter)"
    text = f"{quantity}: {where}"
    return f"{text}; largest systematic part: {in_axis_terms(source)}" if source else text


def signed(value: float) -> str:
    """A number with its sign, as text of two digits."""
    return f"+{number(value, 2)}" if value > 0 else number(value, 2)


def _largest_part(cells: Iterable[Cell]) -> str:
    """Source of the largest systematic part of the estimates; "" without any."""
    parts = (part for cell in cells if isinstance(cell, Estimate) for part in cell.systematic)
    known = [(part.standard_uncertainty or 0.0, part.source) for part in parts]
    size, source = max(known, default=(0.0, ""))
    return source if size else ""


def _deviation(row: Row) -> float | None:
    """Estimate minus true value, in percent of the true value; None for a one-sided bound."""
    estimate, true = row["found"], row["true"]
    if not isinstance(estimate, Estimate) or not isinstance(true, float) or not true:
        return None
    if estimate.is_bound:
        return None
    return None if math.isnan(estimate.value) else 100.0 * (estimate.value - true) / abs(true)


def _is_mean(finding: Finding) -> bool:
    """Whether a finding is the mean of several numbers, by its conditions."""
    conditions = finding.conditions
    return conditions.get("statistic") == "mean" or conditions.get("direction") in MEANS


def duplicate_of(finding: Finding, others: Sequence[Finding]) -> str:
    """Kind of duplicate of other findings of the same quantity; "" if it is no duplicate."""
    beside = [each for each in others if each.quantity == finding.quantity]
    if _is_mean(finding) and not all(map(_is_mean, beside)):
        return "means of others"
    free = {**finding.conditions, EXPONENT: FREE}
    if finding.conditions != free and any(each.conditions == free for each in beside):
        return "fits of the same points with the exponent held"
    return ""


def _row(
    finding: Finding, trials: Sequence[Trial], benches: Benches, units: TestUnits
) -> Mapping[str, Cell] | None:
    """Row of true value and estimate; None if the benches have no single true value."""
    own = list(_benches_of(finding, trials, benches))
    true = {
        None if bench is None else true_value(bench, finding.quantity, finding.conditions)
        for bench in own
    }
    if len(true) != 1 or None in true:
        return None
    value = true.pop()
    estimate = finding.known
    return {
        "quantity": quantity_words(finding.quantity),
        "conditions": conditions_text(finding.conditions, units),
        "unit": finding.unit,
        "true": value,
        "of": "; ".join(dict.fromkeys(true_of(b, finding.quantity) for b in own if b is not None)),
        "found": estimate,
        "inside": inside(estimate, value),
    }


def _benches_of(
    finding: Finding, trials: Sequence[Trial], benches: Benches
) -> Iterator[Bench | None]:
    """Each bench on which a trial of the finding was executed, on its day.

    For a finding of one trial, it is that trial's own bench: friction scatters between trials.
    """
    own = [trial for trial in trials if allow(finding.conditions, trial.point)]
    used = [benches.own(own[0])] if len(own) == 1 else [benches.of(trial) for trial in own]
    yield from {id(bench): bench for bench in used}.values()


def conditions_text(conditions: Mapping[str, Value], units: TestUnits) -> str:
    """Conditions of a number as text, in the units of its test."""
    shown = (
        f"{path_words(name)} {units.value(name, value)}"
        for name, value in conditions.items()
        if value is not None
    )
    return ", ".join(shown)


def inside(estimate: Estimate, true: float | None) -> str:
    """`yes` or `no`: whether the combined interval contains the true value; "" without either."""
    if not estimate.has_interval or true is None:
        return ""
    low, high = estimate.combined
    below, above = low is not None and true < low, high is not None and true > high
    return "no" if below or above else "yes"
