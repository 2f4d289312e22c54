"""Numbers of recorded motions: steady stretches, friction of each direction, tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.estimate import Estimate
from campaign.estimation.friction_line import mean_of_stretches
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import difference, multiplied, shifted_by
from campaign.experiments.friction_map.curves import ANGLE, COEFFICIENT, FEWEST_SPEEDS, FRICTION
from campaign.experiments.friction_map.points import coefficient_of
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.friction_map.steady_recordings import SteadyResult, sliding_of
from campaign.experiments.friction_map.stretches import StretchOptions
from campaign.experiments.friction_map.tables import curve_findings
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.common import conditions
from campaign.reason import Cause
from campaign.result import Cell, Column, Finding, Table, Value

OFFSET = 0.3
"""of Coulomb friction: above this share, half the difference of directions gets a note."""
OF_LOAD, WHAT_HOLDS = "friction_coefficient", "constant_torque"


@dataclass(frozen=True)
class Motion:
    """One recording with its numbers.

    Attributes:
        found: metrics of the whole recording, by name.
        constant: half the difference of Coulomb friction between the directions: a load, an offset,
            or asymmetric friction; None without both directions.
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
        """Coulomb friction by direction, if it is separate from viscous friction."""
        name = "coulomb_torque"
        return {side: own[name] for side, own in self.sliding.found.items() if name in own}


def account_of(
    data: TrialData, found: Mapping[str, Estimate], options: StretchOptions, notes: list[str]
) -> Motion:
    """Numbers of a recording; reasons for missing ones are added to `notes`."""
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
            f"{label}: Coulomb friction of the two directions differs too much for friction alone. "
            "Gravity or an offset of the sensor, for example, is in both with opposite signs."
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
    """Fitted Coulomb friction by direction, if it has an interval."""
    fits = next((each.found for each in sliding.maps if each.quantity is FRICTION), {})
    every = {side: own.get("coulomb_torque") for side, own in fits.items()}
    return {side: one for side, one in every.items() if one is not None and one.has_interval}


def _constant(sliding: SteadyResult) -> Estimate | None:
    coulomb = _coulomb_fitted(sliding)
    if len(coulomb) < 2:
        return None
    half = multiplied(difference(WHAT_HOLDS, coulomb["positive"], coulomb["negative"], "N m"), 0.5)
    # The correction by angle has the same sign in both directions, as a constant has.
    error = 0.5 * sum(
        sliding.maps[0].doubts.get((direction, "coulomb_torque"), 0.0) for direction in DIRECTIONS
    )
    return shifted_by(half, ANGLE, error) if error else half


def is_surely_something(estimate: Estimate) -> bool:
    """Whether an interval lies on one side of zero."""
    low, high = estimate.combined
    return low is not None and high is not None and (low > 0 or high < 0)


def _doubts(label: str, found: Mapping[str, Estimate], sliding: SteadyResult) -> Iterator[str]:
    """Notes on missing stretches and a missing radius."""
    if not sliding.points:
        cause = "`shortest` says how long a steady stretch is"
        if lost := found["lost"].value:
            cause = f"{lost:.0f} samples of it were lost, which end a stretch; {cause}"
        yield f"{label}: nowhere does it slide steadily, so no friction is read from it; {cause}."
    pressed = (p for p in sliding.points if np.isfinite(p.normal_load) and p.normal_load)
    if any(not np.isfinite(point.load) for point in pressed):
        yield (
            f"{label}: friction over normal load on a rotary axis needs the `radius` at which the "
            "load rubs."
        )


OF_ONE_RECORDING = Cause("describes one recording", "it describes one recording")

_SUMMARY = (
    Column("duration", "Duration", "s", "s", reason=OF_ONE_RECORDING()),
    Column("travel", "Travel", "rad", "deg", reason=OF_ONE_RECORDING()),
    Column("top_rate", "Largest rate", "rad/s", "deg/s", reason=OF_ONE_RECORDING()),
    Column("rms_torque", "Torque (RMS)", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("peak_torque", "Largest torque", "N m", "N m", reason=OF_ONE_RECORDING()),
    Column("rms_error", "Tracking error (RMS)", "rad", "mrad", reason=OF_ONE_RECORDING()),
    Column("peak_error", "Largest tracking error", "rad", "mrad", reason=OF_ONE_RECORDING()),
)


def summary_table(motions: Sequence[Motion]) -> Table:
    """Extremes of each recording."""
    columns = [c for c in _SUMMARY if any(c.name in motion.found for motion in motions)]
    rows: list[dict[str, Cell]] = []
    for motion in motions:
        row: dict[str, Cell] = {"recording": motion.data.trial.number, **motion.place}
        row |= {column.name: motion.found.get(column.name) for column in columns}
        row["stretches"] = len(motion.sliding.points)
        row["coefficient"] = motion.coefficient
        rows.append(row)
    loaded = any(motion.coefficient is not None for motion in motions)
    return Table(
        "recordings",
        "Recorded motions",
        (
            Column("recording", "Trial", exact=True),
            *_places(motions),
            *columns,
            Column("stretches", "Steady stretches", exact=True),
            *((Column("coefficient", "Friction coefficient"),) if loaded else ()),
        ),
        tuple(rows),
    )


def line_table(motions: Sequence[Motion]) -> Table:
    """Coulomb and viscous friction of each direction."""
    rows = [
        {
            "recording": motion.data.trial.number,
            **motion.place,
            "direction": direction,
            "coulomb": coulomb,
            "viscous": motion.sliding.found[direction]["viscous_friction"],
            "stretches": sum(
                point.sign == DIRECTIONS[direction] for point in motion.sliding.points
            ),
        }
        for motion in motions
        for direction, coulomb in motion.coulomb.items()
    ]
    return Table(
        "friction-lines",
        "Coulomb and viscous friction by direction",
        (
            Column("recording", "Trial", exact=True),
            *_places(motions),
            Column("direction", "Direction"),
            Column("coulomb", "Coulomb friction", "N m", "N m"),
            Column("viscous", "Viscous friction", "N m s/rad", "N m s/rad"),
            Column("stretches", "Stretches", exact=True),
        ),
        tuple(rows),
        note="Of a straight line through the steady stretches of a direction, or of a Stribeck "
        f"curve where there are {FEWEST_SPEEDS} speeds or more; intervals are of their scatter. "
        "Between and beyond the speeds there are, friction may be another.",
    )


def motion_findings(motion: Motion) -> Iterator[Finding]:
    """Friction of each direction, under the recording's conditions."""
    place = {**motion.place, "recording": motion.data.trial.number}
    yield from curve_findings(motion.sliding.found, place)
    for estimate in (motion.constant, motion.coefficient):
        if estimate is not None:
            yield Finding.of(estimate, place)


def _places(motions: Sequence[Motion]) -> Iterator[Column]:
    """Columns of the conditions of the recordings."""
    for name in dict.fromkeys(name for motion in motions for name in motion.place):
        yield Column(name, name.replace("_", " ").capitalize(), exact=True)
