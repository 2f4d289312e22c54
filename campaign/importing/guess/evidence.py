"""What the numbers of columns say: which are times, and which units agree with each other.

A factor between two columns is told with how well it fits. It proves no unit by itself: what is
said here is likely, and is marked so wherever it is shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from campaign.importing.cutting import restarts
from campaign.importing.defects.between import DEG, Slope, slope
from campaign.importing.defects.clock import ticks
from campaign.importing.defects.defect import Array
from campaign.unit_grammar import parse_unit

EPOCHS = ((1e9, 4e9, "s"), (1e12, 4e12, "ms"), (1e15, 4e15, "us"), (1e18, 4e18, "ns"))
"""Times since 1970, of the years 2001 to 2096, by their size."""


def seconds_of(unit: str) -> float | None:
    """What a unit of time is, in s; None for what is none."""
    try:
        found = parse_unit(unit)
    except ValueError:
        return None
    return float(found.factor) if found.dimensions == parse_unit("s").dimensions else None


def increases(values: Array) -> bool:
    """Whether a column can be one of times: it hardly ever goes back."""
    known = values[np.isfinite(values)]
    if len(known) < 2 or len(known) < len(values):
        return False
    steps = np.diff(known)
    return bool(known[-1] > known[0] and (steps < 0).mean() < 0.01)


def goes_on_anew(values: Array) -> bool:
    """Whether it increases, begins anew, and increases again, as the times of several trials do."""
    parts = np.split(values, restarts(values))
    return len(parts) > 1 and all(increases(part) for part in parts if len(part) > 1)


def evenly(values: Array) -> bool:
    """Whether it does so in steps of one size, as clocks do and motions do not."""
    if len(values) < 8 or not increases(values):
        return False
    clock = ticks(values)
    return clock.step > 0 and clock.scatter < 0.05 * clock.step


def counts(values: Array) -> bool:
    """Whether it counts rows: whole numbers, one by one."""
    known = values[np.isfinite(values)]
    return len(known) > 1 and bool(np.all(np.diff(known) == 1)) and float(known[0]) in (0.0, 1.0)


@dataclass(frozen=True)
class Likely:
    """A unit that the numbers suggest, and why."""

    unit: str
    why: str


RATE_NAMES = {"fs", "fsamp", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"}
STEP_NAMES = {"ts", "dt", "sampletime", "samplingtime", "sampleinterval", "samplinginterval"}
"""What files call their sample rate (Hz) and its inverse (s), without what is between words."""


def stated_rate(said: Mapping[str, str]) -> tuple[str, float] | None:
    """The sample rate (Hz) that a file says besides its columns, and the name that says it."""
    for key, text in said.items():
        name = "".join(filter(str.isalpha, key.rsplit(".", 1)[-1].lower()))
        try:
            value = float(text)
        except ValueError:
            continue
        if name in RATE_NAMES | STEP_NAMES and 0.0 < value < math.inf:
            return key, value if name in RATE_NAMES else 1.0 / value
    return None


def unit_of_time(values: Array, stated: tuple[str, float] | None = None) -> Likely | None:
    """By a rate that the file states, or by size and step: what no rig samples at is not meant."""
    first = float(values[0])
    if stated is not None and (apart := ticks(values).step) > 0:
        name, rate = stated
        for unit, seconds in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
            if abs(apart * seconds * rate - 1.0) < 1e-3:
                return Likely(unit, f"{apart:.4g} apart, and the file says {name}: {rate:g} Hz")
    for low, high, unit in EPOCHS:
        if low <= first < high:
            return Likely(unit, "they would be times since 1970")
    step = ticks(values).step
    if step <= 0:
        return None
    whole = bool(np.all(values == np.round(values)))
    if whole and step >= 1:
        return Likely("ms", f"whole numbers, {step:.4g} apart")
    if step < 0.5:
        return Likely("s", f"{step:.4g} apart, {1 / step:.6g} Hz if it is s")
    return Likely("ms", f"{step:.4g} apart, {1000 / step:.6g} Hz if it is ms")


def unit_of_angle(values: Array) -> Likely | None:
    """By where its scale begins anew; None where it does not."""
    from campaign.importing.defects.samples import of_channel

    for each in of_channel("", values, angle=True):
        if each.kind == "wraparound":
            units = {round(2 * math.pi, 6): "rad", 360.0: "deg", 1.0: "rev"}
            unit = units.get(round(each.size, 6), "count")
            return Likely(unit, f"it begins anew at {each.size:.6g}")
    known = values[np.isfinite(values)]
    if len(known) and np.array_equal(known, np.round(known)) and np.ptp(known) > 20:
        return Likely("count", "whole numbers")
    return None


def unit_of_joint(values: Array) -> Likely | None:
    """Of an angle at the load: one of many turns is rather one in degrees."""
    known = values[np.isfinite(values)]
    span = float(np.ptp(known)) if len(known) else 0.0
    if 8 * math.pi < span <= 720:
        return Likely("deg", f"in rad it would be {span / (2 * math.pi):.3g} turns")
    return None


def unit_of_temperature(values: Array) -> Likely | None:
    """By its range: what laboratories have, in °C."""
    known = values[np.isfinite(values)]
    if len(known) and known.min() > -60 and known.max() < 220:
        return Likely("degC", f"it is between {known.min():.4g} and {known.max():.4g}")
    return None


RATES = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s", "mm": "mm/s", "m": "m/s", "mrad": "mrad/s"}
"""What the derivative of an angle is in."""


def factor(time: Array, angle: Array, rate: Array) -> Slope | None:
    """The factor between a rate and its angle, where it is one."""
    found = slope(time, angle, rate)
    return found if found is not None and found.explained > 0.9 and found.travel > 30 else None


def unit_of_rate(found: Slope, angle_unit: str) -> Likely | None:
    """The unit of a rate beside an angle whose unit is known, time being in s."""
    size = abs(found.factor)
    told = f"{size:.5g} times the derivative of the angle, R² {found.explained:.4f}"
    close = max(0.02, 3 * found.error)
    choices = {RATES.get(angle_unit, ""): 1.0}
    if angle_unit == "rad":
        choices |= {"deg/s": DEG, "rpm": 30 / math.pi}
    if angle_unit == "deg":
        choices |= {"rad/s": 1 / DEG, "rpm": 1 / 6}
    for unit, value in choices.items():
        if unit and abs(size / value - 1) < close:
            return Likely(unit, told)
    return None
