"""Swept values as text, in the protocol's units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from campaign.options import Options, describe
from campaign.units import Quantity, convert, split_quantity

DIGITS = 6


def as_written(value: Any) -> str:
    """A value of a matrix with its unit, as written; "" for a value without a unit."""
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
    """Texts of the quantities that distinguish the trials of an experiment.

    Args:
        options: of the experiment; `speed` has the unit of its option `speed` or `speeds`.
        written: the test's options as in the protocol.
        point: name to SI value.
    """
    texts = {}
    for name, value in point.items():
        match = next(_like(options, name), None)
        if match is not None and isinstance(value, float):
            field, quantity = match[0], match[1].here
            unit = next(_units(written.get(field), quantity), quantity.display)
            shown = convert(value, quantity.si, unit)
            texts[name] = f"{shown:.{DIGITS}g} {unit}"
    return texts


def _like(options: type[Options], name: str) -> Iterator[tuple[str, Quantity]]:
    """The options, with quantities, that a name may come from: the name itself or its plural."""
    known = _quantities(options)
    plural = name[:-1] + "ies" if name.endswith("y") else name + "s"
    yield from ((field, known[field]) for field in (name, plural) if field in known)


@cache
def _quantities(options: type[Options]) -> dict[str, Quantity]:
    pairs = ((info.name, info.quantity) for info in describe(options))
    return {name: quantity for name, quantity in pairs if quantity is not None}


def _units(written: Any, quantity: Quantity) -> Iterator[str]:
    """Units of the quantity in a written text, list or range."""
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
