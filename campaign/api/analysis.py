"""Analysis of each test of an archived run, and its entries in the scoreboard."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from pydantic import ValidationError

from campaign.archive.layout.journal import RunResumed, TrialFinished
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.archive.reading.damage import Damage
from campaign.archive.reading.damage_words import hidden_trials, lost_trials, of_test
from campaign.archive.reading.run_reader import RunReader
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
"""Source of samples by backend, for archives that do not state it."""
MOVES_NOTHING = ("name", "description", "limits")
"""Tables and fields of a bench that may change within a run: they do not affect the motion."""
NOT_EXECUTED = "none of its trials was executed"
NOT_READABLE = "none of its trials can be read"
GONE_ON = "the run was gone on with on a changed bench"
MEASURE_ANEW = "; `campaign report --measure-anew` gives one: it does not use archived metrics"


@dataclass(frozen=True)
class AnalysedTest:
    """One test of a run with its result.

    Attributes:
        title: heading on the page.
        reproduces: published tables that it reproduces.
        options: normalized (SI), before the sweep.
        trials: readable executed trials in plan order, failed ones included.
        experiment: None for an unknown kind or an unusable package.
        bench: None without a valid bench of a readable trial.
        problem: why there is no result, in one line; empty when there is one.
        damaged: damage of its trials; `trials` has no unreadable ones.
        source: source of its samples: `simulation`, `hardware`, `recording`; "" unknown.
        provenance: whether its trials ran on the described bench.
        calibration: uncertainty of its numbers from the calibration of the bench.
        group: heading of the contents for it and the tests after it.
        leading_figure: key of the figure at the top of the page; "" for an automatic choice.
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
        """Kinds of motion of its bench; both rotary without a bench."""
        return self.bench.sides if self.bench else BOTH_ROTARY

    @property
    def failed(self) -> tuple[ArchivedTrial, ...]:
        return tuple(t for t in self.trials if t.ending.outcome is not Outcome.COMPLETED)

    @property
    def lacks_result(self) -> bool:
        """Whether measurements completed, but the analysis has no result."""
        done = any(each.is_completed_measurement for each in self.trials)
        kind = self.experiment
        measures = kind is not None and (kind.measure is not None or bool(kind.model.name))
        wanted = measures or bool(self.result.left_out)
        return done and (bool(self.problem) or (wanted and self.result.is_empty))

    @property
    def account(self) -> tuple[str, ...]:
        """Notes on trials that the analysis leaves out, or on the reason for no result."""
        notes = notes_on(self.result.left_out, len(self.trials))
        texts = tuple(in_axis_terms(note, self.sides) for note in notes)
        if texts or self.problem or not self.lacks_result:
            return texts
        return (f"no result: {' '.join(self.result.notes) or 'nothing was found'}",)

    def evidence(self) -> Evidence:
        """Evidence of the test for the scoreboard."""
        evidence = evidence_of(
            self.name,
            self.reproduces,
            self.result.findings,
            self.bench,
            source=self.source,
            provenance=self.provenance,
        )
        failed = bool(self.problem or self.damaged)
        return replace(evidence, failed=failed, calibration=self.calibration)


@dataclass(frozen=True)
class TestAnalysis:
    """Result of the analysis of one test.

    Attributes:
        trials: numbers of the analyzed trials: all readable ones.
        problem: why there is no result, in one line; empty when there is one.
        damaged: damage of the other trials.
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
    """Analyze every test of a run, in the protocol's order; a failed analysis is one problem.

    Args:
        measure_anew: measure the recordings again instead of using archived metrics.
        found: available analyses by test.
    """
    known = {} if found is None else found  # looked up test by test: it may still be filled
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
    """Damage of a run that its reader and its analyses detected."""
    detected = (damage for test in tests for damage in test.damaged)
    return tuple(dict.fromkeys((*run.damaged, *detected)))


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
    """Text of an error without traceback; for invalid options, that of the first one."""
    if isinstance(error, ValidationError):
        return str(error.errors(include_url=False)[0]["msg"])[:600]
    lines = str(error).strip().splitlines()
    text = lines[0] if lines else "no message"
    return f"{type(error).__name__}: {text}"[:300]


def find(
    run: RunReader, test: Tree, experiments: Mapping[str, Experiment], *, measure_anew: bool
) -> TestAnalysis:
    """Analyze one test; see `analyse_run`."""
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
    """Whether trials of a test are unreadable, or it is unknown whether trials were executed."""
    lost = lost_trials(run)
    planned = {each.number for each in run.plan if each.test == test}
    return bool(hidden_trials(run)) or any(not planned or number in planned for number in lost)


def source_of(run: RunReader) -> str:
    """Source of a run's samples: `simulation`, `hardware`, `recording`; "" unknown."""
    return run.header.source or FORMER_SOURCES.get(run.header.backend, "")


def run_title(run: RunReader) -> str:
    """Title of a run: title or name of its protocol, else the run's name."""
    header = run.header
    return title_of(header.title or header.protocol_name or header.name, source_of(run))


def title_of(title: str, source: str) -> str:
    """Title of a protocol; adds `(simulated)` to one with "hardware" if a simulation executed it.

    A protocol is for a bench and does not depend on the backend.
    """
    words = title.lower()
    claims = "hardware" in words and not any(word in words for word in ("simulat", "virtual"))
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
    """Bench tree of a test from the protocol, with `--set` and without the sweep."""
    tests = run.header.normalised.get("tests")
    for tree in tests if isinstance(tests, list) else []:
        if isinstance(tree, dict) and tree.get("name") == test:
            bench = tree.get("bench")
            return bench if isinstance(bench, dict) else None
    return None


def _gone_on(run: RunReader, test: str) -> str:
    """`GONE_ON` if trials of a test were executed after a change of its bench; else "".

    Changes accepted by one resume last until the next, which compares with the beginning again.
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
    """Whether a change, as from `execution.resume.differences`, affects a test's bench.

    For a bench of several tests, a change names only the first; any test may be one of the others.
    """
    path, others, _ = change.partition(": ")[0].partition(" (and in ")
    name, *keys = path.split(".")
    if keys[:1] == ["matrix"]:
        keys = keys[1:]
    moves = keys[:1] == ["bench"] and "".join(keys[1:2]) not in MOVES_NOTHING
    return moves and (name == test or bool(others))


def _experiment(kind: str, experiments: Mapping[str, Experiment]) -> tuple[Experiment | None, str]:
    """The experiment, or the reason why its package is unusable; None and "" if unknown."""
    try:
        return experiments.get(kind), ""
    except UsageError as error:
        return None, str(error)


def _result(
    data: TestData, experiment: Experiment | None, anew: TestData | None
) -> tuple[Result, str]:
    """The result, or why there is none; `anew`: the data without archived metrics, if any."""
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
    """Whether an analysis of the data, executed here, has a result."""
    if data is None:
        return False
    try:
        return not result_of(experiment, data).is_empty
    except (Exception, SystemExit):  # noqa: BLE001 - as above
        return False


def _bench(trials: tuple[ArchivedTrial, ...]) -> Bench | None:
    """Bench of the first measurement, else of the first trial: no finding is from a warm-up."""
    measured = (each for each in trials if each.trial.role is Role.MEASUREMENT)
    first = next(measured, trials[0] if trials else None)
    try:
        return None if first is None else bench_of(first.trial)
    except ValueError:
        return None
