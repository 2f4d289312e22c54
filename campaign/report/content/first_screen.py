"""The first screen: status, verdict, key numbers, leading figure, problems."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.api.analysis import AnalysedTest
from campaign.api.conclusion_sentences import is_decided, remarks, sentence, told_with_intervals
from campaign.archive import RunReader
from campaign.archive.reading.damage import Damage
from campaign.axis_kind import axis_terms
from campaign.published.headline import LIMITS, NOBODY_FITTED, headline
from campaign.published.scoreboard import Scoreboard
from campaign.report.content.key_numbers import KeyNumbers, key_numbers
from campaign.report.content.references import References
from campaign.report.content.run_problems import wrong_with
from campaign.report.content.truth import COUNTED, biases, held
from campaign.report.content.written_units import units_of
from campaign.result import Factor, Figure, Result, Table

FROM = {
    "simulation": "simulated",
    "hardware": "measured on hardware",
    "recording": "from recordings",
}
MANY = 6
"""Most tests whose answers stand on top in full; of more, that many are chosen, and have a sentence
each: nobody reads twenty answers in a minute."""

CLOSE = (5, 10)
"""Percent of the published value that the first screen counts by, two of `LIMITS`."""
INTERVALS = (
    "± and brackets behind a number: 95 % interval, systematic parts of known size included."
)


@dataclass(frozen=True)
class Answer:
    """What one test comes to, in sentences; `figure` is the key of its most telling figure.

    Attributes:
        remarks: what the numbers of the sentences do not say: no interval, or not all of it.
        first_remarks: those on the first sentence.
        truth: how many intervals hold what is true of the bench that was simulated, and what is
            off alike in all of them; "" unknown.
        prediction: which numbers are not what its bench file states any more; "" untested.
        references: the same of each file of reference values.
        problem: why there is nothing to say, or not all of it.
        kind: of experiment, as people read it: `velocity map`.
    """

    test: str
    title: str
    sentences: tuple[str, ...]
    figure: str = ""
    remarks: tuple[str, ...] = ()
    truth: str = ""
    prediction: str = ""
    problem: str = ""
    kind: str = ""
    first_remarks: tuple[str, ...] = ()
    references: tuple[str, ...] = ()


@dataclass(frozen=True)
class Short:
    """Answers by the first sentence of each; `remarks` are what several remark, and of which."""

    answers: tuple[Answer, ...]
    remarks: tuple[str, ...] = ()


@dataclass(frozen=True)
class FirstScreen:
    """What stands on top of the page.

    Attributes:
        answers: per test, in the protocol's order.
        main: of many tests, those whose first sentence stands on top; empty where all answers do.
        telling: test and key of the one figure that is shown there; None without any.
        wrong: sentences on what went wrong: failed, interrupted, damaged, not analysed.
        asked: what was executed, on which bench, in a sentence.
        compared: how many published values were reproduced; "" where none was compared.
        intervals: what ± and brackets say; "" where no sentence has any.
        held: how many intervals of all tests hold the true values; "" unknown.
        key_numbers: what the main tests, or all where there are few, say first.
    """

    answers: tuple[Answer, ...]
    telling: tuple[str, str] | None = None
    wrong: tuple[str, ...] = ()
    asked: str = ""
    compared: str = ""
    main: tuple[str, ...] = ()
    intervals: str = ""
    held: str = ""
    key_numbers: tuple[KeyNumbers, ...] = ()

    @property
    def in_short(self) -> Short:
        """The main tests, or all where they are few, by the first sentence of each."""
        return _in_short([each for each in self.answers if not self.main or each.test in self.main])

    @property
    def in_words(self) -> tuple[Answer, ...]:
        """Those of them that say no key number."""
        told = {each.test for each in self.key_numbers}
        return tuple(each for each in self.in_short.answers if each.test not in told)


def opening_of(
    run: RunReader,
    tests: Sequence[AnalysedTest],
    scoreboard: Scoreboard,
    truths: Mapping[str, Table],
    references: References,
    damaged: Sequence[Damage] = (),
) -> FirstScreen:
    """The opening of a run's report; `damaged` is all damage that the report met."""
    main = _main(tests)
    shown = [test for test in tests if not main or test.name in main]
    return FirstScreen(
        tuple(_answer(test, truths.get(test.name), references) for test in tests),
        leading_figure(tests),
        (*wrong_with(run, tests, damaged), *_without_stated(tests)),
        _asked(run, tests),
        _compared(scoreboard),
        main,
        INTERVALS if any(map(_tells, tests)) else "",
        held([row for table in truths.values() for row in table.rows if COUNTED in row]),
        key_numbers(shown, units_of(tests, run.header), scoreboard, truths),
    )


def _main(tests: Sequence[AnalysedTest]) -> tuple[str, ...]:
    """Of many tests one of each of the kinds that tell most, in the protocol's order.

    A test tells as much as it says numbers with an interval: what a computation without noise comes
    to is known to all digits, and of nothing but itself. Of a kind it is the first of those whose
    first sentence tells most, as only that is shown.
    """
    if len(tests) <= MANY:
        return ()
    kinds: dict[str, list[AnalysedTest]] = {}
    for test in tests:
        if test.result.conclusions and not test.problem:
            kinds.setdefault(test.kind, []).append(test)
    most = sorted(kinds.values(), key=lambda own: max(map(_tells, own)), reverse=True)[:MANY]
    chosen = [max(own, key=lambda test: _tells(test, 1)).name for own in most]
    return tuple(test.name for test in tests if test.name in chosen)


def _tells(test: AnalysedTest, sentences: int | None = None) -> int:
    """How many numbers with an interval a test says; of its first `sentences`, or of all."""
    return sum(map(told_with_intervals, test.result.conclusions[:sentences]))


def _in_short(chosen: Sequence[Answer]) -> Short:
    titles: dict[str, list[str]] = {}
    for each in chosen:
        for remark in each.first_remarks:
            titles.setdefault(remark, []).append(each.title)
    shared = {remark: own for remark, own in titles.items() if len(own) > 1}
    answers = (
        replace(
            each,
            sentences=each.sentences[:1],
            remarks=tuple(r for r in each.first_remarks if r not in shared),
        )
        for each in chosen
    )
    told = (
        f"Of {'each of these' if len(own) == len(chosen) else '; '.join(own)}: {remark}"
        for remark, own in shared.items()
    )
    return Short(tuple(answers), tuple(told))


def _answer(test: AnalysedTest, truth: Table | None, references: References) -> Answer:
    result = test.result
    said = tuple(sentence(each) for each in result.conclusions)
    figure = most_telling(result)
    stated, files = references.stated.get(test.name), references.files.get(test.name, ())
    with axis_terms(test.sides):
        every, first = (
            tuple(remarks(each)) for each in (result.conclusions, result.conclusions[:1])
        )
        true = "" if truth is None else _held(truth)
    return Answer(
        test.name,
        test.title,
        said,
        "" if figure is None else figure.key,
        every,
        true,
        "" if stated is None else stated.told,
        test.problem or ("" if said else _nothing(test)),
        test.kind.replace("_", " "),
        first,
        tuple(each.told for each in files if each.told),
    )


def _nothing(test: AnalysedTest) -> str:
    """Why there is no sentence, though the analysis went through."""
    if test.trials and len(test.failed) == len(test.trials):
        return f"none of its {len(test.trials)} executed trials completed"
    if test.result.findings or test.result.tables:
        return "its analysis says no sentence; tables and figures have what it found"
    return "; ".join(note.rstrip(".") for note in test.result.notes[:1]) or "nothing was found"


def _held(truth: Table) -> str:
    """How many intervals hold the true value, and which quantities are off all the same."""
    told = held(truth.rows)
    return "; ".join((*([f"{told} of the simulated bench"] if told else []), *biases(truth.rows)))


# The figure on top --------------------------------------------------------------------------------


def leading_figure(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the figure on top of the page; None without any."""
    main = _main(tests)
    shown = [test for test in tests if not main or test.name in main]
    return _stated(tests) or _telling(shown) or _telling(tests)


def most_telling(result: Result) -> Figure | None:
    """The most telling figure of a result; None without any."""
    named = (figure for figure in result.figures if figure.key == result.telling)
    return next(named, next(iter(result.figures), None))


def _stated(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the figure that the protocol puts on top; None where it names none."""
    named = ((test, test.leading_figure) for test in tests)
    there = ((t.name, key) for t, key in named if any(f.key == key for f in t.result.figures))
    return next(there, None)


def _without_stated(tests: Sequence[AnalysedTest]) -> Iterator[str]:
    for test in tests:
        keys = [figure.key for figure in test.result.figures]
        if test.leading_figure and test.leading_figure not in keys and keys:
            yield (
                f"{test.title} has no figure '{test.leading_figure}', which the protocol puts on "
                f"top of the page; it has {', '.join(keys)}."
            )


def _telling(tests: Sequence[AnalysedTest]) -> tuple[str, str] | None:
    """Test and key of the figure that tells most.

    One that draws intervals goes before one that does not; then the one whose test says most: how
    many ratios the data decide. Of equal ones the first of the protocol.
    """
    found = [(test, figure) for test in tests if (figure := most_telling(test.result)) is not None]
    if not found:
        return None
    test, figure = max(found, key=lambda pair: (_has_intervals(pair[1]), _decided(pair[0].result)))
    return test.name, figure.key


def _has_intervals(figure: Figure) -> bool:
    curves = (curve for panel in figure.panels for curve in panel.curves)
    return any(curve.low is not None or curve.high is not None for curve in curves)


def _decided(result: Result) -> int:
    parts = (part for conclusion in result.conclusions for part in conclusion.parts)
    return sum(isinstance(part, Factor) and is_decided(part) for part in parts)


# What was asked, and what others found ------------------------------------------------------------


def _asked(run: RunReader, tests: Sequence[AnalysedTest]) -> str:
    """`What was asked: 3 tests of 35 trials on the bench platform, simulated.`"""
    if not tests:
        return "No test was asked for."
    trials, count = len(run.plan), "1 test" if len(tests) == 1 else f"{len(tests)} tests"
    benches = list(dict.fromkeys(test.bench.name for test in tests if test.bench))
    words = [f"What was asked: {count} of {trials} {'trial' if trials == 1 else 'trials'}"]
    if benches:
        names = " and ".join(filter(None, (", ".join(benches[:-1]), benches[-1])))
        words.append(f" on the {'bench' if len(benches) == 1 else 'benches'} {names}")
    source = FROM.get(next((test.source for test in tests if test.source), ""), "")
    words.append(f", {source}" if source else "")
    if run.header.truth.plants:
        words.append("; plan and analysis did not know the bench that was simulated")
    if changes := run.header.overrides:
        told = (f"{path} = {value}" for path, value in sorted(changes.items()))
        words.append(f". Changed on the command line: {', '.join(told)}")
    return "".join(words) + "."


def _compared(scoreboard: Scoreboard) -> str:
    """How many published values are reproduced; those not fitted apart from the others."""
    found = headline(scoreboard)
    if not found.compared:
        return ""
    free = [count for count in found.counts if count.status in NOBODY_FITTED]
    others = [count for count in found.counts if count.status not in NOBODY_FITTED]
    shares = [
        f"{sum(each.good for each in counts)} of {sum(each.compared for each in counts)} {which}"
        for counts, which in ((free, "that were not fitted"), (others, "others" if free else ""))
        if counts
    ]
    what = "published value was" if found.compared == 1 else "published values were"
    fitted = "" if free else ", none of which is a prediction"
    near = [
        f"{sum(each.within[LIMITS.index(limit)] for each in found.counts)} within {limit} %"
        for limit in CLOSE
    ]
    numbers = sum(each.numbers for each in found.counts)
    close = f" Of {numbers} numbers {' and '.join(near)}." if numbers else ""
    return f"{found.compared} {what} compared: reproduced are {' and '.join(shares)}".rstrip() + (
        f"{fitted}.{close}"
    )
