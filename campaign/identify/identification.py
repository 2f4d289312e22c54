"""Identification of a rig: every suitable model, and changes against a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from campaign.axis_kind import axis_terms
from campaign.entry_points import one_line
from campaign.errors import Problem, ProtocolError, UsageError, explain_in_debug
from campaign.estimate import Estimate, Origin
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
"""Tables that a bench has with all of these keys, or not at all."""


@dataclass(frozen=True)
class Section:
    """What one model's analysis found of the run.

    Attributes:
        trials: numbers of those that suit it.
        result: None where there is none, and `problem` says why.
        changes: against the run that it is compared with; empty without any.
    """

    experiment: Experiment
    options: Any
    trials: tuple[int, ...] = ()
    result: Result | None = None
    problem: str = ""
    changes: tuple[JudgedNumber, ...] = ()

    @property
    def model(self) -> Model:
        """What the analysis is called here."""
        return self.experiment.model

    @property
    def identified(self) -> IdentifiedRig:
        """Of a section without a result, nothing."""
        return self.result.identified if self.result is not None else NOTHING_IDENTIFIED


@dataclass(frozen=True)
class Identification:
    """All that was found; numbers are of the bench's axis.

    Attributes:
        chosen, validation, compared: which trials of which runs.
        bench: what was stated of the rig.
        sections: one for each model, those that found nothing last.
    """

    chosen: ChosenRun
    validation: ChosenRun | None
    compared: ChosenRun | None
    bench: Bench
    sections: tuple[Section, ...]

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """All of them."""
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
        models: names of models; none: all that the trials suffice for.
        settings: `METHOD.option=value`, as for `--set`.
        say: is told what is being done.

    Raises UsageError for unknown models, for trials of several benches and for a run that would
    be held against itself, and ProtocolError for settings that are wrong.
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
    """Raises UsageError where recordings would be held against themselves."""
    both, what = [], "trials that the model is fitted to"
    if chosen.run.identity == other.run.identity:
        own = {each.trial.number for each in chosen.trials}
        both = sorted(own & {each.trial.number for each in other.trials})
    if not both:
        both = same_recordings(chosen, other)
        what = f"the same samples as {chosen.name} in trials"
    if both:
        told = ", ".join(str(number) for number in both[:5]) + (" ..." if len(both) > 5 else "")
        raise UsageError(
            f"{option}: {other.name} has {what} ({told}), so that it "
            "says nothing; name another run, or another test of this one, as in RUN:TEST"
        )


def _bench(chosen: ChosenRun) -> Bench:
    tests: dict[str, dict[str, None]] = {}
    for each in chosen.trials:
        tests.setdefault(str(each.trial.bench.get("name", "")), {})[each.trial.test] = None
    if len(tests) > 1:
        told = "; ".join(f"{bench}: {', '.join(own)}" for bench, own in tests.items())
        first = next(iter(next(iter(tests.values()))))
        raise UsageError(
            f"{chosen.name} has tests of several benches ({told}); name one, as in "
            f"{chosen.run.name}:{first}"
        )
    return bench_of(chosen.trials[0].trial)


def _options(
    settings: Sequence[str], known: Mapping[str, Experiment], bench: Bench
) -> dict[str, Any]:
    """Each method's options, validated; in the units of the bench's axis."""
    overrides, problems = parse_overrides(settings)
    trees: dict[str, dict[str, Any]] = {name: {} for name in known}
    texts: dict[str, str] = {}
    for override in overrides:
        name, *keys = override.keys
        if name not in known or len(keys) != 1:
            told = f"write METHOD.option=value; methods are {', '.join(known)}"
            problems.append(override.origin.problem((), "key", told))
            continue
        trees[str(name)][str(keys[0])] = override.value
        texts[str(name)] = override.text
    found: dict[str, Any] = {}
    with axis_terms(bench.sides):
        for name, tree in trees.items():
            made = find_faults(known[name].model.options, tree)
            if isinstance(made, list):
                problems += list(_placed(made, texts.get(name, name)))
            else:
                found[name] = made
    if problems:
        raise ProtocolError(problems)
    return found


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
    told = f"{experiment.model.name}, {chosen.name}"
    say(told)
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
        lambda text: say(f"{told}: {text}"),
    )
    try:
        found = result_of(experiment, data)
    except ValueError as error:
        return Section(experiment, options, numbers, problem=str(error))
    except ArithmeticError as error:  # numbers of these recordings that no float holds
        explain_in_debug()
        problem = f"it failed: {one_line(error)}"
        return Section(experiment, options, numbers, problem=problem)
    if not found.identified.parameters:
        problem = "; ".join(note.rstrip(".") for note in found.notes) or "nothing is identified"
        return Section(experiment, options, numbers, problem=problem)
    return Section(experiment, options, numbers, _with_place(found, bench))


def fitted_again(
    section: Section, bench: Bench, chosen: ChosenRun, say: Callable[[str], None] = no_progress
) -> Section:
    """The model that a section settled on, fitted to other trials of the same rig."""
    options = section.options.model_copy(update=dict(section.identified.again))
    return _section(section.experiment, options, bench, chosen, None, say)


def _with_place(result: Result, bench: Bench) -> Result:
    """As found, without a place in the bench file for what makes no bench there."""
    notes = list(result.notes)
    found = _with_own_friction(result.identified, bench, notes)
    found = _with_whole_tables(found, bench, notes)
    return replace(result, identified=found, notes=tuple(notes))


def _with_whole_tables(found: IdentifiedRig, bench: Bench, notes: list[str]) -> IdentifiedRig:
    """Without keys of a table that the bench has not, and that would lack others."""
    told = {each.bench for each in found.parameters if each.estimate.origin is Origin.MEASURED}
    for table, keys in WHOLE.items():
        needed = {f"{table}.{key}" for key in keys}
        missing = sorted(needed - told)
        if not needed & told or not missing or getattr(bench, table) is not None:
            continue
        what = f"Without {', '.join(missing)} there is no [{table}] to write"
        notes.append(f"{what}: the file gets none of it.")
        parameters = (
            replace(each, bench="") if each.bench in needed else each for each in found.parameters
        )
        found = replace(found, parameters=tuple(parameters))
    return found


def _with_own_friction(found: IdentifiedRig, bench: Bench, notes: list[str]) -> IdentifiedRig:
    """Friction of all interfaces together is that of none: it goes to no bench with several.

    What compensates it has a model of all together, and takes it.
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
    """The same model of another run, and how its parameters differ."""
    other = fitted_again(section, bench, compared, say)
    if other.result is None:
        return replace(section, problem=f"{compared.name}: {other.problem}")
    after = {each.estimate.name: each.estimate for each in other.identified.parameters}
    changes = (
        JudgedNumber.of(
            each.estimate,
            after[each.estimate.name],
            shared=_shared(each.estimate),
            quantity=each.estimate.name,
            conditions={},
        )
        for each in section.identified.parameters
        if each.estimate.name in after
    )
    return replace(section, changes=tuple(changes))


def _shared(estimate: Estimate) -> list[str]:
    """What is the same for both runs of one rig."""
    return [part.source for part in estimate.systematic if part.of_rig]


def _judged(sections: Sequence[Section]) -> Iterator[Section]:
    """With verdicts on all changes as one family."""
    verdicts = iter(with_verdicts([change for each in sections for change in each.changes]))
    for each in sections:
        yield replace(each, changes=tuple(next(verdicts) for _ in each.changes))


def widest(parameters: Sequence[Parameter]) -> Parameter | None:
    """The parameter whose interval is widest as a share of it; None where none has any.

    One whose interval holds zero is not known to be there at all, and is not asked for; nor is one
    that is not determined for another reason than its interval.
    """
    shares: Mapping[int, float] = {
        index: share
        for index, each in enumerate(parameters)
        if each.estimate.value != 0.0
        and (each.estimate.origin is Origin.MEASURED or each.estimate.reason in TOO_WIDE)
        and (share := abs(each.estimate.half_width / each.estimate.value)) < 1.0
    }
    return parameters[max(shares, key=lambda index: shares[index])] if shares else None
