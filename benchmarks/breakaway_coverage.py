"""How often ramps by `init`'s own choice tell the breakaway torque, and how often they are right.

Run with `python -m benchmarks.breakaway_coverage [--seeds 20] [--only light]`. Each bench is
described in full, gets the options that `breakaway` chooses for it, and runs one ramp per seed.
Truth is the largest friction of the engine's own, up to the end of the ramp.
"""

from __future__ import annotations

import argparse
import math
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from typing import Any

import numpy as np

from benchmarks.document import table
from campaign.axis_kind import axis_terms
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.recording import Outcome
from tests.experiments.laboratory import execute, trials

Tree = dict[str, Any]
DEG = math.pi / 180.0


def axis(
    inertia: float, static: float, stribeck: float, sample_rate: float, limits: Tree, **more: Any
) -> Bench:
    """A direct drive with LuGre friction (SI): presliding of `creep`, `shares` of interfaces."""
    creep, ratio = more.get("creep", 2e-3), more.get("ratio", 1.0)
    shares = more.get("shares", ((1.0, 1.0),))
    friction = {}
    for number, (share, stiffer) in enumerate(shares):
        stiffness = share * stiffer * static / creep
        friction[f"part{number}"] = {
            "model": "lugre",
            "static_torque": share * static,
            "coulomb_torque": 0.75 * share * static,
            "stribeck_velocity": stribeck,
            "viscous_friction": 0.02 * share * static / stribeck,
            "bristle_stiffness": stiffness,
            "bristle_damping": 1.2 * math.sqrt(stiffness * inertia),
        }
    constant = static / (2.0 * ratio)  # it holds against friction with 2 A
    omega = min(2.0 * math.pi * 5.0, 0.03 * 2.0 * math.pi * sample_rate)
    gain = omega * inertia / (ratio * constant)
    tree = {
        "name": more.get("name", "axis"),
        "axis": {"name": "axis", "inertia": inertia},
        "gear": {"ratio": ratio},
        "friction": friction,
        "motor": {
            "torque_constant": constant, "back_emf_constant": 0.0, "resistance": 1.0,
            "inductance": 1e-3,
        },
        "controller": {
            "sample_rate": sample_rate,
            "delay": 0.5 / sample_rate,
            "relative_rate_filter": 3.0 / sample_rate,
            "rate": {"form": "parallel", "proportional": gain, "integral": gain * omega / 6.0},
            "current": {"form": "ideal", "proportional": 3e-4 * sample_rate, "integral": 30.0},
        },
        "sensors": {
            "gyro": {"noise": more.get("noise", 0.0), "resolution": more.get("resolution", 0.0)},
            "encoder": {"resolution": more.get("count", 1e-5)},
            "resolver": {"resolution": more.get("count", 1e-5)},
            "current": {"noise": more.get("current", 5e-3), "resolution": 2e-3},
        },
        "limits": {"acceleration": 1e5, "torque": 20 * static, "current": 40.0, "duration": 600.0}
        | limits,
    }  # fmt: skip
    return Bench.model_validate(tree, context={"si": True})


WIDE = {"angle": 1000.0 * 2.0 * math.pi, "rate": 60.0}
TURN = {"angle": 120.0 * DEG, "rate": 120.0 * DEG}
MOTOR = (1e-4, 0.02)
COUNT = 2.0 * math.pi / (4.0 * 4096.0)


def benches() -> dict[str, Bench]:
    """Several that are unlike the thesis', and two that are shipped."""
    return {
        "light, 10 kHz": axis(*MOTOR, 1.0, 1e4, WIDE, noise=0.01, resolution=1e-3, count=1e-4),
        "light, tight angle": axis(
            *MOTOR, 1.0, 1e4, {"angle": 1.0, "rate": 30.0}, noise=0.01, resolution=1e-3, count=1e-4
        ),
        "light, slow Stribeck": axis(
            *MOTOR, 0.1, 1e4, WIDE, noise=0.01, resolution=1e-3, count=1e-4
        ),
        "heavy, 200 Hz": axis(1e3, 400.0, 0.01, 200.0, TURN, noise=1e-4, resolution=1e-6),
        "heavy, quiet, 200 Hz": axis(1e3, 1200.0, 0.03, 200.0, TURN, noise=1e-5, resolution=1e-6),
        "noisy, two interfaces": axis(
            1.0, 3.0, 0.03, 1e3, {"angle": 120.0 * DEG, "rate": 100.0 * DEG}, noise=3e-3,
            resolution=1e-4, shares=((0.65, 1.0), (0.35, 8.0)), current=0.02,
        ),
        "encoder alone, coarse": axis(
            0.01, 0.5, 0.1, 1e3, WIDE, resolution=1e3 * COUNT, count=COUNT
        ),
        "encoder alone, light": axis(
            *MOTOR, 1.0, 1e4, WIDE, resolution=COUNT * 1e4, count=COUNT
        ),
        "linear": load_bench("linear"),
        "platform": load_bench("platform"),
    }  # fmt: skip


def of_bench(name: str, seeds: int) -> tuple[str, ...]:
    """One row: what was chosen, how ramps ended, what they told and whether it holds."""
    bench, experiment = benches()[name], experiments()["breakaway"]
    assert experiment.fit is not None
    assert experiment.measure is not None
    with axis_terms(bench.sides):
        try:
            chosen = experiment.fit(experiment.options(), bench)
        except ValueError as error:
            return name, "", f"refused: {error}", ""
        written = {key: choice.value for key, choice in chosen.items()}
        options = experiment.options.model_validate(written, context={"si": True})
        own = [
            trial.model_copy(update={"seed": 1000 + seed})
            for seed, trial in zip(range(seeds), trials_of(options, bench), strict=False)
        ]
        told: Counter[str] = Counter()
        ratios = []
        for done in execute(own):
            told[str(done.ending.outcome.name)] += 1
            if done.ending.outcome is not Outcome.COMPLETED:
                continue
            truth = float(np.max(np.abs(done.samples["friction_torque"])))
            try:
                found = experiment.measure(done)[0]
            except ValueError as error:
                told[str(error).split(":")[0][:60]] += 1
                continue
            if not found.has_interval:
                right = found.kind == "at least" and found.value <= truth
                told[f"{found.kind} ({found.reason.code}) {'true' if right else 'FALSE?'}"] += 1
                continue
            low, high = found.combined
            told["interval"] += 1
            told["holds"] += low <= truth <= high
            ratios.append((found.value / truth, 0.5 * (high - low) / truth))
    about = " ".join(f"{np.median(r):.4f}" for r in zip(*ratios, strict=True)) if ratios else ""
    sizes = ", ".join(
        f"{key} {getattr(options, key):.3g}"
        for key in ("sliding_rate", "torque_rate", "rest", "sample_rate")
    )
    return name, sizes, ", ".join(f"{key}: {n}" for key, n in told.items()), about


def trials_of(options: Any, bench: Bench) -> list[Any]:
    """As many as there are, over and over: each ramp with seeds of its own."""
    planned = trials("breakaway", bench, {})
    experiment = experiments()["breakaway"]
    tree = options.model_dump(mode="json")
    requests = list(experiment.trials(options, bench)) * 10
    return [
        planned[0].model_copy(
            update={
                "options": tree, "task": r.task, "point": dict(r.point), "windows": r.windows,
                "number": n,
            }
        )
        for n, r in enumerate(requests, start=1)
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    names = [name for name in benches() if chosen.only in name]
    with ProcessPoolExecutor(2) as pool:
        rows = list(pool.map(of_bench, names, [chosen.seeds] * len(names)))
    print(
        table(
            ["bench", "chosen", "ramps", "median of value, half-width, over truth"],
            [list(r) for r in rows],
        )
    )


if __name__ == "__main__":
    main()
