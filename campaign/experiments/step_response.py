"""Step response of the rate loop, as a rule without friction: how it was tuned (section 4.2.3)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import COMMAND, GYRO_RATE
from campaign.experiments.common import conditions, failures_note, grouped, method_label, swept
from campaign.experiments.interface import Experiment, TestData, TrialData
from campaign.identification.step_response import StepCharacteristics, step_characteristics
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import (
    Array,
    Axis,
    Column,
    Curve,
    Figure,
    Finding,
    Mark,
    Panel,
    Result,
    Table,
    Value,
)
from campaign.signals import Polyline
from campaign.trial import Task, Tree, TrialRequest
from campaign.units import Angle, AngularRate, Frequency, Time

SHOWN = 2.5
"""The figure shows the step up to this many settling times."""


class StepResponseOptions(Options):
    """Options of a step response test."""

    step: AngularRate = Field(default=float(np.deg2rad(1.0)), gt=0)
    """Height of the step of the rate command."""
    ramp: Time = Field(default=0.005, gt=0)
    """How long the command takes to rise: a jump would break any limit of acceleration."""
    linear: bool = True
    """Without the bench's friction, as the loop was tuned; false: as it is. Friction can be taken
    away from a simulated bench only."""
    compensation: str = "none"
    """Compensation method, by its name on the bench; none for none."""
    rest: Time = Field(default=0.1, ge=0.01)
    """Standstill before the step."""
    duration: Time = Field(default=1.0, gt=0)
    """From the start of the step to the end of the trial."""
    band: float = Field(default=0.02, gt=0, lt=0.5)
    """The response has settled once it stays this close, as a share of the step."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    position: Angle = 0.0
    """Angle of the load relative to the hull at the start."""


def _trials(options: StepResponseOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.ramp > 0.1 * options.duration:
        raise ValueError("a ramp of over a tenth of the duration is no step; shorten ramp")
    stop = options.rest + options.duration
    yield TrialRequest(
        Task(
            mode="rate",
            command=Polyline(
                times=(0.0, options.rest, options.rest + options.ramp),
                values=(0.0, 0.0, options.step),
            ),
            compensation=options.compensation,
            duration=stop,
            window=(options.rest, stop),
            sample_rate=options.sample_rate,
            start_angle=options.position,
        ),
        bench=_without_friction(bench) if options.linear else None,
        note="without the bench's friction" if options.linear else "",
    )


def _without_friction(bench: Bench) -> Tree:
    tree: Tree = bench.model_copy(update={"friction": {}}).model_dump(mode="json")
    return tree


@dataclass(frozen=True)
class Step:
    """One step and what it says: time from the step, rate and command, shape (n,), SI.

    The command is None where it was not recorded.
    """

    place: dict[str, Value]
    label: str
    series: str
    time: Array
    rate: Array
    command: Array | None
    options: StepResponseOptions
    found: StepCharacteristics


def _evaluate(data: TrialData, paths: list[str]) -> Step:
    options = StepResponseOptions.model_validate(data.trial.options, context={"si": True})
    recording = data.recording()
    found = step_characteristics(
        recording.time, recording[GYRO_RATE], options.rest, options.step, options.band
    )
    place = conditions(data, "compensation", "linear")
    words = ["linear loop" if options.linear else "with friction"]
    if options.compensation != "none" or "compensation" in paths:
        words.append(method_label(options.compensation))
    words += [f"{path} = {place.get(path)}" for path in paths if path not in place or "." in path]
    label = ", ".join(words)
    plain = options.linear and options.compensation == "none"
    return Step(
        place,
        label,
        "measured" if plain else label,
        recording.time - options.rest,
        recording[GYRO_RATE],
        recording[COMMAND] if COMMAND in recording.channels else None,
        options,
        found,
    )


QUANTITIES = (
    ("rise_time", "s"),
    ("settling_time", "s"),
    ("steady_state_error", "rad/s"),
    ("overshoot", ""),
)


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    paths = list(swept(data))
    steps: list[Step] = []
    findings: list[Finding] = []
    for group in grouped(data.completed()).values():
        try:
            repeats = [_evaluate(item, paths) for item in group]
        except ValueError as error:
            notes.append(f"{group[0].trial.label}: {error}.")
            continue
        steps += repeats
        for name, unit in QUANTITIES:
            mean = float(np.mean([getattr(step.found, name) for step in repeats]))
            findings.append(Finding(name, mean, unit, repeats[0].place))
    if not steps:
        return Result(notes=tuple(notes))
    notes += [
        f"{step.label[0].upper()}{step.label[1:]}: the rate does not stay within "
        f"{100 * step.options.band:g} % of the step."
        for step in steps
        if not math.isfinite(step.found.settling_time)
    ]
    tables = (_table(steps, [path for path in paths if path not in ("linear", "compensation")]),)
    return Result(tables, (_figure(steps),), tuple(findings), tuple(dict.fromkeys(notes)))


def _table(steps: list[Step], extra: list[str]) -> Table:
    rows: list[dict[str, Value]] = []
    for step in steps:
        values = {name: getattr(step.found, name) for name, _ in QUANTITIES}
        finite = {name: v if math.isfinite(v) else None for name, v in values.items()}
        loop = "without friction" if step.options.linear else "with friction"
        rows.append({**step.place, "loop": loop, **finite})
    band = 100 * steps[0].options.band
    return Table(
        key="step-response",
        title="Step response of the rate loop",
        columns=(
            Column("loop", "Loop"),
            Column("compensation", "Compensation"),
            *(Column(path, path) for path in extra),
            Column("rise_time", "Rise time (10 to 90 %)", "s", "ms"),
            Column("settling_time", f"Settling time ({band:g} %)", "s", "ms"),
            Column("overshoot", "Overshoot", "", "percent"),
            Column("steady_state_error", "Steady-state error", "rad/s", "deg/s"),
        ),
        rows=tuple(rows),
        thesis=(),
        note="Times count from the start of the step.",
    )


def _figure(steps: list[Step]) -> Figure:
    first = steps[0]
    settled = [s.found.settling_time for s in steps if math.isfinite(s.found.settling_time)]
    end = min(SHOWN * max(settled), first.options.duration) if settled else first.options.duration
    height = first.options.step
    curves = []
    if first.command is not None:
        curves.append(Curve(first.time, first.command, "command", "reference", "thin"))
    curves += [Curve(step.time, step.rate, step.label, step.series) for step in steps]
    band = first.options.band
    marks = [
        Mark(f"±{100 * band:g} %", y=height * (1 + band)),
        Mark("", y=height * (1 - band)),
    ]
    if math.isfinite(first.found.settling_time):
        marks.append(Mark("settled", x=first.found.settling_time))
    return Figure(
        key="step",
        title="Step response of the rate loop",
        caption="The rate rises to its command and settles on it without an error that stays; the "
        "zero of the PI controller makes it overshoot on the way.",
        alt="Rate of the load over time after a step of the rate command, with the band in which "
        "it counts as settled.",
        panels=(
            Panel(
                Axis("Time from the step", "s", "ms", limits=(-0.05 * end, end)),
                Axis("Rate", "rad/s", "deg/s"),
                curves,
                marks=tuple(marks),
            ),
        ),
        thesis=("4.7",),
    )


EXPERIMENT = Experiment(
    name="step_response",
    summary="rise, settling and steady state of the rate loop (Figure 4.7)",
    options=StepResponseOptions,
    trials=_trials,
    analyse=_analyse,
    requires={GYRO_RATE: "the response"},
    can_use={COMMAND: "command in the figure"},
)
