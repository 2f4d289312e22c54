"""Rotary and linear axes: their units and terms.

The equations of a rotary and of a linear axis are the same in SI numbers, with m for rad, N for N m
and kg for kg m^2. The program uses the terms of a rotary axis; this module converts input files and
output texts. `axis_terms` sets the axis.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, TypeVar

Item = TypeVar("Item")


class AxisKind(StrEnum):
    """Type of motion of an axis."""

    ROTARY = "rotary"
    LINEAR = "linear"


@dataclass(frozen=True)
class Sides:
    """Axis kinds of the two sides of the gear: a rotary motor may drive a linear load."""

    load: AxisKind = AxisKind.ROTARY
    motor: AxisKind = AxisKind.ROTARY

    @property
    def at_motor(self) -> Sides:
        """Sides for a component on the motor's side of the gear."""
        return Sides(self.motor, self.motor)


BOTH_ROTARY = Sides()
_SIDES: ContextVar[Sides] = ContextVar("axis", default=BOTH_ROTARY)


def sides_in(tree: Any) -> Sides:
    """Axis kinds of a bench's tree, as written or normalised; both rotary without a tree.

    A gear with a lead connects a rotary motor with a linear load.
    """
    axis = tree.get("axis") if isinstance(tree, Mapping) else None
    # A prefix suffices: a misspelled "linear" causes one error, not one for each unit.
    if not isinstance(axis, Mapping) or not str(axis.get("kind", "")).startswith("lin"):
        return BOTH_ROTARY
    gear = tree.get("gear")
    lead = isinstance(gear, Mapping) and gear.get("lead") is not None
    return Sides(AxisKind.LINEAR, AxisKind.ROTARY if lead else AxisKind.LINEAR)


@contextmanager
def axis_terms(sides: Sides) -> Iterator[None]:
    """Set the sides of the bench for input and output inside the block."""
    token = _SIDES.set(sides)
    try:
        yield
    finally:
        _SIDES.reset(token)


def each_in_axis_terms(sides: Sides, items: Iterable[Item]) -> Iterator[Item]:
    """Generate `items` in the terms of `sides`; the caller's terms are unchanged."""
    iterator = iter(items)
    while True:
        with axis_terms(sides):
            try:
                item = next(iterator)
            except StopIteration:
                return
        yield item


def current_sides() -> Sides:
    """Sides of the current bench."""
    return _SIDES.get()


def is_linear() -> bool:
    """Whether the current load axis is linear."""
    return _SIDES.get().load is AxisKind.LINEAR


# Units --------------------------------------------------------------------------------------------

_UNITS = {
    "rad": "m",
    "rad/s": "m/s",
    "rad/s^2": "m/s^2",
    "N m": "N",
    "N m/s": "N/s",
    "N m/rad": "N/m",
    "N m/mrad": "N/um",
    "N m rad/s": "N (m/s)",
    "N m s/rad": "N s/m",
    "kg m^2": "kg",
    "N m/A": "N/A",
    "N m s^2/rad^2": "N s^2/m^2",
    "N m/K": "N/K",
    "N m/K^2": "N/K^2",
    "N m s/(rad K^2)": "N s/(m K^2)",
    "N m s/(rad K)": "N s/(m K)",
    "A s/rad": "A s/m",
    "A/rad": "A/m",
    "s/rad": "s/m",
    "V s/rad": "V s/m",
    "rad/s/(N m)": "m/s/N",
    "deg": "mm",
    "mrad": "um",
    "urad": "um",
    "deg/s": "mm/s",
    "mrad/s": "um/s",
    "deg/s^2": "mm/s^2",
    "mrad/s/(N m)": "um/s/N",
}
"""Units of a linear axis by units of a rotary axis: SI units with equal numbers, and display
units."""


def axis_unit(unit: str, sides: Sides | None = None) -> str:
    """Unit of the current axis, or of `sides`, that replaces a unit of a rotary axis.

    Units without angle and torque are unchanged. Not for phases, which are no angles of an axis.
    """
    linear = (sides or current_sides()).load is AxisKind.LINEAR
    return _UNITS.get(unit, unit) if linear else unit


# Words --------------------------------------------------------------------------------------------

_TERMS = {
    "torque": "force",
    "torques": "forces",
    "torque constant": "force constant",
    "inertia": "mass",
    "inertias": "masses",
    "an inertia": "a mass",
    "angle": "position",
    "angles": "positions",
    "an angle": "a position",
}
"""Terms of a linear axis by terms of a rotary axis."""
_OF_MOTOR = "torque constant"
"""Term that depends on the kind of the motor."""
_LONGEST_FIRST = "|".join(sorted(_TERMS, key=len, reverse=True))
_TERM = re.compile(rf"(?<![\w.'\"`])(?:{_LONGEST_FIRST})(?!\w|\.\w|'(?!s)|`)", re.IGNORECASE)
"""A term in a sentence, not in the name of an option: `limits.torque`, `torque_rate`."""


def in_axis_terms(text: str, sides: Sides | None = None) -> str:
    """Output text in the terms of the current axis, or of `sides`.

    `units.in_words` converts units with their numbers.
    """
    sides = sides or current_sides()
    if sides.load is AxisKind.ROTARY:
        return text

    def linear(found: re.Match[str]) -> str:
        rotary = found[0].lower()
        if rotary == _OF_MOTOR and sides.motor is AxisKind.ROTARY:
            return found[0]
        term = _TERMS[rotary]
        return term.capitalize() if found[0][0].isupper() else term

    return _TERM.sub(linear, text)
