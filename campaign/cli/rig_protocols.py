"""`campaign init DIR --bench FILE`: protocols for a rig."""

from __future__ import annotations

import textwrap
import tomllib
from collections.abc import Iterator
from pathlib import Path
from string import Template

from campaign.axis_kind import BOTH_ROTARY, axis_terms, in_axis_terms, sides_in
from campaign.cli.output import print_line, print_warning
from campaign.cli.plan import chosen_lines, in_short
from campaign.errors import CampaignError, UsageError, writing
from campaign.experiments import experiments
from campaign.experiments.interface import Experiment
from campaign.experiments.shared.rig import Rig
from campaign.interrupts import unwinding
from campaign.physics.bench import Bench
from campaign.physics.complete import lacking
from campaign.protocol import Plan, check_limits, check_loops, load_protocol, make_plan
from campaign.protocol.bench_file import bench_source, load_bench
from campaign.resources import protocols_folder
from campaign.text import clock

WIDTH = 98
TEMPLATES = Path(__file__).with_name("rig_protocol_templates")
PILOT = "pilot = true    # no Stribeck curve is stated: ten speeds determine the others\n"


@unwinding()
def init_for_bench(folder: Path, written: str) -> None:
    """Write a bench's protocols into `folder`, and print their trials and bench time.

    Raises, before writing, ProtocolError for an invalid bench, and UsageError if a file exists.
    Raises UsageError also if a file cannot be written.
    """
    bench, source = load_bench(written), bench_source(written).file
    own = folder / "benches" / source.name
    # Without compensations, e.g. a motor on a table, there is nothing to stabilize.
    names = ("identify", *(["stabilize"] if bench.compensation else []))
    files = {
        folder / f"{name}.toml": _text(name, bench, f"benches/{source.name}") for name in names
    }
    for text in files.values():
        for test in tomllib.loads(text)["test"]:
            _check_fit(test["name"], experiments()[test["kind"]], bench)
    if not (own.exists() and own.samefile(source)):
        files[own] = source.read_text(encoding="utf-8")
    taken = [path for path in files if path.exists()]
    if taken:
        raise UsageError(f"{taken[0]} is there already; nothing was written: name a new folder")
    with writing(folder):
        for path, text in files.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8", newline="\n")
    print_line(f"{len(files)} files written to {folder}")
    protocols = [path for path in files if path.parent == folder]
    for path in protocols:
        _with_reasons(path)
    # A bench with missing fields cannot be simulated: trials are handed out.
    where = f"{protocols[0]}{' --backend files --handover out' if lacking(bench) else ''}"
    print_line(f"now: campaign plan {where}, then campaign run {where} --report")


def _check_fit(name: str, experiment: Experiment, bench: Bench) -> None:
    """Raise UsageError if no values of the options suit the bench."""
    try:
        if experiment.fit is not None:
            with axis_terms(bench.sides):
                experiment.fit(experiment.options(), bench)
    except (ValueError, ArithmeticError) as error:
        raise UsageError(f"{bench.name}: no {name} test suits it: {error}") from None


def _text(name: str, bench: Bench, file: str) -> str:
    """Text of a protocol from the template of that name."""
    words = {
        "bench": bench.name,
        "quoted": bench.name.replace("\\", "\\\\").replace('"', '\\"'),
        "file": file,
        "pilot": "" if Rig(bench).stribeck_velocity else PILOT,
        "methods": ", ".join(f'"{method}"' for method in ("none", *bench.compensation)),
    }
    template = Template((TEMPLATES / f"{name}.toml").read_text(encoding="utf-8"))
    return in_axis_terms(template.substitute(words), bench.sides)


def _with_reasons(path: Path) -> None:
    """Print trials and bench time of a protocol; add the chosen options to it as comments."""
    try:
        plan = make_plan(load_protocol(path, experiments(), shipped=protocols_folder()), seed=0)
    except CampaignError as error:
        print_warning(str(error))
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
        print_warning(f"{path}: {problem}")


def _comments(lines: Iterator[str]) -> Iterator[str]:
    listed = list(lines)
    if listed:
        yield "# It follows from the present bench:\n"
    for line in listed:
        wrapped = textwrap.wrap(line, WIDTH, initial_indent="#   ", subsequent_indent="#     ")
        yield "".join(f"{each}\n" for each in wrapped)


def _refusals(plan: Plan) -> Iterator[str]:
    """Reasons to refuse the plan."""
    for check in (check_limits, check_loops):
        try:
            check(plan)
        except CampaignError as error:
            yield str(error)
