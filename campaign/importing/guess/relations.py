"""Relations between columns: derivatives, unit factors, contradictions.

A factor proves no unit. A relation makes a unit likely, or contradicts the stated one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from campaign import channels
from campaign.importing.defects.between import Slope, slope
from campaign.importing.guess.columns import TIME, UNKNOWN, Basis, ColumnGuess
from campaign.importing.interface import Array
from campaign.unit_grammar import parse_unit

ROWS = 20_000
"""Number of rows that columns of unknown role are compared over."""
MOST = 24
"""Maximum number of columns of unknown role: each is compared with each."""
_CERTAIN = 0.995
"""Least explained share of variance at which a column is the derivative of another."""
ANGLES = (channels.RELATIVE_ANGLE, channels.MOTOR_ANGLE)
RATES = (channels.RELATIVE_RATE, channels.MOTOR_RATE)
TORQUES = (channels.DRIVE_TORQUE, channels.JOINT_TORQUE)
_TARGETS = (channels.REFERENCE, channels.COMMAND)
Series = dict[int, Array]


def with_roles(columns: Sequence[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """The columns with roles for uninformative names, from derivatives between columns."""
    draft = list(columns)
    part = {k: values[:ROWS] for k, values in series.items()}
    unknown = [k for k in part if draft[k].role == UNKNOWN and not draft[k].why][:MOST]
    angles, rates = ([k for k in part if draft[k].role in roles] for roles in (ANGLES, RATES))
    pairs = [(k, j) for k in (*angles, *unknown) for j in (*unknown, *rates) if k != j]
    pairs = [pair for pair in pairs if not set(unknown).isdisjoint(pair)]
    factors = {(k, j): _factor(time[:ROWS], part[k], part[j]) for k, j in pairs}
    # The sign counts, too: the angle of a sine is the negative derivative of its rate.
    fits = [p for p, f in factors.items() if f and f.explained > _CERTAIN and f.factor > 0]
    ends = {j for _, j in fits}
    for k, j in (pair for pair in fits if pair[0] not in ends):  # not rate and acceleration
        motor = draft[k].role == channels.MOTOR_ANGLE or draft[j].role == channels.MOTOR_RATE
        whys = (f"{draft[j].name} is its derivative", f"the derivative of {draft[k].name}")
        new = {
            place: replace(draft[place], role=roles[motor], why=f"{why}, by its numbers alone")
            for place, roles, why in zip((k, j), (ANGLES, RATES), whys, strict=True)
            if draft[place].role == UNKNOWN
        }
        # A column that resembles an existing rate may be its target or a copy.
        if not any(a.role == b.role and a.axis == b.axis for a in new.values() for b in draft):
            draft = [new.get(place, column) for place, column in enumerate(draft)]
    return draft


def _factor(time: Array, angle: Array, rate: Array) -> Slope | None:
    """The fit of a rate to the derivative of its angle; None if too poor or with no travel."""
    fit = slope(time, angle, rate)
    return fit if fit is not None and fit.explained > 0.9 and fit.travel > 30 else None


def with_units(columns: Sequence[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """The columns with likely units from their relations, and contradictions as doubts."""
    draft = list(columns)
    for k, j in _pairs(draft, ANGLES, RATES):
        factor = _factor(time, series[k], series[j])
        if factor is not None:
            _rate_of_angle(draft, k, j, factor)
    for k, j in _pairs(draft, _TARGETS, (*ANGLES, *RATES, *TORQUES, channels.MOTOR_CURRENT)):
        size, fit = _beside(series[k], series[j])
        if fit > 0.98 and abs(size - 1) < 0.1:
            # The kind of target depends on the channel that follows it.
            role = channels.REFERENCE if draft[j].role in ANGLES else channels.COMMAND
            why = f"it goes with {draft[j].name}, R² {fit:.4f}"
            draft[k] = replace(draft[k], role=role, why=f"{draft[k].why}; {why}")
            if draft[k].basis is Basis.UNKNOWN:
                draft[k] = draft[k].likely(draft[j].unit, why)
    for k, j in _pairs(draft, TORQUES, (channels.MOTOR_CURRENT,)):
        size, fit = _beside(series[k], series[j])
        if fit > 0.9999:
            made = f"it is {size:.5g} times {draft[j].name}: made of it, and not measured by itself"
            draft[k] = _told(draft[k], made)
    return draft


def _pairs(
    columns: Sequence[ColumnGuess], ones: Sequence[str], others: Sequence[str]
) -> list[tuple[int, int]]:
    """Index pairs of columns with these roles on the same axis."""
    both = [(k, j) for k in range(len(columns)) for j in range(len(columns))]
    roles = [(k, j) for k, j in both if columns[k].role in ones and columns[j].role in others]
    return [(k, j) for k, j in roles if columns[k].axis == columns[j].axis]


def _told(column: ColumnGuess, doubt: str) -> ColumnGuess:
    return replace(column, doubts=(*column.doubts, doubt))


def _rate_of_angle(found: list[ColumnGuess], k: int, j: int, factor: Slope) -> None:
    """Set unit and gear side of a rate from its angle; check stated units against the factor."""
    angle, rate, size = found[k], found[j], abs(factor.factor)
    note = f"{factor.factor:.5g} times the derivative of {angle.name}, R² {factor.explained:.4f}"
    for unit in ("rad/s", "deg/s", "rpm", "rev/s", "m/s", "mm/s", "count/s"):
        due = _due(angle.unit, unit)
        alike = due and abs(size / due - 1) < max(0.02, 3 * factor.error)
        if alike and rate.basis is Basis.UNKNOWN:
            rate = rate.likely(unit, note)
    due = _due(angle.unit, rate.unit)
    if due and abs(factor.factor / due - 1) <= max(0.1, 3 * factor.error):
        own = RATES[ANGLES.index(angle.role)]
        axis_roles = {(each.role, each.axis) for place, each in enumerate(found) if place != j}
        if not rate.sided and (own, rate.axis) not in axis_roles:
            why = f"{rate.why}; the derivative of {angle.name}"
            rate = replace(rate, role=own, sided=angle.sided, why=why)
        found[j] = rate
        return
    found[j] = _told(rate, f"{note}; {factor.factor / due:.5g} in its unit" if due else note)
    sides = (angle.role == channels.MOTOR_ANGLE) == (rate.role == channels.MOTOR_RATE)
    stated = {angle.basis, rate.basis} == {Basis.STATED}
    if due and sides and stated:
        # One of three units is wrong, or a gear is between; the data cannot show which.
        why = f"as the file has it, but {rate.name} is {note}, and {due:.5g} is due"
        for place, each in enumerate(found):
            if place in (k, j) or (each.role == TIME and each.basis is Basis.STATED):
                found[place] = each.likely(each.unit, why)


def _due(angle: str, rate: str) -> float | None:
    """Factor of a rate over the derivative of its angle, from the units; None if unrelated."""
    if not angle or not rate:
        return None
    one, two = parse_unit(angle) * parse_unit("1/s"), parse_unit(rate)
    return float(one.factor / two.factor) if one.dimensions == two.dimensions else None


def _beside(one: Array, other: Array) -> tuple[float, float]:
    """Ratio of the ranges of two columns and their R²; 0 if either is constant."""
    known = np.isfinite(one) & np.isfinite(other)
    x, y = other[known], one[known]
    if len(x) < 20 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, 0.0
    return float(np.ptp(y) / np.ptp(x)), float(np.corrcoef(x, y)[0, 1]) ** 2
