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
from campaign.estimation.ripple import FASTEST, Harmonic, dominant_periods, harmonic
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
"""Reason for metrics of a window without an interval."""


def stated_periods(bench: Bench) -> float | None:
    """Periods per revolution of the largest ripple that the bench describes; None without one."""
    ripples = [
        (each.ripple.amplitude * float(getattr(each, "static_torque", 1.0)), each.ripple.periods)
        for each in bench.friction.values()
        if each.ripple.amplitude > 0
    ]
    return max(ripples)[1] if ripples else None


def measure(data: TrialData) -> tuple[Estimate, ...]:
    """Metrics of one run out and back: rate and friction torque of each direction, and its ripple.

    Names end with the direction. Raises ValueError for a window without samples.
    """
    bench, windows, recording = bench_of(data.trial), windows_of(data.trial), data.recording()
    estimates: list[Estimate] = []
    for name in DIRECTIONS:
        if name not in windows:  # a steady stretch of a recording has one direction
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
            # The rate of an imported recording may be computed from encoder counts.
            own_sensor=not (data.trial.recording or bench.rate_is_of_encoder),
            commanded=None if data.trial.recording else DIRECTIONS[name] * speed_of(data.trial),
        )
        estimates += _metrics(name, sliding, ripple)
    return tuple(estimates)


@dataclass(frozen=True)
class _Samples:
    """Valid samples of one window, SI, shape (n,)."""

    time: Array
    rate: Array
    torque: Array
    angle: Array | None

    @classmethod
    def of(cls, recording: Recording, window: Window) -> _Samples:
        cut = recording.window(window.start, window.stop)
        angle = cut[RELATIVE_ANGLE] if RELATIVE_ANGLE in cut.channels else None
        columns = [cut.time, cut[GYRO_RATE], cut[DRIVE_TORQUE]]
        valid = np.isfinite(np.sum(columns if angle is None else [*columns, angle], axis=0))
        time, rate, torque = (column[valid] for column in columns)
        return cls(time, rate, torque, None if angle is None else angle[valid])


def _ripple(cut: _Samples, bench: Bench) -> Harmonic | None:
    """Ripple that the run shows, at the period that the bench states, or else at its own period.

    None if the inertia is unknown: the ripple of friction and that of the rate are inseparable.
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

    The attributes of `SteadySliding`, with the systematic parts of the torque's uncertainty.

    Attributes:
        trial, repeat: number of its trial, and of the trial's repetition.
        start, stop: its times (s).
        error: standard error of the torque without its ripple (N m), that of the ripple included;
            NaN if the window shows none.
        commanded: commanded rate (rad/s); None for a stretch of a recording.
        rule: what set the window.
        harmonic: ripple of its run, if the run is long enough.
        ripple: torque that `without_ripple` removed (N m).
        normal_load: as recorded (N).
        load: normal load times its arm (N m; N of a linear axis); NaN if it or the arm is unknown.
        doubts: standard uncertainties (N m) of the torque removed by angle, one per part, each
            shared by all points.
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
        """Point of a window's sliding, with its place and `more` attributes."""
        error = own.torque.standard_error
        error = math.nan if error is None else error
        return cls(**vars(own), trial=trial, start=start, stop=stop, error=error, **more)

    @property
    def speed(self) -> float:
        """Commanded rate; of a stretch its mean rate."""
        return self.rate.value if self.commanded is None else self.commanded

    @property
    def sign(self) -> float:
        """Direction: +1 or -1."""
        return 1.0 if self.speed > 0 else -1.0

    def off_by(self, part: int) -> Self:
        """Point shifted by one part of `doubts`, without doubts."""
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
    """Add the uncertainties of constants of the torque and the load, which no point shows.

    Args:
        data: trial that states the constants.
        force: channel of the torque.
        moved: change of the estimate if the bench's inertia doubles.
        scales: whether the estimate is proportional to the torque...
        loaded: ...and inversely proportional to the normal load.
    """
    bench = bench_of(data.trial)
    if scales:
        if not data.trial.recording:  # a recording's torque has its own constant
            one = with_systematic(one, bench, TORQUE_CONSTANT, one.value)
        one = with_scale(one, data, force)
    if force == DRIVE_TORQUE:  # with an unknown inertia, a part of unknown size
        one = with_systematic(one, bench, INERTIA, moved)
    return with_scale(one, data, NORMAL_LOAD) if scales and loaded else one


def coefficient_of(point: Point, data: TrialData) -> Estimate:
    """Friction over normal load, positive against the motion; data: see `with_constants`."""
    one = replace(multiplied(point.torque, point.sign / point.load), name="coefficient", unit="")
    return with_scale(one, data, NORMAL_LOAD)


REMEDY = "raise the gains of the rate loop, settle_angle or max_time, or begin at a higher speed"
MORE_COUNTS = "raise max_time, max_travel and window_angle, or begin at a higher speed"


def steady(points: Sequence[Point], notes: list[str]) -> tuple[list[Point], list[Point]]:
    """Points of steady sliding, and points left out; `notes` count those and the drifting ones."""
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
    """Point with `reason` appended to its rule."""
    return replace(point, rule=f"{point.rule}; {reason}") if reason else point


def _speeds(points: Sequence[Point]) -> str:
    texts = (in_words(point.speed, "rad/s", "deg/s").split() for point in points)
    numbers, units = zip(*texts, strict=True)
    return f"{', '.join(numbers)} {units[0]}"


def _unknown_inertia(points: Sequence[Point], bench: Bench) -> Iterator[str]:
    """Note on what the friction of a bench without inertia includes, and on the missing ripple."""
    if bench.axis.inertia is None and points:
        most = max(abs(point.acceleration) for point in points)
        yield (
            f"The bench '{bench.name}' does not say axis.inertia. Friction includes the torque "
            f"that accelerates the load, by up to {in_words(most, 'rad/s^2', 'deg/s^2', '.2g')} in "
            "these windows. Ripple over position is not estimated."
        )


def points_of(items: Sequence[TrialData], notes: list[str]) -> list[Point]:
    """Points of several runs of one bench; `notes` name the runs without points."""
    points: list[Point] = []
    for item in items:
        try:
            points += map_points(item)
        except ValueError as error:
            notes.append(f"{item.trial.label} has no points: {error}.")
    if items:
        notes += _unknown_inertia(points, bench_of(items[0].trial))
    return points


def map_points(data: TrialData) -> Iterator[Point]:
    """The two points of one run, out and back."""
    trial, values = data.trial, metrics(data, measure)
    inertia = bench_of(trial).axis.inertia or 0.0
    for name, window in windows_of(trial).items():
        if name not in DIRECTIONS:
            continue
        end = f"_{name}"
        own = Metrics({w.removesuffix(end): one for w, one in values.items() if w.endswith(end)})
        why = {w: own[w].reason if w in own else NONE for w in ("unsteady", "torque_drift")}
        rate, moved = own["rate"], own["acceleration"].value
        # Older archives have no reason for unsteady sliding.
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
