"""Identification of a rig: every suitable model, and changes against a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from campaign.axis_kind import axis_terms
from campaign.entry_points import one_line
from campaign.errors import Problem, ProtocolError, UsageError, explain_in_debug
from campaign.estimate import Origin
from campaign.estimation.gate import TOO_WIDE
from campaign.experiments.analysis import result_of, suitable
from campaign.experiments.interface import (
    Experiment,
    Model,
    TestData,
    bench_of,
    no_progress,
    say_at,
)
from campaign.identify.material import ChosenRun, same_recordings
from campaign.parameter import NOTHING_IDENTIFIED, IdentifiedRig, Parameter
from campaign.physics.bench import Bench
from campaign.protocol.files import Typed
from campaign.protocol.overrides import parse_overrides
from campaign.protocol.problems import find_faults
from campaign.references.verdict import JudgedNumber, with_verdicts
from campaign.result import Result

FRICTION = "friction."
WHOLE = {"appendage": ("inertia", "frequency", "damping_ratio")}
"""Tables of a bench file that need all of these keys."""


@dataclass(frozen=True)
class Section:
    """Result of one model's analysis of the run.

    Attributes:
        trials: numbers of the trials that the model can use.
        result: None if the analysis has none; `problem` then states why.
        changes: against the compared run; empty without one.
    """

    experiment: Experiment
    options: Any
    trials: tuple[int, ...] = ()
    result: Result | None = None
    problem: str = ""
    changes: tuple[JudgedNumber, ...] = ()

    @property
    def model(self) -> Model:
        """Model of the experiment."""
        return self.experiment.model

    @property
    def identified(self) -> IdentifiedRig:
        """Identified rig; `NOTHING_IDENTIFIED` without a result."""
        return self.result.identified if self.result is not None else NOTHING_IDENTIFIED


@dataclass(frozen=True)
class Identification:
    """Results of all models; numbers in terms of the bench's axis.

    Attributes:
        chosen, validation, compared: runs, each with its selected trials.
        bench: stated bench of the rig.
        sections: one for each model; those without a result last.
    """

    chosen: ChosenRun
    validation: ChosenRun | None
    compared: ChosenRun | None
    bench: Bench
    sections: tuple[Section, ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Parameters of all sections."""
        return tuple(parameter for own in self.sections for parameter in own.identified.parameters)


def identify(
    chosen: ChosenRun,
    known: Mapping[str, Experiment],
    *,
    models: Sequence[str] = (),
    validation: ChosenRun | None = None,
    compared: ChosenRun | None = None,
    settings: Sequence[str] = (),
    say: Callable[[str], None] = no_progress,
) -> Identification:
    """Identify the rig of a run.

    Args:
        models: names of models; empty: all models that can use the trials.
        settings: `METHOD.option=value`, as for `--set`.
        say: reports progress.

    Raises UsageError for unknown models, for trials of several benches, and for a run that is
    compared with itself. Raises ProtocolError for invalid settings.
    """
    unknown = [name for name in models if name not in known]
    if unknown:
        raise UsageError(f"--model {unknown[0]!r}: there are {', '.join(known)}")
    for option, other in (("--validate", validation), ("--compare", compared)):
        if other is not None:
            _refuse_same(chosen, other, option)
    bench = _bench(chosen)
    given = _options(settings, known, bench)
    sections = []
    names = list(models or known)
    for number, name in enumerate(names, 1):
        say_of = partial(say_at, say, f"method {number} of {len(names)}")
        section = _section(known[name], given[name], bench, chosen, validation, say_of)
        if compared is not None and section.result is not None:
            section = _compared(section, bench, compared, say_of)
        sections.append(section)
    sections.sort(key=lambda each: each.result is None)
    return Identification(chosen, validation, compared, bench, tuple(_judged(sections)))


def _refuse_same(chosen: ChosenRun, other: ChosenRun, option: str) -> None:
    """Raise UsageError if the two runs share trials or recordings."""
    both, what = [], "trials that the model is fitted to"
    if chosen.run.identity == other.run.identity:
        own = {each.trial.number for each in chosen.trials}
        both = sorted(own & {each.trial.number for each in other.trials})
    if not both:
        both = same_recordings(chosen, other)
        what = f"the same samples as {chosen.name} in trials"
    if both:
        numbers = ", ".join(str(number) for number in both[:5]) + (" ..." if len(both) > 5 else "")
        raise UsageError(
            f"{option}: {other.name} has {what} ({numbers}), so that it "
            "says nothing; name another run, or another test of this one, as in RUN:TEST"
        )


def _bench(chosen: ChosenRun) -> Bench:
    tests: dict[str, dict[str, None]] = {}
    for each in chosen.trials:
        tests.setdefault(str(each.trial.bench.get("name", "")), {})[each.trial.test] = None
    if len(tests) > 1:
        listing = "; ".join(f"{bench}: {', '.join(own)}" for bench, own in tests.items())
        first = next(iter(next(iter(tests.values()))))
        raise UsageError(
            f"{chosen.name} has tests of several benches ({listing}); name one, as in "
            f"{chosen.run.name}:{first}"
        )
    return bench_of(chosen.trials[0].trial)


def _options(
    settings: Sequence[str], known: Mapping[str, Experiment], bench: Bench
) -> dict[str, Any]:
    """Validated options by method, in the units of the bench's axis."""
    overrides, problems = parse_overrides(settings)
    trees: dict[str, dict[str, Any]] = {name: {} for name in known}
    texts: dict[str, str] = {}
    for override in overrides:
        name, *keys = override.keys
        if name not in known or len(keys) != 1:
            message = f"write METHOD.option=value; methods are {', '.join(known)}"
            problems.append(override.origin.problem((), "key", message))
            continue
        trees[str(name)][str(keys[0])] = override.value
        texts[str(name)] = override.text
    options: dict[str, Any] = {}
    with axis_terms(bench.sides):
        for name, tree in trees.items():
            result = find_faults(known[name].model.options, tree)
            if isinstance(result, list):
                problems += list(_placed(result, texts.get(name, name)))
            else:
                options[name] = result
    if problems:
        raise ProtocolError(problems)
    return options


def _placed(faults: Sequence[tuple[Any, Any, str]], text: str) -> Iterator[Problem]:
    for keys, _, message in faults:
        at = Typed(f"--set {text}")
        yield at.problem((), "value", f"{'.'.join(map(str, keys))}: {message}")


def _section(
    experiment: Experiment,
    options: Any,
    bench: Bench,
    chosen: ChosenRun,
    validation: ChosenRun | None,
    say: Callable[[str], None],
) -> Section:
    progress = f"{experiment.model.name}, {chosen.name}"
    say(progress)
    trials, why = suitable(experiment, chosen.trials)
    if not trials:
        return Section(experiment, options, problem=why)
    numbers = tuple(each.trial.number for each in trials)
    unseen = validation.trials if validation is not None else ()
    data = TestData(
        chosen.test,
        experiment.name,
        {},
        tuple(trials),
        options,
        unseen,
        lambda text: say(f"{progress}: {text}"),
    )
    try:
        result = result_of(experiment, data)
    except ValueError as error:
        return Section(experiment, options, numbers, problem=str(error))
    except ArithmeticError as error:  # e.g. overflow from extreme samples
        explain_in_debug()
        problem = f"it failed: {one_line(error)}"
        return Section(experiment, options, numbers, problem=problem)
    if not result.identified.parameters:
        problem = "; ".join(note.rstrip(".") for note in result.notes) or "nothing is identified"
        return Section(experiment, options, numbers, problem=problem)
    return Section(experiment, options, numbers, _with_place(result, bench))


def fitted_again(
    section: Section, bench: Bench, chosen: ChosenRun, say: Callable[[str], None] = no_progress
) -> Section:
    """Fit the model that a section selected to other trials of the same rig."""
    options = section.options.model_copy(update=dict(section.identified.again))
    return _section(section.experiment, options, bench, chosen, None, say)


def _with_place(result: Result, bench: Bench) -> Result:
    """Result without keys of the bench file for parameters that the bench cannot hold."""
    notes = list(result.notes)
    identified = _with_own_friction(result.identified, bench, notes)
    identified = _with_whole_tables(identified, bench, notes)
    return replace(result, identified=identified, notes=tuple(notes))


def _with_whole_tables(found: IdentifiedRig, bench: Bench, notes: list[str]) -> IdentifiedRig:
    """Drop keys of a table that the bench lacks and that would stay incomplete."""
    filled = {each.bench for each in found.parameters if each.estimate.origin is Origin.MEASURED}
    for table, keys in WHOLE.items():
        needed = {f"{table}.{key}" for key in keys}
        missing = sorted(needed - filled)
        if not needed & filled or not missing or getattr(bench, table) is not None:
            continue
        what = f"Without {', '.join(missing)} there is no [{table}] to write"
        notes.append(f"{what}: the file gets none of it.")
        parameters = (
            replace(each, bench="") if each.bench in needed else each for each in found.parameters
        )
        found = replace(found, parameters=tuple(parameters))
    return found


def _with_own_friction(found: IdentifiedRig, bench: Bench, notes: list[str]) -> IdentifiedRig:
    """Set the `lumped` keys of friction; with several interfaces, drop its keys of the bench.

    Estimated friction is the sum of all interfaces. Only compensations have a model of that sum.
    """
    found = replace(found, parameters=tuple(map(_lumped, found.parameters)))
    others = [name for name in bench.friction if name != "load"]
    if not others or not any(each.bench.startswith(FRICTION) for each in found.parameters):
        return found
    notes.append(
        f"Friction is that of all interfaces together, and the bench has some besides the load's "
        f"({', '.join(others)}): of the bench file it goes to compensations only."
    )
    return replace(
        found,
        parameters=tuple(
            replace(each, bench="") if each.bench.startswith(FRICTION) else each
            for each in found.parameters
        ),
        settings={k: v for k, v in found.settings.items() if not k.startswith(FRICTION)},
    )


def _lumped(parameter: Parameter) -> Parameter:
    key = parameter.bench.removeprefix(f"{FRICTION}load.")
    return parameter if key == parameter.bench else replace(parameter, lumped=key)


def _compared(
    section: Section,
    bench: Bench,
    compared: ChosenRun,
    say: Callable[[str], None],
) -> Section:
    """Section with the changes of its parameters to another run, by the same model."""
    other = fitted_again(section, bench, compared, say)
    if other.result is None:
        return replace(section, problem=f"{compared.name}: {other.problem}")
    after = {each.estimate.name: each.estimate for each in other.identified.parameters}
    changes = (
        JudgedNumber.of(
            each.estimate,
            after[each.estimate.name],
            # The systematic parts that both runs of one rig share.
            shared=[part.source for part in each.estimate.systematic if part.of_rig],
            quantity=each.estimate.name,
            conditions={},
        )
        for each in section.identified.parameters
        if each.estimate.name in after
    )
    return replace(section, changes=tuple(changes))


def _judged(sections: Sequence[Section]) -> Iterator[Section]:
    """Sections with verdicts; the changes of all sections are one family."""
    verdicts = iter(with_verdicts([change for each in sections for change in each.changes]))
    for each in sections:
        yield replace(each, changes=tuple(next(verdicts) for _ in each.changes))


def widest(parameters: Sequence[Parameter]) -> Parameter | None:
    """Parameter with the widest interval relative to its value; None without any interval.

    Skips parameters whose interval includes zero: they may not exist. Skips parameters that are
    not determined for another reason than their interval.
    """
    shares: Mapping[int, float] = {
        index: share
        for index, each in enumerate(parameters)
        if each.estimate.value != 0.0
        and (each.estimate.origin is Origin.MEASURED or each.estimate.reason in TOO_WIDE)
        and (share := abs(each.estimate.half_width / each.estimate.value)) < 1.0
    }
    return parameters[max(shares, key=lambda index: shares[index])] if shares else None
