"""Steady stretches of a recorded motion, and friction of each direction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.friction_line import mean_of_stretches
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import difference, multiplied, shifted_by
from campaign.experiments.friction_map.curves import ANGLE, COEFFICIENT, FRICTION
from campaign.experiments.friction_map.points import coefficient_of
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.steady_recordings import SteadyResult, sliding_of
from campaign.experiments.friction_map.stretches import StretchOptions
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.common import conditions
from campaign.result import Value

OFFSET = 0.3
"""of Coulomb friction, from which on what both directions do not share is told as a load."""
OF_LOAD, WHAT_HOLDS = "friction_coefficient", "constant_torque"


@dataclass(frozen=True)
class Motion:
    """One recording with what it shows.

    Attributes:
        found: metrics of the whole recording, by name.
        constant: half of what Coulomb friction of the directions differs by: a load, an offset, or
            friction that differs by direction; None without both.
        coefficient: mean of friction over normal load of all stretches; None without any.
    """

    data: TrialData
    place: Mapping[str, Value]
    found: Mapping[str, Estimate]
    sliding: SteadyResult
    constant: Estimate | None
    coefficient: Estimate | None

    @property
    def coulomb(self) -> dict[str, Estimate]:
        """Coulomb friction by direction, where it is known apart from viscous friction."""
        name = "coulomb_torque"
        return {way: own[name] for way, own in self.sliding.found.items() if name in own}


def account_of(
    data: TrialData, found: Mapping[str, Estimate], options: StretchOptions, notes: list[str]
) -> Motion:
    """What a recording shows; what it does not show is added to `notes`."""
    label = data.trial.label
    sliding = sliding_of((data,), options)
    notes += (f"{label}: {note}" for note in sliding.notes)
    notes += (f"{label}: {reason}." for reason in sliding.left_out if sliding.points)
    notes += _doubts(label, found, sliding)
    constant = _constant(sliding)
    dry = [each.value for each in _coulomb_fitted(sliding).values()]
    large = constant is not None and abs(constant.value) > OFFSET * abs(float(np.mean(dry)))
    if constant is not None and large and is_surely_something(constant):
        notes.append(
            f"{label}: Coulomb friction of the two directions differs so much that something else "
            "acts on the axis as well, such as gravity or an offset of the sensor: it is in both "
            "with opposite signs."
        )
    return Motion(data, conditions(data), found, sliding, constant, _mean_coefficient(sliding))


def _mean_coefficient(sliding: SteadyResult) -> Estimate | None:
    curves = next((each for each in sliding.maps if each.quantity is COEFFICIENT), None)
    loaded = [p for p in sliding.points if np.isfinite(p.load)]
    values = [coefficient_of(p, sliding.first).value for p in loaded]
    if not values:
        return None
    mean = mean_of_stretches(OF_LOAD, np.array(values), "")
    return admitted(mean if curves is None else curves.with_constants(mean))


def _coulomb_fitted(sliding: SteadyResult) -> dict[str, Estimate]:
    """Coulomb friction by direction, as fitted."""
    found = next((each.found for each in sliding.maps if each.quantity is FRICTION), {})
    every = {way: own.get("coulomb_torque") for way, own in found.items()}
    return {way: one for way, one in every.items() if one is not None and one.has_interval}


def _constant(sliding: SteadyResult) -> Estimate | None:
    found = _coulomb_fitted(sliding)
    if len(found) < 2:
        return None
    told = multiplied(difference(WHAT_HOLDS, found["positive"], found["negative"], "N m"), 0.5)
    # What was taken off by the angle has the same sign in both directions, as a constant has.
    doubt = 0.5 * sum(
        sliding.maps[0].doubts.get((way, "coulomb_torque"), 0.0) for way in DIRECTIONS
    )
    return shifted_by(told, ANGLE, doubt) if doubt else told


def is_surely_something(estimate: Estimate) -> bool:
    """Whether an interval lies on one side of zero."""
    low, high = estimate.combined
    return low is not None and high is not None and (low > 0 or high < 0)


def _doubts(label: str, found: Mapping[str, Estimate], sliding: SteadyResult) -> Iterator[str]:
    """What a reader of stretches should know."""
    if not sliding.points:
        cause = "`shortest` says how long a steady stretch is"
        if lost := found["lost"].value:
            cause = f"{lost:.0f} samples of it were lost, which end a stretch; {cause}"
        yield f"{label}: nowhere does it slide steadily, so no friction is read from it; {cause}."
    pressed = (p for p in sliding.points if np.isfinite(p.normal_load) and p.normal_load)
    if any(not np.isfinite(point.load) for point in pressed):
        yield (
            f"{label}: friction over normal load needs the `radius` at which the load rubs, as the "
            "axis turns."
        )
