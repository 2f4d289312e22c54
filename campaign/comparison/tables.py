"""Tables and texts of pairs for page, CSV and terminal."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from campaign.api.analysis import AnalysedTest
from campaign.api.quantity_words import axis_quantity_name, condition_words
from campaign.comparison.circumstances import Change
from campaign.comparison.draws import common_draws
from campaign.comparison.finding_pairs import Pair
from campaign.comparison.run_comparison import Against, size_of
from campaign.estimate import Estimate
from campaign.estimation.difference import in_unit
from campaign.reason import Reason
from campaign.references.verdict import Verdict
from campaign.result import Cell, Column, Finding, Table
from campaign.text import count, interval, pretty_unit


def pair_table(key: str, title: str, pairs: Iterable[Pair], letters: tuple[str, str]) -> Table:
    """Table with one row per pair, each in its own unit."""
    reference, other = letters
    return Table(
        key,
        title,
        (
            Column("test", "Test"),
            Column("finding", "Finding"),
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("reference", reference),
            Column("other", other),
            Column("difference", f"{other} − {reference}"),
            Column("change", "Change", "", "percent"),
            Column("p", "p, adjusted", exact=True),
            Column("verdict", "Verdict"),
            Column("reason", "Why not judged"),
        ),
        tuple(_row(pair) for pair in pairs),
    )


def shorter(table: Table, *names: str) -> Table:
    """Table without the named columns."""
    return replace(table, columns=tuple(c for c in table.columns if c.name not in names))


def alone_table(against: Against) -> Table | None:
    """Table of findings that only one run has; None without any."""
    rows: list[Mapping[str, Cell]] = []
    reference, other = against.reference.letter, against.other.letter
    for tested in against.pairing.tests:
        rows += _alone(reference, tested.reference, tested.only_reference)
        rows += _alone(other, tested.other, tested.only_other)
    for letter, tests in (
        (reference, against.pairing.only_reference),
        (other, against.pairing.only_other),
    ):
        for test in tests:
            rows += _alone(letter, test, test.result.findings) or [_no_finding(letter, test)]
    if not rows:
        return None
    return Table(
        "only-in-one",
        "Found in one run only",
        (
            Column("run", "Run"),
            Column("test", "Test"),
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("value", "Value"),
            Column("unit", "Unit"),
        ),
        tuple(rows),
    )


def changes_table(changes: Sequence[Change], letters: tuple[str, str]) -> Table:
    """Table of the differences other than results, one row per field."""
    return Table(
        "circumstances",
        "What differs between the runs besides",
        (
            Column("where", "Where"),
            Column("path", "Field"),
            Column("reference", letters[0]),
            Column("other", letters[1]),
        ),
        tuple(
            {"where": c.where, "path": c.path, "reference": c.reference, "other": c.other}
            for c in changes
        ),
    )


def not_judged(pairs: Iterable[Pair]) -> Iterator[str]:
    """Reasons for no verdict with their counts (`counted`)."""
    return counted(pair.reason for pair in pairs if pair.verdict is Verdict.NOT_JUDGED)


def counted(reasons: Iterable[Reason]) -> Iterator[str]:
    """Reasons with their counts, as `12: ...`, the most frequent first."""
    return (f"{count}: {text}" for text, count in Counter(map(str, reasons)).most_common())


def name_of(pair: Pair) -> str:
    """Name of a pair: `coulomb torque, direction positive`."""
    words = condition_words(pair.test, pair.conditions)
    name = axis_quantity_name(pair.test, pair.quantity)
    return f"{name}, {words}" if words else name


def number_of(estimate: Estimate, unit: str) -> str:
    """Text of an estimate in a unit, without the unit."""
    shown = in_unit(estimate, unit)
    low, high = shown.combined
    if shown.is_bound:
        sign, end = ("≥", low) if shown.kind == "at least" else ("≤", high)
        return f"{sign} {interval(end, None, None)}"
    return interval(shown.value, low, high)


def change_of(pair: Pair) -> str:
    """Text of a change: `+10.0 % (8.9 to 11.1 %)`, a bound, or `–` for none.

    If the relative change is undefined: the difference in its unit.
    """
    change = pair.found.change
    value, low, high = (
        None if end is None else 100 * end for end in (change.value, *change.combined)
    )
    if change.is_bound:
        return f"{number_of(change, 'percent')} %"
    if math.isnan(change.value):
        return _difference_of(pair)
    text = interval(value, low, high)
    if text == "–":
        return text
    sign = "+" if value is not None and value > 0 else ""
    return f"{sign}{text} %"


def _difference_of(pair: Pair) -> str:
    difference = pair.found.difference
    text = number_of(difference, pair.display)
    if math.isnan(difference.value) or text == "–":
        return "–"
    sign = "+" if difference.value > 0 and not difference.is_bound else ""
    return f"{sign}{text} {pretty_unit(pair.display)}".rstrip()


def headline(pair: Pair) -> str:
    """Sentence on a declared pair, without a period."""
    unit = pretty_unit(pair.display)
    numbers = [number_of(each, pair.display) for each in (pair.reference, pair.other)]
    return f"{name_of(pair)}: {change_of(pair)}, from {numbers[0]} to {numbers[1]} {unit}".rstrip()


def sentences(against: Against, tested: int) -> Iterator[str]:
    """Sentences that summarize the comparison with one run. `tested`: size of the family."""
    pairs, judged = against.pairs, against.tested
    if against.equal:
        yield f"Equal: all {len(pairs)} numbers are the same to the last digit."
    yield from common_draws(against.pairing)
    if against.equal:
        return
    common = count(len(pairs), "number is", "numbers are")
    yield f"{common} found in both runs, {judged} of which can be tested."
    different = len(against.of(Verdict.DIFFERENT))
    if different:
        numbers = count(different, "is", "are")
        yield (
            f"{numbers} declared different: at most 5 % of what is declared so is expected to be"
            f" false (Benjamini and Hochberg over {tested} tests)."
        )
    elif judged:
        yield (
            "No difference is shown. That does not say that there is none: each interval says"
            " how large it may still be."
        )
    bounds = len(against.of(Verdict.BEYOND_BOUND))
    if bounds:
        yield f"{count(bounds, 'more lies', 'more lie')} beyond a bound; no test is made of that."
    bare = against.without_interval
    if bare:
        equal = len(bare) - len(bare_differing(against))
        yield (
            f"Of {len(bare)} simulated without an interval {count(equal, 'is', 'are')} equal to the"
            " last digit."
        )


def bare_differing(against: Against) -> tuple[Pair, ...]:
    """Different simulated numbers without an interval, the largest change first."""
    differing = [pair for pair in against.without_interval if pair.found.difference.value]
    return tuple(sorted(differing, key=size_of, reverse=True))


def bench_lines(against: Against) -> Iterator[str]:
    """Differences of benches and truths: `map: bench: inertia: 1 kg·m² -> 2 kg·m²`."""
    for change in against.changes:
        if change.where.endswith((": bench", ": truth")):
            path = f" {change.path}:" if change.path else ""
            yield f"{change.where}:{path} {change.reference} -> {change.other}"


def _row(pair: Pair) -> Mapping[str, Cell]:
    comparison = pair.found
    return {
        "test": pair.test.name,
        "finding": name_of(pair),
        "quantity": pair.quantity,
        "conditions": condition_words(pair.test, pair.conditions),
        "unit": pretty_unit(pair.display),
        "reference": in_unit(pair.reference, pair.display),
        "other": in_unit(pair.other, pair.display),
        "difference": in_unit(comparison.difference, pair.display),
        "change": comparison.change,
        "p": pair.adjusted,
        "verdict": str(pair.verdict),
        "reason": str(pair.reason),
    }


def _alone(
    letter: str, test: AnalysedTest, findings: Iterable[Finding]
) -> list[Mapping[str, Cell]]:
    return [
        {
            "run": letter,
            "test": test.name,
            "quantity": axis_quantity_name(test, finding.quantity),
            "conditions": condition_words(test, finding.conditions),
            "value": finding.known,
            "unit": pretty_unit(finding.unit),
        }
        for finding in findings
    ]


def _no_finding(letter: str, test: AnalysedTest) -> Mapping[str, Cell]:
    return {
        "run": letter,
        "test": test.name,
        "quantity": f"no finding of {test.kind}",
        "conditions": "",
        "value": None,
        "unit": "",
    }
