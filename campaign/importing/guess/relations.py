"""What columns say of each other: rates of angles, units by factors between them, contradictions.

A factor proves no unit. What is found here is likely, or takes away what a file states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from campaign.channels import (
    COMMAND,
    DRIVE_TORQUE,
    JOINT_TORQUE,
    MOTOR_ANGLE,
    MOTOR_CURRENT,
    MOTOR_RATE,
    REFERENCE,
    RELATIVE_ANGLE,
    RELATIVE_RATE,
    TEMPERATURE,
)
from campaign.importing.guess.columns import Basis, ColumnGuess
from campaign.importing.guess.evidence import (
    Likely,
    factor,
    unit_of_angle,
    unit_of_joint,
    unit_of_rate,
    unit_of_temperature,
)
from campaign.importing.guess.quantities import TIME, UNKNOWN
from campaign.importing.interface import Array
from campaign.unit_grammar import parse_unit

ROWS = 20_000
"""Rows by which columns without a telling name are held against the others."""
MOST = 24
"""Such columns that are looked at; each is held against each."""
_CERTAIN = 0.995
"""Share explained from which on a column counts as the derivative of another."""
_SAME = 0.98
_OF_UNITS = "as the file has it; a unit is wrong, or a gear is between"
_OF_TIMES = "as the file has it; a unit is wrong, or that of the times"
_TIMES = (1e3, 1e-3, 1e6, 1e-6, 1e9, 1e-9, 60.0, 1 / 60.0)
"""By what a rate is off where times are in another unit than it is said."""
_PAIRS = ((RELATIVE_ANGLE, RELATIVE_RATE), (MOTOR_ANGLE, MOTOR_RATE), (RELATIVE_ANGLE, MOTOR_RATE))
_FOLLOWED = {
    REFERENCE: (RELATIVE_ANGLE, MOTOR_ANGLE),
    COMMAND: (RELATIVE_RATE, MOTOR_RATE, DRIVE_TORQUE, JOINT_TORQUE, MOTOR_CURRENT),
}
"""What a target may be one of."""

_LENGTHS = ("distance", "displacement", "travel", "stroke", "weg", "hub", "deplacement", "abstand")
"""Words for an angle that are those of a length, too."""

Series = dict[int, Array]


def by_numbers(columns: list[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """Roles of columns whose names say nothing: what is the derivative of what."""
    columns = list(columns)
    part = {place: values[:ROWS] for place, values in series.items()}
    time = time[:ROWS]
    silent = [
        place
        for place, each in enumerate(columns)
        if place in part and each.role == UNKNOWN and not each.why and np.ptp(part[place]) > 0
    ][:MOST]
    for k, j in _derivatives(silent, columns, part, time):
        angle, rate = columns[k], columns[j]
        if angle.role in (RELATIVE_RATE, MOTOR_RATE):
            columns[j] = replace(rate, why=f"the derivative of {angle.name}: an acceleration")
        elif rate.role == UNKNOWN:
            role = MOTOR_RATE if angle.role == MOTOR_ANGLE else RELATIVE_RATE
            if _is_there(columns, role, rate.group):
                continue  # what is like a rate that is there may be its target, or a copy
            columns[j] = _found(rate, role, f"the derivative of {angle.name}, by its numbers")
        if angle.role == UNKNOWN:
            role = MOTOR_ANGLE if columns[j].role == MOTOR_RATE else RELATIVE_ANGLE
            if _is_there(columns, role, angle.group):
                continue
            columns[k] = _found(angle, role, f"{rate.name} is its derivative, by its numbers")
    return columns


def _is_there(columns: Sequence[ColumnGuess], role: str, group: str) -> bool:
    return any(each.role == role and (not group or each.group in ("", group)) for each in columns)


def _found(column: ColumnGuess, role: str, why: str) -> ColumnGuess:
    return replace(column, role=role, why=why, doubts=(*column.doubts, "its name does not say so"))


def _derivatives(
    silent: Sequence[int], columns: Sequence[ColumnGuess], part: Series, time: Array
) -> Iterator[tuple[int, int]]:
    """Pairs of places, the second the derivative of the first, one of them without a name.

    Those with a known one first, then along each chain from its beginning.
    """
    angles = [k for k, each in enumerate(columns) if each.role in (RELATIVE_ANGLE, MOTOR_ANGLE)]
    rates = [k for k, each in enumerate(columns) if each.role in (RELATIVE_RATE, MOTOR_RATE)]
    pairs = [(k, j) for k in [*angles, *rates] for j in silent]
    pairs += [(k, j) for k in silent for j in rates]
    pairs += [(k, j) for k in silent for j in silent if k != j]
    found = []
    for k, j in pairs[: MOST * MOST]:
        each = factor(time, part[k], part[j])
        if each is not None and each.explained > _CERTAIN:
            found.append((k, j))
    ends = {j for _, j in found}
    # An angle is no derivative of another column; what begins a chain is taken first.
    found.sort(key=lambda pair: (columns[pair[0]].role == UNKNOWN, pair[0] in ends))
    used: set[int] = set()
    for k, j in found:
        if j not in used:
            used.add(j)
            yield k, j


def with_units(columns: list[ColumnGuess], series: Series, time: Array) -> list[ColumnGuess]:
    """Units that the numbers suggest, where the file states none; and what contradicts it."""
    columns = list(columns)
    for place, each in enumerate(columns):
        if each.basis is Basis.UNKNOWN and place in series:
            columns[place] = _likely(each, _by_range(each, series[place]))
    for angle_role, rate_role in _PAIRS:
        for k, j in _alike(columns, angle_role, rate_role):
            two = _pair(columns[k], columns[j], time, series[k], series[j])
            if two[1].unit_why.startswith(_OF_TIMES):
                columns = _with_times(columns, two[1].unit_why)
            columns[k], columns[j] = two
    for k, j in _alike(columns, COMMAND, RELATIVE_ANGLE):
        columns[k] = _of_an_angle(columns[k], columns[j], series[k], series[j])
    for target, measured in _FOLLOWED.items():
        for role in measured:
            for k, j in _alike(columns, target, role):
                columns[k] = _follows(columns[k], columns[j], series[k], series[j])
    for role in (DRIVE_TORQUE, JOINT_TORQUE):
        for k, j in _alike(columns, role, MOTOR_CURRENT):
            columns[k] = _multiple(columns[k], columns[j], series[k], series[j])
    return columns


def _by_range(column: ColumnGuess, values: Array) -> Likely | None:
    """A unit that a column's own numbers suggest."""
    if column.role == TEMPERATURE:
        return unit_of_temperature(values)
    if column.role not in (RELATIVE_ANGLE, MOTOR_ANGLE):
        return None
    found = unit_of_angle(values)
    if found is None and column.role == RELATIVE_ANGLE and column.why not in _LENGTHS:
        found = unit_of_joint(values)
    return found


def _alike(columns: Sequence[ColumnGuess], one: str, other: str) -> Iterator[tuple[int, int]]:
    """Places of columns of two roles, of one axis."""
    for k, first in enumerate(columns):
        for j, second in enumerate(columns):
            if first.role == one and second.role == other and first.group == second.group:
                yield k, j


def _likely(column: ColumnGuess, likely: Likely | None) -> ColumnGuess:
    if likely is None:
        return column
    return replace(column, unit=likely.unit, basis=Basis.LIKELY, unit_why=likely.why)


def _pair(
    angle: ColumnGuess, rate: ColumnGuess, time: Array, q: Array, v: Array
) -> tuple[ColumnGuess, ColumnGuess]:
    """A rate beside its angle: the unit of the one from that of the other, and what is odd."""
    found = factor(time, q, v)
    if found is None:
        return angle, rate
    told = f"{found.factor:.5g} times the derivative of {angle.name}, R² {found.explained:.4f}"
    if rate.basis is Basis.UNKNOWN and angle.unit:
        rate = _likely(rate, unit_of_rate(found, angle.unit))
    elif {angle.basis, rate.basis} == {Basis.STATED}:
        due = _due(angle.unit, rate.unit)
        close = max(0.1, 3 * found.error)
        sides = (angle.role == MOTOR_ANGLE) == (rate.role == MOTOR_RATE)
        if due is not None and sides and abs(abs(found.factor) / due - 1) > close:
            # One of them is wrong, or the times are, or a gear is between; nobody can tell which.
            ratio = abs(found.factor) / due
            timely = any(abs(ratio / each - 1) < 0.03 for each in _TIMES)
            against = f"{_OF_TIMES if timely else _OF_UNITS}: {rate.name} is {told}, "
            against += f"and {due:.5g} is due"
            angle, rate = (_doubtful(each, against) for each in (angle, rate))
    return angle, replace(rate, doubts=(*rate.doubts, told))


def _with_times(columns: list[ColumnGuess], why: str) -> list[ColumnGuess]:
    """Times do not stand either where it may be they that contradict a rate."""
    return [
        _doubtful(each, why) if each.role == TIME and each.basis is Basis.STATED else each
        for each in columns
    ]


def _due(angle: str, rate: str) -> float | None:
    """What a rate in its unit is times the derivative of an angle in its own; None: no factor."""
    one, two = parse_unit(angle), parse_unit(rate)
    if (one * parse_unit("1/s")).dimensions != two.dimensions:
        return None
    return float(one.factor / two.factor)


def _doubtful(column: ColumnGuess, why: str) -> ColumnGuess:
    return replace(column, basis=Basis.LIKELY, unit_why=why)


def _slope(one: Array, other: Array) -> tuple[float, float] | None:
    """The factor of `one` over `other`, and how well it fits; None where they do not move."""
    known = np.isfinite(one) & np.isfinite(other)
    x, y = other[known], one[known]
    if len(x) < 20 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return None
    fits = float(np.corrcoef(x, y)[0, 1]) ** 2
    return float(np.ptp(y) / np.ptp(x)), fits


def _follows(target: ColumnGuess, measured: ColumnGuess, w: Array, y: Array) -> ColumnGuess:
    """A target has the unit of what follows it."""
    found = _slope(w, y)
    if found is None or found[1] < _SAME or abs(found[0] - 1) > 0.1:
        return target
    told = f"it goes with {measured.name}, R² {found[1]:.4f}"
    if target.basis is Basis.UNKNOWN and measured.unit:
        return _likely(target, Likely(measured.unit, told))
    return replace(target, doubts=(*target.doubts, told)) if target.role == COMMAND else target


def _of_an_angle(target: ColumnGuess, angle: ColumnGuess, w: Array, q: Array) -> ColumnGuess:
    """A target of which nothing but its numbers says that it is one of an angle."""
    found = _slope(w, q) if target.basis is Basis.UNKNOWN and target.of_anything else None
    if found is None or found[1] < _SAME or abs(found[0] - 1) > 0.1:
        return target
    return replace(target, role=REFERENCE, why=f"{target.why}, and it goes with {angle.name}")


def _multiple(torque: ColumnGuess, current: ColumnGuess, tau: Array, i: Array) -> ColumnGuess:
    """A torque that is the current, times a constant."""
    found = _slope(tau, i)
    if found is None or found[1] < 0.9999:
        return torque
    told = f"it is {found[0]:.5g} times {current.name}: made of it, and not measured by itself"
    return replace(torque, doubts=(*torque.doubts, told))
