"""Results as JSON text with a type for each object, and back.

In place of an array, the text has the path of its dataset. It leaves out fields that have their
default, and the law of a fitted curve, which is code. Numbers that JSON lacks are texts:
`{"$number": "nan"}`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from enum import Enum
from functools import cache
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from campaign import estimate, result
from campaign.archive.layout import results
from campaign.result import Array, Curve

IS, ARRAY, NUMBER = "$is", "$array", "$number"


@cache
def _kinds() -> dict[str, type]:
    """The only classes that a text can create: the dataclasses of results."""
    return {
        name: kind
        for module in (estimate, result, results)
        for name, kind in vars(module).items()
        if isinstance(kind, type) and is_dataclass(kind)
    }


@cache
def _adapter(kind: type) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def to_text(found: results.RunResults, place: Callable[[Array], str]) -> str:
    """The text; `place` returns the path of an array."""
    tree = _plain(found, place)
    return json.dumps(tree, separators=(",", ":"), ensure_ascii=False, allow_nan=False)


def from_text(text: str, array: Callable[[str], Array]) -> results.RunResults:
    """Results from their text; `array` returns the array at a path.

    Raises ValueError, TypeError or LookupError if it is not such a text.
    """
    made = json.loads(text, object_hook=lambda tree: _made(tree, array))
    if not isinstance(made, results.RunResults):
        raise ValueError("is not the text of results")
    return made


def _plain(value: Any, place: Callable[[Array], str]) -> Any:
    if isinstance(value, np.ndarray):
        return {ARRAY: place(value)}
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, Curve):
        value = _with_arrays(replace(value, law=None))  # a function cannot be archived
    if is_dataclass(value):
        items = ((f.name, getattr(value, f.name)) for f in fields(value) if _says(value, f))
        return {IS: type(value).__name__} | {name: _plain(item, place) for name, item in items}
    if isinstance(value, Mapping):
        return {str(key): _plain(item, place) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, place) for item in value]
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, float) and not math.isfinite(value):
        return {NUMBER: str(value)}
    return value


def _with_arrays(curve: Curve) -> Curve:
    """Convert lists to arrays: a plug-in may use lists."""
    listed = {name: v for name, v in vars(curve).items() if isinstance(v, list | tuple)}
    arrays: dict[str, Any] = {name: np.asarray(v, dtype=np.float64) for name, v in listed.items()}
    return replace(curve, **arrays) if arrays else curve


def _says(value: Any, field: Field[Any]) -> bool:
    """Whether the value of a field differs from its default."""
    actual = getattr(value, field.name)
    if field.default is not MISSING:
        return isinstance(actual, np.ndarray) or bool(actual != field.default)
    return field.default_factory is MISSING or bool(actual)


def _made(tree: dict[str, Any], array: Callable[[str], Array]) -> Any:
    if NUMBER in tree:
        return float(tree[NUMBER])
    if ARRAY in tree:
        return array(tree[ARRAY])
    if IS in tree:
        return _adapter(_kinds()[tree.pop(IS)]).validate_python(tree)
    return tree
