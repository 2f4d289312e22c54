"""Fields of a message body: numbers, texts and lists with checks.

A message is a dataclass whose annotations define its body: field by field, in the order of the
bytes. `Code` enumerations are one byte; every other type names its layout by `Annotated`.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields
from functools import cache
from typing import Annotated, Any, TypeVar, cast, get_type_hints

from campaign.wire.codes import Code, WireError

SHORT_TEXT = 255
"""Longest name, unit or label (bytes of UTF-8)."""

C = TypeVar("C", bound=Code)
R = TypeVar("R")


class Writer:
    """Writer of a message body."""

    def __init__(self) -> None:
        self._parts = bytearray()

    def number(self, letter: str, value: float) -> Writer:
        """Add one number; `letter` as in `struct`."""
        try:
            self._parts += struct.pack("<" + letter, value)
        except (struct.error, OverflowError) as error:
            raise WireError(f"{value!r} cannot be sent: {error}") from error
        return self

    def finite(self, value: float) -> Writer:
        """Add a finite f64."""
        if not math.isfinite(value):
            raise WireError(f"{value!r} cannot be sent: not finite")
        return self.number("d", value)

    def optional(self, value: float | None) -> Writer:
        """Add a finite f64, or NaN for None."""
        return self.number("d", math.nan) if value is None else self.finite(value)

    def text(self, text: str, length: str = "B") -> Writer:
        """Add UTF-8 text after its length in bytes, u8 (`B`) or u16 (`H`)."""
        try:
            data = text.encode()
        except UnicodeEncodeError as error:
            raise WireError(f"{text!r} cannot be sent: {error}") from error
        return self.number(length, len(data)).data(data)

    def texts(self, texts: Iterable[str]) -> Writer:
        """Add a list of short texts after their number (u8)."""
        listed = tuple(texts)
        self.number("B", len(listed))
        for text in listed:
            self.text(text)
        return self

    def data(self, data: bytes) -> Writer:
        """Add bytes unchanged."""
        self._parts += data
        return self

    def done(self) -> bytes:
        """The body."""
        return bytes(self._parts)


class Reader:
    """Parser of a message body. Raises WireError if it is malformed."""

    def __init__(self, body: bytes) -> None:
        self._body = body
        self._position = 0

    @property
    def left(self) -> int:
        """Bytes not yet read."""
        return len(self._body) - self._position

    def data(self, count: int) -> bytes:
        """The next `count` bytes."""
        if count > self.left:
            raise WireError(f"{count} bytes expected at {self._position}, {self.left} are left")
        self._position += count
        return self._body[self._position - count : self._position]

    def integer(self, letter: str) -> int:
        """The next integer; `letter` as in `struct`."""
        return int(struct.unpack("<" + letter, self.data(struct.calcsize("<" + letter)))[0])

    def real(self) -> float:
        """The next f64, finite or not."""
        return float(struct.unpack("<d", self.data(8))[0])

    def finite(self) -> float:
        """The next f64, which must be finite."""
        value = self.real()
        if not math.isfinite(value):
            raise WireError(f"a number that is not finite at {self._position - 8}")
        return value

    def optional(self) -> float | None:
        """The next f64, which must not be infinite; None for NaN."""
        value = self.real()
        if math.isinf(value):
            raise WireError("an infinite number")
        return None if math.isnan(value) else value

    def flag(self) -> bool:
        """The next byte, which must be 0 or 1."""
        value = self.integer("B")
        if value > 1:
            raise WireError(f"a flag is 0 or 1, not {value}")
        return value == 1

    def code(self, kind: type[C]) -> C:
        """The next byte as a member of `kind`."""
        value = self.integer("B")
        try:
            return kind(value)
        except ValueError:
            raise WireError(f"no {kind.__name__} has the number {value}") from None

    def text(self, length: str = "B") -> str:
        """The next text, after its length u8 (`B`) or u16 (`H`)."""
        data = self.data(self.integer(length))
        try:
            return data.decode()
        except UnicodeDecodeError as error:
            raise WireError(f"text that is not UTF-8: {error}") from error

    def texts(self) -> tuple[str, ...]:
        """The next list of short texts."""
        return tuple(self.text() for _ in range(self.integer("B")))

    def end(self) -> None:
        """Raise WireError if bytes are left."""
        if self.left:
            raise WireError(f"{self.left} bytes too many")


def clipped(text: str, limit: int = SHORT_TEXT) -> str:
    """`text`, cut to at most `limit` bytes of UTF-8."""
    return text.encode("utf-8", "replace")[:limit].decode("utf-8", "ignore")


# Layouts


@dataclass(frozen=True)
class Layout:
    """Writer and reader of one kind of field."""

    write: Callable[[Writer, Any], object]
    read: Callable[[Reader], Any]


def _integer(letter: str) -> Layout:
    return Layout(lambda w, value: w.number(letter, value), lambda r: r.integer(letter))


U8 = Annotated[int, _integer("B")]
U16 = Annotated[int, _integer("H")]
U32 = Annotated[int, _integer("I")]
F64 = Annotated[float, Layout(Writer.finite, Reader.finite)]
OptionalF64 = Annotated[float | None, Layout(Writer.optional, Reader.optional)]
Flag = Annotated[bool, Layout(lambda w, value: w.number("B", bool(value)), Reader.flag)]
ShortText = Annotated[str, Layout(Writer.text, Reader.text)]
LongText = Annotated[str, Layout(lambda w, value: w.text(value, "H"), lambda r: r.text("H"))]
Words = Annotated[tuple[str, ...], Layout(Writer.texts, Reader.texts)]
Rest = Annotated[bytes, Layout(Writer.data, lambda r: r.data(r.left))]


@cache
def layouts(made: Any) -> tuple[tuple[str, Layout], ...]:
    """Names and layouts of the fields of a dataclass, in order."""
    hints = get_type_hints(made, include_extras=True)
    return tuple((each.name, _layout(hints[each.name])) for each in fields(made))


def _layout(kind: Any) -> Layout:
    if isinstance(kind, type) and issubclass(kind, Code):
        return Layout(lambda w, value: w.number("B", kind(value)), lambda r: r.code(kind))
    layout: Layout = kind.__metadata__[0]
    return layout


def written(record: Any) -> bytes:
    """All fields of a dataclass as bytes. Raises WireError if one cannot be sent."""
    writer, made = Writer(), cast(Any, type(record))
    for name, layout in layouts(made):
        layout.write(writer, getattr(record, name))
    return writer.done()


def read(made: Callable[..., R], reader: Reader) -> R:
    """The dataclass from the next bytes. Raises WireError if they do not match it."""
    return made(**{name: layout.read(reader) for name, layout in layouts(made)})


def listed(write: Callable[[R], bytes], read_one: Callable[[Reader], R]) -> Layout:
    """Layout of a tuple: the number of its members (u8), then each of them."""

    def write_all(writer: Writer, members: tuple[R, ...]) -> None:
        writer.number("B", len(members))
        for each in members:
            writer.data(write(each))

    return Layout(write_all, lambda r: tuple(read_one(r) for _ in range(r.integer("B"))))
