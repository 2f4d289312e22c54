"""From an archived run to results: the analysis of each test, and its scoreboard entries."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from pydantic import ValidationError

from campaign.archive import ArchivedTrial, RunReader
from campaign.archive.layout.journal import RunResumed, TrialFinished
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import hidden_trials, lost_trials, of_test
from campaign.archive.reading.sound_samples import Trials, damaged_records, without_damaged
from campaign.axis_kind import BOTH_ROTARY, Sides, in_axis_terms
from campaign.errors import ArchiveError, UsageError, explain_in_debug
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import Experiment, TestData, bench_of
from campaign.experiments.post_processing.recording_checks import notes_on
from campaign.physics.bench import Bench
from campaign.published.calibration_covariance import NOTHING, CalibrationPart, calibration_part
from campaign.published.evidence import Evidence, evidence_of
from campaign.published.provenance import NOTHING_ALTERED, Provenance, provenance_of
from campaign.published.values import Published, published_values
from campaign.recording import Outcome
from campaign.result import Result
from campaign.trial import Role, Tree

FORMER_SOURCES = {"sim": "simulation", "serial": "hardware", "replay": "recording"}
"""By backend: where samples came from when archives did not say so themselves."""
MOVES_NOTHING = ("name", "description", "limits")
"""Tables and fields of a bench that may be changed within a run: they act on no motion."""
NOT_EXECUTED = "none of its trials was executed"
NOT_READABLE = "none of its trials can be read"
GONE_ON = "the run was gone on with on a changed bench"
MEASURE_ANEW = "; `campaign report --measure-anew` gives one: it does not use archived metrics"


@dataclass(frozen=True)
class AnalysedTest:
    """One test of a run with what its analysis found.

    Attributes:
        title: heading on the page.
        reproduces: published tables it stands for.
        options: normalised (SI), before the sweep.
        trials: the executed ones that could be read, in plan order, failed ones included.
        experiment, bench: None when this program does not know the kind, or nothing was executed.
        problem: why there is no result, in one line; empty when there is one.
        damaged: what is damaged of its trials; those that cannot be read are not among `trials`.
        source: where its samples come from: `simulation`, `hardware`, `recording`; "" unknown.
        provenance: whether its trials ran on the bench that was described.
        calibration: what that of the bench leaves open of its numbers.
        group: heading under which the contents list it and those behind it.
        leading_figure: key of its figure that stands on top of the page; "" for a choice.
    """

    name: str
    kind: str
    title: str
    description: str
    reproduces: tuple[str, ...]
    options: Tree
    trials: tuple[ArchivedTrial, ...]
    experiment: Experiment | None
    bench: Bench | None
    result: Result
    problem: str = ""
    damaged: tuple[Damage, ...] = ()
    source: str = ""
    provenance: Provenance = NOTHING_ALTERED
    calibration: CalibrationPart = NOTHING
    group: str = ""
    leading_figure: str = ""

    @property
    def sides(self) -> Sides:
        """How its bench moves; of no bench as most do."""
        return self.bench.sides if self.bench else BOTH_ROTARY

    @property
    def failed(self) -> tuple[ArchivedTrial, ...]:
        return tuple(t for t in self.trials if t.ending.outcome is not Outcome.COMPLETED)

    @property
    def lacks_result(self) -> bool:
        """Whether measurements completed, and nothing was found in any of them."""
        done = any(
            each.ending.outcome is Outcome.COMPLETED and each.trial.role is Role.MEASUREMENT
            for each in self.trials
        )
        kind = self.experiment
        measures = kind is not None and (kind.measure is not None or bool(kind.model.name))
        wanted = measures or bool(self.result.left_out)
        return done and (bool(self.problem) or (wanted and self.result.is_empty))

    @property
    def account(self) -> tuple[str, ...]:
        """What an analysis that did not fail does without: trials, or any result, and why."""
        notes = notes_on(self.result.left_out, len(self.trials))
        told = tuple(in_axis_terms(note, self.sides) for note in notes)
        if told or self.problem or not self.lacks_result:
            return told
        return (f"no result: {' '.join(self.result.notes) or 'nothing was found'}",)

    def evidence(self) -> Evidence:
        """What it brings to the scoreboard."""
        found = evidence_of(
            self.name,
            self.reproduces,
            self.result.findings,
            self.bench,
            source=self.source,
            provenance=self.provenance,
        )
        failed = bool(self.problem or self.damaged)
        return replace(found, failed=failed, calibration=self.calibration)


@dataclass(frozen=True)
class TestAnalysis:
    """What the analysis of one test comes to.

    Attributes:
        trials: numbers of those that it was made of: all that could be read.
        problem: why there is no result, in one line; empty when there is one.
        damaged: what is damaged of the others.
    """

    result: Result
    trials: tuple[int, ...]
    problem: str = ""
    damaged: tuple[Damage, ...] = ()


def analyse_run(
    run: RunReader,
    experiments: Mapping[str, Experiment],
    *,
    measure_anew: bool = False,
    found: Mapping[str, TestAnalysis] | None = None,
) -> tuple[AnalysedTest, ...]:
    """Analyse every test of a run, in the protocol's order; a failing analysis is one problem.

    Args:
        measure_anew: measure the recordings by this program, whatever is archived with them.
        found: what was found already, by test.
    """
    known = {} if found is None else found  # asked test by test: the last may not be found yet
    return tuple(
        _analysed(
            run,
            test,
            experiments,
            known.get(name_of(test)) or find(run, test, experiments, measure_anew=measure_anew),
        )
        for test in run.header.tests
    )


def damage_of(run: RunReader, tests: Iterable[AnalysedTest]) -> tuple[Damage, ...]:
    """What of a run is damaged, as far as its reader and its analyses looked at it."""
    found = (damage for test in tests for damage in test.damaged)
    return tuple(dict.fromkeys((*run.damaged, *found)))


def name_of(test: Tree) -> str:
    """The name of a test of a run's header."""
    return str(test.get("name", ""))


def published_of(run: RunReader) -> Published:
    """The published values that the run's protocol compares with."""
    chosen = run.header.normalised.get("published", "thesis")
    if chosen == "none":
        return {}
    if not isinstance(chosen, str) or chosen not in run.header.sources:
        return published_values()
    return published_values(run.header.sources[chosen], chosen)


def one_line(error: BaseException) -> str:
    """An error without its traceback; of options that are not valid, the first that is wrong."""
    if isinstance(error, ValidationError):
        return str(error.errors(include_url=False)[0]["msg"])[:600]
    lines = str(error).strip().splitlines()
    text = lines[0] if lines else "no message"
    return f"{type(error).__name__}: {text}"[:300]


def find(
    run: RunReader, test: Tree, experiments: Mapping[str, Experiment], *, measure_anew: bool
) -> TestAnalysis:
    """What the analysis of one test finds in its trials; see `analyse_run`."""
    name, kind = name_of(test), str(test.get("kind", ""))
    trials = tuple(run.trials_of(name))
    if measure_anew:
        trials = tuple(trial.unmeasured() for trial in trials)
    experiment, unusable = _experiment(kind, experiments)
    data = TestData(name, kind, _options(test), trials)

    def analyse(trials: Trials) -> tuple[Result, str]:
        anew = None
        if any(trial.estimates for trial in trials):
            anew = replace(data, trials=tuple(trial.unmeasured() for trial in trials))
        return _result(replace(data, trials=trials), experiment, anew)

    try:
        with run.held_open():
            records = damaged_records(run, trials)
            (result, problem), trials, damaged = without_damaged(run.path, trials, analyse)
    except ArchiveError as error:
        result, problem, damaged = Result(), one_line(error), (Damage.of(run.path, error),)
    if problem == NOT_EXECUTED and (damaged or _has_unreadable(run, name)):
        problem = NOT_READABLE
    numbers = tuple(archived.trial.number for archived in trials)
    return TestAnalysis(result, numbers, unusable or problem, (*records, *damaged))


def _has_unreadable(run: RunReader, test: str) -> bool:
    """Whether trials of a test cannot be read, also where nobody knows if they were executed."""
    lost = lost_trials(run)
    planned = {each.number for each in run.plan if each.test == test}
    return bool(hidden_trials(run)) or any(not planned or number in planned for number in lost)


def source_of(run: RunReader) -> str:
    """Where a run's samples come from: `simulation`, `hardware`, `recording`; "" unknown."""
    return run.header.source or FORMER_SOURCES.get(run.header.backend, "")


def run_title(run: RunReader) -> str:
    """What a run is called: by its protocol, or by its name."""
    header = run.header
    return title_of(header.title or header.protocol_name or header.name, source_of(run))


def title_of(title: str, source: str) -> str:
    """A title from a protocol; one that speaks of hardware says where it was simulated.

    A protocol is written for a bench, whatever executes it.
    """
    said = title.lower()
    claims = "hardware" in said and not any(word in said for word in ("simulat", "virtual"))
    return f"{title} (simulated)" if claims and source == "simulation" else title


def _analysed(
    run: RunReader, test: Tree, experiments: Mapping[str, Experiment], found: TestAnalysis
) -> AnalysedTest:
    name, kind = name_of(test), str(test.get("kind", ""))
    reproduces, numbers = test.get("reproduces"), frozenset(found.trials)
    trials = tuple(each for each in run.trials_of(name) if each.trial.number in numbers)
    experiment, _ = _experiment(kind, experiments)
    bench = _bench(trials)
    stated = None if bench is None else bench.known.fingerprint
    damaged = tuple(damage for damage in of_test(run, name) if damage.trial)
    source = source_of(run)
    return AnalysedTest(
        name=name,
        kind=kind,
        title=title_of(str(test.get("title") or "") or name, source),
        description=str(test.get("description") or ""),
        reproduces=tuple(str(r) for r in reproduces)
        if isinstance(reproduces, list | tuple)
        else (),
        options=_options(test),
        trials=trials,
        experiment=experiment,
        bench=bench,
        result=found.result,
        problem=found.problem,
        damaged=tuple(dict.fromkeys((*damaged, *found.damaged))),
        source=source,
        provenance=provenance_of(
            (archived.trial for archived in trials),
            perturbs_bench=experiment is not None and experiment.perturbs_bench,
            described=_described(run, name),
            changed=_gone_on(run, name),
            failed={t.trial.number for t in trials if t.ending.outcome is not Outcome.COMPLETED},
        ),
        calibration=calibration_part(run.header.sources, stated.bench if stated else ""),
        group=str(test.get("group") or ""),
        leading_figure=str(test.get("leading_figure") or ""),
    )


def _options(test: Tree) -> Tree:
    options = test.get("options")
    return options if isinstance(options, dict) else {}


def _described(run: RunReader, test: str) -> Tree | None:
    """The bench of a test as the protocol has it, with `--set` and without the sweep."""
    tests = run.header.normalised.get("tests")
    for tree in tests if isinstance(tests, list) else []:
        if isinstance(tree, dict) and tree.get("name") == test:
            bench = tree.get("bench")
            return bench if isinstance(bench, dict) else None
    return None


def _gone_on(run: RunReader, test: str) -> str:
    """Why a test had two benches: trials of it were executed after its bench was changed.

    What one resume accepted lasts until the next, which is compared with the beginning again.
    """
    numbers = {each.number for each in run.outlines if each.test == test}
    changed = False
    for entry in run.story.entries:
        if isinstance(entry, RunResumed):
            changed = any(_is_of_bench(change, test) for change in entry.changes)
        elif isinstance(entry, TrialFinished) and changed and entry.trial in numbers:
            return GONE_ON
    return ""


def _is_of_bench(change: str, test: str) -> bool:
    """Whether an accepted change, as `execution.resume.differences` has it, is of a test's bench.

    Of a bench that several tests share, the first test is named; any test may be another of them.
    """
    path, others, _ = change.partition(": ")[0].partition(" (and in ")
    name, *keys = path.split(".")
    if keys[:1] == ["matrix"]:
        keys = keys[1:]
    moves = keys[:1] == ["bench"] and "".join(keys[1:2]) not in MOVES_NOTHING
    return moves and (name == test or bool(others))


def _experiment(kind: str, experiments: Mapping[str, Experiment]) -> tuple[Experiment | None, str]:
    """The experiment, or why a package that should provide it cannot."""
    try:
        return experiments.get(kind), ""
    except UsageError as error:
        return None, str(error)


def _result(
    data: TestData, experiment: Experiment | None, anew: TestData | None
) -> tuple[Result, str]:
    """The result, or why there is none; `anew`: without archived metrics, where there are any."""
    if experiment is None:
        return Result(), f"no experiment is called {data.kind!r} here; install what provides it"
    if not data.trials:
        return Result(), NOT_EXECUTED
    try:
        return result_of(experiment, data), ""
    except ArchiveError:
        raise
    except (Exception, SystemExit) as error:  # noqa: BLE001 (must not cost the other tests)
        explain_in_debug()
        hint = MEASURE_ANEW if _is_analysed(anew, experiment) else ""
        return Result(), f"the analysis failed: {one_line(error)}{hint}"


def _is_analysed(data: TestData | None, experiment: Experiment) -> bool:
    """Whether the analysis of other data finds anything: it is tried."""
    if data is None:
        return False
    try:
        return not result_of(experiment, data).is_empty
    except (Exception, SystemExit):  # noqa: BLE001 - as above
        return False


def _bench(trials: tuple[ArchivedTrial, ...]) -> Bench | None:
    """Of the first measurement: what a warm-up ran on is behind no finding."""
    measured = (each for each in trials if each.trial.role is Role.MEASUREMENT)
    first = next(measured, trials[0] if trials else None)
    try:
        return None if first is None else bench_of(first.trial)
    except ValueError:
        return None
