"""From recordings of a velocity map to its points, and from points to fits of both directions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.axis_kind import unit_here
from campaign.channels import DRIVE_TORQUE, GYRO_RATE, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.estimation.ripple import (
    FASTEST,
    Harmonic,
    dominant_periods,
    harmonic,
)
from campaign.estimation.steadiness import TOO_FEW_COUNTS, drifting
from campaign.estimation.steady_sliding import SteadySliding, steady_sliding
from campaign.experiments.friction_map.runs import DIRECTIONS, WHOLE, rule_of, speed_of, windows_of
from campaign.experiments.interface import TrialData, bench_of, metrics
from campaign.experiments.shared.systematic import INERTIA, TORQUE_CONSTANT, with_systematic
from campaign.physics.bench import Bench
from campaign.reason import NONE, Cause, Reason
from campaign.recording import Recording
from campaign.result import Array
from campaign.units import shown_here

DESCRIBES = Cause("describes the window", "it describes the window")
"""Why some metrics of a window have no interval."""


def told_periods(bench: Bench) -> float | None:
    """Periods per revolution of the largest ripple that the bench describes; None without one."""
    found = [
        (each.ripple.amplitude * float(getattr(each, "static_torque", 1.0)), each.ripple.periods)
        for each in bench.friction.values()
        if each.ripple.amplitude > 0
    ]
    return max(found)[1] if found else None


def measure(data: TrialData) -> tuple[Estimate, ...]:
    """Metrics of one run out and back: rate and friction torque of each direction, and its ripple.

    Names end with the direction. Raises ValueError for a window without samples.
    """
    bench, windows, recording = bench_of(data.trial), windows_of(data.trial), data.recording()
    found: list[Estimate] = []
    for name in DIRECTIONS:
        if name not in windows:  # a stretch that was found, of one direction
            continue
        own = windows[name]
        whole = windows.get(WHOLE.format(name), own)
        ripple = _ripple(_Samples.of(recording, whole), bench)
        cut = _Samples.of(recording, own)
        sliding = steady_sliding(
            cut.time,
            cut.rate,
            cut.torque,
            cut.angle,
            bench.axis.inertia,
            ripple.periods if ripple else None,
            # A recording that was imported may have made its rate of an encoder's counts.
            own_sensor=not (data.trial.recording or bench.rate_is_of_encoder),
            commanded=None if data.trial.recording else DIRECTIONS[name] * speed_of(data.trial),
        )
        found += _metrics(name, sliding, ripple)
    return tuple(found)


@dataclass(frozen=True)
class _Samples:
    """Samples of one window, those that were lost left out; SI, shape (n,)."""

    time: Array
    rate: Array
    torque: Array
    angle: Array | None

    @classmethod
    def of(cls, recording: Recording, window: Window) -> _Samples:
        cut = recording.window(window.start, window.stop)
        angle = cut[RELATIVE_ANGLE] if RELATIVE_ANGLE in cut.channels else None
        columns = [cut.time, cut[GYRO_RATE], cut[DRIVE_TORQUE]]
        there = np.isfinite(np.sum(columns if angle is None else [*columns, angle], axis=0))
        time, rate, torque = (column[there] for column in columns)
        return cls(time, rate, torque, None if angle is None else angle[there])


def _ripple(cut: _Samples, bench: Bench) -> Harmonic | None:
    """The ripple that the run shows, at the period that the bench tells or else at its own.

    None where the inertia is not known: friction's ripple and what it makes of the rate are one.
    """
    inertia = bench.axis.inertia
    if len(cut.time) < 3 or cut.angle is None or inertia is None:
        return None
    angle, rate, torque = cut.angle, cut.rate, cut.torque
    periods = told_periods(bench) or dominant_periods(angle, rate, torque, inertia)
    if periods is None or periods * abs(float(np.mean(rate))) > 2.0 * np.pi * FASTEST:
        return None
    try:
        return harmonic(angle, rate, torque, inertia, periods)
    except ValueError:
        return None


def _metrics(name: str, found: SteadySliding, ripple: Harmonic | None) -> Iterator[Estimate]:
    yield replace(found.rate, name=f"rate_{name}")
    yield replace(found.torque, name=f"friction_torque_{name}")
    plain = {
        "spread": (found.spread, "N m"),
        "acceleration": (found.acceleration, "rad/s^2"),
        "effective_samples": (found.effective, ""),
        "first_angle": (found.first, "rad"),
        "last_angle": (found.last, "rad"),
    }
    if ripple is not None:
        plain |= {
            "ripple_periods": (ripple.periods, ""),
            "ripple_cosine": (ripple.cosine, "N m"),
            "ripple_sine": (ripple.sine, "N m"),
            "ripple_error": (ripple.error, "N m"),
            "ripple_centre": (ripple.centre, "rad"),
            "ripple_travel": (ripple.travel, "rad"),
        }
    for word, (value, unit) in plain.items():
        if np.isfinite(value):
            yield Estimate.without_interval(f"{word}_{name}", value, unit, DESCRIBES())
    for word, reason in (("unsteady", found.unsteady), ("torque_drift", found.drift)):
        if reason:
            yield Estimate.without_interval(f"{word}_{name}", 1.0, "", reason)


@dataclass(frozen=True)
class MapPoint:
    """One point of the map: signed, SI.

    Attributes:
        speed: as commanded.
        rate, torque: with the interval that the window shows; the torque with its systematic parts.
        spread: the torque's 1 sigma in the window.
        window, rule: its length, and what set it.
        acceleration: residual one (rad/s^2).
        first, last: angles between which the window lies (rad); NaN where none was recorded.
        harmonic: the ripple that its run shows, where it is long enough.
        repeat: which repetition it is of.
        unsteady: why it is no steady sliding; such a point is not fitted.
        drift: that its torque changes across the window; such a point is fitted.
        ripple: what `without_ripple` has taken out of the torque (N m).
        error: deviation of the torque without its ripple (N m), that of the ripple included; NaN
            where the window shows none.
    """

    speed: float
    rate: Estimate
    torque: Estimate
    spread: float
    window: float
    rule: str
    acceleration: float
    first: float
    last: float
    harmonic: Harmonic | None
    repeat: int
    error: float
    unsteady: Reason = NONE
    drift: Reason = NONE
    ripple: float = 0.0

    @property
    def sign(self) -> float:
        """+1 or -1: the direction."""
        return 1.0 if self.speed > 0 else -1.0


REMEDY = "raise the gains of the rate loop, settle_angle or max_time, or begin at a higher speed"
MORE_COUNTS = "raise max_time, max_travel and window_angle, or begin at a higher speed"


def steady(points: Sequence[MapPoint], notes: list[str]) -> tuple[list[MapPoint], list[MapPoint]]:
    """The points at which the load slid steadily, and the others; `notes` count them by reason."""
    kept = [_with_rule(point, point.drift) for point in points if not point.unsteady]
    left = [_with_rule(point, point.unsteady) for point in points if point.unsteady]
    for code in dict.fromkeys(point.unsteady.code for point in left):
        own = [point for point in left if point.unsteady.code == code]
        remedy = MORE_COUNTS if own[0].unsteady in TOO_FEW_COUNTS else REMEDY
        notes.append(
            f"{len(own)} of {len(points)} points are left out of the fit, for {code} "
            f"({_speeds(own)}): {remedy}."
        )
    if moved := [point for point in kept if point.drift]:
        notes.append(
            f"At {len(moved)} of {len(points)} points the torque changes across the window "
            f"({_speeds(moved)}): running-in, warming, or a ripple that is longer than the "
            "window. They are fitted; the table of points says by how much."
        )
    return kept, left


def _with_rule(point: MapPoint, reason: Reason) -> MapPoint:
    """The point with a reason behind what set its window."""
    return replace(point, rule=f"{point.rule}; {reason}") if reason else point


def _speeds(points: Sequence[MapPoint]) -> str:
    told = (f"{shown_here(point.speed, 'rad/s', 'deg/s'):.3g}" for point in points)
    return f"{', '.join(told)} {unit_here('deg/s')}"


def _unknown_inertia(points: Sequence[MapPoint], bench: Bench) -> Iterator[str]:
    """What a map leaves in its torques, and does not find, where the bench states no inertia."""
    if bench.axis.inertia is None and points:
        most = float(np.rad2deg(max(abs(point.acceleration) for point in points)))
        yield (
            f"The bench '{bench.name}' does not say axis.inertia: the torque that accelerates the "
            f"load, by up to {most:.2g} deg/s² in these windows, is not taken out of friction, and "
            "no ripple over position is looked for."
        )


def points_of(items: Iterable[TrialData], bench: Bench, notes: list[str]) -> list[MapPoint]:
    """The points of several trials on `bench`; what one lacks is added to `notes`."""
    found: list[MapPoint] = []
    for item in items:
        try:
            found += map_points(item, bench)
        except ValueError as error:
            notes.append(f"{item.trial.label} has no points: {error}.")
    notes += _unknown_inertia(found, bench)
    return found


def map_points(data: TrialData, bench: Bench) -> Iterator[MapPoint]:
    """The two points of one trial on `bench`, out and back."""
    rule = rule_of(data.trial)
    found = metrics(data, measure)
    windows = windows_of(data.trial)
    speed = speed_of(data.trial)
    for name, sign in DIRECTIONS.items():
        if name not in windows:
            continue
        torque, acceleration = found[f"friction_torque_{name}"], found[f"acceleration_{name}"].value
        torque = with_systematic(torque, bench, TORQUE_CONSTANT, torque.value)
        # Of an inertia that nobody knows this is a part of unknown size.
        torque = with_systematic(torque, bench, INERTIA, (bench.axis.inertia or 0.0) * acceleration)
        ripple = None
        rate, window = found[f"rate_{name}"], windows[name].stop - windows[name].start
        if f"unsteady_{name}" in found:
            unsteady = found[f"unsteady_{name}"].reason
        else:  # as an archive of a program that asked no more
            unsteady = drifting(acceleration * window, rate.half_width, rate.value)
        if f"ripple_periods_{name}" in found:
            words = ("periods", "cosine", "sine", "error", "centre", "travel")
            ripple = Harmonic(*(found[f"ripple_{word}_{name}"].value for word in words))
        yield MapPoint(
            speed=speed * sign,
            rate=rate,
            torque=torque,
            spread=found[f"spread_{name}"].value,
            window=window,
            rule=rule,
            acceleration=acceleration,
            first=_value(found, f"first_angle_{name}"),
            last=_value(found, f"last_angle_{name}"),
            harmonic=ripple,
            repeat=data.trial.repeat,
            error=np.nan if torque.standard_error is None else torque.standard_error,
            unsteady=unsteady,
            drift=found[f"torque_drift_{name}"].reason if f"torque_drift_{name}" in found else NONE,
        )


def _value(found: Mapping[str, Estimate], name: str) -> float:
    return found[name].value if name in found else np.nan
