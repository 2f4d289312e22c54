"""The pilot of a friction map: a few speeds that decide the others.

The pilot's speeds are spread evenly over those of the plain map. Friction is still unknown, so its
runs settle for as long as they measure. They are points of the map if they settled long enough. The
runs that follow have the rest of `points`, between the same slowest and fastest speed
(`estimation/map_design.py`).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Origin, Window
from campaign.estimation.friction_memory import memory_angle
from campaign.estimation.map_design import curves_around, telling_speeds
from campaign.estimation.stribeck import PARAMETERS
from campaign.experiments.friction_map.curves import Curves, fit_map
from campaign.experiments.friction_map.points import Point, map_points, points_of, steady
from campaign.experiments.friction_map.runs import (
    DIRECTIONS,
    MEMORIES,
    ROUNDING,
    SMALLEST_WINDOW,
    Run,
    VelocityMapOptions,
    map_speeds,
    map_trials,
    plan_run,
    run_requests,
    settled_angle,
    speed_of,
    warm_ups,
    windows_of,
)
from campaign.experiments.interface import Stage, TestData, TrialData
from campaign.experiments.shared.rig import Rig
from campaign.physics.bench import Bench
from campaign.trial import NONE_MORE, Most, TrialRequest
from campaign.units import angle_text, in_words, torque_text

SPEEDS = 10
"""Speeds of a pilot: twice as many as Equation 4.6 has parameters."""
FEWEST = 2 * SPEEDS
"""Fewest points of a map with a pilot: half of them in the pilot."""
REVERSAL = "reversal"
"""Window of a pilot's run, and of no other: from the turn until the way back is settled."""


class PilotedMapOptions(VelocityMapOptions):
    """Options of a friction-velocity map, which may have a pilot."""

    pilot: bool = False
    """Run 10 of the `points` first. Their friction decides which speeds between slowest and fastest
    follow, and whether these settle and measure longer. `repeat` repeats the 10 only."""


def pilot_speeds(options: VelocityMapOptions) -> tuple[float, ...]:
    """Speeds of the pilot (rad/s), rising: evenly spaced among those of the plain map.

    Raises ValueError for options that leave no choice of speeds.
    """
    if options.speeds:
        raise ValueError("a pilot chooses speeds: write slowest and fastest instead of speeds")
    if options.points < FEWEST:
        raise ValueError(f"a map with a pilot has at least {FEWEST} points, {SPEEDS} of them in it")
    grid = map_speeds(options)
    places = np.round(np.linspace(0, len(grid) - 1, SPEEDS)).astype(int)
    return tuple(grid[place] for place in places)


def trials(options: PilotedMapOptions, bench: Bench) -> Iterator[TrialRequest]:
    """The planned trials: the whole map, or its pilot."""
    if not options.pilot:
        yield from map_trials(options, bench)
        return
    yield from warm_ups(options)
    rig = Rig(bench)
    for number, speed in enumerate(pilot_speeds(options)):
        run = pilot_run(plan_run(speed, options))
        turn = Window(REVERSAL, run.leg, run.window_of(-1)[0])
        for request in run_requests(run, options, rig, number):
            windows = (*request.windows, turn)
            yield replace(request, note=f"pilot; {request.note}", windows=windows)


def pilot_run(run: Run) -> Run:
    """The same run, with its settled part in the second half at most."""
    settle = max(run.settle, 0.5 * run.cruise)
    room = run.cruise - settle
    if run.window <= room:
        return replace(run, settle=settle)
    return replace(run, settle=settle, window=room, rule="half of the run")


def most(options: PilotedMapOptions, bench: Bench) -> Most:
    """Upper limit of what follows a pilot: every trial as long as max_time allows."""
    if not options.pilot:
        return NONE_MORE
    count = (options.points - SPEEDS) * max(1, len(options.start_angles))
    duration = 2.0 * (options.rest + options.max_time) + options.rest
    samples = int(duration * options.sample_rate) + 1
    return Most(count, count * duration, count * samples)


def settled_enough(group: Sequence[TrialData], notes: list[str]) -> list[TrialData]:
    """Runs of a map, without pilot runs that settled for less than those that followed.

    `notes` report the pilot's outcome and the runs left out.
    """
    first = [item for item in group if REVERSAL in windows_of(item.trial)]
    then = [item for item in group if REVERSAL not in windows_of(item.trial)]
    if not first:
        return then
    if not then:
        notes.append("Nothing followed the pilot: the map is that of the pilot alone.")
        return first
    notes += dict.fromkeys(item.trial.note.partition("; window")[0] for item in then)
    needed = min(settled_angle(item.trial) for item in then)
    kept = [item for item in first if settled_angle(item.trial) >= needed * (1.0 - ROUNDING)]
    if short := len(first) - len(kept):
        notes.append(
            f"{short} of {len(first)} runs of the pilot are no points of the map: they settled for "
            f"less than the {angle_text(needed, '.2g')} of those that followed."
        )
    return [*kept, *then]


FINER = 3
"""Candidate speeds per point of `points`."""
HALF = 0.5
"""Least share of the plain window that remains after longer settling, for a speed to be run."""
PERIODS = 1.05
"""Periods of the ripple that a window spans."""
SLOW = 3
"""Number of the slowest pilot speeds whose reversals determine friction's memory."""


@dataclass(frozen=True)
class Choice:
    """What follows from a pilot.

    Attributes:
        options: options of the runs that follow; settling and windows suit the friction.
        speeds: speeds of these runs (rad/s), rising.
        reason: estimated friction and its consequences; for the archive and the page.
    """

    options: VelocityMapOptions
    speeds: tuple[float, ...]
    reason: str


def following(options: PilotedMapOptions, bench: Bench, data: TestData) -> Iterator[TrialRequest]:
    """Requests of the runs after the pilot."""
    choice, rig = choose(options, bench, tuple(data.completed())), Rig(bench)
    for number, speed in enumerate(choice.speeds, start=SPEEDS):
        run = plan_run(speed, choice.options)
        for request in run_requests(run, choice.options, rig, number):
            yield replace(request, note=f"{choice.reason}; {request.note}")


def choose(options: PilotedMapOptions, bench: Bench, pilot: Sequence[TrialData]) -> Choice:
    """Choice from the pilot's recordings; the rest of the plain map if they show too little."""
    points, _ = steady(points_of(pilot, []), [])
    try:
        if not points:
            raise ValueError("it has no steady point")
        fits = fit_map(points, pilot[0])
        curves = _curves(fits)
        longer = _longer(options, bench, fits, _memory(pilot))
        speeds = _speeds(options, longer, points, curves)
    except ValueError as error:
        reason = f"after a pilot that shows too little of friction: {error}"
        return Choice(options, _plain(options, points), reason)
    return Choice(longer, speeds, _reason(options, longer, fits))


def _plain(options: PilotedMapOptions, points: Sequence[Point]) -> tuple[float, ...]:
    """Remaining speeds of the plain map, or a series over the pilot's range of steady speeds."""
    done = set(pilot_speeds(options))
    steadily = [abs(point.speed) for point in points] or [options.slowest, options.fastest]
    slowest, fastest = min(steadily), max(steadily)
    if slowest <= options.slowest * (1.0 + ROUNDING) and fastest >= max(done) * (1.0 - ROUNDING):
        return tuple(speed for speed in map_speeds(options) if speed not in done)
    between = np.geomspace(slowest, fastest, options.points - SPEEDS + 2)[1:-1]
    return tuple(float(speed) for speed in between)


def _curves(fits: Curves) -> list[Mapping[str, float]]:
    """Curves that the pilot's fits allow. Raises ValueError if neither direction shows one."""
    curves: list[Mapping[str, float]] = []
    for direction, fit in fits.fits.items():
        curve = fits.estimates("free")[direction]
        torques = (curve["static_torque"].origin, curve["coulomb_torque"].origin)
        if not fit.shows_stribeck_effect or torques != (Origin.MEASURED, Origin.MEASURED):
            continue
        values = {name: curve[name].value for name in PARAMETERS}
        errors = (_relative_error(curve[f"stribeck_{name}"]) for name in ("velocity", "exponent"))
        curves += curves_around(values, *errors)
    if not curves:
        raise ValueError("it shows no Stribeck effect")
    return curves


def _relative_error(found: Estimate) -> float:
    """Standard error over the value; infinite without one."""
    return np.inf if found.standard_error is None else found.standard_error / found.value


def _memory(pilot: Sequence[TrialData]) -> float:
    """Largest Ts / sigma0 (rad) that reversals of the slowest runs show; NaN without any."""
    slowest = sorted({speed_of(item.trial) for item in pilot})[:SLOW]
    angles = [_reversal(item) for item in pilot if speed_of(item.trial) in slowest]
    return max((angle for angle in angles if np.isfinite(angle)), default=np.nan)


def _reversal(item: TrialData) -> float:
    """Ts / sigma0 (rad) from the way back of one run; NaN if it shows none."""
    turn = windows_of(item.trial)[REVERSAL]
    cut = item.recording().window(turn.start, turn.stop)
    rate = cut[GYRO_RATE]
    if RELATIVE_ANGLE in cut.channels:  # a gyro's bias would add up over minutes
        angle = cut[RELATIVE_ANGLE]
        rate = rate - np.mean(rate) + (angle[-1] - angle[0]) / (cut.time[-1] - cut.time[0])
    try:
        (settled,) = (p.torque.value for p in map_points(item) if p.sign < 0)
    except ValueError:
        return np.nan
    return memory_angle(cut.time, rate, cut[DRIVE_TORQUE], settled)


def _longer(
    options: PilotedMapOptions, bench: Bench, fits: Curves, memory: float
) -> VelocityMapOptions:
    """Options with settling and windows long enough for the estimated friction.

    Settling: `MEMORIES` of friction's memory (rad), after the loop's integral has reversed the
    torque of the slowest runs. Windows average over whole periods of a ripple. Neither is shorter
    than in `options`.
    """
    slowest = sorted({abs(point.speed) for point in fits.points})[:SLOW]
    torque = max(abs(p.torque.value) for p in fits.points if abs(p.speed) in slowest)
    forgotten = options.settle_angle if np.isnan(memory) else MEMORIES * memory
    settle = max(options.settle_angle, forgotten + Rig(bench).unwinding(options.slowest, torque))
    ripples = [ripple for ripple in fits.ripples.values() if ripple is not None]
    period = max((2.0 * np.pi / ripple.periods for ripple in ripples), default=0.0)
    window = max(options.window_angle, PERIODS * period)
    return options.model_copy(update={"settle_angle": settle, "window_angle": window})


def _speeds(
    options: PilotedMapOptions,
    longer: VelocityMapOptions,
    points: Sequence[Point],
    curves: Sequence[Mapping[str, float]],
) -> tuple[float, ...]:
    """Most informative speeds (rad/s), from the pilot's slowest steady speed on.

    Raises ValueError if no run has room for the required settling.
    """
    steadily = np.unique([abs(point.speed) for point in points])
    own = {speed: pilot_run(plan_run(speed, options)) for speed in pilot_speeds(options)}
    settled = [v for v, run in own.items() if v * run.settle >= longer.settle_angle]
    measured = np.intersect1d(steadily, settled)
    fastest = steadily[-1] if steadily[-1] < max(own) else options.fastest
    offered = np.geomspace(steadily[0], fastest, FINER * options.points)
    apart = np.min(np.abs(np.log(offered[:, None] / steadily)), axis=1)
    offered = offered[apart > ROUNDING]  # a repeated speed would be averaged
    candidates = np.array([speed for speed in offered if _fits(float(speed), options, longer)])
    if not len(candidates) or not len(measured):
        angle = angle_text(longer.settle_angle)
        raise ValueError(f"friction asks to settle for {angle}, and no run has room for it")
    chosen = telling_speeds(curves, measured, candidates, options.points - SPEEDS)
    return tuple(chosen.tolist())


def _fits(speed: float, options: VelocityMapOptions, longer: VelocityMapOptions) -> bool:
    """Whether a run at `speed` (rad/s) has room for longer settling and a window after it."""
    plain = plan_run(speed, options)
    try:
        run = plan_run(speed, longer)
    except ValueError:
        return False
    return run.window >= max(HALF * plain.window, SMALLEST_WINDOW / options.sample_rate)


def _reason(options: PilotedMapOptions, longer: VelocityMapOptions, fits: Curves) -> str:
    means = {
        name: float(np.mean([fits.fits[side].fits["free"].values[name] for side in DIRECTIONS]))
        for name in PARAMETERS
    }
    reason = (
        f"where a pilot shows that it determines most: Ts {torque_text(means['static_torque'])}, "
        f"Tc {torque_text(means['coulomb_torque'])}, "
        f"vs {in_words(means['stribeck_velocity'], 'rad/s', 'deg/s')}, "
        f"δ {means['stribeck_exponent']:.2g}"
    )
    settle, window = (angle_text(angle) for angle in (longer.settle_angle, longer.window_angle))
    if longer.settle_angle > options.settle_angle:
        reason += f"; settled for {settle}, as its reversals ask for"
    if longer.window_angle > options.window_angle:
        reason += f"; averaged over {window}, for the ripple's period"
    return reason


STAGE = Stage(
    name="map",
    why="the pilot's friction determines the most informative speeds for the others",
    most=most,
    trials=following,
)
