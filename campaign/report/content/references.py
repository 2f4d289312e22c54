"""Stated and external reference values beside findings of each test.

A bench file states the uncertainty of its numbers (`campaign identify` writes it), so that a later
run shows whether the rig, its friction above all, has changed. This requires samples that were not
simulated with the same bench: hardware, recordings, a simulated truth. Stated values apply only to
their own bench; if a test changes that bench, nothing is compared. A file of reference values is
compared with every run. All pairs of a report are one family of decisions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.api.analysis import AnalysedTest
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate, Origin
from campaign.estimation.difference import in_unit
from campaign.estimation.family import RATE
from campaign.experiments.interface import bench_of
from campaign.physics.bench import Bench
from campaign.physics.bench_fingerprint import why_altered
from campaign.physics.stated_values import stated_value
from campaign.physics.true_values import QUANTITIES
from campaign.reason import Cause
from campaign.references.values import ReferenceValue
from campaign.references.verdict import JudgedNumber, Verdict, with_verdicts
from campaign.report.content.truth import SIMULATED, conditions_text, duplicate_of, signed
from campaign.report.content.written_units import TestUnits
from campaign.result import Cell, Column, Finding, Table, allow
from campaign.text import count, quantity_words
from campaign.trial import Trial
from campaign.units import same_dimension

NAMED = 3
"""Maximum number of changes in a sentence."""
AGAIN = Cause("said by others", "{others}")


@dataclass(frozen=True)
class Source:
    """Texts of a table on the source of reference values.

    Attributes:
        column: heading of their column.
        differ: predicate of different numbers, e.g. `differ from what the bench file states`.
        before: noun phrase for the reference in this predicate.
        said: sentence on the origin of the values.
    """

    key: str
    title: str
    column: str
    differ: str
    before: str
    said: str


@dataclass(frozen=True)
class ReferenceComparison:
    """Comparison of a source's values with the findings of a test.

    Attributes:
        told: summary without full stop; "" if nothing could be tested.
        pairs: judged pairs with their names.
    """

    table: Table
    told: str
    pairs: tuple[tuple[JudgedNumber, str], ...] = ()


@dataclass(frozen=True)
class References:
    """All comparisons of a report's tests with reference values.

    Attributes:
        stated: by test, comparison with its bench file.
        files: by test, comparison with each file of values.
        problems: sentences on rows of files without a matching finding.
    """

    stated: Mapping[str, ReferenceComparison]
    files: Mapping[str, tuple[ReferenceComparison, ...]]
    problems: tuple[str, ...]


Files = Mapping[Path, Sequence[ReferenceValue]]
Found = tuple[AnalysedTest, Source, Sequence[JudgedNumber]]


def compared_with(
    run: RunReader, tests: Iterable[AnalysedTest], units: Mapping[str, TestUnits], files: Files
) -> References:
    """Compare each test's findings with its bench file and with `files`."""
    comparisons: list[Found] = []
    for test in tests:
        with axis_terms(test.sides):
            comparisons += filter(None, [_stated(run, test)])
            comparisons += (_of_file(p, values, units[test.name]) for p, values in files.items())
    verdicts = iter(with_verdicts([pair for _, _, pairs in comparisons for pair in pairs]))
    stated: dict[str, ReferenceComparison] = {}
    others: dict[str, tuple[ReferenceComparison, ...]] = {}
    for test, source, pairs in comparisons:
        own = [next(verdicts) for _ in pairs]
        if not own:
            continue
        with axis_terms(test.sides):
            compared = _compared(own, source, units[test.name])
        if source.key == "stated":
            stated[test.name] = compared
        else:
            others[test.name] = (*others.get(test.name, ()), compared)
    return References(stated, others, tuple(_unused(units, files)))


# The bench file -----------------------------------------------------------------------------------


def _stated(run: RunReader, test: AnalysedTest) -> Found | None:
    trials = [each.trial for each in test.trials if _measured(run, each.trial)]
    bench = _bench(trials[0]) if trials else None
    if bench is None or not bench.known.values:
        return None
    findings = (each for each in test.result.findings if not each.recomputed)
    known = _to_compare([each for each in findings if each.quantity in QUANTITIES])
    pairs = []
    for finding in known:
        own = [trial for trial in trials if allow(finding.conditions, trial.point)]
        on = _bench(own[0]) if own else None
        if on is None or any(trial.bench != own[0].bench for trial in own[1:]) or why_altered(on):
            continue
        stated = stated_value(on, finding.quantity, finding.conditions, finding.unit)
        if stated is not None:
            pairs.append(_pair(stated, finding, known))
    measured = all(pair.reference.origin is Origin.MEASURED for pair in pairs)
    identified = bench.known.identified if measured else None
    if identified is None:
        before, said = "what the bench file states", "The bench file states them"
        title, column, differ = (
            "Stated and estimated",
            "Stated",
            f"differ from {before}",
        )
    else:
        before, title, column = (
            "what was identified",
            "Identified before, and estimated now",
            "Identified",
        )
        differ = "changed since they were identified"
        said = f"The bench file has them from {identified.run} ({identified.command})"
    said += (
        "; what both share, such as a torque constant, counts twice, so that small ones go unseen"
    )
    return test, Source("stated", title, column, differ, before, said), pairs


def _measured(run: RunReader, trial: Trial) -> bool:
    return run.header.backend != SIMULATED or bool(trial.truth)


def _bench(trial: Trial) -> Bench | None:
    try:
        return bench_of(trial)
    except (LookupError, ValueError):
        return None


# A file of values ---------------------------------------------------------------------------------


def _of_file(path: Path, values: Sequence[ReferenceValue], units: TestUnits) -> Found:
    own = [(value, each) for value in values for each in _to_compare(_spoken_of(value, units))]
    known = list({id(finding): finding for _, finding in own}.values())
    pairs = [_pair(in_unit(value.estimate, each.unit), each, known) for value, each in own]
    name = path.name
    title = f"Reference values of {name}, and found"
    said = f"The reference values are of {name}"
    source = Source(f"reference-{path.stem}", title, "Reference", f"differ from {name}", name, said)
    return units.test, source, pairs


def _spoken_of(value: ReferenceValue, units: TestUnits) -> list[Finding]:
    """Findings that match a row; none if a condition has a unit of another dimension."""
    for name, unit in value.units.items():
        shown = units.of(name)
        if shown is not None and not same_dimension(shown.si, unit):
            return []
    return [
        each
        for each in units.test.result.findings
        if not each.recomputed and value.speaks_of(units.test.name, each)
    ]


def _unused(units: Mapping[str, TestUnits], files: Files) -> Iterator[str]:
    """Report rows without a matching finding, so that no row is dropped silently."""
    for path, values in files.items():
        for value in values:
            if any(_spoken_of(value, own) for own in units.values()):
                continue
            row = f"{path.name}, {value.place}: "
            if value.test and value.test not in units:
                yield f"{row}there is no test {value.test}; there are {', '.join(units)}"
            else:
                yield (
                    f"{row}no test found {value.estimate.name} in "
                    f"{value.estimate.unit or 'a unit of no dimension'} under these conditions; "
                    "`findings` in report.json has all that was found, with its conditions in SI"
                )


# Both ---------------------------------------------------------------------------------------------


def _to_compare(known: Sequence[Finding]) -> list[Finding]:
    """Replace repeated measurements by their mean, which resolves smaller changes."""
    means = [each for each in known if each.conditions.get("statistic") == "mean"]
    return [each for each in known if each in means or not any(_is_in(each, m) for m in means)]


def _is_in(finding: Finding, mean: Finding) -> bool:
    """Whether a mean includes this number: the finding has all conditions of the mean."""
    where = {name: value for name, value in mean.conditions.items() if name != "statistic"}
    return finding.quantity == mean.quantity and where.items() <= finding.conditions.items()


def _pair(reference: Estimate, finding: Finding, known: Sequence[Finding]) -> JudgedNumber:
    again = duplicate_of(finding, known)
    pair = JudgedNumber.of(
        reference, finding.known, quantity=finding.quantity, conditions=finding.conditions
    )
    return pair.not_judged(AGAIN(others=again)) if again else pair


def _compared(
    pairs: Sequence[JudgedNumber], source: Source, units: TestUnits
) -> ReferenceComparison:
    summary = _told_of(pairs, source, units)
    table = Table(
        key=source.key,
        title=source.title,
        columns=(
            Column("quantity", "Quantity"),
            Column("conditions", "Conditions"),
            Column("unit", "Unit"),
            Column("stated", source.column),
            Column("found", "Found"),
            Column("difference", "Difference"),
            Column("change", "Change", "", "percent"),
            Column("verdict", "Verdict"),
        ),
        rows=tuple(_row(pair, units) for pair in pairs),
        note=(
            f"{summary or 'None of these numbers can be tested'}. {source.said}. "
            f"A difference is declared where at most {RATE:.0%} of all that this report declares "
            "are expected to be false (Benjamini and Hochberg)."
        ),
    )
    return ReferenceComparison(table, summary, tuple((pair, _name(pair, units)) for pair in pairs))


def _row(pair: JudgedNumber, units: TestUnits) -> Mapping[str, Cell]:
    return {
        "quantity": quantity_words(pair.quantity),
        "conditions": conditions_text(pair.conditions, units),
        "unit": pair.other.unit,
        "stated": pair.reference,
        "found": pair.other,
        "difference": pair.found.difference,
        "change": pair.found.change,
        "verdict": pair.outcome,
    }


def _told_of(pairs: Sequence[JudgedNumber], source: Source, units: TestUnits) -> str:
    """Summary of different numbers, or that no number differs; "" if nothing could be judged."""
    changed = [pair for pair in pairs if pair.verdict is Verdict.DIFFERENT]
    tested = sum(pair.testable for pair in pairs)
    beyond = sum(pair.verdict is Verdict.BEYOND_BOUND for pair in pairs)
    parts = []
    if changed:
        named = "; ".join(_told(pair, units) for pair in changed[:NAMED])
        more = f"; {len(changed) - NAMED} more" if len(changed) > NAMED else ""
        parts.append(f"{len(changed)} of {tested} numbers {source.differ}: {named}{more}")
    elif tested:
        numbers = count(tested, "number does", "numbers do")
        parts.append(f"{numbers} not differ from {source.before}, as far as the intervals show")
    if beyond:
        numbers = count(beyond, "number lies", "numbers lie")
        parts.append(f"{numbers} beyond a bound, of which no test is made")
    return "; ".join(parts)


def _told(pair: JudgedNumber, units: TestUnits) -> str:
    words, change = _name(pair, units), pair.found.change
    if math.isnan(change.value):
        return words
    size = f"{words} by {signed(100.0 * change.value)} %"
    low, high = (None if end is None else signed(100.0 * end) for end in change.combined)
    return size if None in (low, high) or low == high else f"{size} ({low} to {high} %)"


def _name(pair: JudgedNumber, units: TestUnits) -> str:
    where = conditions_text(pair.conditions, units)
    return f"{quantity_words(pair.quantity)} ({where})" if where else quantity_words(pair.quantity)
