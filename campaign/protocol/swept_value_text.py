"""Swept values as text, in the protocol's units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from campaign.options import Options, describe
from campaign.units import Quantity, convert, split_quantity

DIGITS = 6


def as_written(value: Any) -> str:
    """A value of a matrix with its unit, as it is written; "" for one that has none."""
    if not isinstance(value, str):
        return ""
    try:
        number, unit = split_quantity(value)
    except ValueError:
        return ""
    return f"{number:.{DIGITS}g} {unit}" if unit else ""


def point_text(
    options: type[Options], written: Mapping[str, Any], point: Mapping[str, Any]
) -> dict[str, str]:
    """What an experiment distinguishes its trials by, of what is a quantity.

    Args:
        options: of the experiment; `speed` is said as its `speed` or `speeds` are.
        written: the test's options as the protocol has them.
        point: name to SI value.
    """
    told = {}
    for name, value in point.items():
        found = next(_like(options, name), None)
        if found is not None and isinstance(value, float):
            field, quantity = found[0], found[1].here
            unit = next(_units(written.get(field), quantity), quantity.display)
            shown = convert(value, quantity.si, unit)
            told[name] = f"{shown:.{DIGITS}g} {unit}"
    return told


def _like(options: type[Options], name: str) -> Iterator[tuple[str, Quantity]]:
    """The option that gives a name its values."""
    known = _quantities(options)
    plural = name[:-1] + "ies" if name.endswith("y") else name + "s"
    yield from ((field, known[field]) for field in (name, plural) if field in known)


@cache
def _quantities(options: type[Options]) -> dict[str, Quantity]:
    found = ((info.name, info.quantity) for info in describe(options))
    return {name: quantity for name, quantity in found if quantity is not None}


def _units(written: Any, quantity: Quantity) -> Iterator[str]:
    """Units of the quantity in what a protocol writes: a text, a list, a range."""
    if isinstance(written, str):
        try:
            number, unit = split_quantity(written)
            quantity.parse(f"{number!r} {unit}")
            convert(1.0, quantity.si, unit)
        except ValueError:
            return
        yield unit
    elif isinstance(written, Mapping):
        for value in written.values():
            yield from _units(value, quantity)
    elif isinstance(written, list | tuple):
        for value in written:
            yield from _units(value, quantity)
