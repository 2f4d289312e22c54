"""What a recorded motion shows: its steady stretches, and friction of each direction from them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from campaign.channels import DRIVE_TORQUE, JOINT_TORQUE, NORMAL_LOAD
from campaign.estimate import Estimate
from campaign.estimation.friction_line import (
    FrictionLine,
    friction_line,
    in_order_of_time,
    mean_of_stretches,
)
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import difference, shifted_by
from campaign.experiments.interface import TrialData, bench_of
from campaign.experiments.shared.common import conditions
from campaign.experiments.shared.imported_scale import with_scale
from campaign.reason import Cause
from campaign.result import Value

DIRECTIONS = {"positive": 1.0, "negative": -1.0}
OFFSET = 0.3
"""of Coulomb friction, from which on what both directions do not share is told as a load."""
NO_LOAD = Cause("no normal load", "there is no normal load")
FRICTION, OF_LOAD, WHAT_HOLDS = "friction_torque", "friction_coefficient", "constant_torque"


@dataclass(frozen=True)
class Stretch:
    """One steady stretch; signed, SI.

    Attributes:
        first, last: times of its ends (s).
        load: mean normal load (N); None where nobody recorded one.
        coefficient: friction over normal load; None without a load, or without a radius where the
            axis turns.
    """

    rate: Estimate
    torque: Estimate
    first: float
    last: float
    load: float | None
    coefficient: Estimate | None

    @property
    def direction(self) -> str:
        return "positive" if self.rate.value > 0 else "negative"

    @property
    def sign(self) -> float:
        return DIRECTIONS[self.direction]


@dataclass(frozen=True)
class Motion:
    """One recording with what it shows.

    Attributes:
        lines: friction over speed by direction, where its stretches show it.
        levels: mean friction by direction where they do not, against the motion (N m).
        constant: half of what Coulomb friction of the directions differs by: a load, an offset, or
            friction that differs by direction; None without both lines.
        coefficient: mean of friction over normal load of all stretches; None without any.
    """

    data: TrialData
    place: Mapping[str, Value]
    found: Mapping[str, Estimate]
    stretches: tuple[Stretch, ...]
    lines: Mapping[str, FrictionLine]
    levels: Mapping[str, Estimate]
    constant: Estimate | None
    coefficient: Estimate | None


def account_of(
    data: TrialData, found: Mapping[str, Estimate], radius: float | None, notes: list[str]
) -> Motion:
    """What a recording shows by its metrics; what it does not show is added to `notes`.

    radius: at which a normal load rubs (m), of an axis that turns.
    """
    label = data.trial.label
    force = JOINT_TORQUE if JOINT_TORQUE in data.trial.requires else DRIVE_TORQUE
    stretches = tuple(_stretches(data, found, force, radius))
    lines: dict[str, FrictionLine] = {}
    levels: dict[str, Estimate] = {}
    for direction, sign in DIRECTIONS.items():
        own = [each for each in stretches if each.direction == direction]
        if not own:
            continue
        speed = np.array([abs(each.rate.value) for each in own])
        torque = np.array([sign * each.torque.value for each in own])
        try:
            line = friction_line(speed, torque)
        except ValueError as error:
            notes.append(f"{label}, {direction} direction: {error}.")
            levels[direction] = _told(mean_of_stretches(FRICTION, torque, "N m"), data, force)
            continue
        if in_order_of_time(speed):
            notes.append(
                f"{label}, {direction} direction: speeds go one way as time goes on, so friction "
                "that changes with time, as it warms up, looks like viscous friction."
            )
        coulomb, viscous = (_told(each, data, force) for each in (line.coulomb, line.viscous))
        lines[direction] = replace(line, coulomb=coulomb, viscous=viscous)
    notes += _doubts(data, found, stretches)
    constant = _constant(lines)
    if constant is not None and _is_large(constant, lines):
        notes.append(
            f"{label}: Coulomb friction of the two directions differs so much that something else "
            "acts on the axis as well, such as gravity or an offset of the sensor: it is in both "
            "with opposite signs."
        )
    return Motion(
        data,
        conditions(data),
        found,
        stretches,
        lines,
        levels,
        constant,
        _mean_coefficient(stretches, data, force),
    )


def _told(estimate: Estimate, data: TrialData, force: str) -> Estimate:
    """With what no stretch can show: the column's constant, and inertia that nobody knows."""
    told = with_scale(estimate, data, force)
    if force == DRIVE_TORQUE and bench_of(data.trial).axis.inertia is None:
        told = shifted_by(told, "inertia", None)
    return told


def _stretches(
    data: TrialData, found: Mapping[str, Estimate], force: str, radius: float | None
) -> Iterator[Stretch]:
    for number in range(1, int(found["stretches"].value) + 1):
        rate, torque = found[f"rate_{number}"], found[f"{FRICTION}_{number}"]
        torque = _told(torque, data, force)
        loaded = f"normal_load_{number}" in found
        load = found[f"normal_load_{number}"].value if loaded else None
        arm = 1.0 if bench_of(data.trial).is_linear else radius
        ratio = None
        if load is not None and arm is not None:
            ratio = _coefficient(data, rate, torque, load * arm)
        first, last = (found[f"{end}_{number}"].value for end in ("first", "last"))
        yield Stretch(rate, torque, first, last, load, ratio)


def _coefficient(data: TrialData, rate: Estimate, torque: Estimate, load: float) -> Estimate:
    """Friction over normal load times its arm (N m); its interval is that of the friction."""
    if load == 0.0:
        return Estimate.without_interval(OF_LOAD, float("nan"), "", NO_LOAD())
    scale = (1.0 if rate.value > 0 else -1.0) / abs(load)
    ends = [None if end is None else end * scale for end in (torque.low, torque.high)]
    low, high = ends if scale > 0 else ends[::-1]
    error = torque.standard_error
    told = replace(
        torque,
        name=OF_LOAD,
        value=torque.value * scale,
        unit="",
        low=low,
        high=high,
        standard_error=None if error is None else error * abs(scale),
        systematic=tuple(
            replace(part, standard_uncertainty=part.standard_uncertainty * abs(scale))
            if part.standard_uncertainty is not None
            else part
            for part in torque.systematic
        ),
    )
    return with_scale(told, data, NORMAL_LOAD)


def _mean_coefficient(
    stretches: tuple[Stretch, ...], data: TrialData, force: str
) -> Estimate | None:
    values = [
        each.coefficient.value
        for each in stretches
        if each.coefficient is not None and np.isfinite(each.coefficient.value)
    ]
    if not values:
        return None
    mean = mean_of_stretches(OF_LOAD, np.array(values), "")
    return admitted(with_scale(_told(mean, data, force), data, NORMAL_LOAD))


def _constant(lines: Mapping[str, FrictionLine]) -> Estimate | None:
    if len(lines) < 2:
        return None
    positive, negative = (lines[direction].coulomb for direction in DIRECTIONS)
    apart = difference(WHAT_HOLDS, positive, negative, "N m")

    def half(value: float | None) -> float | None:
        return None if value is None else 0.5 * value

    return replace(
        apart,
        value=0.5 * apart.value,
        low=half(apart.low),
        high=half(apart.high),
        standard_error=half(apart.standard_error),
    )


def _is_large(constant: Estimate, lines: Mapping[str, FrictionLine]) -> bool:
    mean = 0.5 * sum(line.coulomb.value for line in lines.values())
    low, high = constant.low, constant.high
    surely = low is not None and high is not None and (low > 0 or high < 0)
    return surely and abs(constant.value) > OFFSET * abs(mean)


def _doubts(
    data: TrialData, found: Mapping[str, Estimate], stretches: tuple[Stretch, ...]
) -> Iterator[str]:
    """What a reader of stretches should know."""
    label, lost = data.trial.label, found["lost"].value
    if not stretches:
        cause = "`shortest` says how long a steady stretch is"
        if lost:
            cause = f"{lost:.0f} samples of it were lost, which end a stretch; {cause}"
        yield f"{label}: nowhere does it slide steadily, so no friction is read from it; {cause}."
    there = found["stretches_found"].value
    if there > len(stretches):
        yield (
            f"{label}: of {there:.0f} steady stretches {len(stretches)} are looked at, evenly over "
            "the recording."
        )
    if any(each.load is not None and each.coefficient is None for each in stretches):
        yield (
            f"{label}: friction over normal load needs the `radius` at which the load rubs, as the "
            "axis turns."
        )
