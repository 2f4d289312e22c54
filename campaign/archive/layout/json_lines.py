"""JSON lines parsed together, which is several times as fast as one by one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

Item = TypeVar("Item")


def parse_at_once(adapter: TypeAdapter[list[Item]], lines: Sequence[bytes]) -> list[Item] | None:
    """What each line says; None where one cannot be understood."""
    try:
        items = adapter.validate_json(b"[%b]" % b",".join(lines))
    except ValidationError:
        return None
    return items if len(items) == len(lines) else None
