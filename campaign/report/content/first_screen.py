"""The first screen: status, verdict, key numbers, leading figure, problems."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.api.analysis import AnalysedTest
from campaign.api.estimate_text import remarks, shows_interval
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import axis_terms
from campaign.experiments.shared.captions import listed
from campaign.published.headline import LIMITS, NOBODY_FITTED, headline
from campaign.published.scoreboard import Scoreboard
from campaign.report.content.key_numbers import KeyNumber, shown_key_numbers
from campaign.report.content.references import References
from campaign.report.content.run_problems import wrong_with
from campaign.report.content.truth import COUNTED, biases, held
from campaign.report.content.written_units import TestUnits
from campaign.result import Figure, Result, Table
from campaign.text import count

FROM = {
    "simulation": "simulated",
    "hardware": "measured on hardware",
    "recording": "from recordings",
}
MANY = 6
"""Most tests whose key numbers are on the first screen; of more tests, this many are selected."""
CLOSE = (5, 10)
"""Deviation limits on the first screen, in percent of the published value; two of `LIMITS`."""
INTERVALS = (
    "± and brackets behind a number: 95 % interval, systematic parts of known size included."
)
ROOM, FEWEST = 18, 2
"""Total number of key numbers on the first screen, and minimum for each test."""
ENOUGH = 4
"""Number of key numbers with an interval above which the rank does not increase."""


@dataclass(frozen=True)
class Answer:
    """Summary of one test.

    Attributes:
        where: conditions that all of its key numbers share.
        numbers: its key numbers, the most important first.
        figure: the key of its leading figure.
        remarks: missing or incomplete intervals of the numbers.
        truth: count of intervals that contain the true value of the simulated bench, and biases;
            "" if unknown.
        prediction: numbers that differ from its bench file; "" if untested.
        references: the same for each file of reference values.
        problem: why some or all numbers are missing.
    """

    test: str
    title: str
    where: str = ""
    numbers: tuple[KeyNumber, ...] = ()
    figure: str = ""
    remarks: tuple[str, ...] = ()
    truth: str = ""
    prediction: str = ""
    references: tuple[str, ...] = ()
    problem: str = ""


@dataclass(frozen=True)
class FirstScreen:
    """Top of the page.

    Attributes:
        answers: per test, in the protocol's order.
        main: of many tests, those with their numbers on top; empty if all answers are.
        telling: test and key of the leading figure; None without any.
        wrong: sentences on problems: failed, interrupted, damaged, not analyzed.
        asked: sentence on the executed tests and trials and their bench.
        compared: count of reproduced published values; "" if none was compared.
        intervals: meaning of ± and brackets; "" if no number has any.
        held: count of intervals of all tests that contain the true value; "" if unknown.
    """

    answers: tuple[Answer, ...]
    telling: tuple[str, str] | None = None
    wrong: tuple[str, ...] = ()
    asked: str = ""
    compared: str = ""
    main: tuple[str, ...] = ()
    intervals: str = ""
    held: str = ""

    @property
    def shown(self) -> tuple[Answer, ...]:
        """Answers of the main tests, or of all if few, each with its first key numbers."""
        chosen = [each for each in self.answers if not self.main or each.test in self.main]
        most = max(FEWEST, ROOM // max(1, sum(bool(each.numbers) for each in chosen)))
        return tuple(replace(each, numbers=each.numbers[:most]) for each in chosen)

    @property
    def left_out(self) -> str:
        """Sentence on key numbers that are not shown; "" if all are."""
        shown = sum(len(each.numbers) for each in self.shown)
        every = sum(len(each.numbers) for each in self.answers)
        return f"{shown} of {every}; the report's sections have all." if shown < every else ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks of the shown tests, each once with the titles of its tests."""
        shown = [each for each in self.shown if each.numbers]
        titles: dict[str, list[str]] = {}
        for each in shown:
            for remark in each.remarks:
                titles.setdefault(remark, []).append(each.title)
        return tuple(
            remark if len(own) == len(shown) else f"{'; '.join(own)}: {remark}"
            for remark, own in titles.items()
        )


def opening_of(
    run: RunReader,
    tests: Sequence[AnalysedTest],
    units: Mapping[str, TestUnits],
    scoreboard: Scoreboard,
    truths: Mapping[str, Table],
    references: References,
    damaged: Sequence[Damage],
) -> FirstScreen:
    """First screen of a run's report; `damaged` is all damage that the report detected."""
    return FirstScreen(
        tuple(
            _answer(test, truths.get(test.name), references, scoreboard, units[test.name])
            for test in tests
        ),
        leading_figure(tests),
        (*wrong_with(run, tests, damaged), *_without_stated(tests)),
        _asked(run, tests),
        _compared(scoreboard),
        _main(tests),
        INTERVALS if any(map(_tells, tests)) else "",
        held([row for table in truths.values() for row in table.rows if COUNTED in row]),
    )


def _main(tests: Sequence[AnalysedTest]) -> tuple[str, ...]:
    """Select one test of each kind, at most `MANY`, in the protocol's order; () for few tests.

    Tests that reproduce printed numbers go first, then those with more key numbers with an
    interval, up to `ENOUGH`. The exact result of a noise-free computation has no interval.
    """
    if len(tests) <= MANY:
        return ()
    by_kind: dict[str, list[tuple[tuple[bool, int], str]]] = {}
    for test in tests:
        if test.result.key_numbers and not test.problem:
            printed = any(not name.startswith("figure") for name in test.reproduces)
            rank = printed, min(ENOUGH, _tells(test))
            by_kind.setdefault(test.kind, []).append((rank, test.name))
    best = [max(own, key=lambda each: each[0]) for own in by_kind.values()]
    chosen = [name for _, name in sorted(best, key=lambda each: each[0], reverse=True)[:MANY]]
    return tuple(test.name for test in tests if test.name in chosen)


def _tells(test: AnalysedTest) -> int:
    """Number of key numbers with an interval."""
    return sum(shows_interval(each.known) for each in test.result.key_numbers)


def _answer(
    test: AnalysedTest,
    truth: Table | None,
    references: References,
    scoreboard: Scoreboard,
    units: TestUnits,
) -> Answer:
    result, figure = test.result, most_telling(test.result)
    stated, files = references.stated.get(test.name), references.files.get(test.name, ())
    where, numbers = shown_key_numbers(test, units, scoreboard.lines, truth)
    with axis_terms(test.sides):
        return Answer(
            test.name,
            test.title,
            where,
            numbers,
            "" if figure is None else figure.key,
            tuple(remarks(each.known for each in result.key_numbers)),
            "" if truth is None else _held(truth),
            "" if stated is None else stated.told,
            tuple(each.told for each in files if each.told),
            test.problem or ("" if numbers else _nothing(test)),
        )


def _nothing(test: AnalysedTest) -> str:
    """Reason why an analysis without error has an empty result; "" if it has a result."""
    if not test.result.is_empty:
        return ""
    if test.trials and len(test.failed) == len(test.trials):
        return f"none of its {len(test.trials)} executed trials completed"
    return "; ".join(note.rstrip(".") for note in test.result.notes[:1]) or "nothing was found"


def _held(truth: Table) -> str:
    """Count of intervals that contain the true value, and the biases."""
    count = held(truth.rows)
    return "; ".join((*([f"{count} of the simulated bench"] if count else []), *biases(truth.rows)))


# The figure on top --------------------------------------------------------------------------------


def leading_figure(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the leading figure; None without any."""
    main = _main(tests)
    shown = [test for test in tests if not main or test.name in main]
    return _stated(tests) or _telling(shown) or _telling(tests)


def most_telling(result: Result) -> Figure | None:
    """Figure that the result declares as leading, or else the first; None without any."""
    named = (figure for figure in result.figures if figure.key == result.telling)
    return next(named, next(iter(result.figures), None))


def _stated(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the figure that the protocol puts on top; None if it names none."""
    named = ((test, test.leading_figure) for test in tests)
    matches = ((t.name, key) for t, key in named if any(f.key == key for f in t.result.figures))
    return next(matches, None)


def _without_stated(tests: Sequence[AnalysedTest]) -> Iterator[str]:
    for test in tests:
        keys = [figure.key for figure in test.result.figures]
        if test.leading_figure and test.leading_figure not in keys and keys:
            yield (
                f"{test.title} has no figure '{test.leading_figure}', which the protocol puts on "
                f"top of the page; it has {', '.join(keys)}."
            )


def _telling(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the most informative figure.

    Figures with intervals go first, then those of tests with more key numbers with an interval.
    Among equal ones the first of the protocol wins.
    """
    figures = [
        (test, figure) for test in tests if (figure := most_telling(test.result)) is not None
    ]
    if not figures:
        return None
    test, figure = max(figures, key=lambda pair: (_has_intervals(pair[1]), _tells(pair[0])))
    return test.name, figure.key


def _has_intervals(figure: Figure) -> bool:
    curves = (curve for panel in figure.panels for curve in panel.curves)
    return any(curve.low is not None or curve.high is not None for curve in curves)


# Sentences on the run -----------------------------------------------------------------------------


def _asked(run: RunReader, tests: Sequence[AnalysedTest]) -> str:
    """Sentence such as `3 tests, 35 trials on the bench platform, simulated.`"""
    if not tests:
        return "The protocol has no test."
    benches = list(dict.fromkeys(test.bench.name for test in tests if test.bench))
    words = [f"{count(len(tests), 'test')}, {count(len(run.plan), 'trial')}"]
    if benches:
        words.append(f" on the {'bench' if len(benches) == 1 else 'benches'} {listed(benches)}")
    source = FROM.get(next((test.source for test in tests if test.source), ""), "")
    words.append(f", {source}" if source else "")
    if run.header.truth.plants:
        words.append("; the simulated bench is another one than plan and analysis use")
    if changes := run.header.overrides:
        settings = (f"{path} = {value}" for path, value in sorted(changes.items()))
        words.append(f". Changed on the command line: {', '.join(settings)}")
    return "".join(words) + "."


def _compared(scoreboard: Scoreboard) -> str:
    """Sentence on the reproduced published values; those not fitted are counted separately."""
    summary = headline(scoreboard)
    if not summary.compared:
        return ""
    free = [each for each in summary.counts if each.status in NOBODY_FITTED]
    others = [each for each in summary.counts if each.status not in NOBODY_FITTED]
    shares = [
        f"{sum(each.good for each in counts)} of {sum(each.compared for each in counts)} {which}"
        for counts, which in ((free, "not fitted"), (others, "others" if free else ""))
        if counts
    ]
    fitted = "" if free else ", none of which is a prediction"
    near = [
        f"{sum(each.within[LIMITS.index(limit)] for each in summary.counts)} within {limit} %"
        for limit in CLOSE
    ]
    numbers = sum(each.numbers for each in summary.counts)
    close = f" Of {numbers} numbers, {' and '.join(near)}." if numbers else ""
    values = count(summary.compared, "published value")
    reproduced = f"{values} compared. Reproduced: {' and '.join(shares)}".rstrip()
    return f"{reproduced}{fitted}.{close}"
