"""JSON lines: their places in a text, and parsing together, several times as fast as one by one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

Item = TypeVar("Item")

TOGETHER = 2000
"""Lines per part; a part is in memory three times."""


def line_places(text: bytes) -> Iterator[slice]:
    """Places of the complete lines of a text, without their ends; no line is copied."""
    start = 0
    while (end := text.find(b"\n", start)) >= 0:
        yield slice(start, end)
        start = end + 1


def parse_at_once(adapter: TypeAdapter[list[Item]], lines: Sequence[bytes]) -> list[Item] | None:
    """Items of the lines; None if a line is invalid."""
    items: list[Item] = []
    for start in range(0, len(lines), TOGETHER):
        part = lines[start : start + TOGETHER]
        try:
            parsed = adapter.validate_json(b"[%b]" % b",".join(part))
        except ValidationError:
            return None
        if len(parsed) != len(part):
            return None
        items += parsed
    return items
