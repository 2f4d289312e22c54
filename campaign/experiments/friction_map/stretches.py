"""Steady stretches of trials, with the normal load if it is known.

Friction of a tribometer means little without its normal load. Their ratio is a coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, NORMAL_LOAD, RELATIVE_ANGLE, RELATIVE_RATE
from campaign.estimation.angle_dependence import OverATurn, over_a_turn
from campaign.estimation.steady_sliding import steady_sliding
from campaign.estimation.steady_stretches import SHORTEST_TIME, steady_stretches
from campaign.experiments.friction_map.points import Point, with_constants
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.interface import TrialData, bench_of
from campaign.options import Options
from campaign.result import Array
from campaign.units import AngularRate, Time

ANY_NAME = "motion"
"""Kind of trials whose windows are stretches with any name."""
FEWEST = 20
"""Fewest valid samples of a stretch."""
LOADS_ALIKE = 1.05
"""Largest over smallest normal load up to which all stretches have one load."""


class StretchOptions(Options):
    """Options of the search for steady stretches."""

    shortest: Time = Field(default=SHORTEST_TIME, gt=0)
    """Shortest steady stretch to use, if a trial has no windows."""
    slowest: AngularRate | None = Field(default=None, ge=0)
    """Largest rate that counts as standstill; absent: 3 % of the largest of the trial. A sweep over
    decades of speed in one trial needs less."""


def force_of(data: TrialData) -> str:
    """Channel of the friction: the joint torque, or else the drive torque."""
    return JOINT_TORQUE if JOINT_TORQUE in data.channel_names() else DRIVE_TORQUE


@dataclass(frozen=True)
class Stretch:
    """Valid samples of a steady stretch, shape (n,) each; `angle` (rad) None if not recorded."""

    data: TrialData
    time: Array
    rate: Array
    torque: Array
    angle: Array | None
    normal_load: float

    def point(self, held: OverATurn | None) -> Point:
        """Point of the stretch, without the torque that depends on the angle."""
        torque, angle, doubts = self.torque, self.angle, ()
        if angle is not None and held is not None:
            torque, doubts = torque - held.at(angle), tuple(held.doubts(angle))
        if angle is not None:
            angle = np.unwrap(angle)
        trial, bench, force = self.data.trial, bench_of(self.data.trial), force_of(self.data)
        # A joint torque sensor does not measure the torque that accelerates the load.
        inertia = 0.0 if force == JOINT_TORQUE else bench.axis.inertia
        # A rate relative to the hull may be computed from encoder counts.
        own = steady_sliding(self.time, self.rate, torque, angle, inertia, own_sensor=False)
        moved = (inertia or 0.0) * own.acceleration
        radius = trial.options.get("radius")
        arm = 1.0 if bench.is_linear else radius if isinstance(radius, float | int) else math.nan
        pressed = abs(self.normal_load) * arm
        return Point.of(
            replace(own, torque=with_constants(own.torque, self.data, force, moved)),
            trial.number,
            float(self.time[0]),
            float(self.time[-1]),
            normal_load=self.normal_load,
            load=pressed if pressed > 0 else math.nan,
            doubts=doubts,
        )


def points_of(
    trials: Sequence[TrialData], shortest: float, slowest: float | None = None
) -> tuple[list[Point], OverATurn | None]:
    """Points of all steady stretches without the torque that depends on the angle, and that torque.

    Args:
        trials: of one bench.
        shortest: shortest stretch (s), in trials without named windows.
        slowest: rate (SI) up to which the axis stands still; None: 3 % of its fastest.
    """
    stretches, held = _found(trials, shortest, slowest, None)
    if held is not None:  # without it the torque is steady for longer
        stretches, held = _found(trials, shortest, slowest, held)
    points = [each.point(held) for each in stretches]
    return [each for each in points if each.rate.value != 0.0], held


def slower(trials: Sequence[TrialData], shortest: float, found: Sequence[Point]) -> int:
    """Number of steady stretches that count as standstill, below half the slowest rate in their
    trial.

    found: points of all trials, with no `slowest` stated.
    """
    count = 0
    for trial in trials:
        own = [abs(each.speed) for each in found if each.trial == trial.trial.number]
        every = _stretches(trial, shortest, 0.0, None)
        speeds = (abs(float(np.mean(each.rate))) for each in every)
        count += sum(0.0 < speed < 0.5 * min(own, default=0.0) for speed in speeds)
    return count


def _found(
    trials: Sequence[TrialData], shortest: float, slowest: float | None, held: OverATurn | None
) -> tuple[list[Stretch], OverATurn | None]:
    """Stretches of steady torque less that of `held`, and their torque that depends on angle."""
    parts = [stretch for trial in trials for stretch in _stretches(trial, shortest, slowest, held)]
    placed = [(each.time, each.angle, each.torque) for each in parts if each.angle is not None]
    whole = len(placed) == len(parts) and not bench_of(trials[0].trial).is_linear
    return parts, over_a_turn(placed) if whole else None


def _stretches(
    data: TrialData, shortest: float, slowest: float | None, held: OverATurn | None
) -> Iterator[Stretch]:
    """Stretches of the named windows, or else of the steady samples."""
    recording, trial = data.recording(), data.trial
    torque, rate = recording[force_of(data)], recording[RELATIVE_RATE]
    load = recording[NORMAL_LOAD] if NORMAL_LOAD in recording.channels else None
    angle = recording[RELATIVE_ANGLE] if RELATIVE_ANGLE in recording.channels else None
    per_second = trial.task.sample_rate
    any_name = trial.kind == ANY_NAME
    named = [w for w in trial.windows if any_name or w.name in DIRECTIONS]
    stretches = [(round(w.start * per_second), round(w.stop * per_second)) for w in named]
    if not stretches:
        left = torque if held is None or angle is None else torque - held.at(angle)
        steady = steady_stretches(rate, per_second, left, shortest, driven=False, slowest=slowest)
        stretches = [(each.first, each.stop) for each in steady]
    for first, stop in stretches:
        good = np.isfinite(rate[first:stop] + torque[first:stop])
        if angle is not None:
            good &= np.isfinite(angle[first:stop])
        valid = np.flatnonzero(good) + first
        if len(valid) < FEWEST:
            continue
        yield Stretch(
            data,
            recording.time[valid],
            rate[valid],
            torque[valid],
            None if angle is None else angle[valid],
            math.nan if load is None else float(np.nanmean(load[valid])),
        )


def loaded(points: Sequence[Point]) -> bool:
    """Whether the normal load of every stretch is known."""
    return all(math.isfinite(each.load) for each in points)


def loads_alike(points: Sequence[Point]) -> bool:
    """Whether the known normal loads of all stretches are one load."""
    known = [each.load for each in points if math.isfinite(each.load)]
    return not known or max(known) <= LOADS_ALIKE * min(known)


def drives_motion(points: Sequence[Point]) -> bool:
    """Whether the friction acts with the motion at nearly all points."""
    power = np.array([each.torque.value * each.sign for each in points])
    return bool(np.median(power) < 0 and np.mean(power < 0) > 0.9)
