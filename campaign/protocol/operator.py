"""Operator steps: `[[test.operator]]`, rendered at each point."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from string import Formatter
from typing import Any

from pydantic import BaseModel

from campaign.axis_kind import sides_in
from campaign.errors import Problem
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.protocol.points import Point
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, shown
from campaign.protocol.schema import OperatorEntry, Test
from campaign.protocol.shapes import shape_at
from campaign.text import nearest
from campaign.units import convert


class PlaceholderError(ValueError):
    """An invalid text of a step, with a message for the user."""


def setup_at(test: Test, point: Point) -> tuple[str, ...]:
    """The operator steps before the trials of `point`, in order."""
    return tuple(_rendered(entry, test.experiment.options, point) for entry in test.entry.operator)


def set_by_operator(test: Test) -> tuple[str, ...]:
    """The swept paths that the operator sets, each once."""
    return tuple(dict.fromkeys(path for entry in test.entry.operator for path in entry.sets))


def operator_problems(test: Test, point: Point) -> Iterator[Problem]:
    """Problems of the steps of `test`, checked at one `point`."""
    swept = [axis.path for axis in test.axes]
    for index, entry in enumerate(test.entry.operator):
        try:
            _rendered(entry, test.experiment.options, point)
        except PlaceholderError as error:
            yield test.origin.problem(("operator", index, "text"), "value", str(error))
        for place, path in enumerate(entry.sets):
            if path not in swept:
                message = f"{shown(path)} is not swept by this test's matrix; {allowed(swept)}"
                message += nearest(path, swept)
                yield test.origin.problem(("operator", index, "sets", place), "value", message)


def _rendered(entry: OperatorEntry, options: type[Options], point: Point) -> str:
    """The text with its placeholders filled; set values without a placeholder are appended."""
    text, placeholders = "", set()
    try:
        parts = list(Formatter().parse(entry.text))
    except ValueError as error:
        raise PlaceholderError(f"{error}; a brace itself is written twice: '{{{{'") from None
    for literal, path, form, conversion in parts:
        text += literal
        if path is None:
            continue
        if form or conversion:
            raise PlaceholderError(f"'{{{path}…}}': a placeholder is a path in braces, no more")
        placeholders.add(path)
        text += _value_text(path, options, point)
    others = [path for path in entry.sets if path not in placeholders]
    values = [f"{p} = {_value_text(p, options, point)}" for p in others if p in point.values]
    return f"{text} ({', '.join(values)})" if values else text


def _value_text(path: str, options: type[Options], point: Point) -> str:
    """The value at a dotted path of the point's options or, after `bench.`, of its bench."""
    keys: Keys = tuple(path.split("."))
    model: type[BaseModel] = options
    tree: Any = point.options_tree
    if keys[0] == "bench":
        model, tree, keys = Bench, point.bench_tree, keys[1:]
    value = tree
    for key in keys:
        if not isinstance(value, Mapping) or key not in value:
            raise PlaceholderError(_unknown(path, point))
        value = value[key]
    if isinstance(value, Mapping | list):
        raise PlaceholderError(
            f"'{path}' is {shown(value)}; name a single value" + _slip(path, point)
        )
    shape = shape_at(model, tree, keys)
    quantity = shape.quantity.of(sides_in(point.bench_tree)) if shape and shape.quantity else None
    if quantity is not None and isinstance(value, int | float):
        return f"{convert(value, quantity.si, quantity.display):.6g} {quantity.display}"
    if isinstance(value, float):
        return f"{value:.6g}"
    return "none" if value is None else shown(value).strip("'")


def _unknown(path: str, point: Point) -> str:
    message = f"nothing is called '{path}'; name an option of this test, or a field of its bench"
    return f"{message} as bench.…{_slip(path, point)}"


def _slip(path: str, point: Point) -> str:
    names = [*_leaves(point.options_tree, ""), *_leaves(point.bench_tree, "bench.")]
    return nearest(path, names)


def _leaves(tree: Mapping[str, Any], prefix: str) -> Iterator[str]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{prefix}{key}.")
        elif not isinstance(value, list):
            yield f"{prefix}{key}"
