"""Which friction model `identify --model whole_model` names, on rigs of which the model is known.

    python -m benchmarks.model_choice --draws 10

Each rig is an inertia with friction of one model that moves along five sines drawn at random;
torque and angle have noise. All models are fitted to each. A line per draw, then a row per true
model: how often it was named, and how often another one alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from campaign.estimation.inverse.motion import FilterSettings, motion_of_position
from campaign.experiments.any_motion.motions import MotionPiece
from campaign.experiments.whole_model.whole_model_fit import Whole, find
from campaign.physics.friction import friction_models
from campaign.physics.friction_response import Along

LINE: dict[str, Any] = {
    "coulomb_torque": 2.0, "viscous_friction": 0.5, "negative": {"coulomb_torque": 2.3},
}  # fmt: skip
CURVE = {**LINE, "static_torque": 3.0, "stribeck_velocity": 0.05}
BRISTLES = {**CURVE, "bristle_stiffness": 200.0, "bristle_damping": 1.0}
TRUTHS: dict[str, dict[str, Any]] = {
    "coulomb": LINE,
    "stribeck": CURVE,
    "karnopp": {**CURVE, "zero_band": 0.2},
    "armstrong": {**CURVE, "bristle_stiffness": 200.0, "memory_lag": 0.02, "dwell_time": 0.1},
    "dahl": {**LINE, "bristle_stiffness": 200.0},
    "bliman-sorine": {
        **LINE, "static_torque": 4.0, "bristle_stiffness": 200.0, "slow_stiffness": 30.0,
    },
    "lugre": BRISTLES,
    "lugre-fading": {**BRISTLES, "bristle_damping": 10.0, "damping_velocity": 0.02},
    "elasto-plastic": BRISTLES,
    "leuven": BRISTLES,
    "gms": {**CURVE, "bristle_stiffness": 200.0, "attraction": 20.0},
}  # fmt: skip
"""N m, rad, s."""
FITTED = tuple(name for name in TRUTHS if friction_models()[name].unknowns is not None)
INERTIA, RATE = 0.8, 1000.0
TORQUE_NOISE, ANGLE_NOISE = 0.02, 2e-6


def identified(
    truth: str, seed: int, names: Sequence[str], seconds: float = 20.0, starts: int = 1
) -> Whole:
    """What is found on one rig. truth: of `TRUTHS`; names: the models that are tried."""
    draw = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    sizes, frequencies, phases = (
        draw.uniform(*ends, 5) for ends in ((0.05, 0.25), (0.1, 1.2), (0.0, 2.0 * np.pi))
    )
    angle = sum(
        a * np.sin(2.0 * np.pi * f * time + p)
        for a, f, p in zip(sizes, frequencies, phases, strict=True)
    )
    rate = np.gradient(angle, time)
    friction = Along.rates(rate, RATE, float(angle[0])).friction({"model": truth, **TRUTHS[truth]})
    torque = INERTIA * np.gradient(rate, time) + friction
    torque = torque + TORQUE_NOISE * draw.standard_normal(len(time))
    seen = angle + ANGLE_NOISE * draw.standard_normal(len(time))
    filtering = FilterSettings.for_rate(RATE)
    motion = motion_of_position(time, seen, torque, filtering.low_pass)
    filtering = replace(filtering, slowest=0.005 * float(np.abs(motion.rate).max()))
    return find([MotionPiece(1, motion, None)], [], filtering, starts=starts, names=names)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--starts", type=int, default=1, help="fits of each model")
    parser.add_argument("--truth", choices=FITTED, action="append")
    parser.add_argument("--models", choices=FITTED, nargs="+", default=FITTED)
    arguments = parser.parse_args()
    rows = []
    for truth in arguments.truth or FITTED:
        named = alone = 0
        for seed in range(arguments.draws):
            found = identified(truth, seed, arguments.models, starts=arguments.starts)
            best = found.fits[found.best].model
            right = best.model == truth
            named += right
            alone += not right and not any(each.startswith(truth) for each in found.as_good)
            print(f"{truth} {seed}: {best.name}; as good: {', '.join(found.as_good) or 'none'}")
        rows.append(f"| `{truth}` | {named} of {arguments.draws} | {alone} of {arguments.draws} |")
    print("\n| truth | named | another one alone |\n| --- | --- | --- |", *rows, sep="\n")


if __name__ == "__main__":
    main()
