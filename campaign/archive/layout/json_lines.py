"""Parsing of JSON lines together, several times as fast as line by line."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

Item = TypeVar("Item")

TOGETHER = 2000
"""Lines per part; a part is in memory three times."""


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
