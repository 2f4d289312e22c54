"""What the numbers of one column say: whether they are times, and in which unit they may be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from campaign.channels import MOTOR_ANGLE, RELATIVE_ANGLE, TEMPERATURE
from campaign.importing.cutting import restarts
from campaign.importing.defects.clock import ticks
from campaign.importing.defects.samples import of_channel
from campaign.importing.guess.columns import Basis, ColumnGuess
from campaign.importing.interface import Array

_SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
_THIS_CENTURY = (1e9, 4e9)
"""s since 1970, of the years 2001 to 2096."""


def increases(values: Array) -> bool:
    """Whether a column can be one of times: it hardly ever goes back, but where it begins anew."""
    known = values[np.isfinite(values)]
    parts = [part for part in np.split(known, restarts(known)) if len(part) > 1]
    return bool(parts) and all(p[-1] > p[0] and (np.diff(p) < 0).mean() < 0.01 for p in parts)


def evenly(values: Array) -> bool:
    """Whether it does so in steps of one size, as clocks do and motions do not."""
    if len(values) < 8 or not np.isfinite(values).all() or not increases(values):
        return False
    clock = ticks(values)
    return clock.step > 0 and clock.scatter < 0.05 * clock.step


def counts(values: Array) -> bool:
    """Whether it counts rows: whole numbers, one by one."""
    return len(values) > 1 and values[0] in (0.0, 1.0) and bool(np.all(np.diff(values) == 1))


def unit_of_time(values: Array) -> tuple[str, str]:
    """A unit, and what suggests it: size and step, as no rig samples at others; or "" twice."""
    step = ticks(values).step
    if step <= 0:
        return "", ""
    for unit, seconds in _SECONDS.items():
        if _THIS_CENTURY[0] <= values[0] * seconds < _THIS_CENTURY[1]:
            return unit, "they would be times since 1970"
    whole = step >= 1 and bool(np.all(values == np.round(values)))
    unit = "ms" if whole or step >= 0.5 else "s"
    return unit, f"{step:.4g} apart, {1 / (step * _SECONDS[unit]):.6g} Hz if it is {unit}"


def likely(column: ColumnGuess, unit: str, why: str) -> ColumnGuess:
    """With a unit that numbers suggest, and why; as it was where they suggest none."""
    return replace(column, unit=unit, basis=Basis.LIKELY, unit_why=why) if unit else column


def unit_by_range(column: ColumnGuess, values: Array) -> ColumnGuess:
    """A temperature as laboratories have it; an angle by where its scale begins anew."""
    known = values[np.isfinite(values)]
    span = column.high - column.low
    if column.basis is not Basis.UNKNOWN or not len(known):
        return column
    if column.role == TEMPERATURE and column.low > -60 and column.high < 220:
        return likely(column, "degC", f"it is between {column.low:.4g} and {column.high:.4g}")
    if column.role not in (RELATIVE_ANGLE, MOTOR_ANGLE):
        return column
    for each in of_channel("", values, angle=True):
        if each.kind == "wraparound":
            turns = {round(2 * math.pi, 6): "rad", 360.0: "deg", 1.0: "rev"}
            unit = turns.get(round(each.size, 6), "count")
            return likely(column, unit, f"it begins anew at {each.size:.6g}")
    if span > 20 and np.array_equal(known, np.round(known)):
        return likely(column, "count", "whole numbers")
    if column.role == RELATIVE_ANGLE and 8 * math.pi < span <= 720:
        return likely(column, "deg", f"in rad it would be {span / (2 * math.pi):.3g} turns")
    return column
