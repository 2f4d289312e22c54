"""How often intervals of `campaign identify` hold the truth, on rigs that nobody tuned them on.

Run with `python -m benchmarks.identification_coverage [--rigs 100] [--whole 24] [--seed 4711]`.
The rigs, half of them linear, are those of `tests.estimation.blind_rigs`: simulated without
this program, with encoders, tachometers, noise, delays, and friction of many kinds; truth is read
when everything has been identified. Columns: how many intervals hold (with the 95 % interval of
that share, Clopper and Pearson), how many have none, their median half-width.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.stats import binomtest

from benchmarks.document import table
from campaign.channels import DRIVE_TORQUE, REFERENCE, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimate import Origin
from campaign.parameter import IdentifiedRig
from campaign.trial import Channel, Recording
from tests.estimation.blind_rigs import RATE, BlindRig, blind_rigs
from tests.experiments.asked import asked

NAMES = (
    "inertia",
    "coulomb_positive",
    "coulomb_negative",
    "viscous_positive",
    "viscous_negative",
    "spring",
    "static_over_coulomb_positive",
    "static_over_coulomb_negative",
    "stribeck_velocity",
    "delay",
)
NOWHERE = ("bristle_stiffness", "bristle_damping")
"""What none of the rigs has: an interval of it holds nothing."""
MODEL = "stribeck, by direction"


@dataclass(frozen=True)
class Told:
    """What was told of one number of one rig.

    Attributes:
        held: whether the interval holds the truth; None where it has none.
        width: half of it over the truth.
        error: of the value, in half-widths.
        to_bench: whether it would go to a bench file.
        passed: whether the gate passes it, as a number or as a bound.
    """

    rig: int
    name: str
    held: bool | None
    width: float
    error: float
    to_bench: bool
    passed: bool


def recorded(rig: BlindRig) -> Any:
    """A trial as an archive has it, of channels that such a rig records."""
    made = [Channel(DRIVE_TORQUE, "N m", "force", "N m", rig.force)]
    if rig.angle is not None:
        made.append(Channel(RELATIVE_ANGLE, "rad", "position", "deg", rig.angle))
    if rig.rate is not None:
        made.append(Channel(RELATIVE_RATE, "rad/s", "rate", "deg/s", rig.rate))
    if rig.wanted is not None:
        made.append(Channel(REFERENCE, "rad", "wanted", "deg", rig.wanted))
    channels = {each.name: each for each in made}
    recording = Recording(rig.time, channels)
    axis = {"name": "axis", "kind": "linear"} if rig.is_linear else {"name": "axis"}
    bench = {"name": "blind", "axis": axis}
    task = SimpleNamespace(mode="recorded", sample_rate=RATE, duration=len(rig.time) / RATE)
    trial = SimpleNamespace(
        number=1,
        kind="motion",
        point={},
        can_use=(),
        task=task,
        bench=bench,
        recording={"channels": []},
    )
    return SimpleNamespace(
        trial=trial,
        ending=SimpleNamespace(outcome="completed"),
        not_kept="",
        estimates=(),
        recording=lambda: recording,
        channel_names=lambda: frozenset(channels),
    )


def by_inverse_dynamics(rig: BlindRig) -> IdentifiedRig:
    """As `campaign identify --model inverse_dynamics` does."""
    return asked("inverse_dynamics", [recorded(rig)]).identified


def by_whole_model(rig: BlindRig) -> IdentifiedRig:
    """The model that can be right: Stribeck friction by direction; one start."""
    return asked("whole_model", [recorded(rig)], model=MODEL, starts=1).identified


def told(method: Callable[[BlindRig], IdentifiedRig], rig: BlindRig, number: int) -> list[Told]:
    """Every number of a rig against its truth; nothing where the method refused."""
    try:
        found = method(rig)
    except ValueError as error:
        print(f"rig {number} refused: {error}")
        return []
    made = []
    for each in found.parameters:
        name, one = each.estimate.name, each.estimate
        if name not in NAMES and name not in NOWHERE:
            continue
        low, high = one.combined
        truth, goes = rig.truth.get(name), bool(each.bench)
        passed = one.origin is not Origin.NOT_DETERMINED
        if one.kind == "at most" and high is not None and truth is not None:
            made.append(Told(number, name, truth <= high, math.nan, math.nan, goes, passed))
            continue
        if low is None or high is None:
            made.append(Told(number, name, None, math.nan, math.nan, goes, passed))
            continue
        held = truth is not None and low <= truth <= high
        size = abs(truth) if truth else math.nan
        error = (one.value - (truth or 0.0)) / one.half_width
        made.append(Told(number, name, held, one.half_width / size, error, goes, passed))
    return made


def weak(rig: BlindRig, number: int) -> BlindRig:
    """Four seconds of it, with noise of the force as large as the force: little is determined."""
    count = round(4.0 * RATE)
    noise = np.random.default_rng(number).standard_normal(count)
    force = rig.force[:count]
    cut = {
        name: None if getattr(rig, name) is None else getattr(rig, name)[:count]
        for name in ("time", "angle", "rate", "wanted")
    }
    return replace(rig, force=force + float(np.std(force)) * noise, **cut)


def _weak(job: tuple[int, BlindRig]) -> list[Told]:
    return told(by_inverse_dynamics, weak(job[1], job[0]), job[0])


def _inverse(job: tuple[int, BlindRig]) -> list[Told]:
    return told(by_inverse_dynamics, job[1], job[0])


def _whole(job: tuple[int, BlindRig]) -> list[Told]:
    return told(by_whole_model, job[1], job[0])


def rows(method: str, found: Iterable[Told]) -> Iterator[list[str]]:
    """One row for each number."""
    by_name: dict[str, list[Told]] = defaultdict(list)
    for each in found:
        by_name[each.name].append(each)
    for name in (*NAMES, *NOWHERE):
        if name not in by_name:
            continue
        judged = [each for each in by_name[name] if each.held is not None]
        held = [each for each in judged if each.held]
        none = len(by_name[name]) - len(judged)
        words = name.replace("_", " ")
        if not judged:
            yield [method, words, "0 of 0", "", str(none), ""]
            continue
        share = binomtest(len(held), len(judged)).proportion_ci(0.95)
        width = sorted(each.width for each in judged)[len(judged) // 2]
        yield [
            method,
            words,
            f"{len(held)} of {len(judged)}",
            f"{100 * share.low:.0f} to {100 * share.high:.0f} %",
            str(none),
            f"{100 * width:.2g} %" if math.isfinite(width) else "",
        ]


def missed(method: str, found: Iterable[Told], rigs: Sequence[BlindRig]) -> Iterator[str]:
    """What kind of rig each interval missed is of."""
    for each in found:
        if each.held is False:
            facts = ", ".join(
                f"{k} {v:.3g}" if isinstance(v, float) else f"{v}"
                for k, v in rigs[each.rig].facts.items()
            )
            far = f"{each.error:+.2f} half-widths"
            yield f"{method}: rig {each.rig}, {each.name} {far} ({facts})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rigs", type=int, default=100, help="for inverse dynamics")
    parser.add_argument("--whole", type=int, default=24, help="of these, for whole models")
    parser.add_argument("--seed", type=int, default=4711)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    rigs = blind_rigs(options.rigs, options.seed)
    jobs = list(enumerate(rigs))
    with ProcessPoolExecutor(options.workers) as pool:
        inverse = [one for each in pool.map(_inverse, jobs) for one in each]
        bad = [one for each in pool.map(_weak, jobs) for one in each]
        whole = [one for each in pool.map(_whole, jobs[: options.whole]) for one in each]
    sent = [each for each in inverse if each.to_bench and each.name not in ("inertia", "delay")]
    made = [
        *rows("`inverse_dynamics`", inverse),
        *rows("the same, of what goes to a bench file", sent),
        *rows("`inverse_dynamics`, weak recordings, before the gate", bad),
        *rows("the same, behind it", [each for each in bad if each.passed]),
        *rows("`whole_model`", whole),
    ]
    headings = ["method", "number", "hold", "95 % interval of that", "without", "half-width"]
    print(table(headings, made))
    for line in (*missed("inverse", inverse, rigs), *missed("whole", whole, rigs)):
        print(line)


if __name__ == "__main__":
    main()
