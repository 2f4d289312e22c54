"""Breakaway torque of each component on its own: motor, gearbox, load (section 4.2.1, Table 4.1).

The component is demounted and turned by hand through a torque sensor, to one side and to the other
in turn. On a simulated bench that is a slow torque ramp with every other friction taken away. What
is motor-side is measured at the motor shaft, so one count of the sensor counts as many times at the
load as the gear reduces.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from pydantic import Field

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.experiments.common import conditions, failures_note, grouped
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.identification.presliding import breakaway_torque
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.friction_paths import torques
from campaign.physics.limits import worst_friction
from campaign.physics.scatter import TORQUES, Scatter, VariationOptions
from campaign.result import Array, Axis, Column, Curve, Figure, Finding, Panel, Result, Table, Value
from campaign.signals import Polyline
from campaign.trial import Task, Tree, TrialRequest
from campaign.units import AngularRate, Frequency, Time, Torque, TorqueRate

STOP_FACTOR = 4.0
"""Rate that ends a trial, over the rate that counts as sliding."""
REACH = 2.0
"""The ramp ends at this many times the friction that the bench describes."""
OWN = ("component", "measurement")


class ComponentFrictionOptions(Options):
    """Options of a component friction test."""

    components: tuple[str, ...] = ()
    """Interfaces of the bench's friction that are measured one by one; without any, all of them."""
    direction: Literal["alternating", "positive", "negative"] = "alternating"
    """Which way the component is turned; friction may differ by direction."""
    scatter: float | None = Field(default=None, ge=0, le=0.3)
    """Relative standard deviation of friction from one measurement to the next, of a simulated
    bench: a part in the hand scatters more than one in its place. Absent: as the bench says."""
    measurements: int = Field(default=10, ge=1, le=1000)
    """How often each is measured."""
    sensor_resolution: Torque = Field(default=0.01, ge=0)
    """One count of the torque sensor, at the shaft it sits on; 0 for a perfect one."""
    torque_rate: TorqueRate = Field(default=1.0, gt=0)
    """Slope of the ramp, at the load."""
    peak_torque: Torque | None = Field(default=None, gt=0)
    """Where the ramp ends if nothing moves; absent: twice the friction that the bench describes."""
    rest: Time = Field(default=0.2, ge=0)
    """Standstill before the ramp."""
    sliding_rate: AngularRate = Field(default=0.005, gt=0)
    """Rate at which the component counts as turning; the trial ends when it is four times this
    fast."""
    sample_rate: Frequency = Field(default=250.0, gt=0, le=100_000)
    """Rate of the recording."""


def _trials(options: ComponentFrictionOptions, bench: Bench) -> Iterator[TrialRequest]:
    known = ", ".join(bench.friction)
    if not bench.friction:
        raise ValueError(f"the bench '{bench.name}' has no friction to measure")
    stop_rate = STOP_FACTOR * options.sliding_rate
    for component in options.components or tuple(bench.friction):
        if component not in bench.friction:
            raise ValueError(
                f"the bench '{bench.name}' has no friction interface '{component}'; it has {known}"
            )
        alone = _alone(bench, component, options.scatter)
        peak = options.peak_torque or REACH * worst_friction(alone, stop_rate)
        if peak <= 0:
            raise ValueError(f"friction '{component}' is zero: there is nothing to measure")
        tree: Tree = alone.model_dump(mode="json")
        stop = options.rest + peak / options.torque_rate
        for number in range(1, options.measurements + 1):
            way = _way(options.direction, number)
            yield TrialRequest(
                Task(
                    mode="torque",
                    command=Polyline(
                        times=(0.0, options.rest, stop), values=(0.0, 0.0, way * float(peak))
                    ),
                    duration=stop,
                    window=(options.rest, stop),
                    sample_rate=options.sample_rate,
                    stop_rate=stop_rate,
                ),
                point={"component": component, "measurement": number},
                bench=tree,
                note=f"only {component}; ends early, once it turns",
            )


def _way(direction: str, number: int) -> float:
    """Sign of the torque of a measurement; alternating ones begin with the positive."""
    if direction == "alternating":
        return 1.0 if number % 2 else -1.0
    return 1.0 if direction == "positive" else -1.0


def _alone(bench: Bench, component: str, scatter: float | None) -> Bench:
    """The bench with the friction of one component only, and its scatter from trial to trial."""
    friction = bench.friction[component]
    alone = bench.with_friction({component: friction})
    if scatter is None:
        return alone
    sliding = {"coulomb_torque", "static_torque"}
    own = tuple(name for name in torques(friction) if name in sliding) or torques(friction)
    if not own:
        raise ValueError(f"the model of friction '{component}' declares no torque that may scatter")
    together = {TORQUES: Scatter(paths=own, relative=scatter)}
    variation = alone.variation or VariationOptions()
    variation = variation.model_copy(update={"trial_to_trial": together})
    return alone.model_copy(update={"variation": variation})


@dataclass(frozen=True)
class Reading:
    """One measurement: torque at the load and at the sensor (N m), and its history, shape (n,)."""

    place: dict[str, Value]
    component: str
    measurement: int
    side: str
    torque: float
    at_sensor: float
    history: tuple[Array, Array]


def _read(data: TrialData) -> Reading:
    options = ComponentFrictionOptions.model_validate(data.trial.options, context={"si": True})
    bench = bench_of(data.trial)
    place = conditions(data)
    component = str(place["component"])
    side = bench.friction[component].side
    ratio = bench.gear.ratio if side == "motor" else 1.0
    recording = data.recording()
    true, _ = breakaway_torque(
        recording.time,
        recording[GYRO_RATE],
        recording[DRIVE_TORQUE],
        bench.axis.inertia,
        options.sliding_rate,
    )
    count = options.sensor_resolution
    shown = round(true / ratio / count) * count if count > 0 else true / ratio
    history = np.abs(recording[DRIVE_TORQUE]), np.abs(recording[GYRO_RATE])
    number = int(str(place["measurement"]))
    return Reading(place, component, number, side, shown * ratio, shown, history)


def _analyse(data: TestData) -> Result:
    notes = list(failures_note(data))
    tables: list[Table] = []
    figures: list[Figure] = []
    findings: list[Finding] = []
    groups = grouped(data.completed(), own=OWN)
    for number, group in enumerate(groups.values(), start=1):
        readings: list[Reading] = []
        for item in group:
            try:
                readings.append(_read(item))
            except ValueError as error:
                notes.append(f"{item.trial.label}: {error}.")
        if not readings:
            continue
        planned = {str(d.trial.point["component"]) for d in data.trials}
        suffix = f"-{number}" if len(groups) > 1 else ""
        tables.append(_table(readings, suffix))
        figures.append(_figure(readings, suffix))
        findings += _findings(readings, planned)
        notes += _remarks(readings, group[0])
    return Result(tuple(tables), tuple(figures), tuple(findings), tuple(dict.fromkeys(notes)))


def _by_component(readings: list[Reading]) -> dict[str, list[Reading]]:
    components: dict[str, list[Reading]] = {}
    for reading in readings:
        components.setdefault(reading.component, []).append(reading)
    return components


def _statistics(readings: list[Reading]) -> dict[str, float]:
    """Mean and standard deviation (N m); of these very readings, so divided by their number."""
    torques = np.array([reading.torque for reading in readings])
    spread = float(np.std(torques - torques[0]))  # equal readings have none, not a rounding error
    return {"mean": float(np.mean(torques)), "standard deviation": spread}


def _findings(readings: list[Reading], planned: set[str]) -> Iterator[Finding]:
    shared = {k: v for k, v in readings[0].place.items() if k not in OWN}
    components = _by_component(readings)
    for reading in readings:
        yield Finding("breakaway_torque", reading.torque, "N m", reading.place)
    means: dict[str, float] = {}
    for component, own in components.items():
        statistics = _statistics(own)
        means[component] = statistics["mean"]
        for statistic, value in statistics.items():
            place = {**shared, "component": component, "statistic": statistic}
            yield Finding("breakaway_torque", value, "N m", place)
    if len(means) > 1 and set(means) == planned:
        total = sum(means.values())
        load = sum(mean for name, mean in means.items() if components[name][0].side == "load")
        place = {**shared, "component": "sum", "statistic": "mean"}
        yield Finding("breakaway_torque", total, "N m", place)
        yield Finding("load_share", load / total, "", shared)


def _table(readings: list[Reading], suffix: str) -> Table:
    components = _by_component(readings)
    rows: list[dict[str, Value]] = []
    for number in sorted({reading.measurement for reading in readings}):
        row: dict[str, Value] = {"measurement": number}
        row |= {r.component: r.torque for r in readings if r.measurement == number}
        rows.append(row)
    statistics = {name: _statistics(own) for name, own in components.items()}
    for statistic in ("mean", "standard deviation"):
        told: dict[str, Value] = {name: values[statistic] for name, values in statistics.items()}
        rows.append({"measurement": statistic, **told})
    if len(components) > 1:
        total = sum(values["mean"] for values in statistics.values())
        rows[-2]["sum"] = total
    return Table(
        key=f"component-friction{suffix}",
        title="Breakaway torque of each component, seen at the load",
        columns=(
            Column("measurement", "Measurement"),
            *(Column(name, name.capitalize(), "N m", "N m") for name in components),
            *((Column("sum", "Sum", "N m", "N m"),) if len(components) > 1 else ()),
        ),
        rows=tuple(rows),
        thesis=("4.1",),
        note="What was measured at the motor shaft is multiplied by the gear ratio.",
    )


def _remarks(readings: list[Reading], first: TrialData) -> Iterator[str]:
    options = ComponentFrictionOptions.model_validate(first.trial.options, context={"si": True})
    motor = [name for name, own in _by_component(readings).items() if own[0].side == "motor"]
    if motor and options.sensor_resolution > 0:
        step = options.sensor_resolution * bench_of(first.trial).gear.ratio
        yield (
            f"The torque sensor shows multiples of {options.sensor_resolution:g} N m. Behind the "
            f"gear that is {step:.3g} N m at the load: the readings of {' and '.join(motor)} fall "
            "on a few steps, and their deviation is that of the sensor as much as of friction."
        )
    yield (
        "A single reading is one sample of a friction that scatters from trial to trial; only mean "
        "and deviation can be compared."
    )


def _figure(readings: list[Reading], suffix: str) -> Figure:
    components = _by_component(readings)
    dots = [
        Curve(
            np.array([float(r.measurement) for r in own]),
            np.array([r.torque for r in own]),
            name,
            name,
            "line+points",
        )
        for name, own in components.items()
    ]
    ramps = [Curve(*own[0].history, name, name) for name, own in components.items()]
    return Figure(
        key=f"component-friction{suffix}",
        title="Breakaway torque of the components",
        caption="Left: the torque rises until a component begins to turn; the load takes the most. "
        "Right: repeated readings. Motor-side readings fall on steps, one count of the sensor "
        "times the gear ratio apart.",
        alt="Rate over torque of one ramp for each component, and breakaway torque of each "
        "component over the number of the measurement.",
        panels=(
            Panel(
                Axis("Torque at the load", "N m", "N m"),
                Axis("Rate", "rad/s", "deg/s"),
                ramps,
                "First measurement",
            ),
            Panel(
                Axis("Measurement"),
                Axis("Breakaway torque", "N m", "N m"),
                dots,
                "All measurements",
            ),
        ),
        across=2,
    )


EXPERIMENT = Experiment(
    name="component_friction",
    summary="breakaway torque of each friction interface on its own (Table 4.1)",
    options=ComponentFrictionOptions,
    trials=_trials,
    analyse=_analyse,
    requires={
        DRIVE_TORQUE: "the torque at which the component turns",
        GYRO_RATE: "the moment at which it turns",
    },
)
