"""`campaign model`: friction models and specimens at a sinusoidal rate, as picture and numbers."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import Field

from campaign.cli.output import print_line
from campaign.errors import UsageError, writing
from campaign.options import Options
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionModel
from campaign.physics.friction_response import Along
from campaign.physics.specimens import specimens
from campaign.physics.specimens.interface import Specimen
from campaign.plugins import Kinds
from campaign.protocol.bench_file import bench_source
from campaign.protocol.overrides import parse_overrides
from campaign.protocol.problems import find_faults
from campaign.report.drawing.figures import draw
from campaign.result import Axis, Curve, Figure, Panel
from campaign.text import nearest, number
from campaign.units import AngularRate, Frequency

Array = NDArray[np.float64]
AnyModel = FrictionModel | Specimen

CYCLES = 4
"""Simulated cycles; the last one is shown, with settled states."""
PER_CYCLE = 2_000
"""Samples of a cycle at the first step, and in the figure."""
FINEST = 256 * PER_CYCLE
ACCURACY = 1e-3
"""Largest change of the friction by half the step, relative to the largest friction."""


class MotionOptions(Options):
    """The motion of all models."""

    rate: AngularRate = Field(gt=0)
    """Amplitude of the rate."""
    frequency: Frequency = Field(gt=0)
    """Frequency of the rate."""


@dataclass(frozen=True)
class ModelCycle:
    """Response of a model in the last cycle; SI, shape (PER_CYCLE,).

    Attributes:
        change: of the friction by half the step, relative to the largest friction.
    """

    model: AnyModel
    options: Any
    friction: Array
    change: float


def show_models(
    names: Sequence[str],
    motion: Mapping[str, str],
    changes: Sequence[str],
    bench: str,
    output: Path | None,
) -> Path:
    """Draw friction over rate, angle and time; return the path of the picture (with a CSV file).

    Args:
        names: of friction models and specimens.
        motion: `MotionOptions` as written.
        changes: `PARAMETER=VALUE`, for every model that has the parameter.
        bench: its first friction interface provides the other parameters.
        output: path of the picture, `.svg`.

    Raises UsageError for an unknown model, parameter or file, and for a missing parameter.
    """
    asked = find_faults(MotionOptions, motion)
    if isinstance(asked, list):
        raise UsageError("\n".join(f"--{place[0]}: {message}" for place, _, message in asked))
    path = output or Path(f"{'-'.join(names)}.svg")
    if path.suffix != ".svg":
        raise UsageError(f"--output {path}: a picture's name ends in .svg")
    chosen = list(_chosen(names, changes, bench))
    met = [_met(model, options, asked) for model, options in chosen]
    for each in met:
        accuracy = f"half the step changes it by at most {number(100 * each.change, 2)} %"
        print_line(f"{each.model.name}: {each.model.summary}; {accuracy}")
    with writing(path):
        path.write_text(draw(_figure(met, asked)), encoding="utf-8", newline="\n")
        columns = dict(zip(("time_s", "rate_rad_per_s", "angle_rad"), _motion(asked), strict=True))
        columns |= {f"{each.model.name}_N_m": each.friction for each in met}
        pd.DataFrame(columns).to_csv(
            path.with_suffix(".csv"), index=False, float_format="%.9g", lineterminator="\n"
        )
    return path


def _chosen(
    names: Sequence[str], changes: Sequence[str], bench: str
) -> Iterator[tuple[AnyModel, Any]]:
    """Models with their validated options."""
    rooms: Sequence[Kinds[Any]] = (friction_models(), specimens())
    every = [name for room in rooms for name in room]
    if wrong := [name for name in names if name not in every]:
        raise UsageError(f"there is no friction model {wrong[0]!r}{nearest(wrong[0], every)}")
    known: dict[str, AnyModel] = {n: room[n] for room in rooms for n in names if n in room}
    overrides, problems = parse_overrides([f"model.{change}" for change in changes])
    if problems:
        raise UsageError("\n".join(str(problem) for problem in problems))
    friction = bench_source(bench).tree.get("friction")
    given: Mapping[str, Any] = (
        next(iter(friction.values()), {}) if isinstance(friction, Mapping) else {}
    )
    used: set[str] = set()
    for name in names:
        fields = known[name].options.model_fields
        tree: dict[str, Any] = {key: value for key, value in given.items() if key in fields}
        tree["model"] = name
        for override in overrides:
            key, *deeper = map(str, override.keys[1:])
            if key in fields:
                used.add(key)
                tree[key] = reduce(lambda value, step: {step: value}, deeper[::-1], override.value)
        options = find_faults(known[name].options, tree)
        if isinstance(options, list):
            messages = (": ".join((*map(str, place), message)) for place, _, message in options)
            raise UsageError(
                f"{name}: {'; '.join(messages)}; --set PARAMETER=VALUE sets a value, and "
                f"`campaign kinds {name}` lists all"
            )
        yield known[name], options
    for override in overrides:
        if (key := str(override.keys[1])) not in used:
            raise UsageError(f"--set {key}: not a parameter of {', '.join(names)}")


def _met(model: AnyModel, options: Any, motion: MotionOptions) -> ModelCycle:
    """Simulate a model; the step is halved until the change is at most `ACCURACY`."""
    per_cycle, coarse = PER_CYCLE, _cycle(model, options, motion, PER_CYCLE)
    while True:
        per_cycle *= 2
        fine = _cycle(model, options, motion, per_cycle)
        change = float(np.max(np.abs(fine - coarse)) / max(np.max(np.abs(fine)), 1e-300))
        if change <= ACCURACY or per_cycle >= FINEST:
            return ModelCycle(model, options, fine, change)
        coarse = fine


def _cycle(model: AnyModel, options: Any, motion: MotionOptions, per_cycle: int) -> Array:
    """Friction in the last cycle, at `PER_CYCLE` samples."""
    if isinstance(model, Specimen):
        time, _, angle = _motion(motion, CYCLES, per_cycle)
        friction = model.torque(options, time, angle)
    else:
        along = Along.sine(motion.rate, motion.frequency, CYCLES, per_cycle)
        friction = along.friction(options.model_dump(mode="json"))
    return friction[-per_cycle :: per_cycle // PER_CYCLE]


def _motion(
    motion: MotionOptions, cycles: int = 1, per_cycle: int = PER_CYCLE
) -> tuple[Array, Array, Array]:
    """Time (s), rate (rad/s) and angle (rad), shape (cycles * per_cycle,)."""
    time = np.arange(cycles * per_cycle) / (per_cycle * motion.frequency)
    turned = 2.0 * np.pi * motion.frequency
    angle = -motion.rate / turned * np.cos(turned * time)
    return time, motion.rate * np.sin(turned * time), angle


def _figure(met: Sequence[ModelCycle], motion: MotionOptions) -> Figure:
    time, rate, angle = _motion(motion)
    torque = Axis("Friction torque", "N m", "N m")
    steady = np.linspace(-motion.rate, motion.rate, 401)
    closed = [np.append(each.friction, each.friction[0]) for each in met]
    names = [each.model.name for each in met]

    def over(x: Array) -> list[Curve]:
        around = np.append(x, x[0])
        return [Curve(around, y, name, name) for y, name in zip(closed, names, strict=True)]

    alone = met[0].model.steady_state(met[0].options, steady)
    return Figure(
        key="model",
        title="Friction models at a sinusoidal rate",
        caption="",
        alt="Friction torque over rate, over angle and over time.",
        panels=(
            Panel(
                Axis("Rate", "rad/s", "deg/s"),
                torque,
                [
                    *over(rate),
                    Curve(steady, alone, f"{names[0]}, steady sliding", "reference", "line"),
                ],
                "Over rate",
            ),
            Panel(Axis("Angle", "rad", "deg"), torque, over(angle), "Over angle"),
            Panel(
                Axis("Time", "s"),
                torque,
                [
                    Curve(time, each.friction, name, name)
                    for each, name in zip(met, names, strict=True)
                ],
                "Over time",
            ),
        ),
        across=2,
    )
