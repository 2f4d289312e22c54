"""Commands from the options of an excitation.

Sums of sines remain sums of sines, for which the line to a controller has a message. All else is a
polyline with as few points as its course needs; the controller limits their number.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from campaign.estimation.excitation_design.fourier import (
    FourierSeries,
    Room,
    best_series,
    condition,
)
from campaign.estimation.excitation_design.multisines import crest_factor, odd_multisine, peak
from campaign.estimation.excitation_design.noise import band_noise
from campaign.estimation.excitation_design.sweep import chirp
from campaign.estimation.frequency.multisine import OddGrid, odd_grid
from campaign.experiments.excitation.options import ExcitationOptions
from campaign.experiments.shared.multisine import MOST_LINES, PER_LINE
from campaign.experiments.shared.rig import MOST, Rig
from campaign.physics.bench import Bench
from campaign.physics.complete import control_rate
from campaign.physics.limits import worst_friction
from campaign.signals import Array, MultiSine, Polyline
from campaign.units import angle_text, rate_text, torque_text

PER_CYCLE = 16.0
"""Smallest number of points per cycle of the highest frequency of noise."""
MOST_POINTS = 100_000
"""Largest number of points of a polyline: a trial contains all of them."""
NYQUIST_SHARE = 0.4
"""of the controller's sample rate: the highest frequency that can be commanded."""


@dataclass(frozen=True)
class Course:
    """One complete command; its measured part is from `begin` (s) to its end."""

    command: MultiSine | Polyline
    begin: float
    duration: float
    note: str
    realisation: int | None = None


def courses(options: ExcitationOptions, bench: Bench) -> Iterator[Course]:
    """The commands of a test. Raises ValueError, with a message for the user, if there is none."""
    if options.signal not in ("fourier", "file"):
        _check_band(options, bench)
    match options.signal:
        case "multisine":
            yield from _multisines(options)
        case "chirp":
            yield _chirp(options)
        case "noise":
            yield from _noises(options)
        case "fourier":
            series = series_of(options, bench)
            used = condition(series.motion(options.position), options.terms)
            note = f"condition number {used:.3g} of {', '.join(options.terms)}"
            yield Course(series.rate, 0.0, options.periods * options.period, note)
        case "file" if options.table is not None:  # else the options are refused
            command = options.table.signal(options.command)
            note = f"{options.table.file}, {len(command.times)} rows"
            yield Course(command, 0.0, command.times[-1], note)


def _check_band(options: ExcitationOptions, bench: Bench) -> None:
    highest, control = options.highest, control_rate(bench)
    if options.sample_rate < PER_LINE * highest * (1.0 - 1e-9):
        raise ValueError(
            f"{highest:.4g} Hz needs a sample_rate of {PER_LINE:g} times that; raise sample_rate "
            "or lower highest"
        )
    if control is not None and highest > NYQUIST_SHARE * control:
        raise ValueError(
            f"{highest:g} Hz is above {NYQUIST_SHARE:g} of the controller's sample rate "
            f"({control:g} Hz); lower highest"
        )


def grid_of(options: ExcitationOptions) -> OddGrid:
    """Lines of a multisine, common to its realizations. Raises ValueError for none, or too many."""
    grid = odd_grid(options.lowest, options.highest, options.period, options.seed, options.group)
    if len(grid.excited) > MOST_LINES:
        raise ValueError(
            f"{len(grid.excited)} lines of 1/{options.period:g} s between {options.lowest:g} and "
            f"{options.highest:g} Hz; {MOST_LINES} are possible: shorten the period"
        )
    return grid


@lru_cache(maxsize=64)  # a sweep of the amplitude repeats the same calls
def _unscaled(
    lowest: float, highest: float, period: float, group: int, draws: int, lowered: bool,
    order: int, seed: int, count: int,
) -> tuple[MultiSine, ...]:  # fmt: skip
    grid = odd_grid(lowest, highest, period, seed, group)
    return tuple(
        odd_multisine(grid, _derived(seed, number), draws, lowered=lowered, order=order)
        for number in range(1, count + 1)
    )


def _derived(seed: int, number: int) -> int:
    """A separate seed for each realization."""
    return int(np.random.SeedSequence((seed, number)).generate_state(1)[0])


def _multisines(options: ExcitationOptions) -> Iterator[Course]:
    samples = options.period * options.sample_rate
    if abs(samples - round(samples)) > 1e-6 * samples:
        raise ValueError(
            f"a period of {options.period:g} s is no whole number of samples at "
            f"{options.sample_rate:g} Hz"
        )
    lines = len(grid_of(options).excited)
    signals = _unscaled(
        options.lowest, options.highest, options.period, options.group, options.draws,
        options.phases == "lowered", _order(options), options.seed, options.realisations,
    )  # fmt: skip
    # All have the same power, since one response is made of them; one of them has the peak.
    scale = options.size / max(peak(each, options.period) for each in signals)
    for number, signal in enumerate(signals, start=1):
        note = (
            f"{lines} odd lines from {signal.frequencies[0]:.4g} to {signal.frequencies[-1]:.4g} "
            f"Hz, crest factor {crest_factor(signal, options.period):.3g}"
        )
        sized = signal.model_copy(
            update={"amplitudes": tuple(scale * a for a in signal.amplitudes)}
        )
        duration = options.settle + options.periods * options.period
        yield Course(sized, options.settle, duration, note, number)


def _order(options: ExcitationOptions) -> int:
    """Order of the integral that begins at zero: 0 for a rate, 1 for a torque."""
    return 1 if options.command == "torque" else 0


def _chirp(options: ExcitationOptions) -> Course:
    sweep = chirp(options.lowest, options.highest, options.duration, options.sweep)
    time = sweep.points()
    _check_points(len(time))
    # A torque begins at its peak, so that a free load neither creeps nor drifts.
    values = options.size * np.sin(sweep.phase(time) + 0.5 * np.pi * _order(options))
    note = f"{options.sweep} sweep from {options.lowest:.4g} to {options.highest:.4g} Hz"
    return Course(_polyline(time, values), 0.0, float(time[-1]), note)


def _noises(options: ExcitationOptions) -> Iterator[Course]:
    share = max(1, int(options.sample_rate / (PER_CYCLE * options.highest) + 1e-9))
    rate = options.sample_rate / share
    count = round(options.duration * rate)
    _check_points(count)
    duration = count / rate
    seeds = [_derived(options.seed, number) for number in range(1, options.realisations + 1)]
    drawn = [
        band_noise(options.lowest, options.highest, duration, rate, seed, _order(options))
        for seed in seeds
    ]
    scale = options.size / max(float(np.max(np.abs(each))) for each in drawn)
    time = np.arange(count + 1) / rate
    for number, values in enumerate(drawn, start=1):
        crest = float(np.max(np.abs(values)))
        note = (
            f"noise from {options.lowest:.4g} to {options.highest:.4g} Hz, crest factor {crest:.3g}"
        )
        yield Course(_polyline(time, scale * values), 0.0, duration, note, number)


def _check_points(count: int) -> None:
    if count > MOST_POINTS:
        raise ValueError(
            f"this is a polyline of {count} points, and {MOST_POINTS} are the most: lower highest, "
            "or shorten duration"
        )


def _polyline(time: Array, values: Array) -> Polyline:
    return Polyline(times=tuple(time.tolist()), values=tuple(values.tolist()))


def series_of(options: ExcitationOptions, bench: Bench) -> FourierSeries:
    """The best series of a search within the limits. Raises ValueError for no room."""
    room = room_of(options, bench)
    return best_series(
        options.period, options.harmonics, options.terms, room, options.position, options.search,
        options.seed,
    )  # fmt: skip


def room_of(options: ExcitationOptions, bench: Bench) -> Room:
    """Limits of a series, from the test's own limits or else from the bench's.

    Friction at the largest rate reduces the torque. Raises ValueError for no room.
    """
    rig = Rig(bench)
    rate = options.max_rate or MOST * rig.limits.rate
    angle = (options.max_angle or MOST * rig.limits.angle) - abs(options.position)
    torque = options.max_torque or MOST * rig.torque
    left = torque - worst_friction(bench, rate)
    if left <= 0:
        raise ValueError(
            f"friction at {rate_text(rate)} asks for {torque_text(torque - left)}, and "
            f"{torque_text(torque)} are allowed: lower max_rate or raise max_torque"
        )
    acceleration = options.max_acceleration or MOST * rig.limits.acceleration
    return Room(angle, rate, min(acceleration, rig.accelerated_by(left)))


def start_of(options: ExcitationOptions, bench: Bench, course: Course) -> float:
    """Start angle (rad) of the load, so that it swings around the position.

    For a torque, friction is neglected; without an inertia, or below static friction, the start is
    the position. Raises ValueError if a frictionless load would swing beyond the limits.
    """
    if options.command == "rate":
        return options.position - _middle(_travel(course, 1)[1])
    inertia, largest = bench.axis.inertia, _largest(course)
    static = Rig(bench).static_torque
    if inertia is None or (static is not None and largest < static):
        return options.position
    rate, angle = (each / inertia for each in _travel(course, 2))
    limits = Rig(bench).limits
    swing, fastest = 0.5 * float(np.ptp(angle)), float(np.max(np.abs(rate)))
    if abs(options.position) + swing > limits.angle or fastest > limits.rate:
        raise ValueError(
            f"{torque_text(largest)} would swing a load without friction by "
            f"{angle_text(swing)} at {rate_text(fastest)}, beyond the bench's limits of "
            f"{angle_text(limits.angle)} and {rate_text(limits.rate)}; lower torque or raise lowest"
        )
    return options.position - _middle(angle)


def _largest(course: Course) -> float:
    time = _fine(course)
    return float(np.max(np.abs(course.command.sample(time))))


def _middle(course: Array) -> float:
    return 0.5 * float(np.max(course) + np.min(course))


def _travel(course: Course, order: int) -> tuple[Array, Array]:
    """The last two integrals, from zero, of a command integrated `order` times."""
    time = _fine(course)
    command = course.command
    if isinstance(command, MultiSine):
        integrals = [command.integral(time, n) for n in range(order + 1)]
        for n in range(1, order + 1):
            integrals[n] = integrals[n] - integrals[n][0]
        return integrals[-2], integrals[-1]
    values = [command.sample(time)]
    for _ in range(order):
        steps = 0.5 * np.diff(time) * (values[-1][1:] + values[-1][:-1])
        values.append(np.concatenate([[0.0], np.cumsum(steps)]))
    return values[-2], values[-1]


def _fine(course: Course) -> Array:
    command = course.command
    if isinstance(command, MultiSine):
        step = 1.0 / (PER_CYCLE * max(command.frequencies))
        return np.arange(0.0, course.duration + step, step)
    return np.asarray(command.times)
