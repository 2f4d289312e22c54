"""Files named by options of a test, read with the protocol."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from pydantic import BaseModel

from campaign.options import TextFile
from campaign.protocol.positions import Keys
from campaign.protocol.shapes import Shape, shape_at

Read = Callable[[Keys, str], TextFile]
"""The file that is written at some keys; when it cannot be read, one without text."""


def attach(options: type[BaseModel], tree: Mapping[str, Any], read: Read) -> dict[str, Any]:
    """`tree` with every path of an option of type `TextFile` replaced by that file."""
    attached: dict[str, Any] = _attached(Shape((options,)), dict(tree), (), read)
    return attached


def attach_values(
    options: type[BaseModel], tree: Mapping[str, Any], keys: Keys, values: Any, read: Read
) -> Any:
    """The same for the listed values of an option that is swept; `keys` lead to it."""
    shape = shape_at(options, tree, keys)
    if shape is None or not isinstance(values, list):
        return values
    return [_attached(shape, value, (index,), read) for index, value in enumerate(values)]


def _attached(shape: Shape | None, value: Any, keys: Keys, read: Read) -> Any:
    if shape is None:
        return value
    if shape.members == (TextFile,) and isinstance(value, str):
        return read(keys, value)
    if not isinstance(value, Mapping | list):
        return value
    narrow = shape.narrowed(value)
    if isinstance(value, list):
        return [_attached(narrow.child(i), v, (*keys, i), read) for i, v in enumerate(value)]
    return {k: _attached(narrow.child(k), v, (*keys, k), read) for k, v in value.items()}
