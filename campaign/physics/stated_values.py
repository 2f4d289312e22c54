"""Values and uncertainties that a bench file states for findings."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import BaseModel

from campaign.estimate import Estimate, Origin
from campaign.physics.bench import Bench
from campaign.physics.bench_knowledge import NORMAL_95, number_at
from campaign.physics.true_values import true_value

LEVEL = 0.95
SMALL = 1e-3
"""Relative change of a value for the test whether a number depends on it."""


def stated_value(
    bench: Bench, quantity: str, conditions: Mapping[str, Any], unit: str
) -> Estimate | None:
    """Number (SI) that results from the bench's stated values, with its interval.

    First order in the stated standard uncertainties, with the stated correlations (GUM 5.1.2,
    5.2.2). Its origin is *measured* if all values were measured, else *given*. None if the bench
    has no such number, or if a friction or known value that it depends on has no uncertainty: the
    interval would not include it.

    Args:
        quantity, conditions: of a finding (`true_value`).
        unit: of the finding.
    """
    value = true_value(bench, quantity, conditions)
    if value is None:
        return None
    effects: dict[str, float] = {}
    origins = set()
    for path in dict.fromkeys((*_of_friction(bench), *bench.known.values)):
        number = number_at(bench, path)
        if number is None:
            continue
        sigma = bench.known_uncertainty(path)
        moved = _moved(bench, path.split("."), number[0] + (sigma or SMALL * (number[0] or 1.0)))
        other = true_value(moved, quantity, conditions)
        if other == value:
            continue
        if other is None or sigma is None:
            return None
        effects[path] = other - value
        origins.add(bench.known.values[path].origin)
    if not effects:
        return None
    sigma = math.sqrt(_variance(effects, bench))
    return Estimate(
        quantity,
        value,
        unit,
        value - NORMAL_95 * sigma,
        value + NORMAL_95 * sigma,
        LEVEL,
        "stated in the bench file",
        origin=Origin.MEASURED if origins == {"measured"} else Origin.GIVEN,
        standard_error=sigma,
    )


def _variance(effects: Mapping[str, float], bench: Bench) -> float:
    total = math.fsum(effect**2 for effect in effects.values())
    for one, other, share in bench.known.correlations:
        if one in effects and other in effects:
            total += 2.0 * share * effects[one] * effects[other]
    return max(total, 0.0)


def _of_friction(bench: Bench) -> Iterator[str]:
    """Paths of all options of the bench's friction."""
    for name, options in bench.friction.items():
        for field in type(options).model_fields:
            if isinstance(getattr(options, field), BaseModel):
                within = type(getattr(options, field)).model_fields
                yield from (f"friction.{name}.{field}.{key}" for key in within)
            else:
                yield f"friction.{name}.{field}"


def _moved(tree: Any, keys: list[str], value: float) -> Any:
    """A copy of the bench with another value at a path."""
    if not keys:
        return value
    key, *rest = keys
    if isinstance(tree, Mapping):
        return {**tree, key: _moved(tree[key], rest, value)}
    return tree.model_copy(update={key: _moved(getattr(tree, key), rest, value)})
