"""Stick-slip: the load on a spring whose far end moves at a constant rate.

The load sticks while the spring is wound up, breaks loose at the static torque, overtakes the
spring because sliding friction is smaller, and sticks again (Figure 2.12).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
from pydantic import Field

from campaign.channels import COMMAND, DRIVE_TORQUE, LOAD_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate
from campaign.estimation.intervals import of_repeats, shifted_by
from campaign.estimation.sampled_curve import LOST, SAMPLES, bracketed, peak, upward_crossings
from campaign.experiments.interface import Experiment, TestData, TrialData, validated
from campaign.experiments.shared.captions import amount, sentence, setting, trials_of
from campaign.experiments.shared.common import COUNTED
from campaign.experiments.shared.friction_models import (
    OF_ONE,
    ConditionGroup,
    combined,
    in_models,
    model_label,
    model_series,
    places,
    simulated,
)
from campaign.experiments.shared.swept_words import axis_of, name_of, words
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
)
from campaign.signals import Polyline
from campaign.trial import Task, TrialRequest
from campaign.units import AngularRate, Frequency, RotationalStiffness, Time


class StickSlipOptions(Options):
    """Options of a stick-slip test."""

    stiffness: RotationalStiffness = Field(default=100.0, gt=0)
    """Stiffness of the spring."""
    pull_rate: AngularRate = Field(default=0.02, gt=0)
    """Rate of the spring's far end."""
    duration: Time = Field(default=60.0, gt=0)
    """Duration of the pull."""
    slip_rate: AngularRate = Field(default=0.02, gt=0)
    """Rate of the load that counts as a slip."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording; slips are timed between two samples."""
    models: tuple[str, ...] = ()
    """Friction models to describe the bench's friction, one by one; none: its own."""


def _trials(options: StickSlipOptions, bench: Bench) -> Iterator[TrialRequest]:
    far = options.pull_rate * options.duration
    for point, tree in in_models(bench, options.models):
        yield TrialRequest(
            Task(
                mode="spring",
                spring_stiffness=options.stiffness,
                command=Polyline(times=(0.0, options.duration), values=(0.0, far)),
                duration=options.duration,
                window=(0.0, options.duration),
                sample_rate=options.sample_rate,
            ),
            point=point,
            bench=tree,
        )


UNITS = {"first_slip": "s", "period": "s", "peak_torque": "N m", "top_rate": "rad/s"}
"""Metrics of a pull: time of the first slip, mean time between slips (without the first, whose
spring began unstretched), largest torque of the spring, and largest rate of the load."""
OF_SLIPS = ("first_slip", "period")
TOO_FEW_SLIPS = Cause("too few slips", "there were too few slips")
PREFIX = "stick_slip_"
PARTS = 200
"""Parts of a period, in the search for a rest."""
RESTS, AT_REST = 0.2, 0.005
"""A load rests if, in the first share of a period, it moves by at most the second share of the pull
in a period. For comparison: a load that swings undamped about the pull, and just stops, moves by a
share of 0.013 in 0.2 of a period."""


def _measure(data: TrialData) -> tuple[Estimate, ...]:
    """Numbers of slips and rests, and the metrics of `UNITS` that the pull shows."""
    options = validated(StickSlipOptions, data.trial.options)
    recording = data.recording()
    rate = recording[LOAD_RATE]
    peaks = peak("peak_torque", recording[DRIVE_TORQUE], "N m"), peak("top_rate", rate, "rad/s")
    if not np.all(np.isfinite(rate)):  # the number of lost slips is unknown
        return simulated(replace(each, name=PREFIX + each.name) for each in peaks)
    times, before = upward_crossings(recording.time, rate, options.slip_rate)
    step = 1.0 / data.trial.task.sample_rate
    counts = {"slips": float(len(times))}
    if RELATIVE_ANGLE in recording.channels and np.all(np.isfinite(recording[RELATIVE_ANGLE])):
        counts["rests"] = _rests(recording, times, options.pull_rate)
    estimates = [
        *(Estimate(name, n, "", kind="count", reason=COUNTED()) for name, n in counts.items()),
        *peaks,
    ]
    if len(times):
        ends = float(before[0]), float(before[0]) + step
        method = "where the rate rises, between two samples"
        estimates.append(bracketed("first_slip", float(times[0]), "s", ends, method))
    if len(times) > 2:
        estimates.append(_period(np.diff(times[1:]), step))
    return simulated(replace(each, name=PREFIX + each.name) for each in estimates)


def _rests(recording: Recording, slips: Array, pull: float) -> float:
    """Number of consecutive periods with a rest, up to the last slip; `slips` (s), shape (n,)."""
    count = 0
    for start, end in reversed(list(pairwise(slips))):
        time = np.linspace(start, end, 1 + PARTS)
        x = np.interp(time, recording.time, recording[RELATIVE_ANGLE])
        length = round(RESTS * PARTS)
        if np.min(np.abs(x[length:] - x[:-length])) > AT_REST * pull * (end - start):
            break
        count += 1
    return float(count)


def _period(between: Array, step: float) -> Estimate:
    """Mean of the times `between` slips (s), shape (n,), each timed to one `step` (s)."""
    mean, one = float(np.mean(between)), step / len(between)
    if len(between) == 1:
        method = "one time between slips, each between two samples"
        return bracketed("period", mean, "s", (mean - one, mean + one), method)
    # First and last slip have errors of at most a step: together a triangular distribution.
    period = of_repeats("period", between, "s", "times between slips")
    return shifted_by(period, SAMPLES, one / math.sqrt(6.0))


def _analyse(data: TestData) -> Result:
    groups = places(data.completed(), own=())
    if not groups:
        return Result()
    measured = [(place, _shown(place)) for place in groups]
    rows: list[dict[str, Cell]] = [
        {
            **place.point,
            "slips": _count(m["slips"].value),
            "rests": _count(m["rests"].value),
            **{name: m[name] for name in UNITS},
        }
        for place, m in measured
    ]
    table = Table(
        key="stick-slip",
        title="Stick-slip of a load pulled through a spring",
        columns=(
            *groups[0].columns,
            Column("slips", "Slips", exact=True),
            Column("rests", "Rests", exact=True),
            Column("first_slip", "First slip", "s", "s"),
            Column("period", "Period", "s", "s"),
            Column("peak_torque", "Largest torque of the spring", "N m", "N m"),
            Column("top_rate", "Largest rate of the load", "rad/s", "rad/s"),
        ),
        rows=tuple(rows),
        note="Rests: periods in a row, up to the last slip, of which the load rests for about a "
        "fifth. The period is the mean time between slips after the first one, which "
        "started from an unstretched spring. " + OF_ONE,
    )
    findings = tuple(
        Finding.of(replace(m[name], name=PREFIX + name), place.point)
        for place, m in measured
        for name in UNITS
    )
    few = [
        place.label or "The load"
        for place, m in measured
        if math.isnan(m["period"].value) and not math.isnan(m["slips"].value)
    ]
    loads = few if len(few) <= HISTORIES else [f"{len(few)} of {len(measured)} pulls"]
    notes = (
        f"{load}: fewer than three slips, so there is no period; pull longer, slower, or through a "
        "softer spring."
        for load in loads
    )
    drawn = map_of(measured) or _figure(measured)
    return Result((table,), tuple(filter(None, (drawn,))), findings, tuple(notes))


def _count(slips: float) -> int | float | None:
    """Count as a whole number, or as a mean of repeats; None if it is not determined."""
    if math.isnan(slips):
        return None
    return int(slips) if slips.is_integer() else slips


def _shown(place: ConditionGroup) -> dict[str, Estimate]:
    """Metrics of the pulls of a condition, by name; missing ones are not determined."""
    estimates = {
        name.removeprefix(PREFIX): each for name, each in combined(place.trials, _measure).items()
    }
    counted = "slips" in estimates
    for name, unit in {"slips": "", "rests": "", **UNITS}.items():
        if name not in estimates:
            cause = TOO_FEW_SLIPS if counted and name in OF_SLIPS else LOST
            estimates[name] = Estimate.without_interval(name, math.nan, unit, cause())
    return estimates


def _figure(measured: Measured) -> Figure | None:
    """The first pull of each place over time; None without samples."""
    measured = [each for each in measured if not each[0].trials[0].not_kept]
    if not measured:
        return None
    time = Axis("Time", "s", "s")
    torque, rate, angle = [], [], []
    marks: list[Mark] = []
    for place, found in measured:
        recording, label = place.trials[0].recording(), place.label
        series = model_series(str(place.point.get("model", ""))) or "measured"
        torque.append(Curve(recording.time, recording[DRIVE_TORQUE], label, series))
        rate.append(Curve(recording.time, recording[LOAD_RATE], label, series))
        marks += _first_slip(recording, found, series)
        if RELATIVE_ANGLE in recording.channels:
            angle.append(Curve(recording.time, recording[RELATIVE_ANGLE], label, series))
    if COMMAND in recording.channels:
        angle.append(Curve(recording.time, recording[COMMAND], "end of the spring", "reference"))
    angles = (Panel(time, Axis("Angle", "rad", "rad"), angle, "Angle of the load"),)
    return Figure(
        key="stick-slip",
        title="Stick-slip motion",
        caption=f"{_how(measured[0][0].trials[0])} "
        + " ".join(_what_shows(place, found) for place, found in measured),
        alt="Torque of the spring, rate of the load, and angle of the load with the straight line "
        "of the spring's end, over time.",
        panels=(
            Panel(time, Axis("Spring torque", "N m", "N m"), torque, "Torque of the spring", marks),
            Panel(time, Axis("Rate", "rad/s", "rad/s"), rate, "Rate of the load"),
            *(angles if angle else ()),
        ),
        thesis=("2.12",),
        trials=trials_of(place.trials[0] for place, _ in measured),
    )


def _first_slip(recording: Recording, found: Mapping[str, Estimate], series: str) -> Iterator[Mark]:
    """Mark of the first slip on the torque of the spring."""
    at, torque = found["first_slip"].value, recording[DRIVE_TORQUE]
    known = np.isfinite(torque)
    if math.isfinite(at) and known.any():
        level = float(np.interp(at, recording.time[known], torque[known]))
        label = f"slips at {amount(at, 's')}, {amount(level, 'N m')}"
        yield Mark(label, x=at, y=level, point=True, series=series)


def _how(item: TrialData) -> str:
    """Caption sentence: rate of the pull and stiffness of the spring."""
    options = validated(StickSlipOptions, item.trial.options)
    pull, spring = setting(options.pull_rate, "rad/s"), setting(options.stiffness, "N m/rad")
    return f"The load is pulled at {pull} through a spring of {spring}."


def _what_shows(place: ConditionGroup, found: Mapping[str, Estimate]) -> str:
    """Caption sentence: number of slips, mean period, largest rate."""
    who, slips = place.label or "the load", found["slips"].value
    if math.isnan(slips):
        return sentence(f"{who}: samples were lost, and the number of slips is not known")
    if not slips:
        return sentence(f"{who}: it does not slip")
    top = amount(found["top_rate"].value, "rad/s")
    period = found["period"].value
    times = f"{slips:g} slips" if slips != 1 else "one slip"
    every = f", mean period {amount(period, 's')} after the first" if math.isfinite(period) else ""
    return sentence(f"{who}: {times}{every}, largest rate {top}")


Measured = Sequence[tuple[ConditionGroup, Mapping[str, Estimate]]]
"""Conditions, each with the metrics of its pulls by name."""
SHORT = 0.1
"""Share of a pull within which the load must first slip: a load that sticks again does so within
twice that time and one swing."""
HISTORIES = 8
"""Most pulls that are drawn over time; more pulls with two swept numbers give a map."""


def _kind(found: Mapping[str, Estimate], place: ConditionGroup) -> str:
    if math.isnan(found["rests"].value):
        return "not determined"
    if found["rests"].value > 1.0:
        return "stick-slip"
    early = found["first_slip"].value < SHORT * place.trials[0].trial.task.duration
    return "smooth" if early else "pull too short"


def _counts(measured: Measured) -> str:
    """Caption sentence: number of pulls with stick-slip, by model."""
    kinds: dict[str, list[str]] = {}
    for place, found in measured:
        model = str(place.point.get("model", ""))
        kinds.setdefault(model and f" ({model_label(model)})", []).append(_kind(found, place))
    parts = (f"{own.count('stick-slip')} of {len(own)} pulls{who}" for who, own in kinds.items())
    return f"Stick-slip in {', '.join(parts)}."


def map_of(measured: Measured) -> Figure | None:
    """Map of stick-slip over the two swept numbers with most values; None for few pulls.

    Rests in several periods distinguish stick-slip from a decaying oscillation.
    """
    swept: dict[str, set[float]] = {}
    for place, _ in measured:
        for path, value in place.point.items():
            if isinstance(value, int | float) and not isinstance(value, bool):
                swept.setdefault(path, set()).add(value)
    across = sorted((p for p in swept if len(swept[p]) > 1), key=lambda p: -len(swept[p]))[:2]
    if len(measured) <= HISTORIES or len(across) < 2:
        return None
    trial = measured[0][0].trials[0].trial
    x_axis, y_axis = (
        replace(
            axis_of(path, trial),
            scale="log" if min(swept[path]) > 0.0 else "linear",
            label=name_of(path.split(".")[-1]),
        )
        for path in across
    )
    panels: dict[str, list[tuple[str, float, float]]] = {}
    for place, found in measured:
        others = {path: value for path, value in place.point.items() if path not in across}
        texts = words(others, trial, frozenset(others))
        title = ", ".join(reversed(list(texts)))
        x, y = (float(str(place.point[path])) for path in across)
        panels.setdefault(title, []).append((_kind(found, place), x, y))
    looks = {
        "stick-slip": "measured",
        "smooth": "alternative",
        "pull too short": "reference",
        "not determined": "none",
    }
    return Figure(
        key="stick-slip",
        title="Conditions of stick-slip motion",
        caption=f"{_counts(measured)} A mark for each pull. Stick-slip: the load rests for about a "
        "fifth of a period in two or more periods in a row, up to the last. Too short: it first "
        f"slips after {SHORT:.0%} of the pull.",
        alt="Marks of stick-slip and of smooth sliding over two swept numbers.",
        panels=tuple(
            Panel(
                x_axis,
                y_axis,
                [
                    Curve(
                        np.array([x for own, x, _ in points if own == kind]),
                        np.array([y for own, _, y in points if own == kind]),
                        kind,
                        look,
                        "points",
                    )
                    for kind, look in looks.items()
                    if any(own == kind for own, _, _ in points)
                ],
                title,
            )
            for title, points in panels.items()
        ),
        across=min(3, len(panels)),
        thesis=("2.12",),
    )


EXPERIMENT = Experiment(
    name="stick_slip",
    summary="a load pulled through a spring: period, first slip, peaks (Figure 2.12)",
    options=StickSlipOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    requires={
        LOAD_RATE: "the slips",
        DRIVE_TORQUE: "the torque of the spring",
    },
    can_use={
        RELATIVE_ANGLE: "number of rests, and angle of the load in the figure",
        COMMAND: "far end of the spring in the figure",
    },
    measure=_measure,
    needs_samples=False,
)
