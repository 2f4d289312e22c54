"""JSON lines parsed together, which is several times as fast as one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

Item = TypeVar("Item")

TOGETHER = 2000
"""Lines of a part, which are in memory three times."""


def parse_at_once(adapter: TypeAdapter[list[Item]], lines: Sequence[bytes]) -> list[Item] | None:
    """What each line says; None where one cannot be understood."""
    items: list[Item] = []
    for start in range(0, len(lines), TOGETHER):
        part = lines[start : start + TOGETHER]
        try:
            found = adapter.validate_json(b"[%b]" % b",".join(part))
        except ValidationError:
            return None
        if len(found) != len(part):
            return None
        items += found
    return items
