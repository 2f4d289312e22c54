"""Step response of the rate loop, as a rule without friction: how it was tuned (section 4.2.3)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import Field

from campaign.channels import COMMAND, GYRO_RATE
from campaign.estimate import Estimate, Window
from campaign.experiments.conclusions.parts import Settings
from campaign.experiments.conclusions.servo import step_conclusions
from campaign.experiments.interface import Experiment, TestData, TrialData, metrics
from campaign.experiments.shared import fitting
from campaign.experiments.shared.common import (
    conditions,
    failures_note,
    grouped,
    method_label,
    swept,
)
from campaign.experiments.shared.swept_words import words as swept_words
from campaign.identification.intervals import of_repeats
from campaign.identification.sampled import where_it_scatters
from campaign.identification.step_response import reached, step_characteristics
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import (
    Array,
    Axis,
    Cell,
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
from campaign.trial import Recording, Task, Tree, Trial, TrialRequest
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
        windows=tuple(_windows(options)),
    )


REST, ANSWER = "rest", "answer"
"""Windows: standstill before the step, and all that follows it."""


def _windows(options: StepResponseOptions) -> Iterator[Window]:
    """For the plan, and for archived trials that are older than windows."""
    yield Window(REST, 0.0, options.rest)
    yield Window(ANSWER, options.rest, options.rest + options.duration)


def _answer(trial: Trial) -> Window:
    windows = trial.windows or _windows(_options(trial))
    return next(window for window in windows if window.name == ANSWER)


def _options(trial: Trial) -> StepResponseOptions:
    return StepResponseOptions.model_validate(trial.options, context={"si": True})


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Rise, settling, overshoot and what error stays; without those that were not seen."""
    options = _options(data.trial)
    recording = data.recording()
    found = step_characteristics(
        recording.time, recording[GYRO_RATE], _answer(data.trial).start, options.step, options.band
    )
    values = ((name, float(getattr(found, name)), unit) for name, unit in QUANTITIES)
    return tuple(
        Estimate(name, value, unit, reason=ONE_STEP)
        for name, value, unit in values
        if math.isfinite(value)
    )


ONE_STEP = "it is of one step: repeats would show how it scatters"
NOT_SEEN = "not every step was seen to do that before its recording ended"


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
    found: Mapping[str, Estimate]

    def value(self, name: str) -> float:
        """A characteristic by name; NaN where it was not seen."""
        return self.found[name].value if name in self.found else math.nan


def _evaluate(data: TrialData, paths: list[str]) -> Step:
    options = _options(data.trial)
    found = metrics(data, _measure)
    recording: Recording = data.recording()  # for the figure
    place = conditions(data, "compensation", "linear")
    words = ["linear loop" if options.linear else "with friction"]
    if options.compensation != "none" or "compensation" in paths:
        words.append(method_label(options.compensation))
    others = {path: place.get(path) for path in paths if path not in ("compensation", "linear")}
    label = ", ".join([*words, *swept_words(others, data.trial, StepResponseOptions)])
    plain = options.linear and options.compensation == "none"
    return Step(
        place,
        label,
        "measured" if plain else label,
        recording.time - _answer(data.trial).start,
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
        findings += (
            Finding.of(_together(repeats, name, unit), repeats[0].place)
            for name, unit in QUANTITIES
        )
    if not steps:
        return Result(notes=tuple(notes))
    notes += [
        f"{step.label[0].upper()}{step.label[1:]}: the rate does not stay within "
        f"{100 * step.options.band:g} % of the step."
        for step in steps
        if not math.isfinite(step.value("settling_time"))
    ]
    tables = (_table(steps, [path for path in paths if path not in ("linear", "compensation")]),)
    options, settings = steps[0].options, Settings.of(data, StepResponseOptions)
    return Result(
        tables,
        (_figure(steps),),
        tuple(findings),
        tuple(dict.fromkeys(notes)),
        step_conclusions(findings, options.step, options.band, settings),
    )


def _together(repeats: Sequence[Step], name: str, unit: str) -> Estimate:
    """Mean of a characteristic over repeated steps, with the interval of their scatter."""
    values = [step.value(name) for step in repeats]
    if not all(map(math.isfinite, values)):
        return Estimate.without_interval(name, math.nan, unit, NOT_SEEN)
    return where_it_scatters(of_repeats(name, values, unit), max(map(abs, values)))


def _table(steps: list[Step], extra: list[str]) -> Table:
    rows: list[Mapping[str, Cell]] = []
    for step in steps:
        loop = "without friction" if step.options.linear else "with friction"
        rows.append({**step.place, "loop": loop, **step.found})
    band = 100 * steps[0].options.band
    return Table(
        key="step-response",
        title="Step response of the rate loop",
        columns=(
            Column("loop", "Loop"),
            Column("compensation", "Compensation"),
            *(Column(path, path, exact=True) for path in extra),
            Column("rise_time", "Rise time (10 to 90 %)", "s", "ms"),
            Column("settling_time", f"Settling time ({band:g} %)", "s", "ms"),
            Column("overshoot", "Overshoot", "", "percent"),
            Column("steady_state_error", "Steady-state error", "rad/s", "deg/s"),
        ),
        rows=tuple(rows),
        thesis=(),
        note="Times count from the start of the step. Each row is one step; what repeats of it say "
        "together, with intervals, is among the findings.",
    )


def _figure(steps: list[Step]) -> Figure:
    first = steps[0]
    times = [step.value("settling_time") for step in steps]
    settled = [time for time in times if math.isfinite(time)]
    end = min(SHOWN * max(settled), first.options.duration) if settled else first.options.duration
    height = first.options.step
    curves = []
    if first.command is not None:
        curves.append(Curve(first.time, first.command, "command", "reference", "thin"))
    curves += [Curve(step.time, step.rate, step.label, step.series) for step in steps]
    band = 100 * first.options.band
    marks = [
        Mark(f"±{band:g} %", y=height * (1 - 0.01 * band), until=height * (1 + 0.01 * band)),
        *_marks(first),
    ]
    marked = f" Marked are numbers of: {first.label}." if len(steps) > 1 and marks[1:] else ""
    return Figure(
        key="step",
        title="Step response of the rate loop",
        caption="The rate rises to its command; it has settled once it stays within the shaded "
        f"band of ±{band:g} % of the step around it.{marked}",
        alt="Rate of the load over time after a step of the rate command, with the band in which "
        "it counts as settled; rise, overshoot and settling are marked where they are seen.",
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


def _marks(step: Step) -> Iterator[Mark]:
    """Rise, overshoot and settling of one step, where they were seen."""
    rise, settled, over = (step.value(name) for name in ("rise_time", "settling_time", "overshoot"))
    height = step.options.step
    if math.isfinite(rise):
        before = step.rate[step.time < 0]
        zero = float(np.mean(before)) if before.size else 0.0
        start = reached(step.time, (step.rate - zero) / height, RISE_FROM)
        yield Mark(f"rise {_time(rise)}", x=start, until=start + rise, series=step.series)
    if over > 0:
        peak = int(np.nanargmax(step.rate))
        label = f"overshoot {100 * over:.3g} %"
        x, y = float(step.time[peak]), float(step.rate[peak])
        yield Mark(label, x=x, y=y, point=True, series=step.series)
    if math.isfinite(settled):
        yield Mark(f"settled {_time(settled)}", x=settled, series=step.series)


RISE_FROM = 0.1
"""Share of the step from which on the rise time counts."""


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


EXPERIMENT = Experiment(
    name="step_response",
    summary="rise, settling and steady state of the rate loop (Figure 4.7)",
    options=StepResponseOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    fit=fitting.step_response,
    perturbs_bench=True,
    requires={GYRO_RATE: "the response"},
    can_use={COMMAND: "command in the figure"},
)
