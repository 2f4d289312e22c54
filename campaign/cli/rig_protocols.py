"""`campaign init DIR --bench FILE`: protocols for a rig."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from campaign.axis_kind import BOTH_ROTARY, axis_terms, in_axis_terms, sides_in
from campaign.cli.chosen_options import chosen_lines
from campaign.cli.output import print_line, print_note
from campaign.cli.plan import in_short
from campaign.errors import CampaignError, UsageError
from campaign.execution.display import clock
from campaign.experiments import experiments
from campaign.experiments.shared.rig import Rig
from campaign.interrupts import unwinding
from campaign.physics.bench import Bench
from campaign.physics.complete import lacking
from campaign.protocol import Plan, check_limits, check_loops, load_protocol, make_plan
from campaign.protocol.bench_file import load_bench
from campaign.resources import protocols_folder

WIDTH = 98


@dataclass(frozen=True)
class _Test:
    """One test of a protocol that is written: what it is called, and what it is for."""

    name: str
    kind: str
    title: str
    purpose: str
    more: str = ""


SPREAD = "spread_starts = true    # a ripple over position then bends no curve\n"
PILOT = "pilot = true    # no Stribeck curve is described: ten speeds tell which others to run\n"


def _identify(bench: Bench) -> tuple[_Test, ...]:
    return (
        _Test(
            "velocity-map",
            "velocity_map",
            "Friction torque over speed",
            "Constant speeds in both directions, and the Stribeck curve through them.",
            SPREAD + ("" if Rig(bench).stribeck_velocity else PILOT),
        ),
        _Test(
            "breakaway",
            "breakaway",
            "Breakaway and presliding",
            "Slow torque ramps from rest: how friction gives way, and how stiff it is before.",
        ),
        _Test(
            "closed-loop",
            "frequency_response",
            "Frequency response of the rate loop",
            "A stepped sine of the rate command: bandwidth and margins.",
        ),
    )


@unwinding()
def init_for_bench(folder: Path, written: str) -> None:
    """Write a bench's protocols into `folder`, and say what they would do.

    Raises ProtocolError for a bench that is wrong, UsageError when a file would be overwritten or
    cannot be written; nothing is written then.
    """
    bench = load_bench(written)
    identify, stabilize = _identify(bench), _stabilize(bench)
    for test in (*identify, *stabilize):
        _check_fit(test, bench)
    source = _source(written)
    own = folder / "benches" / source.name
    name = f"benches/{source.name}"
    files = {folder / "identify.toml": _page(bench, name, "Identification of", identify)}
    if stabilize:
        files[folder / "stabilize.toml"] = _page(bench, name, "Compensation on", stabilize)
    if not _is(source, own):
        files[own] = source.read_text(encoding="utf-8")
    taken = [path for path in files if path.exists()]
    if taken:
        raise UsageError(f"{taken[0]} is there already; nothing was written: name a new folder")
    try:
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
    except OSError as error:
        raise UsageError(f"{folder}: cannot be written: {error.strerror}") from None
    print_line(f"{len(files)} files written to {folder}")
    protocols = [path for path in files if path.parent == folder]
    for path in protocols:
        _with_reasons(path)
    # What cannot be simulated is executed on hardware, or by hand.
    where = f"{protocols[0]}{' --backend files --handover out' if lacking(bench) else ''}"
    print_line(f"now: campaign plan {where}, then campaign run {where} --report")


def _check_fit(test: _Test, bench: Bench) -> None:
    """Raises UsageError where no values would suit the bench."""
    experiment = experiments()[test.kind]
    try:
        if experiment.fit is not None:
            with axis_terms(bench.sides):
                experiment.fit(experiment.options(), bench)
    except (ValueError, ArithmeticError) as error:
        raise UsageError(f"{bench.name}: no {test.name} fits it: {error}") from None


def _source(written: str) -> Path:
    """The file of a bench that has been loaded by that word."""
    shipped = protocols_folder() / "benches" / f"{written}.toml"
    return shipped if shipped.is_file() else Path(written)


def _is(one: Path, other: Path) -> bool:
    return other.exists() and one.resolve() == other.resolve()


def _stabilize(bench: Bench) -> tuple[_Test, ...]:
    """Where the bench has a compensation: a motor on a table has no hull that swings."""
    if not bench.compensation:
        return ()
    methods = ", ".join(f'"{name}"' for name in ("none", *bench.compensation))
    return (
        _Test(
            "stabilization",
            "stabilization",
            "Stabilization error by compensation method",
            "The hull swings, the load should not: what each compensation of the bench leaves.",
            f"repeat = 3\n\n[test.matrix]\ncompensation = [{methods}]\n",
        ),
    )


def _page(bench: Bench, name: str, what: str, tests: Sequence[_Test]) -> str:
    with axis_terms(bench.sides):
        return in_axis_terms(_text(bench, name, what, tests))


def _text(bench: Bench, name: str, what: str, tests: Sequence[_Test]) -> str:
    head = (
        f"# {what} {bench.name}. Values that are not written follow from the bench file: its\n"
        "# limits, inertia, sensors, loops, and its friction as far as it is described. Write\n"
        "# one to have your own.\n"
    )
    title = f"{what} {bench.name}".replace("\\", "\\\\").replace('"', '\\"')
    parts = (
        f'# {test.purpose}\n[[test]]\nname = "{test.name}"\nkind = "{test.kind}"\n'
        f'bench = "{name}"\ntitle = "{test.title}"\n{test.more}'
        for test in tests
    )
    return head + "\n".join([f'title = "{title}"\npublished = "none"\n', *parts])


def _with_reasons(path: Path) -> None:
    """Say what a protocol would do, and write what was chosen into it as comments."""
    try:
        plan = make_plan(load_protocol(path, experiments(), shipped=protocols_folder()), seed=0)
    except CampaignError as error:
        print_note(str(error), style="yellow")
        return
    text = path.read_text(encoding="utf-8")
    for test in plan.tests:
        trials = [plan.trials[number - 1] for number in test.numbers[:1]]
        with axis_terms(sides_in(trials[0].bench) if trials else BOTH_ROTARY):
            reasons = "".join(_comments(chosen_lines(test)))
        mark = f'name = "{test.name}"\n'
        text = text.replace(f"[[test]]\n{mark}", f"{reasons}[[test]]\n{mark}")
    path.write_text(text, encoding="utf-8", newline="\n")
    later = f"; later stages add {in_short(plan.following)}" if plan.stages else ""
    print_line(f"{path}: {len(plan.trials)} trials, {clock(plan.duration)} of bench time{later}")
    for problem in _refusals(plan):
        print_note(f"{path}: {problem}", style="yellow")


def _comments(lines: Iterator[str]) -> Iterator[str]:
    told = list(lines)
    if told:
        yield "# Today it follows from the bench:\n"
    for line in told:
        wrapped = textwrap.wrap(line, WIDTH, initial_indent="#   ", subsequent_indent="#     ")
        yield "".join(f"{each}\n" for each in wrapped)


def _refusals(plan: Plan) -> Iterator[str]:
    """Why the plan would be refused as it is."""
    for check in (check_limits, check_loops):
        try:
            check(plan)
        except CampaignError as error:
            yield str(error)
