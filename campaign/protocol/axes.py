"""Validation of a matrix: existing paths and valid values."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import BaseModel

from campaign.errors import Problem
from campaign.physics.bench import Bench
from campaign.protocol.files import Origin
from campaign.protocol.matrix import (
    LARGEST_PLAN,
    RANGE_KEYS,
    Axis,
    Range,
    RangeEntry,
    count_points,
    make_range,
)
from campaign.protocol.positions import Keys
from campaign.protocol.problems import allowed, find_faults, shown, validate
from campaign.protocol.schema import Test, TestEntry, replaced, with_values
from campaign.protocol.shapes import Shape
from campaign.text import nearest


def make_axis(
    path: str, written: Any, origin: Origin, options: type[BaseModel], trees: Mapping[str, Any]
) -> Axis | list[Problem]:
    """The axis of one key of a matrix; `trees`: the test's `options` and `bench` without it."""
    parts = tuple(path.split("."))
    of_bench = parts[0] == "bench"
    keys: Keys = parts[1:] if of_bench else parts
    model, tree = (Bench, trees["bench"]) if of_bench else (options, trees["options"])
    wrong = _wrong_path(model, tree, keys, "bench." if of_bench else "")
    if wrong:
        return [origin.problem((), "key", wrong)]
    values = _values(written, origin)
    if not isinstance(values, Range) and values and isinstance(values[0], Problem):
        return list(values)
    return Axis(path, keys, of_bench, values, origin, listed=isinstance(written, list))


def value_problems(test: Test) -> Iterator[Problem]:
    """Problems of swept values: each with the first value of every other axis.

    Only the ends of a range are checked; they bound the values between them. A fault elsewhere in a
    bench is also due to the value, because the bench is valid without it. A fault elsewhere in the
    options may depend on the whole point, which the plan validates.
    """
    options = with_values(test.options, ((axis, 0) for axis in test.axes if not axis.of_bench))
    bench = with_values(test.bench, ((axis, 0) for axis in test.axes if axis.of_bench))
    for axis in test.axes:
        yield from _repeated(axis)
        tree = bench if axis.of_bench else options
        model: type[BaseModel] = Bench if axis.of_bench else test.experiment.options
        for index in range(len(axis)) if axis.listed else sorted({0, len(axis) - 1}):
            origin = axis.value_origin(index)
            valid = find_faults(model, replaced(tree, axis.keys, axis.value(index)))
            for keys, aim, message in valid if isinstance(valid, list) else ():
                if keys[: len(axis.keys)] == axis.keys:
                    yield origin.problem(keys[len(axis.keys) :], aim, message)
                elif axis.of_bench:
                    elsewhere = ".".join(str(key) for key in keys)
                    message = f"with this value, {elsewhere}: {message}"
                    yield origin.problem((), "value", message)


def _repeated(axis: Axis) -> Iterator[Problem]:
    """Problems of equal values: their trials would be identical, even in their seed."""
    seen: set[str] = set()
    for index in range(len(axis)) if axis.listed else ():
        value = repr(axis.value(index))
        if value in seen:
            message = f"{shown(axis.value(index))} stands there twice; to repeat, use 'repeat'"
            yield axis.value_origin(index).problem((), "value", message)
        seen.add(value)


def is_large(axes: Sequence[Axis], repeat: int) -> bool:
    """Whether a matrix alone makes a plan too large; its values are then not checked."""
    return count_points(axes) * repeat > LARGEST_PLAN


def _wrong_path(model: type[BaseModel], tree: Any, keys: Keys, prefix: str) -> str:
    """Reason for which `keys` cannot be swept; "" if they can."""
    if not keys:
        return "a bench as a whole cannot be swept; write one [[test]] for each bench"
    if not prefix and keys[0] in TestEntry.model_fields:
        return f"'{keys[0]}' belongs to the whole test and cannot be swept"
    shape: Shape | None = Shape((model,))
    for depth, key in enumerate(keys):
        around = shape.narrowed(tree) if shape is not None else Shape(())
        # A number may abbreviate a table, but then it has no parts.
        names = () if isinstance(tree, int | float) else around.names()
        names = tuple(dict.fromkeys((*names, *(tree if isinstance(tree, Mapping) else ()))))
        shape = around.child(key) if key in names else None
        if shape is None:
            if not names:
                whole = ".".join(str(part) for part in keys[:depth])
                target = shown(f"{prefix}{whole}.{key}")
                return f"nothing to sweep at {target}: {shown(whole)} has no parts"
            before = prefix + "".join(f"{part}." for part in keys[:depth])
            paths = [f"{before}{name}" for name in names] + ([] if prefix else ["bench.…"])
            slip = nearest(f"{before}{key}", paths)
            return f"nothing to sweep at {shown(f'{before}{key}')}; {allowed(paths)}{slip}"
        tree = tree.get(key) if isinstance(tree, Mapping) else None
    return ""


def _values(written: Any, origin: Origin) -> Sequence[Any] | Range:
    """The values of an axis; a list that begins with a Problem if they are invalid."""
    if isinstance(written, list):
        if not written:
            return [origin.problem((), "value", "an empty list; name at least one value")]
        return written
    if not isinstance(written, Mapping) or not RANGE_KEYS & written.keys():
        ranges = "{ start, stop, num, spacing } or { start, stop, step }"
        message = f"{shown(written)} is no sweep; write a list, {ranges}"
        return [origin.problem((), "value", message)]
    entry = validate(RangeEntry, written, origin)
    if isinstance(entry, list):
        return entry
    try:
        return make_range(entry)
    except ValueError as error:
        return [origin.problem((), "value", str(error))]
