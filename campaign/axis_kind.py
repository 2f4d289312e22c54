"""Rotary and linear axes: their units and terms.

The equations of a rotary and of a linear axis are the same in SI numbers, with m for rad, N for N m
and kg for kg m^2. So the program is written in the words of a rotary axis; what is read from files
and told to people passes through here. `axis_terms` says whose axis is meant.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from typing import Any, TypeVar

Item = TypeVar("Item")


class AxisKind(StrEnum):
    """How the axis of a bench moves."""

    ROTARY = "rotary"
    LINEAR = "linear"


@dataclass(frozen=True)
class Sides:
    """How the two sides of the gear move: a rotary motor may well drive a linear load."""

    load: AxisKind = AxisKind.ROTARY
    motor: AxisKind = AxisKind.ROTARY

    @property
    def at_motor(self) -> Sides:
        """What is written of something on the motor's side of the gear."""
        return Sides(self.motor, self.motor)


BOTH_ROTARY = Sides()
_SIDES: ContextVar[Sides] = ContextVar("axis", default=BOTH_ROTARY)


def sides_in(tree: Any) -> Sides:
    """The kinds that a bench's tree states, as written or normalised; of no tree the usual ones.

    A gear with a lead is between a rotary motor and a linear load.
    """
    axis = tree.get("axis") if isinstance(tree, Mapping) else None
    # So that a slip of "linear" is one mistake, and not one for each unit.
    if not isinstance(axis, Mapping) or not str(axis.get("kind", "")).startswith("lin"):
        return BOTH_ROTARY
    gear = tree.get("gear")
    lead = isinstance(gear, Mapping) and gear.get("lead") is not None
    return Sides(AxisKind.LINEAR, AxisKind.ROTARY if lead else AxisKind.LINEAR)


@contextmanager
def axis_terms(sides: Sides) -> Iterator[None]:
    """Whatever is read and told inside is about a bench with these sides."""
    token = _SIDES.set(sides)
    try:
        yield
    finally:
        _SIDES.reset(token)


def each_in_axis_terms(sides: Sides, items: Iterable[Item]) -> Iterator[Item]:
    """What makes `items` speaks of a bench with these sides; who takes them does not."""
    iterator = iter(items)
    while True:
        with axis_terms(sides):
            try:
                item = next(iterator)
            except StopIteration:
                return
        yield item


def current_sides() -> Sides:
    """The sides of the bench that is meant here."""
    return _SIDES.get()


def is_linear() -> bool:
    """Whether the axis that is meant here is linear."""
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
"""Units of a rotary axis and those of a linear one: SI for SI, with equal numbers, and what a
reader is shown for what a reader is shown."""


def axis_unit(unit: str) -> str:
    """The unit that stands for one of a rotary axis, of the axis that is meant here.

    What has no angle and no torque in it stays. Not for phases: those are angles of no axis.
    """
    return _UNITS.get(unit, unit) if is_linear() else unit


# Words --------------------------------------------------------------------------------------------

_NAMED = r"(?<![\w.'\"])(?<!phase ){}(?![\w\"]|'(?!s)|\.\w| =)"
"""A word of a sentence: no name of a field or option, as in `limits.torque`."""
_WORDS = (
    ("moments of inertia", "masses"),
    ("moment of inertia", "mass"),
    ("it turns", "it moves"),
    ("component turns", "component moves"),
    ("counts as turning", "counts as moving"),
    ("slow speeds turn", "slow speeds travel"),
    ("per revolution", "per 2π m"),
    ("an inertia", "a mass"),
    ("an angle", "a position"),
    ("settle angle", "settle travel"),
    ("window angle", "window travel"),
    ("inertias", "masses"),
    ("inertia's", "mass's"),
    ("inertia", "mass"),
    ("angles", "positions"),
    ("angle", "position"),
    ("torques", "forces"),
    ("torque's", "force's"),
    ("torque", "force"),
)
_PATTERNS = (
    (re.compile(r"\b[Aa]ngular (?=\w)"), ""),
    *(
        (re.compile(_NAMED.format(f"(?:{word}|{word.capitalize()})")), other)
        for word, other in _WORDS
    ),
)
_OF_MOTOR = re.compile(r"\btorque constant\b")
"""What a motor that turns has, whatever it drives."""
_KEPT = "\N{SYMBOL FOR SUBSTITUTE}"
_TEXT_UNITS = tuple(
    (re.compile(rf"(?<![\w·]){rotary}(?![\w·/²^])"), linear)
    for rotary, linear in (
        (r"rad/s per N[· ]m", "m/s per N"),
        (r"N[· ]m[· ]s/rad", "N·s/m"),
        (r"N[· ]m/rad", "N/m"),
        (r"N[· ]m/s", "N/s"),
        (r"N[· ]m/A", "N/A"),
        (r"N[· ]m", "N"),
        (r"kg[· ]m(?:²|\^2)", "kg"),
        (r"rad/s(?:²|\^2)", "m/s²"),
        (r"rad/s", "m/s"),
    )
)
"""Where the number before them, if any, is the same: SI units alone."""


def in_axis_terms(text: str) -> str:
    """A text for people, in the words of the axis that is meant here."""
    if not text or not is_linear():
        return text
    for pattern, linear in _TEXT_UNITS:
        text = pattern.sub(linear, text)
    if _SIDES.get().motor is AxisKind.ROTARY:
        text = _OF_MOTOR.sub(_KEPT, text)
    for pattern, word in _PATTERNS:
        text = pattern.sub(partial(_like, word), text)
    return text.replace(_KEPT, "torque constant")


def _like(word: str, found: re.Match[str]) -> str:
    """`word` with a capital where what it stands for has one."""
    return word.capitalize() if found[0][:1].isupper() else word
