"""Step response of the rate loop, usually without friction (section 4.2.3)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field, ValidationError, field_validator

from campaign.channels import COMMAND, GYRO_RATE
from campaign.estimate import Estimate, Window
from campaign.estimation.intervals import of_repeats
from campaign.estimation.rise_time import rise_interval
from campaign.estimation.sampled_curve import drop_interval_if_deterministic
from campaign.estimation.step_response import NOT_SETTLED, StepCharacteristics, step_characteristics
from campaign.experiments.interface import Experiment, TestData, TrialData, key, metrics, validated
from campaign.experiments.shared import default_options
from campaign.experiments.shared.captions import duration
from campaign.experiments.shared.common import conditions, grouped, method_label, swept
from campaign.experiments.shared.detected_trials import step_found
from campaign.experiments.shared.swept_words import words as swept_words
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.recording import Recording
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
from campaign.trial import OfferedRecording, Task, Trial, TrialRequest
from campaign.units import Angle, AngularRate, Frequency, Time

LEAST_REST = 0.01
"""Shortest standstill (s) before a step."""


class StepResponseOptions(Options):
    """Options of a step response test."""

    step: AngularRate = float(np.deg2rad(1.0))
    """Height of the step of the rate command; negative: downwards, or to the negative side."""
    ramp: Time = Field(default=0.005, ge=0)
    """Rise time of the command. A jump exceeds any limit of acceleration, so 0 is for recordings
    only."""
    linear: bool = True
    """Without the bench's friction, as the loop was tuned; false: with it. Only a simulated bench
    can omit friction."""
    compensation: str = "none"
    """Name of a compensation of the bench, or none."""
    rest: Time = Field(default=0.1, ge=LEAST_REST)
    """Standstill before the step."""
    duration: Time = Field(default=1.0, gt=0)
    """From the start of the step to the end of the trial."""
    band: float = Field(default=0.02, gt=0, lt=0.5)
    """Half-width of the settling band, as a share of the step."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    position: Angle = 0.0
    """Start angle of the load relative to the hull."""

    @field_validator("step")
    @classmethod
    def _is_one(cls, step: float) -> float:
        if step == 0.0:
            raise ValueError("a step of zero is none")
        return step


def _trials(options: StepResponseOptions, bench: Bench) -> Iterator[TrialRequest]:
    if options.ramp == 0.0:
        raise ValueError("a jump of the command breaks any limit of acceleration; give it a ramp")
    if options.ramp > 0.1 * options.duration:
        raise ValueError("a ramp of over a tenth of the duration is no step; shorten ramp")
    stop = options.rest + options.duration
    plain = bench.model_copy(update={"friction": {}}).model_dump(mode="json")
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
        bench=plain if options.linear else None,
        note="without the bench's friction" if options.linear else "",
        windows=tuple(_windows(options)),
    )


REST, ANSWER = "rest", "answer"
"""Windows: standstill before the step, and all that follows it."""


def _windows(options: StepResponseOptions) -> Iterator[Window]:
    """Windows for the plan, and for archived trials without windows."""
    yield Window(REST, 0.0, options.rest)
    yield Window(ANSWER, options.rest, options.rest + options.duration)


def _found(
    options: StepResponseOptions, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """Trial of the step in an unplanned recording."""
    request = step_found(offered, (REST, ANSWER))
    if float(str(request.options["rest"])) < LEAST_REST:
        raise ValueError(
            f"{COMMAND}: its step comes within {1e3 * LEAST_REST:g} ms of its begin; "
            "the standstill before it is needed too"
        )
    yield request


def _answer(trial: Trial) -> Window:
    """Window of the response: the one named `answer`, else that of the options."""
    windows = (*trial.windows, *_windows(_options(trial)))
    return next(window for window in windows if window.name == ANSWER)


def _options(trial: Trial) -> StepResponseOptions:
    """Options of a trial. Raises ValueError with a message for the user if of another test."""
    try:
        return validated(StepResponseOptions, trial.options)
    except ValidationError as error:
        wrong = ", ".join(str(each["loc"][0]) for each in error.errors() if each["loc"])
        raise ValueError(f"these options fit no step response: {wrong}") from None


def _characteristics(
    trial: Trial, recording: Recording
) -> tuple[StepCharacteristics, Estimate | None]:
    """Characteristics of a step, and its rise time with the interval of its noise, or None."""
    options, start = _options(trial), _answer(trial).start
    rate = recording[GYRO_RATE]
    step = step_characteristics(recording.time, rate, start, options.step, options.band)
    if not math.isfinite(step.rise_time):
        return step, None
    interval = rise_interval(recording.time, rate, start, options.step, step)
    if interval is None:
        return step, None
    rise, rise_from = interval
    reasons = step.reasons | ({} if math.isfinite(rise.value) else {"rise_time": rise.reason})
    step = replace(step, rise_time=rise.value, rise_from=rise_from, reasons=reasons)
    return step, rise


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Rise time, settling time, steady-state error, overshoot; without those not seen."""
    step, rise = _characteristics(data.trial, data.recording())
    values = ((name, float(getattr(step, name)), unit) for name, unit in QUANTITIES)
    return tuple(
        rise
        if rise is not None and name == rise.name
        else Estimate(name, value, unit, reason=ONE_STEP())
        for name, value, unit in values
        if math.isfinite(value)
    )


ONE_STEP = Cause("of one step", "it is of one step: repeats measure its scatter")
NOT_SEEN = Cause("not seen in every step", "not every step was seen to do that")


def _evaluate(data: TrialData, paths: list[str]) -> Step:
    options = _options(data.trial)
    recording: Recording = data.recording()  # for the figure, and for reasons
    again, _ = _characteristics(data.trial, recording)
    estimates = dict(metrics(data, _measure))
    for name, unit in QUANTITIES:
        if name not in estimates:
            reason = again.reasons.get(name, NOT_SEEN())
            estimates[name] = Estimate.without_interval(name, math.nan, unit, reason)
    rate, start = recording[GYRO_RATE], _answer(data.trial).start
    before = rate[(recording.time < start) & np.isfinite(rate)]
    place = conditions(data, "compensation", "linear")
    words = ["linear loop" if options.linear else "with friction"]
    if options.compensation != "none" or "compensation" in paths:
        words.append(method_label(options.compensation))
    others = {path: place.get(path) for path in paths if path not in ("compensation", "linear")}
    label = ", ".join([*words, *swept_words(others, data.trial)])
    plain = options.linear and options.compensation == "none"
    return Step(
        place,
        label,
        "measured" if plain else label,
        recording.time - start,
        rate,
        recording[COMMAND] if COMMAND in recording.channels else None,
        float(np.mean(before)) if before.size else 0.0,
        options,
        again.rise_from - start,
        estimates,
    )


QUANTITIES = (
    ("rise_time", "s"),
    ("settling_time", "s"),
    ("steady_state_error", "rad/s"),
    ("overshoot", ""),
)


def _analyse(data: TestData) -> Result:
    paths = list(swept(data))
    places = [
        [_evaluate(item, paths) for item in group] for group in grouped(data.completed()).values()
    ]
    if not places:
        return Result()
    steps = [step for repeats in places for step in repeats]
    findings = (
        Finding.of(_together(repeats, name, unit), repeats[0].place)
        for repeats in places
        for name, unit in QUANTITIES
    )
    extra = [path for path in paths if path not in ("linear", "compensation")]
    notes = (note for step in steps for note in _notes(step))
    table, figure = step_table(steps, extra), step_figure(steps)
    return Result((table,), (figure,), tuple(findings), tuple(notes))


def _notes(step: Step) -> Iterator[str]:
    """Sentences on the characteristics of a step without a number, with the reason."""
    label = f"{step.label[0].upper()}{step.label[1:]}"
    for name, what in UNSEEN.items():
        reason = step.found[name].reason
        if math.isfinite(step.value(name)):
            continue
        if reason in NOT_SETTLED:
            band = f"{100 * step.options.band:g} %"
            yield f"{label}: the rate does not stay within {band} of the step."
        else:
            yield f"{label}: no {what}: {reason}."


UNSEEN = {"rise_time": "rise time", "settling_time": "settling time", "overshoot": "overshoot"}
"""Texts of the characteristics that a step may not show."""


def _together(repeats: Sequence[Step], name: str, unit: str) -> Estimate:
    """Mean of a characteristic over repeated steps, with the interval of their scatter.

    A single step has its own value, with the interval of its noise.
    """
    if len(repeats) == 1 and repeats[0].found[name].has_interval:
        return repeats[0].found[name]
    values = [step.value(name) for step in repeats]
    if not all(map(math.isfinite, values)):
        unseen = [step.found[name].reason for step in repeats if math.isnan(step.value(name))]
        # Compare the texts: their values may differ by less than a text shows.
        why = unseen[0] if len(set(map(str, unseen))) == 1 else NOT_SEEN()
        return Estimate.without_interval(name, math.nan, unit, why)
    return drop_interval_if_deterministic(of_repeats(name, values, unit), max(map(abs, values)))


SHOWN = 2.5
"""The figure shows the step up to this many settling times."""


@dataclass(frozen=True)
class Step:
    """One step with its characteristics: time from the step, rate, command, shape (n,), SI.

    The command is None where it was not recorded; `level` is the rate (rad/s) before the step.
    """

    place: dict[str, Value]
    label: str
    series: str
    time: Array
    rate: Array
    command: Array | None
    level: float
    options: StepResponseOptions
    rise_from: float
    found: Mapping[str, Estimate]

    def value(self, name: str) -> float:
        """A characteristic by name; NaN where it was not seen."""
        return self.found[name].value if name in self.found else math.nan


def step_table(steps: Sequence[Step], extra: Sequence[str]) -> Table:
    """A row for each step; `extra`: swept paths with a column of their own."""
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
        note="Times count from the start of the step. Each row is one step: the interval of its "
        "rise time is that of its own noise. The findings combine repeats, with intervals.",
    )


def step_figure(steps: Sequence[Step]) -> Figure:
    """Figure of the steps over time, with marks on the first of them."""
    first = steps[0]
    times = [step.value("settling_time") for step in steps]
    settled = [time for time in times if math.isfinite(time)]
    end = min(SHOWN * max(settled), first.options.duration) if settled else first.options.duration
    height, level = first.options.step, first.level
    ends = sorted(level + height * (1 + sign * first.options.band) for sign in (-1, 1))
    curves = []
    if first.command is not None:
        curves.append(Curve(first.time, first.command, "command", "reference", "thin"))
    curves += [Curve(step.time, step.rate, step.label, step.series) for step in steps]
    band = 100 * first.options.band
    marks = [
        Mark(f"±{band:g} %", y=ends[0], until=ends[1]),
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
    """Marks of rise, overshoot and settling of one step, as far as seen."""
    rise, settled, over = (step.value(name) for name in ("rise_time", "settling_time", "overshoot"))
    if math.isfinite(rise + step.rise_from):
        start = step.rise_from
        yield Mark(f"rise {duration(rise)}", x=start, until=start + rise, series=step.series)
    if over > 0:
        # Only after the step: noise before it may be as large.
        share = np.where(step.time >= 0, step.rate / step.options.step, np.nan)
        peak = int(np.nanargmax(share))
        label = f"overshoot {100 * over:.3g} %"
        x, y = float(step.time[peak]), float(step.rate[peak])
        yield Mark(label, x=x, y=y, point=True, series=step.series)
    if math.isfinite(settled):
        yield Mark(f"settled {duration(settled)}", x=settled, series=step.series)


EXPERIMENT = Experiment(
    name="step_response",
    summary="rise, settling and steady state of the rate loop (Figure 4.7)",
    options=StepResponseOptions,
    trials=_trials,
    analyse=_analyse,
    measure=_measure,
    fit=default_options.step_response,
    recorded=_found,
    windows=(REST, ANSWER),
    perturbs_bench=True,
    requires={GYRO_RATE: "the response"},
    can_use={COMMAND: "command in the figure"},
    key_numbers=(
        key("settling_time"),
        key("overshoot"),
        key("rise_time"),
    ),
)
