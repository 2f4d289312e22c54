"""How often intervals of excitations hold the truth, on rigs unlike the shipped ones.

Run with `python -m benchmarks.excitation_coverage [--rigs 20] [--seeds 20] [--first 200]`. Two
tables: what the report of `excitation` itself tells of three rigs, seed by seed, and of random ones
(inertia and friction by a Fourier series, levels of distortion by multisines), and what `campaign
identify --model frequency_response` makes of multisines at one amplitude and at two on random rigs.
Truth is the bench that was simulated; of a level of distortion, which no bench states, the mean
over seeds.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import cast

from scipy.stats import binomtest

from benchmarks.document import table
from campaign.axis_kind import axis_terms
from campaign.estimate import Estimate, Origin
from campaign.physics.bench import Bench
from tests.estimation.coverage import holds
from tests.estimation.excited_rigs import THREE, excited_rig
from tests.experiments.asked import asked
from tests.experiments.excited import by_lines, by_series, played, rate, series, true_dynamics
from tests.experiments.laboratory import Done

WIDE = {"signal": "multisine", "lowest": "0.5 Hz", "highest": "40 Hz", "period": "4 s"}
SHARES = (0.1, 0.2)
"""of the rate limit: amplitudes of the responses."""
LITTLE_FRICTION = (0.0008, 0.04)
Held = dict[str, list[bool | None]]
"""Whether each interval holds, by number; None without an interval."""


def true_levels(found: Sequence[Sequence[Estimate]]) -> Mapping[str, float]:
    """Root of the mean power over all seeds; of what no seed tells from the noise, nothing."""
    powers: dict[str, list[float]] = defaultdict(list)
    for each in (one for many in found for one in many):
        if each.kind == "number" and math.isfinite(each.value):
            powers[each.name].append(each.value**2)
    return {
        name: math.sqrt(sum(p) / len(p)) for name, p in powers.items() if 2 * len(p) > len(found)
    }


def true_drive(on: Bench) -> Mapping[str, float]:
    whole, hung = cast("float", on.axis.inertia), on.appendage
    if hung is None:
        return {"total_inertia": whole}
    return {
        "total_inertia": whole,
        "motor_inertia": whole - hung.inertia,
        "load_inertia": hung.inertia,
        "stiffness": hung.inertia * (2.0 * math.pi * hung.frequency) ** 2,
        "antiresonance": hung.frequency,
        "resonance": hung.frequency * math.sqrt(whole / (whole - hung.inertia)),
    }


def judged(found: Sequence[Estimate], truth: Mapping[str, float], held: Held) -> None:
    for one in found:
        if one.name in truth and one.kind == "number":
            told = one.has_interval and one.origin is not Origin.NOT_DETERMINED
            held[one.name].append(holds(one, truth[one.name]) if told else None)


def random_series(seed: int) -> Held:
    """Of one random rig: what the report tells of a Fourier series."""
    on = excited_rig(seed, linear=bool(seed % 2), alike=bool(seed % 4 > 1))
    held: Held = defaultdict(list)
    try:
        found = series(on, seed)
    except ValueError as error:
        print(f"rig {seed}: {error}")
        return held
    judged(found, true_dynamics(on), held)
    return held


def responses(seed: int) -> dict[str, Held]:
    """Of one random rig: at each amplitude, at both, and as scatter alone would have it."""
    on = excited_rig(
        seed, linear=bool(seed % 2), friction=LITTLE_FRICTION, appendage=bool(seed % 4 > 1)
    )
    made: dict[str, Held] = {
        name: defaultdict(list) for name in ("scatter alone", "one amplitude", "two amplitudes")
    }
    done = []
    for place, share in enumerate(SHARES):
        try:
            done.append(played(on, {**WIDE, "amplitude": rate(on, share)}, 100 * place))
        except ValueError as error:
            print(f"rig {seed}, {share:g}: {error}")
    truth = true_drive(on)
    for each in done:
        own = told_of(on, each)
        judged(own, truth, made["one amplitude"])
    if len(done) == len(SHARES):
        both = told_of(on, [trial for each in done for trial in each])
        judged(both, truth, made["two amplitudes"])
        judged([replace(each, systematic=()) for each in both], truth, made["scatter alone"])
    return made


def told_of(on: Bench, done: Sequence[Done]) -> list[Estimate]:
    with axis_terms(on.sides):
        try:
            found = asked("frequency_response", done)
        except ValueError as error:
            print(f"{on.name}: {error}")
            return []
    return [each.estimate for each in found.identified.parameters]


def rows(what: str, held: Held) -> Iterator[list[str]]:
    for name, each in held.items():
        told = [one for one in each if one is not None]
        if not told:
            yield [what, name.replace("_", " "), "0 of 0", "", str(len(each))]
            continue
        share = binomtest(sum(told), len(told)).proportion_ci(0.95)
        yield [
            what,
            name.replace("_", " "),
            f"{sum(told)} of {len(told)}",
            f"{100 * share.low:.0f} to {100 * share.high:.0f} %",
            str(len(each) - len(told)),
        ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--rigs", type=int, default=20, help="random ones, for responses")
    parser.add_argument("--seeds", type=int, default=20, help="of each of three rigs")
    parser.add_argument("--first", type=int, default=200, help="seed of the first random rig")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    headings = ["of", "number", "hold", "95 % interval of that", "without"]
    seeds = range(1, options.seeds + 1)
    with ProcessPoolExecutor(options.workers) as pool:
        made = []
        for name, rig in THREE.items():
            held: Held = defaultdict(list)
            for found in pool.map(by_series, [name] * len(seeds), seeds):
                judged(found, true_dynamics(rig()), held)
            levels = list(pool.map(by_lines, [name] * len(seeds), seeds))
            for found in levels:
                judged(found, true_levels(levels), held)
            made += rows(name, held)
        random: Held = defaultdict(list)
        for one in pool.map(random_series, range(options.first, options.first + options.rigs)):
            for number, each in one.items():
                random[number] += each
        print(table(headings, [*made, *rows("random rigs", random)]))
        together: dict[str, Held] = defaultdict(lambda: defaultdict(list))
        for each in pool.map(responses, range(options.first, options.first + options.rigs)):
            for what, held in each.items():
                for number, many in held.items():
                    together[what][number] += many
        print(table(headings, [row for what, held in together.items() for row in rows(what, held)]))


if __name__ == "__main__":
    main()
