"""Friction-velocity map: the drive torque of constant-velocity runs, and its Stribeck fit.

Each trial runs out at one speed and back at the same, so it ends where it began and needs no
homing. Steady sliding needs no drive but friction (Eq. 4.1 without acceleration), so the mean drive
torque over a settled window, less J times the residual acceleration, is one point of the map.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from pydantic import Field, JsonValue

from campaign.channels import COMMAND, DRIVE_TORQUE, GYRO_RATE
from campaign.experiments.common import failures_note, grouped
from campaign.experiments.interface import Experiment, TestData, TrialData, bench_of
from campaign.identification.least_squares import Fit
from campaign.identification.velocity_map import PARAMETERS, UNITS, fit_stribeck, stribeck
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Array, Axis, Column, Curve, Figure, Finding, Panel, Result, Table
from campaign.result import Mark as FigureMark
from campaign.signals import Polyline
from campaign.trial import Role, Task, TrialRequest
from campaign.units import Angle, AngularAcceleration, AngularRate, Frequency, Time

SMALLEST_WINDOW = 10
"""samples: fewer say nothing about a mean and a slope."""
DIRECTIONS = {"positive": 1.0, "negative": -1.0}
SYMBOLS = {
    "viscous_friction": "σ2",
    "coulomb_torque": "Tc",
    "static_torque": "Ts",
    "stribeck_velocity": "vs",
    "stribeck_exponent": "δ",
}


def default_speeds() -> tuple[float, ...]:
    """80 speeds from 0.05 to 65 deg/s (rad/s), evenly in their logarithm: dense at low speed."""
    return tuple(float(v) for v in np.deg2rad(np.geomspace(0.05, 65.0, 80)))


class VelocityMapOptions(Options):
    """Options of a friction-velocity map."""

    speeds: tuple[AngularRate, ...] = Field(default_factory=default_speeds, min_length=1)
    """Speeds of the map, each run in both directions."""
    max_travel: Angle = Field(default=float(np.deg2rad(60.0)), gt=0)
    """Longest way of one run, ramps included."""
    max_time: Time = Field(default=20.0, gt=0)
    """Longest motion of one run; the shorter of this and max_travel counts."""
    window_time: Time = Field(default=2.0, gt=0)
    """Shortest settled window that is averaged..."""
    window_angle: Angle = Field(default=float(np.deg2rad(5.0)), gt=0)
    """...or the time to travel this, whichever takes longer; as far as the run has room."""
    settle_time: Time = Field(default=0.3, ge=0)
    """After the ramp, before the window: for the loop to settle..."""
    settle_angle: Angle = Field(default=float(np.deg2rad(0.75)), ge=0)
    """...or the time to travel this, whichever takes longer: friction's own memory is an angle.
    With Ts / sigma0 of 0.1 deg, 0.75 deg leaves a thousandth of it, also after a reversal."""
    acceleration: AngularAcceleration = Field(default=float(np.deg2rad(300.0)), gt=0)
    """Of the ramps."""
    rest: Time = Field(default=0.5, ge=0)
    """Standstill before each run."""
    warm_up_speed: AngularRate = Field(default=float(np.deg2rad(20.0)), gt=0)
    """Speed of the warm-up."""
    warm_up_cycles: int = Field(default=3, ge=0, le=1000)
    """Moves out and back before the first point; 0 for no warm-up."""
    compensation: str = "none"
    """Compensation while the map is measured; a map is normally taken without."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""


@dataclass(frozen=True)
class Run:
    """Times of one out-and-back trial (s), from the trial's start.

    Attributes:
        ramp, cruise: length of one ramp, and of the constant speed between two.
        window: length of the settled window, at the end of each cruise.
        rule: what set the window's length.
    """

    speed: float
    rest: float
    ramp: float
    cruise: float
    window: float
    rule: str

    @property
    def leg(self) -> float:
        return self.rest + 2 * self.ramp + self.cruise

    def window_of(self, direction: float) -> tuple[float, float]:
        """Start and stop of the window of the run in `direction` (+1 out, -1 back)."""
        stop = self.rest + self.ramp + self.cruise + (self.leg if direction < 0 else 0.0)
        return stop - self.window, stop

    def command(self) -> Polyline:
        """The rate command: rest, out, rest, back, rest."""
        times, values = [0.0], [0.0]
        for speed in (self.speed, -self.speed):
            for span, value in (
                (self.rest, 0.0),
                (self.ramp, speed),
                (self.cruise, speed),
                (self.ramp, 0.0),
            ):
                times.append(times[-1] + span)
                values.append(value)
        return Polyline(times=tuple(times), values=tuple(values))


REQUIRED = {
    GYRO_RATE: "the rate of each point",
    DRIVE_TORQUE: "the friction torque of each point",
}
"""Channels of a map, whatever is made of it."""


def plan_run(speed: float, options: VelocityMapOptions) -> Run:
    """The run at `speed` (rad/s). ValueError when it cannot settle within the travel allowed."""
    ramp = speed / options.acceleration
    by_travel = options.max_travel / speed - ramp
    by_time = options.max_time - 2 * ramp
    cruise = min(by_travel, by_time)
    settle = max(options.settle_time, options.settle_angle / speed)
    room = cruise - settle
    if room <= 0:
        raise ValueError(
            f"at {np.rad2deg(speed):.4g} deg/s the run lasts {max(cruise, 0):.3g} s at constant "
            f"speed but takes {settle:.3g} s to settle; raise max_travel, max_time or "
            "acceleration, or drop that speed"
        )
    by_angle = options.window_angle / speed
    wanted = max(options.window_time, by_angle)
    if wanted > room:
        limit = "max_travel" if by_travel < by_time else "max_time"
        return Run(speed, options.rest, ramp, cruise, room, f"all that {limit} leaves")
    rule = "window_angle" if by_angle > options.window_time else "window_time"
    return Run(speed, options.rest, ramp, cruise, wanted, rule)


def map_trials(options: VelocityMapOptions, bench: Bench) -> Iterator[TrialRequest]:
    """The warm-up, then one trial out and back for each speed."""
    start_angle = -0.5 * options.max_travel
    if options.warm_up_cycles:
        yield _warm_up(options, start_angle)
    for speed in options.speeds:
        if speed <= 0:
            raise ValueError("speeds are positive; each is run in both directions")
        run = plan_run(speed, options)
        if run.window * options.sample_rate < SMALLEST_WINDOW:
            raise ValueError(
                f"at {np.rad2deg(speed):.4g} deg/s the window of {run.window:.3g} s holds fewer "
                f"than {SMALLEST_WINDOW} samples; raise sample_rate or drop that speed"
            )
        (first, _), (_, last) = run.window_of(+1), run.window_of(-1)
        yield TrialRequest(
            Task(
                mode="rate",
                command=run.command(),
                compensation=options.compensation,
                duration=2 * run.leg + options.rest,
                window=(first, last),
                sample_rate=options.sample_rate,
                start_angle=start_angle,
            ),
            point={"speed": speed},
            note=f"window {run.window:.3g} s, {np.rad2deg(run.window * speed):.3g} deg: {run.rule}",
        )


def _warm_up(options: VelocityMapOptions, start_angle: float) -> TrialRequest:
    relaxed = options.model_copy(update={"settle_time": 0.0, "settle_angle": 0.0})
    run = plan_run(options.warm_up_speed, relaxed)
    once = run.command()
    times, values = [0.0], [0.0]
    for cycle in range(options.warm_up_cycles):
        times += [cycle * once.times[-1] + t for t in once.times[1:]]
        values += once.values[1:]
    return TrialRequest(
        Task(
            mode="rate",
            command=Polyline(times=tuple(times), values=tuple(values)),
            duration=times[-1] + options.rest,
            window=(0.0, times[-1]),
            sample_rate=options.sample_rate,
            start_angle=start_angle,
        ),
        role=Role.WARM_UP,
        point={"speed": options.warm_up_speed},
        note=f"{options.warm_up_cycles} moves out and back",
    )


@dataclass(frozen=True)
class MapPoint:
    """One point of the map: signed, SI. `spread`: the torque's 1 sigma in the window."""

    speed: float
    rate: float
    torque: float
    spread: float
    window: float
    rule: str


def map_points(data: TrialData) -> Iterator[MapPoint]:
    """The two points of one trial, out and back."""
    options = VelocityMapOptions.model_validate(data.trial.options, context={"si": True})
    run = plan_run(float(str(data.trial.point["speed"])), options)
    inertia = bench_of(data.trial).axis.inertia
    recording = data.recording()
    for direction in DIRECTIONS.values():
        cut = recording.window(*run.window_of(direction))
        rate, torque = cut[GYRO_RATE], cut[DRIVE_TORQUE]
        # The rate's slope over the window, by least squares: robust to the gyro's noise.
        acceleration = float(np.polyfit(cut.time - cut.time[0], rate, 1)[0])
        yield MapPoint(
            speed=run.speed * direction,
            rate=float(np.mean(rate)),
            torque=float(np.mean(torque)) - inertia * acceleration,
            spread=float(np.std(torque)),
            window=run.window,
            rule=run.rule,
        )


@dataclass(frozen=True)
class DirectionFit:
    """Both fits of one direction, of the points (rate, torque), all made positive."""

    rate: Array
    torque: Array
    free: Fit
    fixed: Fit


def fit_direction(points: list[MapPoint], direction: float) -> DirectionFit:
    """Fits of the points in one direction (+1, -1). Raises ValueError where there are too few."""
    chosen = sorted((p for p in points if p.rate * direction > 0), key=lambda p: abs(p.rate))
    rate = np.array([abs(p.rate) for p in chosen])
    torque = np.array([p.torque * direction for p in chosen])
    return DirectionFit(rate, torque, fit_stribeck(rate, torque), fit_stribeck(rate, torque, 2.0))


def _analyse(data: TestData) -> Result:
    tables: list[Table] = []
    figures: list[Figure] = []
    findings: list[Finding] = []
    notes: list[str] = list(failures_note(data))
    maps: list[tuple[dict[str, JsonValue], list[MapPoint]]] = []
    for group in grouped(data.completed(), own=("speed",)).values():
        place = {k: v for k, v in group[0].trial.point.items() if k != "speed"}
        maps.append((place, [point for item in group for point in map_points(item)]))
    for number, (place, points) in enumerate(maps, start=1):
        suffix = f"-{number}" if len(maps) > 1 else ""
        where = ", ".join(f"{k} = {v}" for k, v in place.items())
        tables.append(_point_table(points, suffix, where))
        try:
            fits = {name: fit_direction(points, sign) for name, sign in DIRECTIONS.items()}
        except ValueError as error:
            notes.append(f"No fit{f' for {where}' if where else ''}: {error}.")
            continue
        tables.append(_parameter_table(fits, suffix, where))
        findings += _findings(fits, place)
        figures += [_map_figure(points, suffix, where), _fit_figure(fits, suffix, where)]
        for name, fit in fits.items():
            notes += [
                f"{name.capitalize()} direction, δ free: {doubt}." for doubt in fit.free.doubts
            ]
    example = _example(data)
    return Result(tuple(tables), (*example, *figures), tuple(findings), tuple(notes))


def _nominal(fits: Mapping[str, DirectionFit], parameter: str, fixed: bool) -> float:
    return float(np.mean([(f.fixed if fixed else f.free).values[parameter] for f in fits.values()]))


def _findings(
    fits: Mapping[str, DirectionFit], place: Mapping[str, JsonValue]
) -> Iterator[Finding]:
    told = {k: v for k, v in place.items() if isinstance(v, str | int | float | bool)}
    for fixed in (False, True):
        for parameter in PARAMETERS:
            values = {
                name: (f.fixed if fixed else f.free).values[parameter] for name, f in fits.items()
            }
            values["nominal"] = _nominal(fits, parameter, fixed)
            for direction, value in values.items():
                where = {**told, "direction": direction, "exponent": "2" if fixed else "free"}
                yield Finding(parameter, value, UNITS[parameter], where)


def _point_table(points: list[MapPoint], suffix: str, where: str) -> Table:
    return Table(
        key=f"map{suffix}",
        title=f"Points of the friction-velocity map{f' ({where})' if where else ''}",
        columns=(
            Column("speed", "Commanded rate", "rad/s", "deg/s"),
            Column("rate", "Measured rate", "rad/s", "deg/s"),
            Column("torque", "Friction torque", "N m", "N m"),
            Column("spread", "Spread in the window (1σ)", "N m", "N m"),
            Column("window", "Window", "s", "s"),
            Column("rule", "Window set by"),
        ),
        rows=tuple(vars(point) for point in sorted(points, key=lambda p: p.speed)),
        note="Mean drive torque over the settled window, less inertia times residual acceleration.",
    )


def _parameter_table(fits: Mapping[str, DirectionFit], suffix: str, where: str) -> Table:
    rows = []
    for parameter in PARAMETERS:
        row: dict[str, float | str | None] = {
            "parameter": SYMBOLS[parameter],
            "unit": UNITS[parameter],
        }
        for name, fit in fits.items():
            row[name] = fit.free.values[parameter]
            row[f"{name}_error"] = fit.free.errors[parameter]
            row[f"{name}_2"] = fit.fixed.values[parameter]
        row["nominal"] = _nominal(fits, parameter, fixed=False)
        row["nominal_2"] = _nominal(fits, parameter, fixed=True)
        rows.append(row)
    rms: dict[str, float | str | None] = {"parameter": "residual (rms)", "unit": "N m"}
    for name, fit in fits.items():
        rms |= {name: fit.free.rms, f"{name}_2": fit.fixed.rms}
    return Table(
        key=f"parameters{suffix}",
        title=f"Static friction parameters{f' ({where})' if where else ''}",
        columns=(
            Column("parameter", "Parameter"),
            Column("unit", "Unit"),
            Column("positive", "Positive"),
            Column("positive_error", "± (1σ)"),
            Column("negative", "Negative"),
            Column("negative_error", "± (1σ)"),
            Column("nominal", "Nominal"),
            Column("positive_2", "Positive, δ = 2"),
            Column("negative_2", "Negative, δ = 2"),
            Column("nominal_2", "Nominal, δ = 2"),
        ),
        rows=(*rows, rms),
        thesis=("4.3",),
        note="δ free is for the static model and this table; δ = 2 is what the LuGre model uses. "
        "Nominal is the mean of both directions.",
    )


RATE = Axis("Rate", "rad/s", "deg/s")
TORQUE = Axis("Friction torque", "N m", "N m")


def _map_figure(points: list[MapPoint], suffix: str, where: str) -> Figure:
    ordered = sorted(points, key=lambda p: p.rate)
    rate = np.array([p.rate for p in ordered])
    torque = np.array([p.torque for p in ordered])
    halves = [
        Curve(rate[rate < 0], torque[rate < 0], "negative direction", "negative", "points"),
        Curve(rate[rate > 0], torque[rate > 0], "positive direction", "positive", "points"),
    ]
    return Figure(
        key=f"map{suffix}",
        title=f"Friction-velocity map{f' ({where})' if where else ''}",
        caption="Friction falls from its static value as sliding becomes faster (Stribeck effect) "
        "and rises again with viscous friction.",
        alt="Friction torque over rate for both directions, one dot per constant-velocity run.",
        panels=(Panel(RATE, TORQUE, halves),),
        thesis=("4.9",),
    )


def _fit_figure(fits: Mapping[str, DirectionFit], suffix: str, where: str) -> Figure:
    panels = []
    log_rate = Axis("Rate, either direction", "rad/s", "deg/s", scale="log")
    for name, fit in fits.items():
        fine = np.geomspace(fit.rate.min(), fit.rate.max(), 400)
        panels.append(
            Panel(
                log_rate,
                TORQUE,
                [
                    Curve(fit.rate, fit.torque, "measured", "measured", "points"),
                    Curve(fine, stribeck(fine, fit.free.values), "fitted, δ free", "fit"),
                    Curve(fine, stribeck(fine, fit.fixed.values), "fitted, δ = 2", "alternative"),
                ],
                f"{name.capitalize()} direction, δ = {fit.free.values['stribeck_exponent']:.3g}",
            )
        )
    return Figure(
        key=f"fit{suffix}",
        title=f"Stribeck curve fitted to the map{f' ({where})' if where else ''}",
        caption="Equation 4.6 fitted by least squares, with δ free and with δ = 2. The logarithmic "
        "axis shows the low speeds that decide Ts and vs.",
        alt="Measured friction torque over rate on a logarithmic axis with both fitted curves, one "
        "panel per direction.",
        panels=tuple(panels),
        thesis=("4.11",),
        across=2,
    )


def _example(data: TestData) -> tuple[Figure, ...]:
    """The time history of one point: the middle one of the first map."""
    measured = list(data.completed())
    if not measured:
        return ()
    item = measured[len(measured) // 2]
    options = VelocityMapOptions.model_validate(item.trial.options, context={"si": True})
    run = plan_run(float(str(item.trial.point["speed"])), options)
    recording = item.recording().window(0.0, run.leg)
    start, stop = run.window_of(+1)
    marks = (FigureMark("window", x=start), FigureMark("", x=stop))
    time = Axis("Time", "s", "s")
    speed = f"{np.rad2deg(run.speed):.3g} deg/s"
    rates = [Curve(recording.time, recording[GYRO_RATE], "measured", "measured")]
    if COMMAND in recording.channels:
        command = recording[COMMAND]
        rates.append(Curve(recording.time, command, "commanded", "reference", "thin"))
    return (
        Figure(
            key="one-point",
            title=f"One point of the map: {speed}",
            caption="Rate and drive torque of one run. The mean torque between the two lines is "
            "the friction torque at this speed.",
            alt="Rate and drive torque over time for one constant-velocity run, with the averaging "
            "window marked.",
            panels=(
                Panel(
                    time,
                    RATE,
                    rates,
                    marks=marks,
                ),
                Panel(
                    time,
                    Axis("Drive torque", "N m", "N m"),
                    [Curve(recording.time, recording[DRIVE_TORQUE], "measured", "measured")],
                    marks=marks,
                ),
            ),
            thesis=("4.8",),
        ),
    )


EXPERIMENT = Experiment(
    name="velocity_map",
    summary="friction torque over constant velocity, and its Stribeck fit (Table 4.3)",
    options=VelocityMapOptions,
    trials=map_trials,
    analyse=_analyse,
    requires=REQUIRED,
    can_use={COMMAND: "command in the figure of one point"},
)
