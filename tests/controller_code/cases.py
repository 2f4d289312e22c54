"""What the tests of every target run: shipped compensations, every friction model, hard inputs."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from campaign.controller_code.compensation import SampledCompensation
from campaign.physics.bench import Bench
from campaign.physics.compilation import called
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.elementary import log, power, tanh
from campaign.physics.friction import friction_models
from campaign.physics.lanes import together
from campaign.physics.step_function import Motion
from campaign.protocol.bench_file import simulable
from tests.physics.friction.cases import CURVE, MODELS

SHIPPED = [(b, n) for b in ("platform", "linear") for n in simulable(b).compensation]
TRIES: dict[str, dict[str, Any]] = {
    **{name: tree for name, tree in MODELS.items() if not friction_models()[name].no_compensation},
    "coulomb": {"coulomb_torque": 26.0, "viscous_friction": 4.0, "sign_smoothing": 0.01}
    if "sign_smoothing" in friction_models()["coulomb"].options.model_fields
    else {"coulomb_torque": 26.0, "viscous_friction": 4.0},
    "stribeck": {**CURVE, "sign_smoothing": 0.01},
}
EVIL = (
    "*/ #error gone\n#error /* *)\nEND_FUNCTION (* {x} $ (*) **)) (*\n"
    "%}\nerror('gone')\r%{\x85\u2028error(1)"
)
"""A name by which whoever wrote the bench file would write code for the controller."""


def with_friction(*friction: dict[str, Any], gain: float = 0.8) -> CompleteBench:
    """The platform with one compensation, `tried`, of these interfaces (SI)."""
    tree = simulable("platform").model_dump()
    named = {f"interface-{n}": each for n, each in enumerate(friction)}
    method = {"method": "friction-model", "friction": named, "gain": gain}
    tree["compensation"], tree["known"] = {"tried": method}, {}
    tree.pop("plant", None)
    return complete(Bench.model_validate(tree, context={"si": True}))


def of_model(name: str, **options: Any) -> SampledCompensation:
    """With a ripple, with directions of their own, on either side of the gear."""
    draw = np.random.default_rng(sum(name.encode()))
    tree = {"model": name, **TRIES[name], **options}
    for key, value in tree.items():
        if key in ("coulomb_torque", "static_torque", "bristle_stiffness", "viscous_friction"):
            tree[key] = float(value * draw.uniform(0.8, 1.0))
    plain = {**tree, "negative": {"coulomb_torque": 0.7 * tree["coulomb_torque"]}}
    rippled = {**tree, "ripple": {"amplitude": 0.1, "periods": 31.0, "phase": 0.4}}
    motor = {**tree, "side": "motor", "velocity": "motor", "coulomb_torque": 0.03}
    motor |= {"static_torque": 0.04} if "static_torque" in tree else {}
    motor |= {"viscous_friction": 1e-4}  # or all is at the limit
    return SampledCompensation.of(with_friction(plain, plain, rippled, motor), "tried")


@called
def _moved(parameters: Any, state: Any, by: float) -> tuple[float, bool]:
    """Shift a line of numbers; what falls out, and whether that is above 0."""
    out = state[0]
    for i in range(1, len(state)):
        state[i - 1] = state[i]
    state[len(state) - 1] = by
    return out * parameters[0], out > 0.0


def branching(parameters: Any, state: Any, motion: Motion) -> tuple[float, float]:
    """A step function of a plug-in: branches, loops, whole numbers, names of one letter."""
    if motion.step < 1e-9:
        return state[0] + state[2], 0.0
    T, t, end_if = parameters[0], parameters[1], 3  # noqa: N806 - also names that differ in case
    late, above = _moved(parameters, state, motion.rate_end)
    if late != 0.0:
        late = late + 0.2
    for i in range(0):
        late = late + state[i]  # never
    for i in range(end_if - 2):
        late = late + 0.5 * i + state[i] * (end_if // 2 - i)  # once
    size = -T if (above and not late > 5.0) or state[1] == 0.0 else t * end_if
    count = 0
    for i in range(len(state)):
        if state[i] < 0.0:
            count = count + 1
            late = late + 0.1
        else:
            count = count - 1 if i > 1 else count
    size, late = late, size
    state[2] += size + tanh(late) + 0.1 * count + log(1.0 + power(abs(late), 0.3))
    state[2] *= 0.2
    return state[2], 0.0


def of_a_plug_in() -> SampledCompensation:
    """A compensation with the step function `branching`."""
    made = of_model("coulomb")
    lane = made.lanes.trials[0]
    own = replace(
        lane.compensation[0], step=branching, parameters=np.array([0.7, 1.3]), state_size=4
    )
    return replace(made, lanes=together([replace(lane, compensation=(own,))], 1))


def of_an_evil_name() -> SampledCompensation:
    """A compensation and a bench whose names would be code."""
    tree = with_friction(TRIES["coulomb"] | {"model": "coulomb"}).model_dump()
    name = f"../{EVIL[:25]}"
    tree["name"], tree["compensation"] = EVIL, {name: tree["compensation"]["tried"]}
    tree.pop("plant", None)
    bench = complete(Bench.model_validate(tree, context={"si": True}))
    return SampledCompensation.of(bench, name)


def hurting(made: SampledCompensation) -> np.ndarray:
    """Reversals in every sample, rest, zeros of both signs, denormals, jumps, and fast motion."""
    draw = np.random.default_rng(3)
    pieces = [
        1e-4 * (-1.0) ** np.arange(200),
        np.zeros(50),
        np.full(50, -0.0),
        5e-324 * np.arange(50),
        1e-310 * draw.standard_normal(100),
        np.repeat(draw.uniform(-1.0, 1.0, 20), 10),
        np.cumsum(draw.normal(0.0, 0.02, 300)),
    ]
    angle = np.concatenate(pieces)
    rate = np.gradient(angle) / float(made.controller.period[0])
    return np.column_stack([rate, angle, -angle, 10.0 * draw.standard_normal(len(angle))])
