"""Points of a friction map: friction at one steady rate."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from campaign.channels import DRIVE_TORQUE, GYRO_RATE, NORMAL_LOAD, RELATIVE_ANGLE
from campaign.estimate import Estimate, Window
from campaign.estimation.intervals import multiplied
from campaign.estimation.ripple import (
    FASTEST,
    Harmonic,
    dominant_periods,
    harmonic,
)
from campaign.estimation.steadiness import TOO_FEW_COUNTS, drifting
from campaign.estimation.steady_sliding import SteadySliding, steady_sliding
from campaign.experiments.friction_map.runs import DIRECTIONS, WHOLE, rule_of, speed_of, windows_of
from campaign.experiments.interface import Metrics, TrialData, bench_of, metrics
from campaign.experiments.shared.systematic import (
    INERTIA,
    TORQUE_CONSTANT,
    with_scale,
    with_systematic,
)
from campaign.physics.bench import Bench
from campaign.reason import NONE, Cause, Reason
from campaign.recording import Recording
from campaign.result import Array
from campaign.units import in_words

RIPPLE = {
    "periods": "", "cosine": "N m", "sine": "N m", "error": "N m", "centre": "rad", "travel": "rad",
}  # fmt: skip
"""Metrics of a ripple, with their units."""
DESCRIBES = Cause("describes the window", "it describes the window")
"""Why some metrics of a window have no interval."""


def stated_periods(bench: Bench) -> float | None:
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
    periods = stated_periods(bench) or dominant_periods(angle, rate, torque, inertia)
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
        plain |= {f"ripple_{w}": (getattr(ripple, w), unit) for w, unit in RIPPLE.items()}
    for word, (value, unit) in plain.items():
        if np.isfinite(value):
            yield Estimate.without_interval(f"{word}_{name}", value, unit, DESCRIBES())
    for word, reason in (("unsteady", found.unsteady), ("torque_drift", found.drift)):
        if reason:
            yield Estimate.without_interval(f"{word}_{name}", 1.0, "", reason)


@dataclass(frozen=True, kw_only=True)
class Point(SteadySliding):
    """Friction at one steady rate, of a run's window or of a stretch: signed, SI.

    What `SteadySliding` has, with the systematic parts of the torque.

    Attributes:
        trial, repeat: which trial it is of, and which repetition of it.
        start, stop: times between which it lies (s).
        error: deviation of the torque without its ripple (N m), that of the ripple included; NaN
            where the window shows none.
        commanded: rate that was asked for (rad/s); None of a stretch that was found.
        rule: what set the window.
        harmonic: the ripple that its run shows, where it is long enough.
        ripple: what `without_ripple` has taken out of the torque (N m).
        normal_load: as recorded (N).
        load: normal load times its arm (N m; N of a linear axis); NaN where nobody recorded it, or
            a rotary axis has no radius.
        doubts: what was taken off by the angle may be off by (N m, 1 sigma), one part after the
            other, each shared by all points.
    """

    trial: int
    start: float
    stop: float
    error: float
    repeat: int = 0
    commanded: float | None = None
    rule: str = ""
    harmonic: Harmonic | None = None
    ripple: float = 0.0
    normal_load: float = math.nan
    load: float = math.nan
    doubts: tuple[float, ...] = ()

    @classmethod
    def of(cls, own: SteadySliding, trial: int, start: float, stop: float, **more: Any) -> Self:
        """What a window says, with where it is and `more` of its attributes."""
        error = own.torque.standard_error
        error = math.nan if error is None else error
        return cls(**vars(own), trial=trial, start=start, stop=stop, error=error, **more)

    @property
    def speed(self) -> float:
        """As commanded; of a stretch its mean rate."""
        return self.rate.value if self.commanded is None else self.commanded

    @property
    def sign(self) -> float:
        """+1 or -1: the direction."""
        return 1.0 if self.speed > 0 else -1.0

    def off_by(self, part: int) -> Self:
        """As it would be if one of `doubts` were so, and there were no other."""
        torque, off = self.torque, self.doubts[part]
        low, high = (None if end is None else end - off for end in (torque.low, torque.high))
        moved = replace(torque, value=torque.value - off, low=low, high=high)
        return replace(self, torque=moved, doubts=())


def with_constants(
    one: Estimate,
    data: TrialData,
    force: str,
    moved: float,
    *,
    scales: bool = True,
    loaded: bool = False,
) -> Estimate:
    """With what no point shows: how well constants of the torque and the load are known.

    Args:
        data: a trial, which says it.
        force: the channel that the torque was read from.
        moved: by how much it moves when the bench's inertia grows to twice its size.
        scales: whether it is proportional to the torque, and
        loaded: inversely to the normal load.
    """
    bench = bench_of(data.trial)
    if scales:
        if not data.trial.recording:  # of which the torque has a constant of its own
            one = with_systematic(one, bench, TORQUE_CONSTANT, one.value)
        one = with_scale(one, data, force)
    if force == DRIVE_TORQUE:  # of an inertia that nobody knows this is a part of unknown size
        one = with_systematic(one, bench, INERTIA, moved)
    return with_scale(one, data, NORMAL_LOAD) if scales and loaded else one


def coefficient_of(point: Point, data: TrialData) -> Estimate:
    """Friction over normal load, positive against the motion; data: a trial, as above."""
    one = replace(multiplied(point.torque, point.sign / point.load), name="coefficient", unit="")
    return with_scale(one, data, NORMAL_LOAD)


REMEDY = "raise the gains of the rate loop, settle_angle or max_time, or begin at a higher speed"
MORE_COUNTS = "raise max_time, max_travel and window_angle, or begin at a higher speed"


def steady(points: Sequence[Point], notes: list[str]) -> tuple[list[Point], list[Point]]:
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


def _with_rule(point: Point, reason: Reason) -> Point:
    """The point with a reason behind what set its window."""
    return replace(point, rule=f"{point.rule}; {reason}") if reason else point


def _speeds(points: Sequence[Point]) -> str:
    told = (in_words(point.speed, "rad/s", "deg/s").split() for point in points)
    numbers, units = zip(*told, strict=True)
    return f"{', '.join(numbers)} {units[0]}"


def _unknown_inertia(points: Sequence[Point], bench: Bench) -> Iterator[str]:
    """What a map leaves in its torques, and does not find, where the bench states no inertia."""
    if bench.axis.inertia is None and points:
        most = max(abs(point.acceleration) for point in points)
        yield (
            f"The bench '{bench.name}' does not say axis.inertia. Friction includes the torque "
            f"that accelerates the load, by up to {in_words(most, 'rad/s^2', 'deg/s^2', '.2g')} in "
            "these windows. Ripple over position is not estimated."
        )


def points_of(items: Sequence[TrialData], notes: list[str]) -> list[Point]:
    """The points of several runs of one bench; what one lacks is added to `notes`."""
    found: list[Point] = []
    for item in items:
        try:
            found += map_points(item)
        except ValueError as error:
            notes.append(f"{item.trial.label} has no points: {error}.")
    if items:
        notes += _unknown_inertia(found, bench_of(items[0].trial))
    return found


def map_points(data: TrialData) -> Iterator[Point]:
    """The two points of one run, out and back."""
    trial, found = data.trial, metrics(data, measure)
    inertia = bench_of(trial).axis.inertia or 0.0
    for name, window in windows_of(trial).items():
        if name not in DIRECTIONS:
            continue
        end = f"_{name}"
        own = Metrics({w.removesuffix(end): one for w, one in found.items() if w.endswith(end)})
        why = {w: own[w].reason if w in own else NONE for w in ("unsteady", "torque_drift")}
        rate, moved = own["rate"], own["acceleration"].value
        # An archive of a program that asked no more has no reason.
        drifts = drifting(moved * (window.stop - window.start), rate.half_width, rate.value)
        sliding = SteadySliding(
            rate,
            with_constants(own["friction_torque"], data, DRIVE_TORQUE, inertia * moved),
            own["spread"].value,
            moved,
            own["effective_samples"].value,
            own["first_angle"].value,
            own["last_angle"].value,
            why["unsteady"] or drifts,
            why["torque_drift"],
        )
        harmonic = Harmonic(*(own[f"ripple_{word}"].value for word in RIPPLE))
        yield Point.of(
            sliding,
            trial.number,
            window.start,
            window.stop,
            repeat=trial.repeat,
            commanded=DIRECTIONS[name] * speed_of(trial),
            rule=rule_of(trial),
            harmonic=None if math.isnan(harmonic.periods) else harmonic,
        )
