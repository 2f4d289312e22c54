"""The pilot of a friction map: a few speeds that decide the others.

The pilot's speeds are spread evenly over those of the plain map. Its runs settle for as long as
they measure, for nobody knows friction yet, and are points of the map where that was long enough.
What follows has the rest of `points`, between the same slowest and fastest speed
(`velocity_map_choice`).
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
"""of a pilot: twice as many as Equation 4.6 has parameters."""
FEWEST = 2 * SPEEDS
"""points of a map with a pilot: as many after it as in it."""
REVERSAL = "reversal"
"""Window of a pilot's run: from the turn until the way back is settled. No other run has one."""


class PilotedMapOptions(VelocityMapOptions):
    """Options of a friction-velocity map, which may have a pilot."""

    pilot: bool = False
    """Run 10 of the `points` first. Their friction decides which speeds between slowest and fastest
    follow, and whether these settle and measure longer. `repeat` repeats the 10 only."""


def pilot_speeds(options: VelocityMapOptions) -> tuple[float, ...]:
    """Speeds of the pilot (rad/s), rising: among those of the plain map, as evenly as these are.

    Raises ValueError for options that leave nothing to be chosen.
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
    """The same, with what is settled in its second half at most."""
    settle = max(run.settle, 0.5 * run.cruise)
    room = run.cruise - settle
    if run.window <= room:
        return replace(run, settle=settle)
    return replace(run, settle=settle, window=room, rule="half of the run")


def most(options: PilotedMapOptions, bench: Bench) -> Most:
    """What follows a pilot at most: every trial as long as max_time allows."""
    if not options.pilot:
        return NONE_MORE
    count = (options.points - SPEEDS) * max(1, len(options.start_angles))
    duration = 2.0 * (options.rest + options.max_time) + options.rest
    samples = int(duration * options.sample_rate) + 1
    return Most(count, count * duration, count * samples)


def settled_enough(group: Sequence[TrialData], notes: list[str]) -> list[TrialData]:
    """The runs of a map without those of its pilot that settled for less than what followed does.

    What became of the pilot, and what was left out, is told in `notes`.
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
"""speeds to choose among for each of `points`."""
HALF = 0.5
"""Share of a window that a longer settling may take, where a speed is still run."""
PERIODS = 1.05
"""of the ripple that a window spans."""
SLOW = 3
"""speeds of a pilot, the slowest, whose reversals tell friction's memory."""


@dataclass(frozen=True)
class Choice:
    """What follows from a pilot.

    Attributes:
        options: those of the runs that follow: settling and windows as friction asks for.
        speeds: at which they are (rad/s), rising.
        reason: what was found, and what follows from it; for the archive and the page.
    """

    options: VelocityMapOptions
    speeds: tuple[float, ...]
    reason: str


def following(options: PilotedMapOptions, bench: Bench, data: TestData) -> Iterator[TrialRequest]:
    """The runs after the pilot."""
    choice, rig = choose(options, bench, tuple(data.completed())), Rig(bench)
    for number, speed in enumerate(choice.speeds, start=SPEEDS):
        run = plan_run(speed, choice.options)
        for request in run_requests(run, choice.options, rig, number):
            yield replace(request, note=f"{choice.reason}; {request.note}")


def choose(options: PilotedMapOptions, bench: Bench, pilot: Sequence[TrialData]) -> Choice:
    """What the pilot's recordings ask for; the rest of the plain map where they say nothing."""
    points, _ = steady(points_of(pilot, []), [])
    try:
        if not points:
            raise ValueError("it has no steady point")
        fits = fit_map(points, pilot[0])
        curves = _curves(fits)
        longer = _longer(options, bench, fits, _memory(pilot))
        speeds = _speeds(options, longer, points, curves)
    except ValueError as error:
        told = f"after a pilot that shows too little of friction: {error}"
        return Choice(options, _plain(options, points), told)
    return Choice(longer, speeds, _reason(options, longer, fits))


def _plain(options: PilotedMapOptions, points: Sequence[Point]) -> tuple[float, ...]:
    """The rest of the plain map; between the speeds at which the pilot slid steadily."""
    done = set(pilot_speeds(options))
    found = [abs(point.speed) for point in points] or [options.slowest, options.fastest]
    slowest, fastest = min(found), max(found)
    if slowest <= options.slowest * (1.0 + ROUNDING) and fastest >= max(done) * (1.0 - ROUNDING):
        return tuple(speed for speed in map_speeds(options) if speed not in done)
    between = np.geomspace(slowest, fastest, options.points - SPEEDS + 2)[1:-1]
    return tuple(float(speed) for speed in between)


def _curves(fits: Curves) -> list[Mapping[str, float]]:
    """Curves that the pilot leaves possible. ValueError where neither direction shows one."""
    curves: list[Mapping[str, float]] = []
    for direction, fit in fits.fits.items():
        found = fits.estimates("free")[direction]
        torques = (found["static_torque"].origin, found["coulomb_torque"].origin)
        if not fit.shows_stribeck_effect or torques != (Origin.MEASURED, Origin.MEASURED):
            continue
        values = {name: found[name].value for name in PARAMETERS}
        errors = (_relative_error(found[f"stribeck_{name}"]) for name in ("velocity", "exponent"))
        curves += curves_around(values, *errors)
    if not curves:
        raise ValueError("it shows no Stribeck effect")
    return curves


def _relative_error(found: Estimate) -> float:
    """1 sigma over the value; infinite where it has none."""
    return np.inf if found.standard_error is None else found.standard_error / found.value


def _memory(pilot: Sequence[TrialData]) -> float:
    """Ts / sigma0 (rad), the largest that a reversal of the slowest runs shows; NaN without any."""
    slowest = sorted({speed_of(item.trial) for item in pilot})[:SLOW]
    found = [_reversal(item) for item in pilot if speed_of(item.trial) in slowest]
    return max((angle for angle in found if np.isfinite(angle)), default=np.nan)


def _reversal(item: TrialData) -> float:
    """Ts / sigma0 (rad) from the way back of one run; NaN where it tells none."""
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
    """Options whose settling and windows are long enough for the friction that was found.

    Settling: `MEMORIES` of friction's memory (rad), once the loop's integral has turned round the
    torque of the slowest runs. Windows average over whole periods of a ripple. Neither is shorter
    than `options` has it.
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
    """The speeds that tell most, from the slowest at which the pilot slid steadily.

    ValueError where no run has room to settle for as long as friction asks.
    """
    steadily = np.unique([abs(point.speed) for point in points])
    own = {speed: pilot_run(plan_run(speed, options)) for speed in pilot_speeds(options)}
    settled = [v for v, run in own.items() if v * run.settle >= longer.settle_angle]
    measured = np.intersect1d(steadily, settled)
    fastest = steadily[-1] if steadily[-1] < max(own) else options.fastest
    offered = np.geomspace(steadily[0], fastest, FINER * options.points)
    apart = np.min(np.abs(np.log(offered[:, None] / steadily)), axis=1)
    offered = offered[apart > ROUNDING]  # a repeat would be averaged with what it repeats
    candidates = np.array([speed for speed in offered if _fits(float(speed), options, longer)])
    if not len(candidates) or not len(measured):
        angle = angle_text(longer.settle_angle)
        raise ValueError(f"friction asks to settle for {angle}, and no run has room for it")
    chosen = telling_speeds(curves, measured, candidates, options.points - SPEEDS)
    return tuple(chosen.tolist())


def _fits(speed: float, options: VelocityMapOptions, longer: VelocityMapOptions) -> bool:
    """Whether a run at `speed` (rad/s) has room to settle for longer, and to measure then."""
    plain = plan_run(speed, options)
    try:
        run = plan_run(speed, longer)
    except ValueError:
        return False
    return run.window >= max(HALF * plain.window, SMALLEST_WINDOW / options.sample_rate)


def _reason(options: PilotedMapOptions, longer: VelocityMapOptions, fits: Curves) -> str:
    found = {
        name: float(np.mean([fits.fits[way].fits["free"].values[name] for way in DIRECTIONS]))
        for name in PARAMETERS
    }
    told = (
        f"where a pilot shows that it determines most: Ts {torque_text(found['static_torque'])}, "
        f"Tc {torque_text(found['coulomb_torque'])}, "
        f"vs {in_words(found['stribeck_velocity'], 'rad/s', 'deg/s')}, "
        f"δ {found['stribeck_exponent']:.2g}"
    )
    settle, window = (angle_text(angle) for angle in (longer.settle_angle, longer.window_angle))
    if longer.settle_angle > options.settle_angle:
        told += f"; settled for {settle}, as its reversals ask for"
    if longer.window_angle > options.window_angle:
        told += f"; averaged over {window}, for the ripple's period"
    return told


STAGE = Stage(
    name="map",
    why="the pilot's friction determines the most informative speeds for the others",
    most=most,
    trials=following,
)
