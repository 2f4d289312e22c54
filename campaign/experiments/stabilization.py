"""Stabilization under base motion: how still the load stays in space, by compensation method.

The hull swings, the rate command is zero, and the standard deviation of the integrated gyro rate is
the stabilization error (sections 5.2 and 5.3): over whole cycles where the motion is sinusoidal,
over the whole window where it is a measured series or a ship's roll.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from pydantic import Field

from campaign.channels import (
    BASE_RATE,
    COMPENSATION_TORQUE,
    FRICTION_TORQUE,
    POINTING_ERROR,
    RELATIVE_RATE,
    missing,
)
from campaign.experiments.common import (
    conditions,
    failures_note,
    grouped,
    method_label,
    swept,
)
from campaign.experiments.comparisons import compared, preload_of
from campaign.experiments.hull_motion import Motion, SeriesMotion, ShipMotion, SineMotion
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Axis, Column, Curve, Figure, Finding, Panel, Result, Table, Value
from campaign.signals import Sine
from campaign.trial import Recording, Task, TrialRequest
from campaign.units import AngularAcceleration, Frequency

TIME = Axis("Time", "s", "s")
RATE = Axis("Rate relative to the hull", "rad/s", "deg/s")
ERROR = Axis("Position error", "rad", "mrad")
SAMPLES_PER_CYCLE = 10
"""of the base motion, at least: the standard deviation needs the shape of the error."""
SHOWN_CYCLES = 1.5
"""of the base motion in a time history; more cycles only make the reversals smaller."""
SHOWN_TIME = 60.0
"""s; of a motion that is not sinusoidal."""
ZOOM_RATE = 0.12
"""Half height of the zoom on a reversal, as a share of the largest relative rate."""
ZOOM_SPAN = 0.02
"""Time before the reversal in the zoom, as a share of the time shown; a little more follows."""


class StabilizationOptions(Options):
    """Options of a stabilization test."""

    motion: Motion = SineMotion()
    """How the hull moves; frequency, acceleration and cycles are those of a sine."""
    frequency: Frequency = Field(default=0.24, gt=0)
    """Frequency of the base motion."""
    acceleration: AngularAcceleration = Field(default=float(np.deg2rad(18.0)), gt=0)
    """Amplitude of the base's angular acceleration."""
    compensation: str = "none"
    """Compensation method, by its name on the bench; none for none."""
    cycles: int = Field(default=6, ge=1, le=10_000)
    """Whole cycles of the base motion that are measured."""
    settle_cycles: int = Field(default=2, ge=0, le=1_000)
    """Cycles before them, for the transient to pass."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""


OF_A_SINE = ("frequency", "acceleration", "cycles", "settle_cycles")


def _trials(options: StabilizationOptions, bench: Bench) -> Iterator[TrialRequest]:
    if not isinstance(options.motion, SineMotion):
        yield _irregular(options, options.motion)
        return
    if options.sample_rate < SAMPLES_PER_CYCLE * options.frequency:
        raise ValueError(
            f"a recording at {options.sample_rate:.4g} Hz shows fewer than {SAMPLES_PER_CYCLE} "
            f"samples per cycle of a {options.frequency:.4g} Hz motion; raise sample_rate"
        )
    start = options.settle_cycles / options.frequency
    stop = start + options.cycles / options.frequency
    yield TrialRequest(
        Task(
            mode="rate",
            base_acceleration=Sine(amplitude=options.acceleration, frequency=options.frequency),
            compensation=options.compensation,
            duration=stop,
            window=(start, stop),
            sample_rate=options.sample_rate,
        ),
        note=f"{options.cycles} cycles measured after {options.settle_cycles} to settle",
        can_use=_can_use(options),
    )


def _irregular(options: StabilizationOptions, motion: SeriesMotion | ShipMotion) -> TrialRequest:
    """The trial of a motion that is no sine: all of it is measured once it has settled."""
    given = [name for name in OF_A_SINE if name in options.model_fields_set]
    if given:
        raise ValueError(
            f"{', '.join(given)}: for a sinusoidal motion only, and this one is of kind "
            f"'{motion.kind}'; remove one or the other"
        )
    signal, start, stop = motion.signal()
    task = Task(
        mode="rate",
        base_acceleration=signal,
        compensation=options.compensation,
        duration=stop,
        window=(start, stop),
        sample_rate=options.sample_rate,
    )
    note = f"{stop - start:.4g} s measured after {start:.4g} s to settle"
    return TrialRequest(task, note=note, can_use=_can_use(options))


def _can_use(options: StabilizationOptions) -> tuple[str, ...]:
    """Channels of its figures; the torque shown without compensation is that of friction."""
    plain = options.compensation == "none"
    return BASE_RATE, RELATIVE_RATE, FRICTION_TORQUE if plain else COMPENSATION_TORQUE


def stabilization_error(recording: Recording, frequency: float) -> float:
    """Standard deviation (rad) of the pointing error over the whole cycles of `recording`."""
    samples = recording[POINTING_ERROR]
    rate = (len(recording.time) - 1) / float(np.ptp(recording.time))
    whole = int(len(samples) * frequency / rate + 1e-6)
    count = round(whole * rate / frequency) if whole else len(samples)
    return float(np.std(samples[:count]))


def stuck_share(recording: Recording) -> float:
    """Share of the time that the load moves with the hull: below 0.1 % of the largest base rate.

    NaN where a channel that would show it is missing.
    """
    if missing((BASE_RATE, RELATIVE_RATE), recording.channels):
        return float("nan")
    threshold = 0.001 * float(np.max(np.abs(recording[BASE_RATE])))
    return float(np.mean(np.abs(recording[RELATIVE_RATE]) < threshold))


def _measure(data: TrialData) -> tuple[float, float, float]:
    """Error (rad, 1 sigma), largest deviation from the mean (rad), stuck share of one trial."""
    recording = data.recording().window(*data.trial.task.window)
    signal = data.trial.task.base_acceleration
    position = recording[POINTING_ERROR]
    peak = float(np.max(np.abs(position - np.mean(position))))
    whole = float(np.std(position))
    error = stabilization_error(recording, signal.frequency) if isinstance(signal, Sine) else whole
    return error, peak, stuck_share(recording)


def _told(data: TrialData, columns: Sequence[str]) -> dict[str, Value]:
    """Conditions of the trial; an irregular motion has its kind, not a sine's numbers."""
    motion = data.trial.options.get("motion")
    kind = motion.get("kind", "sine") if isinstance(motion, Mapping) else "sine"
    if kind == "sine":
        return conditions(data, *columns)
    told = conditions(data, "compensation")
    return {**told, "motion": str(kind)}


def _analyse(data: TestData) -> Result:
    groups = grouped(data.completed())
    paths = swept(data)
    columns = ["compensation", "frequency", "acceleration"]
    findings: list[Finding] = []
    rows: list[dict[str, Value]] = []
    for group in groups.values():
        measures = np.array([_measure(item) for item in group])
        error, peak, stuck = measures.mean(axis=0)
        told = _told(group[0], columns) | preload_of(group[0])
        findings.append(Finding("stabilization_error", float(error), "rad", told))
        spread = float(np.std(measures[:, 0], ddof=1)) if len(group) > 1 else None
        row = {**told, "error": float(error), "peak": float(peak)}
        row["stuck"] = float(stuck) if np.isfinite(stuck) else None
        rows.append(row | {"repeats": len(group), "spread": spread})
    extra = [path for path in paths if path not in columns]
    firsts = [group[0] for group in groups.values()]
    sines = any("frequency" in row for row in rows)
    irregular = any("motion" in row for row in rows)
    stuck_known = any(row["stuck"] is not None for row in rows)
    table = Table(
        key="stabilization-error",
        title="Stabilization error by compensation method",
        columns=(
            Column("compensation", "Compensation"),
            *((Column("motion", "Motion"),) if irregular else ()),
            *(
                (
                    Column("frequency", "Frequency", "Hz", "Hz"),
                    Column("acceleration", "Base acceleration", "rad/s^2", "deg/s^2"),
                )
                if sines
                else ()
            ),
            *(Column(path, path) for path in extra),
            Column("error", "Error (1σ)", "rad", "mrad"),
            Column("peak", "Largest error", "rad", "mrad"),
            *((Column("stuck", "Time stuck", "", "percent"),) if stuck_known else ()),
            *(
                (Column("repeats", "Repeats"), Column("spread", "Spread (1σ)", "rad", "mrad"))
                if any(len(group) > 1 for group in groups.values())
                else ()
            ),
        ),
        rows=tuple(rows),
        thesis=("5.2", "5.8", "5.4", "5.10", "5.5", "5.11", "5.6", "5.12", "5.7", "5.13"),
        note="The error is the standard deviation of the integrated gyro rate over "
        + ("the measured time." if irregular else "whole cycles.")
        + _high_pass(firsts),
    )
    figures = tuple(_figures(data, firsts, paths, rows))
    return Result((table,), figures, (*findings, *compared(findings)), failures_note(data))


def _high_pass(trials: list[TrialData]) -> str:
    """A sentence when the bench sees its position error through a high-pass."""
    corner = bench_of(trials[0].trial).controller.pointing_high_pass if trials else 0.0
    return f" The bench sees it through a high-pass at {corner:.3g} Hz." if corner > 0 else ""


def _figures(
    data: TestData, firsts: list[TrialData], paths: tuple[str, ...], rows: list[dict[str, Value]]
) -> Iterator[Figure]:
    shown = _one_per_method(firsts)
    if shown:
        yield from _rate_figure(shown)
        yield _error_figure(shown)
        if any(name != "none" for name in shown):
            yield from _torque_figure(shown)
    numeric = [
        path
        for path in paths
        if path != "compensation"
        and len({row.get(path) for row in rows if isinstance(row.get(path), int | float)}) > 2
    ]
    for path in numeric[:2]:
        yield _sweep_figure(path, rows)


def _one_per_method(trials: list[TrialData]) -> dict[str, TrialData]:
    """One trial of each compensation, all at the last point of the rest of the sweep."""
    shown: dict[str, TrialData] = {}
    for item in trials:
        same = all(
            item.trial.point.get(path) == value
            for path, value in trials[-1].trial.point.items()
            if path != "compensation"
        )
        if same:
            shown.setdefault(item.trial.task.compensation, item)
    return shown


def _cut(data: TrialData) -> Recording:
    """The first cycles of the measuring window, on a time axis that begins with it."""
    task = data.trial.task
    signal = task.base_acceleration
    start, stop = task.window
    shown = SHOWN_CYCLES / signal.frequency if isinstance(signal, Sine) else SHOWN_TIME
    stop = min(stop, start + shown)
    cut = data.recording().window(start, stop)
    return Recording(cut.time - start, cut.channels, cut.events, cut.ending)


def _rate_figure(shown: dict[str, TrialData]) -> Iterator[Figure]:
    cuts = {name: _cut(item) for name, item in shown.items()}
    if any(missing((BASE_RATE, RELATIVE_RATE), cut.channels) for cut in cuts.values()):
        return
    reference = next(iter(cuts.values()))
    largest = float(np.max(np.abs(reference[BASE_RATE])))
    zoom = _reversal(reference)
    hull = Curve(reference.time, -reference[BASE_RATE], "held still in space", "reference", "thin")
    curves = [hull]
    for name, cut in cuts.items():
        curves.append(Curve(cut.time, cut[RELATIVE_RATE], method_label(name), name))
    inside = (reference.time >= zoom[0]) & (reference.time <= zoom[1])
    near = [Curve(c.x[inside], c.y[inside], c.label, c.series, c.style) for c in curves]
    zoomed_time = Axis("Time", "s", "s", limits=zoom)
    zoomed_rate = Axis(
        RATE.label, "rad/s", "deg/s", limits=(-ZOOM_RATE * largest, ZOOM_RATE * largest)
    )
    yield Figure(
        key="relative-rate",
        title="Rate of the load relative to the hull",
        caption="Where the relative rate passes zero the load sticks to the hull and is carried "
        "along; then it breaks loose. The zoom shows by how much each method leaves the dotted "
        "line of a load held still in space.",
        alt="Relative rate over time for each compensation method, and a zoom on one reversal "
        "where the uncompensated curve stays at zero the longest.",
        panels=(
            Panel(TIME, RATE, curves, "Base motion"),
            Panel(zoomed_time, zoomed_rate, near, "At a reversal"),
        ),
        thesis=("5.4", "5.18", "5.8", "5.22"),
        across=2,
    )


def _reversal(recording: Recording) -> tuple[float, float]:
    """Times (s) around a sign change of the base rate, wide enough to show the sticking."""
    rate = recording[BASE_RATE]
    changes = np.flatnonzero(np.diff(np.sign(rate)) != 0)
    span = float(np.ptp(recording.time))
    middle = recording.time[changes[len(changes) // 2]] if len(changes) else span / 2
    return float(middle - ZOOM_SPAN * span), float(middle + 1.25 * ZOOM_SPAN * span)


def _error_figure(shown: dict[str, TrialData]) -> Figure:
    panels = []
    for name, item in shown.items():
        cut = _cut(item)
        error = cut[POINTING_ERROR] - np.mean(cut[POINTING_ERROR])
        panels.append(
            Panel(
                TIME, ERROR, [Curve(cut.time, error, method_label(name), name)], method_label(name)
            )
        )
    return Figure(
        key="position-error",
        title="Position error by compensation method",
        caption="The error jumps at every reversal of the relative rate and is then integrated "
        "away. The scales differ: each panel shows its method's own error.",
        alt="Position error over time, one panel per compensation method, each with peaks at the "
        "reversals.",
        panels=tuple(panels),
        thesis=("5.9", "5.23", "5.10", "5.24"),
        across=2,
    )


def _torque_figure(shown: dict[str, TrialData]) -> Iterator[Figure]:
    torque = Axis("Torque", "N m", "N m")
    curves = []
    for name, item in shown.items():
        cut = _cut(item)
        if name == "none":
            if FRICTION_TORQUE in cut.channels:
                curves.append(
                    Curve(cut.time, cut[FRICTION_TORQUE], "true friction", "reference", "thin")
                )
        elif COMPENSATION_TORQUE in cut.channels:
            curves.append(Curve(cut.time, cut[COMPENSATION_TORQUE], method_label(name), name))
    if all(curve.series == "reference" for curve in curves):
        return
    yield Figure(
        key="compensation-torque",
        title="Compensation torque",
        caption="What each method adds to the drive torque, beside the friction that acts without "
        "compensation (known only to a simulation).",
        alt="Compensation torque over time for each method, square-like with the sign of the "
        "relative rate.",
        panels=(Panel(TIME, torque, curves),),
        thesis=("5.7", "5.21"),
    )


def _sweep_figure(path: str, rows: list[dict[str, Value]]) -> Figure:
    methods: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        value, error = row.get(path), row["error"]
        if isinstance(value, int | float) and isinstance(error, int | float):
            methods.setdefault(str(row["compensation"]), []).append((float(value), float(error)))
    curves = []
    for name, points in methods.items():
        xy = np.array(sorted(points))
        curves.append(Curve(xy[:, 0], xy[:, 1], method_label(name), name, "line+points"))
    axis = {
        "frequency": Axis("Frequency of the base motion", "Hz", "Hz"),
        "acceleration": Axis("Base acceleration", "rad/s^2", "deg/s^2"),
    }.get(path, Axis(path))
    return Figure(
        key="error-over-" + "".join(c if c.isalnum() else "-" for c in path.lower()),
        title=f"Stabilization error over {axis.label.lower() if axis.unit else path}",
        caption="Error (1σ) of each method along the sweep.",
        alt=f"Stabilization error over {path}, one curve per compensation method.",
        panels=(Panel(axis, Axis("Stabilization error (1σ)", "rad", "mrad"), curves),),
    )


EXPERIMENT = Experiment(
    name="stabilization",
    summary="stabilization error under base motion, by compensation (Tables 5.2 and 5.8)",
    options=StabilizationOptions,
    trials=_trials,
    analyse=_analyse,
    requires={POINTING_ERROR: "the stabilization error"},
    can_use={
        BASE_RATE: "time stuck, and no figure of the relative rate",
        RELATIVE_RATE: "time stuck, and no figure of the relative rate",
        COMPENSATION_TORQUE: "figure of what the compensation adds",
        FRICTION_TORQUE: "true friction beside the compensation torque",
    },
)
