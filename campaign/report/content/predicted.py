"""Identified and found: each test's findings beside what its bench file states of them.

A bench file says how well its numbers are known, `campaign identify` writes that: then a later run
shows whether the rig, its friction above all, still is what it was. Only where samples do not come
from that very bench: of hardware, of recordings, and of a simulated truth.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from campaign.access.analysis import AnalysedTest
from campaign.archive import RunReader
from campaign.axis_kind import speaking_of
from campaign.estimate import Estimate
from campaign.experiments.interface import bench_of
from campaign.identification.difference import Difference, difference_of
from campaign.identification.trends.family import RATE, adjusted
from campaign.physics.bench import Bench
from campaign.physics.stated_values import stated_value
from campaign.physics.true_values import QUANTITIES
from campaign.report.content.truth import SIMULATED, conditions_text, is_of, says_again
from campaign.report.content.written_units import TestUnits, units_of
from campaign.result import Cell, Column, Finding, Table, Value
from campaign.text import number, quantity_words
from campaign.trial import Trial

CHANGED, SAME = "changed", "no change shown"
NAMED = 3
"""Most changes that one sentence names."""


@dataclass(frozen=True)
class _Pair:
    """What a bench states, what a test found of it, and whether others say the same."""

    finding: Finding
    stated: Estimate
    difference: Difference
    again: str

    @property
    def p(self) -> float | None:
        return None if self.again else self.difference.p


def predicted_tables(run: RunReader, tests: Iterable[AnalysedTest]) -> dict[str, Table]:
    """By test, what it found of the numbers that its bench file states with an interval."""
    tests = tuple(tests)
    pairs: dict[str, list[_Pair]] = {}
    origins: dict[str, str] = {}
    for test in tests:
        trials = [each.trial for each in test.trials if _measured(run, each.trial)]
        bench = _bench(trials[0]) if trials else None
        if bench is not None and bench.known.values:
            with speaking_of(test.sides):
                pairs[test.name] = list(_pairs(test.result.findings, trials))
            origins[test.name] = _origin(bench)
    family = [pair.p for own in pairs.values() for pair in own if pair.p is not None]
    judged = iter(adjusted(family))
    units = units_of(tests, run.header) if any(pairs.values()) else {}
    found = {}
    for name, own in pairs.items():
        p_values = [math.nan if pair.p is None else next(judged) for pair in own]
        if own:
            found[name] = _table(own, p_values, units[name], origins[name])
    return found


def _measured(run: RunReader, trial: Trial) -> bool:
    return run.header.backend != SIMULATED or bool(trial.truth)


def _bench(trial: Trial) -> Bench | None:
    try:
        return bench_of(trial)
    except (LookupError, ValidationError, ValueError):
        return None


def _origin(bench: Bench) -> str:
    known = bench.known.identified
    if known is None:
        return "Stated by the bench file."
    return f"Stated by the bench file, which has it from {known.run} ({known.command})."


def _pairs(findings: Sequence[Finding], trials: Sequence[Trial]) -> Iterator[_Pair]:
    known = [each for each in findings if each.quantity in QUANTITIES and not each.recomputed]
    means = {_place(each) for each in known if each.conditions.get("statistic") == "mean"}
    # Of repeated measurements the mean, which tells a smaller change than any of them.
    known = [each for each in known if _place(each, "mean") not in means or _place(each) in means]
    for finding in known:
        own = [trial for trial in trials if is_of(trial, finding)]
        # What a test changes of a bench makes another one, of which nothing is stated.
        bench = _bench(own[0]) if own else None
        if bench is None or any(trial.bench != own[0].bench for trial in own[1:]):
            continue
        stated = stated_value(bench, finding.quantity, finding.conditions, finding.unit)
        if stated is not None:
            compared = difference_of(stated, finding.known)
            yield _Pair(finding, stated, compared, says_again(finding, known))


def _place(finding: Finding, statistic: str = "") -> tuple[Value, ...]:
    """Quantity, direction and statistic of a number, or of another statistic of it."""
    conditions = finding.conditions
    told = statistic or conditions.get("statistic")
    return finding.quantity, conditions.get("direction"), told


def _table(pairs: Sequence[_Pair], judged: Sequence[float], units: TestUnits, origin: str) -> Table:
    rows = [_row(pair, p, units) for pair, p in zip(pairs, judged, strict=True)]
    told = (told_of_changes(rows) or "None of these numbers can be tested").rstrip(".")
    return Table(
        key="identified",
        title="Identified before, and found now",
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("identified", "Identified"),
            Column("found", "Found"),
            Column("difference", "Difference"),
            Column("change", "Change", "", "percent"),
            Column("verdict", "Verdict"),
        ),
        rows=tuple(rows),
        note=(
            f"{told}. {origin} A change is declared where at most {RATE:.0%} of all that this "
            "report declares are expected to be false (Benjamini and Hochberg); what both share, "
            "such as a torque constant, counts twice, so that small changes go unseen."
        ),
    )


def _row(pair: _Pair, p: float, units: TestUnits) -> Mapping[str, Cell]:
    verdict = "" if math.isnan(p) else CHANGED if p <= RATE else SAME
    change = pair.difference.change
    return {
        "quantity": quantity_words(pair.finding.quantity),
        "conditions": conditions_text(pair.finding.conditions, units),
        "unit": pair.finding.unit,
        "identified": pair.stated,
        "found": pair.finding.known,
        "difference": pair.difference.difference,
        "change": change,
        "verdict": verdict or pair.again or pair.difference.reason,
    }


def told_of_changes(rows: Sequence[Mapping[str, Cell]]) -> str:
    """Which numbers have changed, or that none has; "" where nothing could be tested."""
    changed = [row for row in rows if row["verdict"] == CHANGED]
    tested = len(changed) + sum(row["verdict"] == SAME for row in rows)
    if not tested:
        return ""
    if not changed:
        one = tested == 1
        return (
            f"{tested} {'number does' if one else 'numbers do'} not differ from what was"
            " identified, as far as the intervals show"
        )
    named = "; ".join(_told(row) for row in changed[:NAMED])
    more = f"; {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    return f"{len(changed)} of {tested} numbers changed since they were identified: {named}{more}"


def _told(row: Mapping[str, Cell]) -> str:
    change = row["change"]
    words = f"{row['quantity']} ({row['conditions']})" if row["conditions"] else row["quantity"]
    if not isinstance(change, Estimate) or math.isnan(change.value):
        return str(words)
    ends = [None if end is None else 100.0 * end for end in change.combined]
    size = f"{words} by {_signed(100.0 * change.value)} %"
    low, high = (None if end is None else _signed(end) for end in ends)
    return size if None in (low, high) or low == high else f"{size} ({low} to {high} %)"


def _signed(value: float) -> str:
    return f"{'+' if value > 0 else ''}{number(value, 2)}"
