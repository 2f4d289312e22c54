"""Stated and found: each test's findings beside what its bench file states of them.

A bench file says how well its numbers are known, `campaign identify` writes that: then a later run
shows whether the rig, its friction above all, still is what it was. Only where samples do not come
from that very bench: of hardware, of recordings, and of a simulated truth. What is stated holds for
the bench that it was said of; where a test changes that bench, nothing is compared.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from pydantic import ValidationError

from campaign.access.analysis import AnalysedTest
from campaign.archive import RunReader
from campaign.axis_kind import speaking_of
from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import Difference, difference_of
from campaign.estimation.trends.family import RATE, adjusted
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import why_altered
from campaign.physics.stated_values import stated_value
from campaign.physics.true_values import QUANTITIES
from campaign.report.content.truth import SIMULATED, conditions_text, duplicate_of, is_of
from campaign.report.content.written_units import TestUnits, units_of
from campaign.result import Cell, Column, Finding, Table
from campaign.text import number, quantity_words
from campaign.trial import Trial

DIFFERS, SAME = "differs", "no difference shown"
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


@dataclass(frozen=True)
class Predicted:
    """What a bench file states beside what a test found, and what that comes to in a sentence.

    Attributes:
        told: without its full stop; "" where nothing could be tested.
    """

    table: Table
    told: str


def predicted(run: RunReader, tests: Iterable[AnalysedTest]) -> dict[str, Predicted]:
    """By test, what it found of the numbers that its bench file states with an interval."""
    tests = tuple(tests)
    pairs: dict[str, list[_Pair]] = {}
    origins: dict[str, str] = {}  # of what each test's bench states
    for test in tests:
        trials = [each.trial for each in test.trials if _measured(run, each.trial)]
        bench = _bench(trials[0]) if trials else None
        if bench is not None and bench.known.values:
            with speaking_of(test.sides):
                pairs[test.name] = list(_pairs(test.result.findings, trials))
            origins[test.name] = _origin(bench, pairs[test.name])
    family = [pair.p for own in pairs.values() for pair in own if pair.p is not None]
    judged = iter(adjusted(family))
    units = units_of(tests, run.header) if any(pairs.values()) else {}
    found = {}
    for name, own in pairs.items():
        p_values = [math.nan if pair.p is None else next(judged) for pair in own]
        if own:
            found[name] = _predicted(own, p_values, units[name], origins[name])
    return found


def _measured(run: RunReader, trial: Trial) -> bool:
    return run.header.backend != SIMULATED or bool(trial.truth)


def _bench(trial: Trial) -> Bench | None:
    try:
        return bench_of(trial)
    except (LookupError, ValidationError, ValueError):
        return None


def _origin(bench: Bench, pairs: Sequence[_Pair]) -> str:
    """The run that all of it was identified from; "" where the file says so of not all of it."""
    known = bench.known.identified
    measured = all(pair.stated.origin is Origin.MEASURED for pair in pairs)
    return f"{known.run} ({known.command})" if known is not None and measured else ""


def _pairs(findings: Sequence[Finding], trials: Sequence[Trial]) -> Iterator[_Pair]:
    known = [each for each in findings if each.quantity in QUANTITIES and not each.recomputed]
    means = [each for each in known if each.conditions.get("statistic") == "mean"]
    # Of repeated measurements the mean, which tells a smaller change than any of them.
    known = [each for each in known if each in means or not any(_is_in(each, m) for m in means)]
    for finding in known:
        own = [trial for trial in trials if is_of(trial, finding)]
        bench = _bench(own[0]) if own else None
        if bench is None or any(trial.bench != own[0].bench for trial in own[1:]):
            continue
        if why_altered(bench):
            continue
        stated = stated_value(bench, finding.quantity, finding.conditions, finding.unit)
        if stated is not None:
            compared = difference_of(stated, finding.known)
            yield _Pair(finding, stated, compared, duplicate_of(finding, known))


def _is_in(finding: Finding, mean: Finding) -> bool:
    """Whether a mean is of this number, too: it holds wherever all of the mean's conditions do."""
    where = {name: value for name, value in mean.conditions.items() if name != "statistic"}
    return finding.quantity == mean.quantity and where.items() <= finding.conditions.items()


def _predicted(
    pairs: Sequence[_Pair], judged: Sequence[float], units: TestUnits, origin: str
) -> Predicted:
    rows = [_row(pair, p, units) for pair, p in zip(pairs, judged, strict=True)]
    told = _told_of(rows, identified=bool(origin))
    source = f", which has them from {origin}" if origin else ""
    table = Table(
        key="stated",
        title="Identified before, and found now" if origin else "Stated by the bench, and found",
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("stated", "Identified" if origin else "Stated"),
            Column("found", "Found"),
            Column("difference", "Difference"),
            Column("change", "Change", "", "percent"),
            Column("verdict", "Verdict"),
        ),
        rows=tuple(rows),
        note=(
            f"{told or 'None of these numbers can be tested'}. The bench file states them{source}. "
            f"A difference is declared where at most {RATE:.0%} of all that this report declares "
            "are expected to be false (Benjamini and Hochberg); what both share, such as a torque "
            "constant, counts twice, so that small ones go unseen."
        ),
    )
    return Predicted(table, told)


def _row(pair: _Pair, p: float, units: TestUnits) -> Mapping[str, Cell]:
    verdict = "" if math.isnan(p) else DIFFERS if p <= RATE else SAME
    change = pair.difference.change
    return {
        "quantity": quantity_words(pair.finding.quantity),
        "conditions": conditions_text(pair.finding.conditions, units),
        "unit": pair.finding.unit,
        "stated": pair.stated,
        "found": pair.finding.known,
        "difference": pair.difference.difference,
        "change": change,
        "verdict": verdict or pair.again or str(pair.difference.reason),
    }


def _told_of(rows: Sequence[Mapping[str, Cell]], *, identified: bool) -> str:
    """Which numbers are not what was stated, or that all are; "" where nothing could be tested."""
    changed = [row for row in rows if row["verdict"] == DIFFERS]
    tested = len(changed) + sum(row["verdict"] == SAME for row in rows)
    if not tested:
        return ""
    before = "what was identified" if identified else "what the bench file states"
    if not changed:
        numbers = "1 number does" if tested == 1 else f"{tested} numbers do"
        return f"{numbers} not differ from {before}, as far as the intervals show"
    named = "; ".join(_told(row) for row in changed[:NAMED])
    more = f"; {len(changed) - NAMED} more" if len(changed) > NAMED else ""
    differ = "changed since they were identified" if identified else f"differ from {before}"
    return f"{len(changed)} of {tested} numbers {differ}: {named}{more}"


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
