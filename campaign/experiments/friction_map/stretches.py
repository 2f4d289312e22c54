"""Steady stretches of trials, with the load that presses the surfaces together where it is known.

Of a tribometer friction means little without its normal load: over it, it is a coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from campaign.channels import (
    DRIVE_TORQUE,
    JOINT_TORQUE,
    NORMAL_LOAD,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
)
from campaign.estimate import Estimate
from campaign.estimation.intervals import multiplied
from campaign.estimation.over_a_turn import OverATurn, over_a_turn
from campaign.estimation.steady_sliding import SteadySliding, steady_sliding
from campaign.estimation.steady_stretches import SHORTEST_TIME, steady_stretches
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.interface import TrialData
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.result import Array
from campaign.units import AngularRate, Time

ANY_NAME = "motion"
"""Kind of trials whose windows are stretches whatever their names."""
FEWEST = 20
"""samples of a stretch that are not lost."""
LOADS_ALIKE = 1.05
"""Largest over smallest normal load up to which all stretches had one."""
ONE_SPEED = 0.02
"""Share by which speeds of one place may differ, but for what a loop makes of them."""


class StretchOptions(Options):
    """How steady stretches are found."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch that is read, where a trial names no windows."""
    slowest: AngularRate | None = Field(default=None, ge=0)
    """Rate up to which the axis counts as standing still; absent: 3 % of the fastest of its trial.
    A sweep over decades of speed in one trial needs less."""


@dataclass(frozen=True)
class Point:
    """One steady stretch.

    Attributes:
        load: normal load times its arm (N m; N of a linear axis); NaN where nobody recorded it, or
            a rotary axis has no radius.
        normal_load: as recorded (N).
        first, last: times between which it lies (s).
        doubts: what was taken off may be off by (N m, 1 sigma), one part after the other, each
            shared by all points.
    """

    trial: int
    own: SteadySliding
    load: float = math.nan
    doubts: tuple[float, ...] = ()
    normal_load: float = math.nan
    first: float = math.nan
    last: float = math.nan

    def off_by(self, part: int) -> Point:
        """As it would be if one of `doubts` were so."""
        torque, off = self.own.torque, self.doubts[part]
        low, high = (None if end is None else end - off for end in (torque.low, torque.high))
        moved = replace(torque, value=torque.value - off, low=low, high=high)
        return replace(self, own=replace(self.own, torque=moved))

    @property
    def sign(self) -> float:
        """1, or -1 in the negative direction."""
        return 1.0 if self.own.rate.value > 0 else -1.0

    @property
    def speed(self) -> float:
        """Without its sign."""
        return abs(self.own.rate.value)

    @property
    def coefficient(self) -> Estimate:
        """Friction over normal load, with the sign of the friction; the stretch's own scatter."""
        return replace(multiplied(self.own.torque, 1.0 / self.load), name="coefficient", unit="")


def force_of(trial: TrialData) -> str:
    """The channel that friction is read from: the joint's own, or else the drive's."""
    return JOINT_TORQUE if JOINT_TORQUE in trial.channel_names() else DRIVE_TORQUE


@dataclass(frozen=True)
class Stretch:
    """Samples of a steady stretch, shape (n,) each; `angle` (rad) None where nobody recorded it."""

    trial: int
    time: Array
    rate: Array
    torque: Array
    angle: Array | None
    normal_load: float
    arm: float
    inertia: float | None

    def point(self, held: OverATurn | None) -> Point:
        """What it comes to, without what follows from the angle."""
        torque, angle, doubts = self.torque, self.angle, ()
        if angle is not None and held is not None:
            torque, doubts = torque - held.at(angle), tuple(held.doubts(angle))
        if angle is not None:
            angle = np.unwrap(angle)
        # A rate relative to the hull may be made of an encoder's counts.
        own = steady_sliding(self.time, self.rate, torque, angle, self.inertia, own_sensor=False)
        pressed = abs(self.normal_load) * self.arm
        load = pressed if pressed > 0 else math.nan
        first, last = float(self.time[0]), float(self.time[-1])
        return Point(self.trial, own, load, doubts, self.normal_load, first, last)


def points_of(
    trials: Sequence[TrialData], bench: Bench, shortest: float, slowest: float | None = None
) -> tuple[list[Point], OverATurn | None]:
    """Of all steady stretches, and what of their torque follows from the angle, and is not in them.

    Args:
        shortest: stretch (s) that is looked for, where a trial names no windows.
        slowest: rate (SI) up to which the axis stands still; None: 3 % of its fastest.
    """
    found, held = _found(trials, bench, shortest, slowest, None)
    if held is not None:  # without it the torque is steady for longer
        found, held = _found(trials, bench, shortest, slowest, held)
    points = [each.point(held) for each in found]
    return [each for each in points if each.own.rate.value != 0.0], held


def slower(
    trials: Sequence[TrialData], bench: Bench, shortest: float, found: Sequence[Point]
) -> int:
    """How many steady stretches count as standstill, slower than all that were found there.

    found: the points of all trials, with no `slowest` stated.
    """
    count = 0
    for trial in trials:
        own = [each.speed for each in found if each.trial == trial.trial.number]
        every = _stretches(trial, bench, shortest, 0.0, None)
        speeds = (abs(float(np.mean(each.rate))) for each in every)
        count += sum(0.0 < speed < 0.5 * min(own, default=0.0) for speed in speeds)
    return count


def _found(
    trials: Sequence[TrialData],
    bench: Bench,
    shortest: float,
    slowest: float | None,
    held: OverATurn | None,
) -> tuple[list[Stretch], OverATurn | None]:
    """Stretches in which what `held` leaves is steady, and what follows from the angle there."""
    found = [
        stretch for trial in trials for stretch in _stretches(trial, bench, shortest, slowest, held)
    ]
    placed = [(each.time, each.angle, each.torque) for each in found if each.angle is not None]
    whole = len(placed) == len(found) and not bench.is_linear
    return found, over_a_turn(placed) if whole else None


def _stretches(
    trial: TrialData,
    bench: Bench,
    shortest: float,
    slowest: float | None,
    held: OverATurn | None,
) -> Iterator[Stretch]:
    """Of the windows that somebody named, or of what is steady."""
    recording = trial.recording()
    force = force_of(trial)
    torque, rate = recording[force], recording[RELATIVE_RATE]
    load = recording[NORMAL_LOAD] if NORMAL_LOAD in recording.channels else None
    angle = recording[RELATIVE_ANGLE] if RELATIVE_ANGLE in recording.channels else None
    radius = trial.trial.options.get("radius")
    arm = 1.0 if bench.is_linear else radius if isinstance(radius, float | int) else math.nan
    # A sensor in the joint is not told what accelerates the load.
    inertia = 0.0 if force == JOINT_TORQUE else bench.axis.inertia
    per_second = trial.trial.task.sample_rate
    any_name = trial.trial.kind == ANY_NAME
    named = [w for w in trial.trial.windows if any_name or w.name in DIRECTIONS]
    stretches = [(round(w.start * per_second), round(w.stop * per_second)) for w in named]
    if not stretches:
        left = torque if held is None or angle is None else torque - held.at(angle)
        steady = steady_stretches(rate, per_second, left, shortest, driven=False, slowest=slowest)
        stretches = [(each.first, each.stop) for each in steady]
    for first, stop in stretches:
        good = np.isfinite(rate[first:stop] + torque[first:stop])
        if angle is not None:
            good &= np.isfinite(angle[first:stop])
        there = np.flatnonzero(good) + first
        if len(there) < FEWEST:
            continue
        yield Stretch(
            trial.trial.number,
            recording.time[there],
            rate[there],
            torque[there],
            None if angle is None else angle[there],
            math.nan if load is None else float(np.nanmean(load[there])),
            arm,
            inertia,
        )


def loaded(points: Sequence[Point]) -> bool:
    """Whether the normal load of every stretch is known."""
    return all(math.isfinite(each.load) for each in points)


def loads_alike(points: Sequence[Point]) -> bool:
    """Whether friction of all stretches belongs to one normal load, as far as anybody knows."""
    known = [each.load for each in points if math.isfinite(each.load)]
    return not known or max(known) <= LOADS_ALIKE * min(known)


def places(speed: Array) -> Array:
    """Which speeds are one, shape (n,): within 2 % of the slowest of them."""
    place, first, number = np.empty(len(speed)), math.nan, -1
    for index in np.argsort(speed):
        if not speed[index] <= first * (1.0 + ONE_SPEED):
            first, number = float(speed[index]), number + 1
        place[index] = number
    return place


def goes_along(points: Sequence[Point]) -> bool:
    """Whether what is called friction drives the motion, nearly wherever it slides."""
    power = np.array([each.own.torque.value * each.sign for each in points])
    return bool(np.median(power) < 0 and np.mean(power < 0) > 0.9)
