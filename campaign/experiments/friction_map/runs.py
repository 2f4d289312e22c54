"""Runs of a friction map: planned trial and measured windows of each speed.

Each trial runs out and back at one speed. It ends where it began and needs no homing.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import Field

from campaign.axis_kind import is_linear
from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Window
from campaign.estimation.steady_stretches import steady_stretches
from campaign.experiments.interface import bench_of, validated
from campaign.experiments.shared.rig import Rig
from campaign.options import LaterOptions
from campaign.physics.bench import Bench
from campaign.signals import Polyline
from campaign.trial import OfferedRecording, Role, Task, Trial, TrialRequest, canonical_json
from campaign.units import (
    Angle,
    AngularAcceleration,
    AngularRate,
    Frequency,
    Time,
    angle_text,
    rate_text,
)

SMALLEST_WINDOW = 10
"""Fewest samples for a mean and a slope."""
DIRECTIONS = {"positive": 1.0, "negative": -1.0}
WHOLE = "settled {}"
"""Name of the window of the whole settled part of a run, by direction."""
GOLDEN = 0.5 * (1.0 + math.sqrt(5.0))
"""Golden ratio: its multiples spread starts most evenly."""
MEMORIES = 7.0
"""Settling angle over friction's memory, Ts / sigma0: 2 exp(-7), 0.2 % of a reversal, is left."""

ROUNDING = 1e-9
"""Relative rounding error of an angle from a difference of times."""


class VelocityMapOptions(LaterOptions):
    """Options of a friction-velocity map."""

    later = frozenset({"spread_starts"})

    slowest: AngularRate = Field(default=float(np.deg2rad(0.05)), gt=0)
    """Lowest speed of the map."""
    fastest: AngularRate = Field(default=float(np.deg2rad(65.0)), gt=0)
    """Highest speed of the map."""
    points: int = Field(default=80, ge=1, le=10_000)
    """Number of speeds from slowest to fastest, even in the logarithm: dense at low speed."""
    speeds: tuple[AngularRate, ...] = ()
    """Your own speeds instead of slowest, fastest and points. Each is run in both directions."""
    max_travel: Angle = Field(default=float(np.deg2rad(60.0)), gt=0)
    """Longest travel of one run, ramps included."""
    max_time: Time = Field(default=20.0, gt=0)
    """Longest motion of one run; the shorter of this and max_travel counts."""
    window_time: Time = Field(default=2.0, gt=0)
    """Shortest settled window to average."""
    window_angle: Angle = Field(default=float(np.deg2rad(5.0)), gt=0)
    """Shortest travel of that window. The longer of both counts, as far as the run has room."""
    settle_time: Time = Field(default=0.3, ge=0)
    """Time from ramp to window, for the loop to settle."""
    settle_angle: Angle = Field(default=float(np.deg2rad(0.75)), ge=0)
    """Travel from ramp to window; the longer of both counts. The memory of friction is an angle:
    7.5 times Ts / sigma0 leaves a thousandth of it, also after a reversal."""
    acceleration: AngularAcceleration = Field(default=float(np.deg2rad(300.0)), gt=0)
    """Acceleration of the ramps."""
    rest: Time = Field(default=0.5, ge=0)
    """Standstill before each run."""
    warm_up_speed: AngularRate = Field(default=float(np.deg2rad(20.0)), gt=0)
    """Speed of the warm-up."""
    warm_up_cycles: int = Field(default=3, ge=0, le=1000)
    """Moves out and back before the first point; 0 for no warm-up."""
    compensation: str = "none"
    """Compensation while the map is measured; normally none."""
    sample_rate: Frequency = Field(default=1000.0, gt=0, le=100_000)
    """Rate of the recording."""
    start_angles: tuple[Angle, ...] = ()
    """Start angles of the runs: each speed is run from each, and its torques are averaged. Angles
    half a period of friction's ripple apart cancel it. None: one, half of max_travel below zero."""

    spread_starts: bool = False
    """Whether each run starts at another angle, by the golden ratio. A ripple of friction over
    position then scatters the points, and does not bend the curve."""

    def without_effect(self) -> frozenset[str]:
        unused = {"slowest", "fastest", "points"} if self.speeds else set()
        return frozenset(unused | (set() if self.warm_up_cycles else {"warm_up_speed"}))


def map_speeds(options: VelocityMapOptions) -> tuple[float, ...]:
    """Speeds of the map (rad/s), as written or rising. Raises ValueError for an empty range."""
    if options.speeds:
        if min(options.speeds) <= 0:
            raise ValueError("speeds are positive; each is run in both directions")
        return options.speeds
    # Round numbers, as they are written: the last bits equal those of a list.
    unit = 1e-3 if is_linear() else float(np.deg2rad(1.0))
    low, high = (round(v / unit, 12) for v in (options.slowest, options.fastest))
    if high < low:
        raise ValueError("fastest must not be below slowest")
    return tuple(float(v) for v in np.geomspace(low, high, options.points) * unit)


@dataclass(frozen=True)
class Run:
    """Times of one out-and-back trial (s), from the trial's start.

    Attributes:
        ramp, cruise: durations of one ramp, and of the constant speed between two ramps.
        window: duration of the settled window, at the end of each cruise.
        rule: what set the window's duration.
        settle: duration at the beginning of each cruise that is left out.
    """

    speed: float
    rest: float
    ramp: float
    cruise: float
    window: float
    rule: str
    settle: float

    @property
    def settled(self) -> float:
        """Duration of the constant speed after settling (s)."""
        return self.cruise - self.settle

    @property
    def leg(self) -> float:
        return self.rest + 2 * self.ramp + self.cruise

    def window_of(self, direction: float) -> tuple[float, float]:
        """Start and stop of the window of the run in `direction` (+1 out, -1 back)."""
        stop = self.rest + self.ramp + self.cruise + (self.leg if direction < 0 else 0.0)
        return stop - self.window, stop

    def windows(self) -> tuple[Window, ...]:
        """Averaged window and whole settled window of each direction."""
        windows = []
        for name, direction in DIRECTIONS.items():
            start, stop = self.window_of(direction)
            windows.append(Window(name, start, stop))
            begin = stop - self.cruise + self.settle
            windows.append(Window(WHOLE.format(name), min(begin, start), stop))
        return tuple(windows)

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
"""Channels that every map needs."""
OWN = ("speed", "start_angle")
"""Point keys that differ between trials of one map. Any other swept key makes another map."""
CAN_USE = {RELATIVE_ANGLE: "look for a ripple of friction over position"}


def windows_of(trial: Trial) -> dict[str, Window]:
    """Windows of a trial by name, planned again for archives that have none."""
    windows = trial.windows or _replanned(trial).windows()
    return {window.name: window for window in windows}


def rule_of(trial: Trial) -> str:
    """What set the length of the trial's window, in words."""
    if trial.task.mode == "recorded":
        return "found in the recording"
    run, own = _replanned(trial), windows_of(trial)["positive"]
    # Windows of a pilot's runs, and of runs that follow it, differ from those of the options.
    return run.rule if math.isclose(own.stop - own.start, run.window) else "the pilot"


def settled_angle(trial: Trial) -> float:
    """Angle (rad) that a run moves at constant speed before its settled part."""
    run, whole = _replanned(trial), windows_of(trial).get(WHOLE.format("positive"))
    settle = run.settle if whole is None else run.cruise - (whole.stop - whole.start)
    return settle * run.speed


def speed_of(trial: Trial) -> float:
    """Commanded speed (rad/s)."""
    return float(str(trial.point["speed"]))


def _replanned(trial: Trial) -> Run:
    known = {k: v for k, v in trial.options.items() if k in VelocityMapOptions.model_fields}
    return plan_run(speed_of(trial), validated(VelocityMapOptions, known))


def settling_advice(rig: Rig, speed: float, settled: float) -> str:
    """Advice for a run at `speed` (rad/s) that settles for too short an angle (rad); empty if it is
    long enough.
    """
    memory, turned = rig.presliding or 0.0, rig.unwinding(speed)
    turned = turned if turned > memory else 0.0  # a shorter reversal ends within friction's memory
    needed = MEMORIES * memory + turned
    if settled >= needed * (1.0 - ROUNDING):
        return ""
    wanted, lag = (angle_text(angle, ".2g") for angle in (needed, turned))
    integral = f", and the loop's integral reverses in {lag}" if turned else ""
    return f"settle for {wanted} or more: Ts/sigma0 is {angle_text(memory)}{integral}"


def plan_run(speed: float, options: VelocityMapOptions) -> Run:
    """Plan the run at `speed` (rad/s). ValueError if it cannot settle within the allowed travel."""
    ramp = speed / options.acceleration
    by_travel = options.max_travel / speed - ramp
    by_time = options.max_time - 2 * ramp
    cruise = min(by_travel, by_time)
    settle = max(options.settle_time, options.settle_angle / speed)
    room = cruise - settle
    if room <= 0:
        raise ValueError(
            f"at {rate_text(speed, '.4g')} the run lasts {max(cruise, 0):.3g} s at constant "
            f"speed but takes {settle:.3g} s to settle; raise max_travel, max_time or "
            "acceleration, or drop that speed"
        )
    by_angle = options.window_angle / speed
    wanted = max(options.window_time, by_angle)
    if wanted > room:
        limit = "max_travel" if by_travel < by_time else "max_time"
        rule, wanted = f"all that {limit} leaves", room
    else:
        rule = "window_angle" if by_angle > options.window_time else "window_time"
    return Run(speed, options.rest, ramp, cruise, wanted, rule, settle)


def settling_notes(trials: Iterable[Trial]) -> Iterator[str]:
    """Advice for maps whose runs settle for too short an angle, one note per bench."""
    by_bench: dict[str, list[Trial]] = {}
    for trial in trials:
        if trial.task.mode != "recorded":  # else its settling was not planned
            by_bench.setdefault(canonical_json(trial.bench), []).append(trial)
    for own in by_bench.values():
        runs = [(speed_of(trial), settled_angle(trial)) for trial in own]
        where, advice = settling_of_runs(Rig(bench_of(own[0])), runs)
        if advice:
            yield f"At {where}: {advice}."


def settling_of_runs(rig: Rig, runs: Iterable[tuple[float, float]]) -> tuple[str, str]:
    """Speeds at which runs settle for too short an angle, and the advice for the slowest of them.

    Args:
        runs: speed (rad/s) and settled angle (rad) of each.
    """
    advices = {speed: settling_advice(rig, speed, settled) for speed, settled in runs}
    short = sorted(speed for speed, advice in advices.items() if advice)
    return (speed_range(short), advices[short[0]]) if short else ("", "")


def speed_range(speeds: Sequence[float]) -> str:
    """Range of speeds (rad/s), in words."""
    low, high = rate_text(min(speeds)), rate_text(max(speeds))
    return high if low == high else f"{low.split()[0]} to {high}"


def map_trials(options: VelocityMapOptions, bench: Bench) -> Iterator[TrialRequest]:
    """Requests of the warm-up, then of one trial out and back per speed and start angle."""
    yield from warm_ups(options)
    rig = Rig(bench)
    for number, speed in enumerate(map_speeds(options)):
        yield from run_requests(plan_run(speed, options), options, rig, number)


def run_requests(
    run: Run, options: VelocityMapOptions, rig: Rig, number: int
) -> Iterator[TrialRequest]:
    """Trials of the run, one per start angle. Raises ValueError for too few samples.

    number: index of the run in its map, from 0.
    """
    if run.window * options.sample_rate < SMALLEST_WINDOW:
        raise ValueError(
            f"at {rate_text(run.speed, '.4g')} the window of {run.window:.3g} s holds fewer "
            f"than {SMALLEST_WINDOW} samples; raise sample_rate or drop that speed"
        )
    (first, _), (_, last) = run.window_of(+1), run.window_of(-1)
    window_text = f"window {run.window:.3g} s, {angle_text(run.window * run.speed)}: {run.rule}"
    advice = settling_advice(rig, run.speed, run.speed * run.settle)
    many = bool(options.start_angles)
    for start_angle in _starts(options, run, number, rig.limits.angle):
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
            point={"speed": run.speed} | ({"start_angle": start_angle} if many else {}),
            note=f"{window_text}; {advice}" if advice else window_text,
            windows=run.windows(),
        )


def _stated_starts(options: VelocityMapOptions) -> tuple[float, ...]:
    """Start angles (rad) of the warm-up, and of all runs if they are not spread."""
    return options.start_angles or (-0.5 * options.max_travel,)


def _starts(options: VelocityMapOptions, run: Run, number: int, limit: float) -> tuple[float, ...]:
    """Start angles (rad) of a run on an axis with that limit.

    Starts spread over half of the angle between the limits, or a quarter turn without limits. Over
    the travel of the fastest run alone, all fast runs would see a long ripple at one place.
    """
    if options.start_angles or not options.spread_starts:
        return _stated_starts(options)
    room = max(options.max_travel, limit if math.isfinite(limit) else 0.5 * math.pi)
    left = max(room - run.speed * (run.ramp + run.cruise), 0.0)
    return (-0.5 * room + number / GOLDEN % 1.0 * left,)


def warm_ups(options: VelocityMapOptions) -> Iterator[TrialRequest]:
    """Request of the warm-up, if one is wanted."""
    if not options.warm_up_cycles:
        return
    relaxed = options.model_copy(update={"settle_time": 0.0, "settle_angle": 0.0})
    run = plan_run(options.warm_up_speed, relaxed)
    once = run.command()
    times, values = [0.0], [0.0]
    for cycle in range(options.warm_up_cycles):
        times += [cycle * once.times[-1] + t for t in once.times[1:]]
        values += once.values[1:]
    yield TrialRequest(
        Task(
            mode="rate",
            command=Polyline(times=tuple(times), values=tuple(values)),
            duration=times[-1] + options.rest,
            window=(0.0, times[-1]),
            sample_rate=options.sample_rate,
            start_angle=_stated_starts(options)[0],
        ),
        role=Role.WARM_UP,
        point={"speed": options.warm_up_speed},
        note=f"{options.warm_up_cycles} moves out and back",
    )


def stretches_found(
    options: Any, bench: Bench, offered: OfferedRecording
) -> Iterator[TrialRequest]:
    """One trial per steady stretch, of one direction; or one trial of the windows that are named.

    Raises ValueError without a steady stretch.
    """
    if offered.windows:
        yield from _named(offered)
        return
    recording = offered.read([GYRO_RATE, DRIVE_TORQUE])
    torque = recording[DRIVE_TORQUE]
    stretches = [
        each
        for each in steady_stretches(recording[GYRO_RATE], offered.sample_rate, torque)
        if each.stop - each.first >= SMALLEST_WINDOW
    ]
    if not stretches:
        raise ValueError("nowhere does the load slide steadily; say its windows, or how fast it is")
    for stretch in stretches:
        start, stop = stretch.first / offered.sample_rate, stretch.stop / offered.sample_rate
        name = "positive" if stretch.rate > 0 else "negative"
        yield _request(
            abs(stretch.rate),
            (Window(name, 0.0, stop - start), Window(WHOLE.format(name), 0.0, stop - start)),
            (start, stop),
        )


def _named(offered: OfferedRecording) -> Iterator[TrialRequest]:
    wrong = [window.name for window in offered.windows if window.name not in DIRECTIONS]
    if wrong:
        raise ValueError(
            f"a window {wrong[0]!r} has no meaning here; they are {', '.join(DIRECTIONS)}"
        )
    rate = offered.read([GYRO_RATE])
    speeds = [
        abs(float(rate.window(window.start, window.stop)[GYRO_RATE].mean()))
        for window in offered.windows
    ]
    wholes = tuple(Window(WHOLE.format(w.name), w.start, w.stop) for w in offered.windows)
    speed = offered.conditions.get("speed", sum(speeds) / len(speeds))
    yield _request(float(str(speed)), (*offered.windows, *wholes), (0.0, offered.duration))


def _request(speed: float, windows: tuple[Window, ...], part: tuple[float, float]) -> TrialRequest:
    return TrialRequest(
        Task(
            mode="recorded",
            duration=part[1] - part[0],
            window=(windows[0].start, windows[0].stop),
            sample_rate=1.0,  # replaced by the recording's own, once its part is known
        ),
        point={"speed": speed},
        note="found in the recording",
        windows=windows,
        part=part,
    )
