"""Numbers called measured on rigs that nobody has seen, by protocols that `campaign init` writes.

Run with `python -m benchmarks.blind_rigs run FILE [--rigs 200] [--text WORDS]`, then
`python -m benchmarks.blind_rigs show FILE`, which prints the tables of docs/trust.md. The rigs
(`benchmarks.drawn_rigs`) are drawn by a text: the hash of the last commit that changed code, so
that nothing can have been tuned on them. FILE gets a line for each rig, and a run that was stopped
goes on; `list` shows every draw.

Of each rig the stated bench file is written, `init --bench` makes protocols of it, and they are
planned, simulated on the truth, followed by their stages, and analysed as `campaign run` does it.
An offset of the torque sensor is added to what is recorded. Truths and the Cramér-Rao bound are
those of `tests.coverage`; a sensor's offset is a constant force, which is true of each direction.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import tempfile
import time
import traceback
import warnings
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict, dataclass, replace
from functools import partial
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from scipy.stats import beta

from benchmarks.drawn_rigs import Rig, drawn
from campaign.channels import DRIVE_TORQUE
from campaign.cli.rig_protocols import init_for_bench
from campaign.errors import CampaignError
from campaign.estimate import Origin
from campaign.experiments import experiments
from campaign.experiments.analysis import result_of
from campaign.experiments.interface import TestData, options_of
from campaign.physics.truth import digest, plant_of
from campaign.protocol import Plan, check_limits, check_loops, load_protocol, make_plan
from campaign.protocol.bench_file import load_bench
from campaign.protocol.stage_trials import follow
from campaign.recording import Channel, Outcome, Recording
from campaign.resources import protocols_folder
from campaign.result import Finding
from campaign.trial import Trial
from tests.coverage.benches import Case, Scale
from tests.coverage.bounds import bound_of
from tests.coverage.judging import parameter_of
from tests.coverage.laboratory import Run, execute
from tests.coverage.truths import IN_TORQUE, Truths
from tests.experiments.laboratory import Done

CODE = ("campaign", "protocols", "templates")
STATED = frozenset({"torque constant", "inertia"})
TELLING = 0.20
"""Half-width of the Cramér-Rao bound over the value below which a parameter can be determined."""
LEVEL = 0.95
SIGNS = {"positive": 1.0, "negative": -1.0, "nominal": 0.0}


@dataclass(frozen=True)
class Told:
    """One finding of one rig beside its truth.

    Attributes:
        held: whether its interval, or bound, holds the truth; None where it has none.
        error: of the value, in half-widths; None for a bound.
        width: half of the interval over the true value; None for a bound.
        bound: 1.96 times the Cramér-Rao deviation over the true value; None where not worked out.
        reason: code of why it is no measured number.
    """

    parameter: str
    origin: str
    kind: str
    held: bool | None
    error: float | None
    width: float | None
    bound: float | None
    reason: str


def last_commit() -> str:
    """Hash of the last commit that changed code."""
    command = ["git", "log", "-1", "--format=%H", "--", *CODE]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def case_of(rig: Rig, folder: Path) -> Case:
    """The rig's bench files, written and read again."""
    benches = []
    for name, tree in (("truth", rig.truth), ("stated", rig.stated)):
        path = folder / f"{name}.toml"
        path.write_text(tomlkit.dumps(tree), encoding="utf-8")
        benches.append(load_bench(str(path)))
    return Case(rig.number, benches[0], benches[1], Scale(0.0, 0.0, 0.0, 0.0))


def looked_at(text: str, number: int) -> dict[str, Any]:
    """What became of one rig: its draw, what was told, and what went wrong."""
    rig, began = drawn(text, number), time.process_time()
    found: dict[str, Any] = {"number": number, "text": text, "facts": rig.facts, "told": []}
    found |= {"refused": "", "warnings": [], "at_limit": 0, "trials": 0, "failed": []}
    said = StringIO()
    try:
        with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with redirect_stdout(said), redirect_stderr(said):
                _look(rig, Path(name), found)
    except CampaignError as error:
        found["refused"] = str(error).replace(name, "")
    except Exception:  # noqa: BLE001 - one rig never stops the rest
        found["failed"].append(traceback.format_exc())
    return found | {"seconds": time.process_time() - began}


def _look(rig: Rig, folder: Path, found: dict[str, Any]) -> None:
    case = case_of(rig, folder)
    init_for_bench(folder / "lab", str(folder / "stated.toml"))
    protocol = load_protocol(
        folder / "lab" / "identify.toml",
        experiments(),
        shipped=protocols_folder(),
        truth=str(folder / "truth.toml"),
    )
    plan = make_plan(protocol, seed=rig.number + 1)
    check_limits(plan)  # as `campaign run` does: nothing is moved then
    check_loops(plan)
    for test in plan.tests:
        found["warnings"] += [f"{test.name}: {line}" for line in test.warnings]
        done = _executed(case, rig, plan, test.name)
        found["trials"] += len(done)
        found["at_limit"] += sum(each.ending.outcome is Outcome.LIMIT for each in done)
        try:
            data = TestData(test.name, test.kind, test.options, done)
            result = result_of(experiments()[test.kind], data)
            run = Run(case, test.kind, done, result)
            found["told"] += [asdict(each) for each in judged(run, rig)]
        except Exception:  # noqa: BLE001 - nor does one test
            found["failed"].append(f"{test.name}: {traceback.format_exc()}")


def _executed(case: Case, rig: Rig, plan: Plan, test: str) -> tuple[Done, ...]:
    """The planned trials of a test, and those of its stages."""
    truth = digest(plant_of(case.truth))
    planned = [t.model_copy(update={"truth": truth}) for t in plan.trials if t.test == test]
    done = _measured(case, rig, planned)
    for stage in (each for each in plan.stages if each.test == test):
        experiment = experiments()[planned[0].kind]
        options = options_of(experiment, planned[0].options)
        data = TestData(test, planned[0].kind, planned[0].options, done)
        asked = experiment.stages[stage.number - 2].trials(options, case.stated, data)
        first = plan.trials[-1].number + 1
        followed = follow(stage, experiment, asked, planned[0], first, lambda trial: "")
        done += _measured(case, rig, followed.trials)
    return done


def _measured(case: Case, rig: Rig, trials: Sequence[Trial]) -> tuple[Done, ...]:
    """Trials executed on the truth; the torque sensor adds its offset."""
    return tuple(replace(d, samples=_offset(d.samples, rig)) for d in execute(case, trials))


def _offset(samples: Recording, rig: Rig) -> Recording:
    torque = samples.channels.get(DRIVE_TORQUE)
    if torque is None or not rig.offset:
        return samples
    moved: Channel = replace(torque, samples=torque.samples + rig.offset)
    return replace(samples, channels={**samples.channels, DRIVE_TORQUE: moved})


def judged(run: Run, rig: Rig) -> Iterator[Told]:
    """Every finding that has a truth. Torques are put right by the true torque constant."""
    truths = Truths(run)
    for finding in run.result.findings:
        parameter = parameter_of(finding)
        true = truths.of(finding) if parameter else None
        if true is None or not math.isfinite(true):
            continue
        reckoned = truths.by_stated(finding)
        yield _told(run, rig, finding, parameter, true if reckoned is None else reckoned)


def _told(run: Run, rig: Rig, finding: Finding, parameter: str, true: float) -> Told:
    one = finding.known
    ratio = run.case.torque_ratio if finding.quantity in IN_TORQUE else 1.0
    if finding.quantity in ("coulomb_torque", "static_torque"):
        way = str(finding.conditions.get("direction"))
        true += SIGNS.get(way, 0.0) * rig.offset * ratio
    known = tuple(part for part in one.systematic if part.source not in STATED)
    ends = replace(one, systematic=known).combined
    low, high = (None if end is None else end * ratio for end in ends)
    held = None
    if low is not None or high is not None:
        held = bool((low is None or low <= true) and (high is None or true <= high))
    half = None if low is None or high is None else 0.5 * (high - low)
    bound = bound_of(run, finding)
    return Told(
        parameter,
        str(one.origin),
        one.kind,
        held,
        error=(one.value * ratio - true) / half if half else None,
        width=half / abs(true) if half is not None and true else None,
        bound=1.96 * bound / abs(true) if bound is not None and true else None,
        reason=one.reason.code if one.reason else "",
    )


# --- the table ----------------------------------------------------------------------------------


def clustered(groups: Sequence[tuple[int, int]]) -> float:
    """Lower end of the 95 % interval of a coverage, of (held, told) of each rig.

    Clopper and Pearson with the number of intervals over the design effect: what a rig's own vary
    by beyond a binomial (Korn and Graubard, Survey Methodology 24 (1998) 193).
    """
    held, of = (sum(each[k] for each in groups) for k in (0, 1))
    share = held / of
    if held < of and len(groups) > 1:
        square = sum((h - share * n) ** 2 for h, n in groups) * len(groups) / (len(groups) - 1)
        effect = max(1.0, square / (of * share * (1.0 - share)))
    else:
        effect = max(1.0, of / len(groups))  # nothing missed: a rig counts once
    n = of / effect
    k = share * n
    return float(beta.ppf(0.5 * (1.0 - LEVEL), k, n - k + 1.0)) if k else 0.0


def is_measured(one: dict[str, Any]) -> bool:
    return one["origin"] == str(Origin.MEASURED) and one["held"] is not None


def rows(rigs: Sequence[dict[str, Any]], *, apart: bool = False) -> Iterator[list[str]]:
    """One for each parameter, and one for all; `apart`: by direction, statistic and exponent."""
    by: dict[str, list[tuple[int, dict[str, Any]]]] = defaultdict(list)
    for rig in rigs:
        for one in rig["told"]:
            name = one["parameter"]
            name = name if apart else name.split(",")[0].removesuffix(" with delta = 2")
            by[name].append((rig["number"], one))
    for name in sorted(by):
        yield row(name, by[name])
    yield row("**all**", [each for own in by.values() for each in own])


def row(name: str, own: Sequence[tuple[int, dict[str, Any]]]) -> list[str]:
    measured = [(rig, one) for rig, one in own if is_measured(one)]
    told: dict[int, list[bool]] = defaultdict(list)
    for rig, one in measured:
        told[rig].append(one["held"])
    groups = [(sum(each), len(each)) for each in told.values()]
    held, of = sum(h for h, _ in groups), sum(n for _, n in groups)
    wide = [one["width"] / one["bound"] for _, one in measured if one["width"] and one["bound"]]
    telling = [one for _, one in own if one["bound"] is not None and one["bound"] < TELLING]
    seen = sum(is_measured(one) for one in telling)
    kept = Counter(one["reason"] or one["origin"] for _, one in own if not is_measured(one))
    most = "; ".join(f"{reason} {count}" for reason, count in kept.most_common(3))
    return [
        name.replace("_", " "),
        f"{held} of {of}" if of else "–",
        f"{100 * held / of:.0f} %" if of else "–",
        f"{100 * clustered(groups):.0f} %" if of else "–",
        f"{float(np.median(wide)):.2f}" if wide else "–",
        f"{seen} of {len(telling)}" if telling else "–",
        f"{sum(kept.values())}" + (f" ({most})" if most else ""),
    ]


HEADINGS = (
    "parameter",
    "measured numbers that hold",
    "share",
    "lower bound, by rig",
    "half-width over bound",
    "measured of those that can be",
    "held back",
)


def _in_short(refusal: str) -> str:
    """The first test of a plan that was refused, or the one line of another refusal."""
    return (refusal.splitlines()[1:] or [refusal])[0].strip().split(";")[0]


def page(rigs: Sequence[dict[str, Any]]) -> str:
    """The section of docs/trust.md."""
    refused = Counter(_in_short(rig["refused"]) for rig in rigs if rig["refused"])
    trials, at_limit = (sum(rig[key] for rig in rigs) for key in ("trials", "at_limit"))
    warned = sum(bool(rig["warnings"]) for rig in rigs)
    failed = sum(len(rig["failed"]) for rig in rigs)
    head = [f"| {' | '.join(HEADINGS)} |", f"|{' --- |' * len(HEADINGS)}"]
    lines = [
        (
            f"Drawn by `{rigs[0]['text']}`: {len(rigs)} rigs, {trials} trials; {at_limit} ended at "
            f"a limit, {warned} plans had a warning of the program, {failed} analyses failed, "
            f"{sum(refused.values())} rigs were refused."
        ),
        *(f"- {n} refused: {why}" for why, n in refused.items()),
        "",
        "By parameter, all directions, means and exponents together:",
        "",
        *head,
        *(f"| {' | '.join(cells)} |" for cells in rows(rigs)),
        "",
        "The same, apart:",
        "",
        *head,
        *(f"| {' | '.join(cells)} |" for cells in rows(rigs, apart=True)),
    ]
    return "\n".join(lines)


def listed(rigs: Iterable[dict[str, Any]]) -> str:
    """Every draw, a line for each."""
    facts = [{"rig": rig["number"], **rig["facts"]} for rig in rigs]
    lines = [",".join(facts[0])]
    for each in facts:
        shown = (f"{v:.4g}" if isinstance(v, float) else str(v) for v in each.values())
        lines.append(",".join(shown))
    return "\n".join(lines)


def read(file: Path) -> list[dict[str, Any]]:
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    return sorted(map(json.loads, lines), key=lambda rig: rig["number"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("what", choices=("run", "show", "list"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--rigs", type=int, default=200)
    parser.add_argument("--text", default="", help="that draws; the last commit's hash without it")
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    if given.what == "run":
        text = given.text or last_commit()
        there = {rig["number"] for rig in read(given.file)}
        left = [number for number in range(given.rigs) if number not in there]
        with ProcessPoolExecutor(given.workers) as pool, given.file.open("a") as out:
            for rig in pool.map(partial(looked_at, text), left):
                out.write(json.dumps(rig) + "\n")
                out.flush()
        return
    rigs = read(given.file)
    print(listed(rigs) if given.what == "list" else page(rigs))


if __name__ == "__main__":
    main()
