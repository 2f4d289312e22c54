"""`campaign plan`: what `campaign run` would do, as text or JSON."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from campaign.archive.writing.run_names import new_run_name
from campaign.axis_kind import BOTH_ROTARY, axis_terms, sides_in
from campaign.backends.interface import Backend, ExecutesTogether, KnowsCost
from campaign.cli.damage import archive_of, say_damaged
from campaign.cli.output import (
    bytes_text,
    print_json,
    print_line,
    print_note,
    print_table,
    print_warning,
)
from campaign.cli.prepare import PreparedRun, Request, lacking, prepare
from campaign.errors import ExitCode
from campaign.experiments import experiments
from campaign.experiments.analysis import lost_without
from campaign.options import describe
from campaign.policy import Policy, Response
from campaign.protocol import (
    LimitUse,
    Plan,
    PlannedStage,
    PlannedTest,
    as_tree,
    check_limits,
    check_loops,
    low_margins,
)
from campaign.protocol.limit_check import in_display_units, in_words, one_count
from campaign.protocol.stages import most_of
from campaign.text import clock, count, shortened
from campaign.trial import Most, Role, Trial
from campaign.units import Quantity, convert

NOTES = 5
"""Most notes of a test that the text shows; the JSON has all."""
LEAST = 0.005
"""Least share of a limit for its use to be shown."""


def show_plan(request: Request, results: Path, *, as_json: bool, details: bool = False) -> ExitCode:
    """Show the plan; return ARCHIVE if the run to replay is damaged.

    details: show them also for several tests.

    Raises LimitError, after printing, if the plan exceeds a limit or is unstable.
    """
    prepared = prepare(request)
    backend = prepared.open_backend()  # checks the trials; does not connect
    source = archive_of(backend)
    losses = _losses(prepared.plan, lacking(backend, prepared.plan.trials))
    cost = costs(backend, prepared.plan)
    if as_json:
        tree = {**as_tree(prepared.plan), "backend": prepared.kind.name, "without": losses}
        print_json({**tree, "cost": {test: asdict(each) for test, each in cost.items()}})
    else:
        _print(prepared, results, losses, cost, details=details)
    code = say_damaged(source.path, source.damaged) if source else ExitCode.DONE
    check_limits(prepared.plan)
    check_loops(prepared.plan)
    print_warnings(prepared.plan)
    return code


def _losses(plan: Plan, names: Mapping[str, Sequence[str]]) -> list[dict[str, str]]:
    """Missing channels that tests could use, each with the results that need it."""
    known = experiments()
    return [
        {"test": test.name, "channel": name, "no": lost_without(known[test.kind], name)}
        for test in plan.tests
        for name in names.get(test.name, ())
    ]


def _print(
    prepared: PreparedRun,
    results: Path,
    losses: Sequence[Mapping[str, str]],
    cost: Mapping[str, Cost],
    *,
    details: bool,
) -> None:
    plan = prepared.plan
    if plan.protocol.title:
        print_line(plan.protocol.title)
    archive = results / f"{new_run_name(results, prepared.path.stem, datetime.now(UTC))}.nxs"
    print_line(
        f"{count(len(plan.trials), 'trial')}, {clock(plan.duration)} of bench time; backend "
        f"{prepared.kind.name}; output {archive}, at most {bytes_text(plan.size)}"
    )
    if (most := plan.following).trials:
        print_line(f"later stages add {in_short(most)}, in the size above")
    for line in policy_lines(plan.protocol.policy):
        print_line(line)
    unseeded = [test.name for test in plan.tests if test.order == "shuffled"]
    if unseeded:
        print_note(
            f"shuffled: {', '.join(unseeded)}; a test without `seed` draws a new seed for each run"
        )
    print_line()
    headings = ("test", "kind", "bench", "trials", "bench time", "closest limit")
    print_table(headings, [_row(test) for test in plan.tests], spare=("bench", "kind"))
    for test in plan.tests:
        own = [loss for loss in losses if loss["test"] == test.name]
        if details or len(plan.tests) == 1:
            _print_details(plan, test, own, cost.get(test.name))
        else:
            _print_needed(plan, test, own)
    if not details and len(plan.tests) > 1:
        print_line("limits, loops, chosen options and notes of each test: --details")


def in_short(most: Most) -> str:
    """Text such as `at most 14 trials, 0:42 of bench time`."""
    return f"at most {count(most.trials, 'trial')}, {clock(most.duration)} of bench time"


def stage_lines(stages: Sequence[PlannedStage]) -> Iterator[str]:
    """Lines on the later stages of a test, each over all points of its matrix."""
    for number in sorted({stage.number for stage in stages}):
        own = [stage for stage in stages if stage.number == number]
        points = f" at {len(own)} points" if len(own) > 1 else ""
        yield f"stage {number}, {own[0].name}: {in_short(most_of(own))}{points}: {own[0].why}"


def print_warnings(plan: Plan) -> None:
    """Print the warnings of experiments, and a line for each low stability margin."""
    tests: dict[str, list[str]] = {}
    for test in plan.tests:
        for line in test.warnings:
            tests.setdefault(line, []).append(test.name)
    for line, names in tests.items():
        print_warning(f"{', '.join(names)}: {line}")
    for line in low_margins(plan):
        print_warning(line)


def _by_hand(trials: Sequence[Trial]) -> Sequence[str]:
    """Lines on manual steps before trials, at each change within the test."""
    done: tuple[str, ...] = ()
    steps = []
    for trial in trials:
        if trial.setup != done:
            steps += [f"by hand before {trial.name}: {step}" for step in trial.setup]
        done = trial.setup
    return shortened(steps, NOTES, "more steps by hand; --json lists all")


KEPT = {
    "none": "none, metrics only",
    "failed": "those of failed trials",
    "extremes": "those of failed trials, and of the smallest and largest metrics of each test",
}


def policy_lines(policy: Policy) -> Iterator[str]:
    """Lines on the protocol's policy: faults, rests, kept samples."""
    if policy.faults:
        responses = (f"{name}: {_response(one)}" for name, one in policy.faults.items())
        others = () if "default" in policy.faults else ("others: skip",)
        yield f"faults: {'; '.join((*responses, *others))}"
    if policy.rest is not None:
        pause, every = clock(policy.rest.pause), clock(policy.rest.every)
        yield f"rests: {pause} after each {every} of bench time"
    if policy.keep != "all":
        yield f"samples kept: {KEPT.get(str(policy.keep), f'{policy.keep} trials of each test')}"


def _response(response: Response) -> str:
    if response.do != "retry":
        return response.do
    pause = f" after {clock(response.pause)}" if response.pause else ""
    times = "once" if response.times == 1 else f"{response.times} times"
    return f"retry {times}{pause}, then {response.then}"


def _row(test: PlannedTest) -> tuple[str, ...]:
    closest = _closest(test)[:1]
    limit = "".join(f"{use.margin.called} {use.margin.fraction:.0%}" for use in closest)
    trials = str(len(test.numbers))
    return (test.name, test.kind, test.bench, trials, clock(test.duration), limit)


def _closest(test: PlannedTest) -> list[LimitUse]:
    """Uses of the limits, the closest first; without hardly used ones after the first."""
    uses = sorted(test.closest, key=lambda use: use.margin.fraction, reverse=True)
    return [use for use in uses if use is uses[0] or use.margin.fraction >= LEAST]


def _print_needed(plan: Plan, test: PlannedTest, losses: Sequence[Mapping[str, str]]) -> None:
    """Print manual steps, missing results and later stages of a test."""
    trials = [plan.trials[number - 1] for number in test.numbers]
    lacking = (f"without {loss['channel']}: no {loss['no']}" for loss in losses)
    for line in (*_by_hand(trials), *lacking, *stage_lines(test.stages)):
        print_line(f"{test.name}: {line}")


def _print_chosen(test: PlannedTest) -> None:
    if test.chosen:
        print_line("  not stated; chosen for this bench:")
    for line in chosen_lines(test):
        print_line(f"    {line}")


def _print_details(
    plan: Plan, test: PlannedTest, losses: Sequence[Mapping[str, str]], cost: Cost | None
) -> None:
    """Print all details of a test: limits, options, loop, stages, cost, notes."""
    trials = [plan.trials[number - 1] for number in test.numbers]
    print_line(f"{test.name}{f': {test.title}' if test.title else ''}")
    warm_ups = sum(trial.role is Role.WARM_UP for trial in trials)
    if warm_ups:
        print_line(f"  {warm_ups} of the trials warm up and are not analyzed")
    checks = sum(trial.role is Role.CHECK for trial in trials)
    if checks:
        print_line(f"  {checks} of the trials check the bench for changes")
    for line in _by_hand(trials):
        print_line(f"  {line}")
    for use in _closest(test):
        value, bound = in_display_units(use.margin)
        _print_use(plan, use, f"{value} of {bound}")
    with axis_terms(sides_in(trials[0].bench) if trials else BOTH_ROTARY):
        _print_chosen(test)
    for loss in losses:
        print_line(f"  without {loss['channel']}: no {loss['no']}")
    if test.loops:
        sought = "; the experiment seeks instability" if test.seeks_instability else ""
        print_line(f"  loop: {in_words(test.loops[0])}{sought}")
    for use in test.coarse:
        _print_use(plan, use, one_count(use.margin))
    for line in stage_lines(test.stages):
        print_line(f"  {line}")
    for line in () if cost is None else cost_lines(cost):
        print_line(f"  {line}")
    noted = Counter(trial.note for trial in trials if trial.note).most_common()
    notes = [f"{count(number, 'trial')}: {note}" for note, number in noted]
    for line in shortened(notes, NOTES, "more notes; --json lists all"):
        print_line(f"  {line}")
    print_line()


def _print_use(plan: Plan, use: LimitUse, amount: str) -> None:
    """Print the used share of a limit, the amount and its trial."""
    broken = "  BROKEN" if use.margin.broken else ""
    share = f"{use.margin.fraction:4.0%} of the {use.margin.called} limit"
    print_line(f"  {share}: {amount} in {plan.trials[use.trial - 1].name}{broken}")


def chosen_lines(test: PlannedTest) -> Iterator[str]:
    """Lines on the chosen options: `settle_angle = "1 deg"`, and the reason."""
    texts = {name: as_toml(test.kind, name, test.options[name]) for name in test.chosen}
    width = max((len(f"{name} = {text}") for name, text in texts.items()), default=0)
    for name, reason in test.chosen.items():
        line = f"{name} = {texts[name]}"
        yield f"{line:<{min(width, 40)}}  {reason}"


def as_toml(kind: str, name: str, value: Any) -> str:
    """Value (SI) of an option in protocol syntax; a long list is shortened."""
    known = {info.name: info.quantity for info in describe(experiments()[kind].options)}
    quantity = known.get(name)
    quantity = quantity and quantity.here
    if isinstance(value, Sequence) and not isinstance(value, str):
        return _listed([_one(item, quantity) for item in value])
    return _one(value, quantity)


def _one(value: Any, quantity: Quantity | None) -> str:
    if isinstance(value, str) or quantity is None:
        return f'"{value}"' if isinstance(value, str) else f"{value:g}"
    return f'"{convert(value, quantity.si, quantity.display):.6g} {quantity.display}"'


def _listed(texts: Sequence[str]) -> str:
    if len(texts) <= 3:
        return f"[{', '.join(texts)}]"
    return f"[{texts[0]}, {texts[1]}, ... {texts[-1]}] ({len(texts)})"


MILLISECOND = 1e-3


@dataclass(frozen=True)
class Cost:
    """Cost of the trials of one test.

    Attributes:
        steps: total integration steps.
        shortest, longest: step (s).
        because: reason for the shortest step; empty for the longest possible one.
        of_milliseconds: steps per millisecond of bench time, on average.
        alone: count of trials executed one by one, as too few of the plan have their structure.
    """

    steps: int
    shortest: float
    longest: float
    because: str
    of_milliseconds: float
    alone: int


def costs(backend: Backend, plan: Plan) -> Mapping[str, Cost]:
    """Costs by test; empty for a backend that does not simulate."""
    if not isinstance(backend, KnowsCost):
        return {}
    like = _like(plan)
    alone = _alone(backend, like)
    known = {trial.number: backend.cost(trial) for trial in like.values()}
    by_test = {}
    for test in plan.tests:
        each = [known[like[number].number] for number in test.numbers]
        shortest = min(each, key=lambda cost: cost.step)
        steps = sum(cost.steps for cost in each)
        by_test[test.name] = Cost(
            steps=steps,
            shortest=shortest.step,
            longest=max(cost.step for cost in each),
            because=shortest.because,
            of_milliseconds=MILLISECOND * steps / sum(cost.steps * cost.step for cost in each),
            alone=sum(number in alone for number in test.numbers),
        )
    return by_test


def _like(plan: Plan) -> dict[int, Trial]:
    """First trial that differs in its seed only, by number: both have the same cost."""
    first: dict[Hashable, Trial] = {}
    return {t.number: first.setdefault(t.apart_from_seed, t) for t in plan.trials}


def _alone(backend: Backend, like: Mapping[int, Trial]) -> frozenset[int]:
    """Numbers of the trials in groups that are too small for joint execution."""
    if not isinstance(backend, ExecutesTogether):
        return frozenset()
    group = {trial.number: backend.group(trial) for trial in like.values()}
    count = Counter(group[trial.number] for trial in like.values())
    few = backend.fewest_together
    return frozenset(n for n, trial in like.items() if count[group[trial.number]] < few)


def cost_lines(cost: Cost) -> Iterator[str]:
    """Lines on the step, its reason, and trials that are simulated alone."""
    step = f"{1e3 * cost.shortest:.4g}"
    if cost.longest != cost.shortest:
        step += f" to {1e3 * cost.longest:.4g}"
    line = f"{cost.steps / 1e6:.3g} million steps of {step} ms"
    if cost.because:
        line += f", {cost.of_milliseconds:.2g} times those of 1 ms: {cost.because}"
    yield line
    if cost.alone:
        which = "it is" if cost.alone == 1 else f"{cost.alone} of the trials are"
        yield f"{which} simulated alone: too few trials have the same structure"
