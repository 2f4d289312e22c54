"""Relations between columns: derivatives, unit factors, contradictions.

A factor proves no unit. What is found here is likely, or takes away what a file states.
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
"""Rows by which columns without a telling name are held against the others."""
MOST = 24
"""Such columns that are looked at; each is held against each."""
_CERTAIN = 0.995
"""Share explained from which on a column counts as the derivative of another."""
ANGLES = (channels.RELATIVE_ANGLE, channels.MOTOR_ANGLE)
RATES = (channels.RELATIVE_RATE, channels.MOTOR_RATE)
TORQUES = (channels.DRIVE_TORQUE, channels.JOINT_TORQUE)
_TARGETS = (channels.REFERENCE, channels.COMMAND)
Series = dict[int, Array]


def with_roles(columns: Sequence[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """Roles of columns whose names say nothing: what is the derivative of what."""
    found = list(columns)
    part = {k: values[:ROWS] for k, values in series.items()}
    silent = [k for k in part if found[k].role == UNKNOWN and not found[k].why][:MOST]
    angles, rates = ([k for k in part if found[k].role in roles] for roles in (ANGLES, RATES))
    pairs = [(k, j) for k in (*angles, *silent) for j in (*silent, *rates) if k != j]
    pairs = [pair for pair in pairs if not set(silent).isdisjoint(pair)]
    factors = {(k, j): _factor(time[:ROWS], part[k], part[j]) for k, j in pairs}
    # Its sign counts, too: of a sine the angle is the negative one of its rate.
    fits = [p for p, f in factors.items() if f and f.explained > _CERTAIN and f.factor > 0]
    ends = {j for _, j in fits}
    for k, j in (pair for pair in fits if pair[0] not in ends):  # of a rate it is an acceleration
        motor = found[k].role == channels.MOTOR_ANGLE or found[j].role == channels.MOTOR_RATE
        whys = (f"{found[j].name} is its derivative", f"the derivative of {found[k].name}")
        new = {
            place: replace(found[place], role=roles[motor], why=f"{why}, by its numbers alone")
            for place, roles, why in zip((k, j), (ANGLES, RATES), whys, strict=True)
            if found[place].role == UNKNOWN
        }
        # What is like a rate that is there may be its target, or a copy.
        if not any(a.role == b.role and a.axis == b.axis for a in new.values() for b in found):
            found = [new.get(place, column) for place, column in enumerate(found)]
    return found


def _factor(time: Array, angle: Array, rate: Array) -> Slope | None:
    """The factor between a rate and the derivative of its angle, where it is one."""
    found = slope(time, angle, rate)
    return found if found is not None and found.explained > 0.9 and found.travel > 30 else None


def with_units(columns: Sequence[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """Units that columns suggest of each other; and what contradicts those that a file states."""
    found = list(columns)
    for k, j in _pairs(found, ANGLES, RATES):
        factor = _factor(time, series[k], series[j])
        if factor is not None:
            _rate_of_angle(found, k, j, factor)
    for k, j in _pairs(found, _TARGETS, (*ANGLES, *RATES, *TORQUES, channels.MOTOR_CURRENT)):
        size, fit = _beside(series[k], series[j])
        if fit > 0.98 and abs(size - 1) < 0.1:
            # A target is one of what follows it.
            role = channels.REFERENCE if found[j].role in ANGLES else channels.COMMAND
            why = f"it goes with {found[j].name}, R² {fit:.4f}"
            found[k] = replace(found[k], role=role, why=f"{found[k].why}; {why}")
            if found[k].basis is Basis.UNKNOWN:
                found[k] = found[k].likely(found[j].unit, why)
    for k, j in _pairs(found, TORQUES, (channels.MOTOR_CURRENT,)):
        size, fit = _beside(series[k], series[j])
        if fit > 0.9999:
            made = f"it is {size:.5g} times {found[j].name}: made of it, and not measured by itself"
            found[k] = _told(found[k], made)
    return found


def _pairs(
    columns: Sequence[ColumnGuess], ones: Sequence[str], others: Sequence[str]
) -> list[tuple[int, int]]:
    """Places of columns of such roles, of one axis."""
    both = [(k, j) for k in range(len(columns)) for j in range(len(columns))]
    roles = [(k, j) for k, j in both if columns[k].role in ones and columns[j].role in others]
    return [(k, j) for k, j in roles if columns[k].axis == columns[j].axis]


def _told(column: ColumnGuess, doubt: str) -> ColumnGuess:
    return replace(column, doubts=(*column.doubts, doubt))


def _rate_of_angle(found: list[ColumnGuess], k: int, j: int, factor: Slope) -> None:
    """The unit of a rate, and its side, from its angle; whether those that are stated agree."""
    angle, rate, size = found[k], found[j], abs(factor.factor)
    told = f"{factor.factor:.5g} times the derivative of {angle.name}, R² {factor.explained:.4f}"
    for unit in ("rad/s", "deg/s", "rpm", "rev/s", "m/s", "mm/s", "count/s"):
        due = _due(angle.unit, unit)
        alike = due and abs(size / due - 1) < max(0.02, 3 * factor.error)
        if alike and rate.basis is Basis.UNKNOWN:
            rate = rate.likely(unit, told)
    due = _due(angle.unit, rate.unit)
    if due and abs(factor.factor / due - 1) <= max(0.1, 3 * factor.error):
        own = RATES[ANGLES.index(angle.role)]
        there = {(each.role, each.axis) for place, each in enumerate(found) if place != j}
        if not rate.sided and (own, rate.axis) not in there:
            why = f"{rate.why}; the derivative of {angle.name}"
            rate = replace(rate, role=own, sided=angle.sided, why=why)
        found[j] = rate
        return
    found[j] = _told(rate, f"{told}; {factor.factor / due:.5g} in its unit" if due else told)
    sides = (angle.role == channels.MOTOR_ANGLE) == (rate.role == channels.MOTOR_RATE)
    stated = {angle.basis, rate.basis} == {Basis.STATED}
    if due and sides and stated:
        # One of the three is wrong, or a gear is between; nobody can tell which.
        why = f"as the file has it, but {rate.name} is {told}, and {due:.5g} is due"
        for place, each in enumerate(found):
            if place in (k, j) or (each.role == TIME and each.basis is Basis.STATED):
                found[place] = each.likely(each.unit, why)


def _due(angle: str, rate: str) -> float | None:
    """What a rate in its unit is times the derivative of an angle in its own; None: no factor."""
    if not angle or not rate:
        return None
    one, two = parse_unit(angle) * parse_unit("1/s"), parse_unit(rate)
    return float(one.factor / two.factor) if one.dimensions == two.dimensions else None


def _beside(one: Array, other: Array) -> tuple[float, float]:
    """How large one is beside the other, and how well that fits (R²); 0 where one stands still."""
    known = np.isfinite(one) & np.isfinite(other)
    x, y = other[known], one[known]
    if len(x) < 20 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, 0.0
    return float(np.ptp(y) / np.ptp(x)), float(np.corrcoef(x, y)[0, 1]) ** 2
