"""From pydantic errors to messages for a user.

A message states the value, the permitted values, and the nearest valid name for a typo.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from campaign.axis_kind import axis_terms, current_sides, in_axis_terms, sides_in
from campaign.errors import Problem
from campaign.protocol.files import Origin
from campaign.protocol.positions import Aim, Keys
from campaign.protocol.shapes import Shape, from_location, shape_at
from campaign.text import nearest

Model = TypeVar("Model", bound=BaseModel)
Fault = tuple[Keys, Aim, str]
"""A problem in a tree of values: keys, aim and message."""


def validate(
    model: type[Model], tree: Mapping[str, Any], origin: Origin, also: Collection[str] = ()
) -> Model | list[Problem]:
    """`tree` as a `model`, or all its problems. `also`: further names to suggest."""
    valid = find_faults(model, tree, also)
    return [origin.problem(*fault) for fault in valid] if isinstance(valid, list) else valid


def find_faults(
    model: type[Model], tree: Mapping[str, Any], also: Collection[str] = ()
) -> Model | list[Fault]:
    """`tree` as a `model`, or its faults, without their place in a file."""
    # A bench states its kind of axis; options use that of the bench of their test.
    sides = sides_in(tree) if "axis" in model.model_fields else current_sides()
    with axis_terms(sides):
        faults = list(_loose_values(model, tree))
        try:
            valid = model.model_validate(dict(tree))
        except ValidationError as error:
            details = error.errors(include_url=False)
            faults += (_fault(model, tree, one, also) for one in details)
        else:
            if not faults:
                return valid
    return _once_per_place(faults)


def allowed(names: Iterable[str]) -> str:
    """`allowed are a, b, c`."""
    listed = list(names)
    return f"allowed are {', '.join(listed)}" if listed else "nothing is allowed here"


def shown(value: Any) -> str:
    """A value in TOML notation, shortened."""
    if isinstance(value, Mapping):
        return "a table"
    if isinstance(value, list | tuple):
        return "a list"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f"'{value}'" if len(value) <= 60 else f"'{value[:57]}...'"
    return str(value)[:60]


def _a(noun: str) -> str:
    """The noun with its article."""
    return f"{'an' if noun[:1] in 'aeiou' else 'a'} {noun}"


def _fault(model: type[BaseModel], tree: Any, detail: ErrorDetails, also: Collection[str]) -> Fault:
    keys, shape = from_location(model, detail["loc"])
    if keys[-1:] == ("[key]",):  # pydantic's name for a key that a table does not permit
        return keys[:-1], "key", _wrong_value(None, detail)
    while keys and not isinstance(_value_at(tree, keys[:-1]), Mapping | list):
        keys = keys[:-1]  # within a value that abbreviates a table
    match detail["type"]:
        case "extra_forbidden":
            around = shape_at(model, tree, keys[:-1]) if len(keys) > 1 else Shape((model,))
            value = _value_at(tree, keys[:-1])
            names = around.narrowed(value).names() if around is not None else ()
            names = (*names, *also) if len(keys) == 1 else names
            here = f"unknown key {shown(keys[-1])}"
            return keys, "key", f"{here}; {allowed(names)}{nearest(keys[-1], names)}"
        case "missing":
            return keys[:-1], "value", f"{shown(keys[-1])} is missing{_expected(shape)}"
        case "union_tag_not_found":
            field = detail["ctx"]["discriminator"].strip("'")
            tags = allowed(shape.tags() if shape is not None else ())
            return keys, "value", f"'{field}' is missing; {tags}"
        case "union_tag_invalid":
            return _wrong_tag(keys, shape, tree, detail["ctx"])
        case "unusable_kind":
            return *_place_of_tag(keys, tree, detail["ctx"]["discriminator"]), str(detail["msg"])
        case "friction_path":
            return keys, "value" if isinstance(keys[-1], int) else "key", str(detail["msg"])
        case _:
            return keys, "value", _wrong_value(shape, detail, _value_at(tree, keys))


def _wrong_tag(keys: Keys, shape: Shape | None, tree: Any, context: Mapping[str, Any]) -> Fault:
    """An unknown model, method or form; a compensation's method may be implied by its name."""
    field, tag = context["discriminator"].strip("'"), context["tag"]
    tags = [str(name) for name in shape.tags()] if shape is not None else []
    message = f"unknown {field} {shown(tag)}; {allowed(tags)}{nearest(tag, tags)}"
    keys, aim = _place_of_tag(keys, tree, field)
    implied = f", or say which with '{field} = ...'" if aim == "key" else ""
    return keys, aim, f"{message}{implied}"


def _place_of_tag(keys: Keys, tree: Any, field: str) -> tuple[Keys, Aim]:
    """The place of a table's tag: `field`, or the table's own name."""
    value = _value_at(tree, keys)
    if isinstance(value, Mapping) and field not in value:
        return keys, "key"
    return (*keys, field), "value"


_WANTED = {
    "string_type": "text in quotes",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "int_parsing": "a whole number",
    "float_type": "a number",
    "float_parsing": "a number",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "tuple_type": "a list",
    "list_type": "a list",
    "dict_type": "a table",
    "model_type": "a table",
    "model_attributes_type": "a table",
}
_COMPARED = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def _wrong_value(shape: Shape | None, detail: ErrorDetails, written: Any = None) -> str:
    """The message; `written` is the value before the conversion of its unit, if known."""
    kind, value, context = detail["type"], detail["input"], detail.get("ctx", {})
    here = shown(value)
    if isinstance(value, float) and not math.isfinite(value):
        return f"{here} is not a finite number"
    if kind == "quantity":
        return str(detail["msg"])
    if kind == "literal_error":
        names = _literals(context["expected"])
        return f"{here} is not allowed here; {allowed(names)}{nearest(value, names)}"
    if kind in _COMPARED:
        limit, words = _COMPARED[kind]
        quantity = shape.quantity.here if shape is not None and shape.quantity else None
        unit = f" {quantity.si}" if quantity else ""
        here = shown(written) if isinstance(written, str) else f"{here}{unit}"
        return f"{here} is out of range; it must be {words} {context[limit]:g}{unit}"
    if kind in _WANTED:
        wanted = _WANTED[kind]
        if shape is not None and shape.quantity and "number" in wanted:
            quantity = shape.quantity.here
            wanted = f"{_a(quantity.name)} as text, such as {quantity.example}"
        if wanted == "a list" and isinstance(value, Mapping):
            return f"{here} is not a list; write [[{detail['loc'][-1]}]] for each of its tables"
        return f"{here} is not {wanted}"
    message = str(detail["msg"]).removeprefix("Value error, ")
    message = re.sub(r"^\w+ should", "it should", message).replace(" after validation", "")
    return f"{here}: {message}" if not isinstance(value, Mapping) else message


def _expected(shape: Shape | None) -> str:
    if shape is None:
        return ""
    if shape.quantity is not None:
        quantity, meaning = shape.quantity.here, in_axis_terms(shape.meaning)
        return f": {_a(quantity.name)} such as {quantity.example}; {meaning}"
    return f": {in_axis_terms(shape.meaning)}" if shape.meaning else ""


def _literals(expected: str) -> list[str]:
    """The names in pydantic's text `'a', 'b' or 'c'`."""
    return [part.strip().strip("'") for part in expected.replace(" or ", ", ").split(",")]


def _loose_values(model: type[BaseModel], tree: Any) -> Iterator[Fault]:
    """Faults of values that pydantic would convert silently: text or true for a number."""
    stack: list[tuple[Keys, Shape | None, Any]] = [((), Shape((model,)), tree)]
    while stack:
        keys, shape, value = stack.pop()
        if shape is None:
            continue
        if isinstance(value, Mapping | list):
            narrow = shape.narrowed(value)
            items = value.items() if isinstance(value, Mapping) else enumerate(value)
            stack += [((*keys, key), narrow.child(key), item) for key, item in items]
        elif shape.members and all(member in (int, float) for member in shape.members):
            is_text = isinstance(value, str) and shape.quantity is None
            if is_text or isinstance(value, bool):
                kind = "float_type" if float in shape.members else "int_type"
                detail: ErrorDetails = {"type": kind, "loc": (), "msg": "", "input": value}
                yield keys, "value", _wrong_value(shape, detail)
        elif shape.members == (bool,) and not isinstance(value, bool):
            yield keys, "value", f"{shown(value)} is not true or false"


def _value_at(tree: Any, keys: Keys) -> Any:
    for key in keys:
        try:
            tree = tree[key]
        except (KeyError, IndexError, TypeError):
            return None
    return tree


def _once_per_place(faults: Iterable[Fault]) -> list[Fault]:
    """One message per place, in the given order: each member of a union reports its own."""
    first: dict[tuple[Keys, Aim, str], Fault] = {}
    for keys, aim, message in faults:
        # Two missing fields of one table are two problems at one place.
        distinct = message if " is missing" in message else ""
        first.setdefault((keys, aim, distinct), (keys, aim, message))
    return list(first.values())
