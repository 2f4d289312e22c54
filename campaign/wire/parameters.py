"""Parameters of SET: named values in several messages, checked.

A configuration is the list of all SET bodies since the device was idle, in order. ARM contains its
CRC-32, so no motion uses parameters other than the sent ones.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated

from campaign.wire.codes import Tag, WireError
from campaign.wire.fields import Reader, Writer, listed

NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")
LONGEST_NAME = 64
LONGEST_TEXT = 512
"""Bytes of UTF-8."""
SLICE = 64
"""Largest number of values in one piece of an array."""


@dataclass(frozen=True)
class ArraySlice:
    """A piece of an array of f64.

    Attributes:
        total: length of the whole array.
        offset: index of this piece's first value in it.
        values: the piece.
    """

    total: int
    offset: int
    values: tuple[float, ...]


Scalar = float | int | bool | str
Value = Scalar | tuple[float, ...]
"""A whole parameter: float (f64), int (i64), bool, text, or an array of f64."""


@dataclass(frozen=True)
class Item:
    """One named value of a SET; an array may come in several pieces."""

    name: str
    value: Scalar | ArraySlice


def items(parameters: Mapping[str, Value]) -> list[Item]:
    """`parameters` as items, in order; arrays cut into slices (an empty one is one slice)."""
    made = []
    for name, value in parameters.items():
        if not isinstance(value, tuple):
            made.append(Item(name, value))
            continue
        for offset in range(0, max(1, len(value)), SLICE):
            piece = tuple(value[offset : offset + SLICE])
            made.append(Item(name, ArraySlice(len(value), offset, piece)))
    return made


def assembled(pieces: Iterable[Item]) -> dict[str, Value]:
    """Whole parameters from items, in order of first appearance; a later scalar replaces.

    Raises WireError if the pieces of an array are not contiguous from 0 to its total.
    """
    whole: dict[str, Value] = {}
    totals: dict[str, int] = {}
    for item in pieces:
        if not isinstance(item.value, ArraySlice):
            whole[item.name] = item.value
            totals.pop(item.name, None)
            continue
        piece = item.value
        before = whole.get(item.name, ()) if piece.offset else ()
        if not isinstance(before, tuple) or len(before) != piece.offset:
            raise WireError(f"{item.name}: a piece at {piece.offset} does not follow")
        if piece.offset and totals[item.name] != piece.total:
            raise WireError(f"{item.name}: its length changed")
        whole[item.name] = before + piece.values
        totals[item.name] = piece.total
    for name, total in totals.items():
        value = whole[name]
        if isinstance(value, tuple) and len(value) != total:
            raise WireError(f"{name}: {len(value)} of {total} values")
    return whole


def configuration_crc(bodies: Iterable[bytes]) -> int:
    """CRC-32 of the SET bodies, in order, for ARM; 0 for none."""
    crc = 0
    for body in bodies:
        crc = zlib.crc32(body, crc)
    return crc


def encoded(item: Item) -> bytes:
    """The bytes of one item. Raises WireError if name or value cannot be sent."""
    name, value = item.name, item.value
    _check_name(name)
    writer = Writer().text(name)
    if isinstance(value, bool):
        writer.number("B", Tag.BOOL).number("B", value)
    elif isinstance(value, int):
        writer.number("B", Tag.I64).number("q", value)
    elif isinstance(value, float):
        writer.number("B", Tag.F64).finite(value)
    elif isinstance(value, str):
        if len(value.encode("utf-8", "replace")) > LONGEST_TEXT:
            raise WireError(f"{name}: a text of more than {LONGEST_TEXT} bytes")
        writer.number("B", Tag.TEXT).text(value, "H")
    else:
        _check_slice(name, value)
        writer.number("B", Tag.F64_ARRAY).number("I", value.total).number("I", value.offset)
        writer.number("B", len(value.values))
        for number in value.values:
            writer.finite(number)
    return writer.done()


def read_item(reader: Reader) -> Item:
    """The next item of a body."""
    name = reader.text()
    _check_name(name)
    return Item(name, _read_value(name, reader))


Items = Annotated[tuple[Item, ...], listed(encoded, read_item)]


def _check_name(name: str) -> None:
    if len(name) > LONGEST_NAME or not NAME.fullmatch(name):
        raise WireError(f"{name!r} is no parameter name")


def _read_value(name: str, reader: Reader) -> Scalar | ArraySlice:
    tag = reader.code(Tag)
    if tag is Tag.F64:
        return reader.finite()
    if tag is Tag.I64:
        return reader.integer("q")
    if tag is Tag.BOOL:
        return reader.flag()
    if tag is Tag.TEXT:
        text = reader.text("H")
        if len(text.encode()) > LONGEST_TEXT:
            raise WireError(f"{name}: a text of more than {LONGEST_TEXT} bytes")
        return text
    total, offset, count = reader.integer("I"), reader.integer("I"), reader.integer("B")
    piece = ArraySlice(total, offset, tuple(reader.finite() for _ in range(count)))
    _check_slice(name, piece)
    return piece


def _check_slice(name: str, piece: ArraySlice) -> None:
    count = len(piece.values)
    if count > SLICE or piece.offset + count > piece.total or (count == 0 and piece.total):
        raise WireError(f"{name}: {count} values at {piece.offset} of {piece.total}")
