"""Breakaway torque of each component on its own: motor, gearbox, load (section 4.2.1, Table 4.1).

The component is removed and turned by hand through a torque sensor, in alternating directions. A
simulated bench applies a slow torque ramp, without the friction of other components. Motor-side
components are measured at the motor shaft: the gear ratio multiplies a count of the sensor at the
load.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from pydantic import Field

from campaign.channels import DRIVE_TORQUE, GYRO_RATE
from campaign.estimate import Estimate, Systematic, Window
from campaign.estimation.breakaway_torque import breakaway_torque
from campaign.estimation.intervals import shifted_by, welch, with_error
from campaign.estimation.relative_rate import STOP_FACTOR
from campaign.estimation.scatter import RESOLUTION, deviation_of_readings, mean_of_readings
from campaign.experiments.component_friction.figures import ComponentCurves, component_figure
from campaign.experiments.interface import (
    Experiment,
    TestData,
    TrialData,
    bench_of,
    key,
    metrics,
    validated,
)
from campaign.experiments.shared.captions import trials_of
from campaign.experiments.shared.common import conditions, of_each_place
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.complete import inertia_of
from campaign.physics.friction_paths import torques
from campaign.physics.limits import worst_friction
from campaign.physics.scatter import TORQUES, Scatter, VariationOptions
from campaign.reason import NONE, Cause
from campaign.result import Cell, Column, Figure, Finding, Result, Table, Value
from campaign.signals import Polyline
from campaign.trial import Task, Tree, TrialRequest
from campaign.units import AngularRate, Frequency, Time, Torque, TorqueRate, torque_text

REACH = 2.0
"""End of the ramp, in multiples of the friction of the bench."""
OWN = ("component", "measurement")
STILL_ROSE = Cause("friction that still rose", "friction still rose at the end of some readings")


class ComponentFrictionOptions(Options):
    """Options of a component friction test."""

    components: tuple[str, ...] = ()
    """Friction interfaces of the bench to measure one by one; none: all of them."""
    direction: Literal["alternating", "positive", "negative"] = "alternating"
    """Direction of the component's motion; friction may differ by direction."""
    scatter: float | None = Field(default=None, ge=0, le=0.3)
    """Relative standard deviation of friction between measurements on a simulated bench. A removed
    part scatters more than an installed one. Absent: that of the bench."""
    measurements: int = Field(default=10, ge=1, le=1000)
    """Number of measurements of each component."""
    sensor_resolution: Torque = Field(default=0.01, ge=0)
    """One count of the torque sensor, at its shaft; 0 for an ideal sensor."""
    torque_rate: TorqueRate = Field(default=1.0, gt=0)
    """Slope of the ramp, at the load."""
    peak_torque: Torque | None = Field(default=None, gt=0)
    """End of the ramp if nothing moves; absent: twice the friction of the bench."""
    rest: Time = Field(default=0.2, ge=0)
    """Standstill before the ramp."""
    sliding_rate: AngularRate = Field(default=0.005, gt=0)
    """Rate at which the component slides; the trial ends at four times this rate."""
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
            sign = _way(options.direction, number)
            yield TrialRequest(
                Task(
                    mode="torque",
                    command=Polyline(
                        times=(0.0, options.rest, stop), values=(0.0, 0.0, sign * float(peak))
                    ),
                    duration=stop,
                    window=(options.rest, stop),
                    sample_rate=options.sample_rate,
                    stop_rate=stop_rate,
                ),
                point={"component": component, "measurement": number},
                bench=tree,
                note=f"only {component}; ends early, once it slides",
                windows=(Window("ramp", options.rest, stop),),
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
    """One measurement: reading of the torque sensor, referred to the load."""

    data: TrialData
    place: dict[str, Value]
    component: str
    measurement: int
    torque: Estimate


def _count(data: TrialData, component: str) -> float:
    """One count of the torque sensor, referred to the load (N m)."""
    options = validated(ComponentFrictionOptions, data.trial.options)
    bench = bench_of(data.trial)
    return options.sensor_resolution * bench.at_load(bench.friction[component])[0]


def _measure(data: TrialData) -> Sequence[Estimate]:
    """Reading: largest friction of the ramp, rounded to a count of the torque sensor."""
    options = validated(ComponentFrictionOptions, data.trial.options)
    recording = data.recording()
    torque = breakaway_torque(
        recording.time,
        recording[GYRO_RATE],
        recording[DRIVE_TORQUE],
        inertia_of(bench_of(data.trial), "friction of a load that gathers speed"),
        options.sliding_rate,
    ).torque
    count = _count(data, str(data.trial.point["component"]))
    if count == 0:
        return (torque,)
    shift = round(torque.value / count) * count - torque.value
    low, high = (None if end is None else end + shift for end in (torque.low, torque.high))
    shown = replace(torque, value=torque.value + shift, low=low, high=high)
    return (shifted_by(shown, RESOLUTION, count / math.sqrt(12.0)),)


def _read(data: TrialData) -> Reading:
    place = conditions(data)
    (torque,) = metrics(data, _measure).values()
    number = int(str(place["measurement"]))
    return Reading(data, place, str(place["component"]), number, torque)


def _analyse(data: TestData) -> Result:
    trials = (*data.left_out, *(item.trial for item in data.trials))
    planned = {str(trial.point["component"]) for trial in trials}

    def of_place(group: Sequence[TrialData]) -> Result:
        readings = [_read(item) for item in group]
        return Result(
            (_table(readings),),
            (_figure(readings),),
            tuple(_findings(readings, planned)),
            tuple(_remarks(readings, group[0])),
        )

    return of_each_place(data.completed(), OWN, of_place)


def _by_component(readings: list[Reading]) -> dict[str, list[Reading]]:
    components: dict[str, list[Reading]] = {}
    for reading in readings:
        components.setdefault(reading.component, []).append(reading)
    return components


def _open_ended(estimate: Estimate) -> Estimate:
    """Estimate without interval, because friction still rose."""
    return replace(estimate, low=None, high=None, standard_error=None, reason=STILL_ROSE())


def _statistics(readings: list[Reading]) -> dict[str, Estimate]:
    """Mean and standard deviation (N m), the latter of these readings only."""
    torques = [reading.torque.value for reading in readings]
    count = _count(readings[0].data, readings[0].component)
    mean = mean_of_readings("breakaway_torque", torques, "N m", count)
    deviation = deviation_of_readings("breakaway_torque", torques, "N m", count)
    if any(reading.torque.kind == "at least" for reading in readings):
        mean = replace(_open_ended(mean), kind="at least")
        deviation = _open_ended(deviation)
    return {"mean": mean, "standard deviation": deviation}


def _findings(readings: list[Reading], planned: set[str]) -> Iterator[Finding]:
    shared = {k: v for k, v in readings[0].place.items() if k not in OWN}
    components = _by_component(readings)
    for reading in readings:
        yield Finding.of(reading.torque, reading.place)
    means: dict[str, Estimate] = {}
    for component, own in components.items():
        statistics = _statistics(own)
        means[component] = statistics["mean"]
        for statistic, estimate in statistics.items():
            place = {**shared, "component": component, "statistic": statistic}
            yield Finding.of(estimate, place)
    if len(means) > 1 and set(means) == planned:
        sides = {name: _side(components[name][0]) for name in means}
        place = {**shared, "component": "sum", "statistic": "mean"}
        yield Finding.of(total_of(means), place)
        yield Finding.of(load_share(means, sides), shared)


def _side(reading: Reading) -> str:
    return str(bench_of(reading.data.trial).friction[reading.component].side)


def _figure(readings: list[Reading]) -> Figure:
    shown = [
        ComponentCurves(
            name,
            tuple(reading.measurement for reading in own),
            tuple(reading.torque for reading in own),
            _statistics(own)["mean"],
            own[0].data,
            _count(own[0].data, name) if _side(own[0]) == "motor" else 0.0,
        )
        for name, own in _by_component(readings).items()
    ]
    options = validated(ComponentFrictionOptions, readings[0].data.trial.options)
    shared = {k: v for k, v in readings[0].place.items() if k not in OWN}
    trials = trials_of(reading.data for reading in readings)
    return component_figure(shown, shared, options.sliding_rate, trials)


def _table(readings: list[Reading]) -> Table:
    components = _by_component(readings)
    rows: list[dict[str, Cell]] = []
    for number in sorted({reading.measurement for reading in readings}):
        row: dict[str, Cell] = {"measurement": number}
        row |= {r.component: r.torque for r in readings if r.measurement == number}
        rows.append(row)
    statistics = {name: _statistics(own) for name, own in components.items()}
    for statistic in ("mean", "standard deviation"):
        cells: dict[str, Cell] = {name: values[statistic] for name, values in statistics.items()}
        rows.append({"measurement": statistic, **cells})
    if len(components) > 1:
        rows[-2]["sum"] = total_of({name: values["mean"] for name, values in statistics.items()})
    return Table(
        key="component-friction",
        title="Breakaway torque of each component, seen at the load",
        columns=(
            Column("measurement", "Measurement", exact=True),
            *(Column(name, name.capitalize(), "N m", "N m") for name in components),
            *((Column("sum", "Sum", "N m", "N m"),) if len(components) > 1 else ()),
        ),
        rows=tuple(rows),
        thesis=("4.1",),
        note="Torques measured at the motor shaft are multiplied by the gear ratio. The interval "
        "of a standard deviation accounts for the small number of readings.",
    )


def _remarks(readings: list[Reading], first: TrialData) -> Iterator[str]:
    options = validated(ComponentFrictionOptions, first.trial.options)
    motor = [name for name, own in _by_component(readings).items() if _side(own[0]) == "motor"]
    gear = bench_of(first.trial).gear
    if motor and gear is not None and options.sensor_resolution > 0:
        step = options.sensor_resolution * gear.ratio
        yield (
            f"The torque sensor shows multiples of {torque_text(options.sensor_resolution, 'g')}. "
            f"Behind the gear that is {torque_text(step)} at the load. Readings of "
            f"{' and '.join(motor)} fall on a few steps: their deviation is that of the sensor as "
            "much as of friction."
        )
    yield (
        "A single reading is one sample of a friction that scatters from trial to trial; only mean "
        "and deviation can be compared. Its own interval is that of this one reading."
    )


def _of_means(
    name: str, unit: str, parts: Sequence[tuple[float, Estimate]], value: float
) -> Estimate:
    """A value that depends on independent means, each with its derivative (GUM 5.1.2)."""
    reason = next((each.reason for _, each in parts if not each.has_interval), NONE)
    shift = math.hypot(*(slope * each.systematic_uncertainty for slope, each in parts))
    systematic = (Systematic(RESOLUTION, shift),)
    if reason:
        return Estimate.without_interval(name, value, unit, reason, systematic=systematic)
    errors = [(abs(slope) * (each.standard_error or 0.0), each.freedom) for slope, each in parts]
    error = math.hypot(*(size for size, _ in errors))
    method = "of the means, Welch and Satterthwaite"
    return with_error(name, value, unit, error, welch(*errors), method, systematic=systematic)


def total_of(means: Mapping[str, Estimate]) -> Estimate:
    """Sum of the components' means (N m)."""
    value = sum(mean.value for mean in means.values())
    return _of_means("breakaway_torque", "N m", [(1.0, mean) for mean in means.values()], value)


def load_share(means: Mapping[str, Estimate], sides: Mapping[str, str]) -> Estimate:
    """Share of the load in that sum; `sides`: side of the gear of each component."""
    total = sum(mean.value for mean in means.values())
    load = sum(mean.value for name, mean in means.items() if sides[name] == "load")
    parts = [
        (((sides[name] == "load") - load / total) / total, mean) for name, mean in means.items()
    ]
    return _of_means("load_share", "", parts, load / total)


EXPERIMENT = Experiment(
    name="component_friction",
    summary="breakaway torque of each friction interface on its own (Table 4.1)",
    options=ComponentFrictionOptions,
    trials=_trials,
    analyse=_analyse,
    perturbs_bench=True,
    measure=_measure,
    needs_samples=False,
    requires={
        DRIVE_TORQUE: "the torque at which the component slides",
        GYRO_RATE: "the moment at which it slides",
    },
    key_numbers=(
        key("breakaway_torque", statistic="mean"),
        key("breakaway_torque", statistic="standard deviation"),
        key("load_share"),
    ),
)
