"""Common parts of analyses: groups of trials, conditions, picks from a sweep."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from pydantic import ValidationError

from campaign.estimate import Estimate
from campaign.experiments.interface import TestData, TrialData
from campaign.physics.bench import Bench
from campaign.reason import Cause
from campaign.result import Array, Result, Value
from campaign.trial import Tree, Trial, canonical_json
from campaign.units import TORQUE

OF_NO_OPTION = {"average_friction": TORQUE}
"""Quantities of conditions that are neither options of their experiment nor paths of a bench."""
COUNTED = Cause("counted", "counted")
OF_RECORDING = Cause("describes the recording", "it describes this recording")


def of_recording(name: str, value: float, unit: str) -> Estimate:
    """A number that describes one recording: it has no interval."""
    return Estimate.without_interval(name, value, unit, OF_RECORDING())


METHOD_LABELS = {
    "none": "no compensation",
    "static": "static model",
    "lugre": "LuGre model",
    "observer": "disturbance observer",
}

SHORT_LABELS = {"none": "none", "static": "static", "lugre": "LuGre", "observer": "observer"}
"""Labels for narrow places: under an axis, beside a dot."""


def method(name: object) -> str:
    """`the LuGre model`; a name of the bench is unchanged."""
    return f"the {METHOD_LABELS[str(name)]}" if str(name) in METHOD_LABELS else str(name)


def short_label(name: str) -> str:
    """Short label of a compensation; a name of the bench is unchanged."""
    return SHORT_LABELS.get(name, name)


def method_label(name: str) -> str:
    """Label of a compensation on the page; a name of the bench is unchanged."""
    return METHOD_LABELS.get(name, name)


def grouped(
    trials: Iterable[TrialData], own: Sequence[str] = ()
) -> dict[str, tuple[TrialData, ...]]:
    """Trials by sweep point, in plan order, without the conditions named in `own`.

    Repeats of a point are in one group. The keys are canonical JSON of the point.
    """
    groups: dict[str, list[TrialData]] = {}
    for data in trials:
        point = {path: v for path, v in data.trial.point.items() if path not in own}
        groups.setdefault(canonical_json(point), []).append(data)
    return {key: tuple(group) for key, group in groups.items()}


def number_of(trial: Trial, name: str) -> float:
    """A number of the trial's sweep point (SI)."""
    return float(str(trial.point[name]))


def by_value(trials: Iterable[TrialData], name: str) -> dict[float, tuple[TrialData, ...]]:
    """Trials by a number of their points (SI), ascending; repeats are in one group."""
    groups: dict[float, list[TrialData]] = {}
    for item in trials:
        groups.setdefault(number_of(item.trial, name), []).append(item)
    return {value: tuple(groups[value]) for value in sorted(groups)}


def swept(data: TestData, own: Sequence[str] = ()) -> tuple[str, ...]:
    """Dotted paths that the test's matrix sweeps, in the order of the protocol."""
    paths: dict[str, None] = {}
    for item in data.trials:
        paths |= {path: None for path in item.trial.point if path not in own}
    return tuple(paths)


def conditions(data: TrialData, *names: str) -> dict[str, Value]:
    """Named options of the trial and its whole sweep point, for findings and table rows."""
    options: Mapping[str, object] = data.trial.options
    values = {name: options.get(name) for name in names} | data.trial.point
    return {k: v for k, v in values.items() if v is None or isinstance(v, str | int | float | bool)}


def joined(results: Iterable[Result]) -> Result:
    """The results of several analyses, concatenated."""
    every = tuple(results)
    return Result(
        tuple(table for each in every for table in each.tables),
        tuple(figure for each in every for figure in each.figures),
        tuple(finding for each in every for finding in each.findings),
        tuple(note for each in every for note in each.notes),
    )


def closed(x: Array, y: Array) -> tuple[Array, Array]:
    """A cycle, shape (n,), with its first sample again at its end."""
    return np.append(x, x[0]), np.append(y, y[0])


def correlations(names: Sequence[str], matrix: Array) -> dict[tuple[str, str], float]:
    """Correlation of each pair of names; matrix: shape (k, k)."""
    return {
        (one, other): float(matrix[i, j])
        for i, one in enumerate(names)
        for j, other in enumerate(names[:i])
    }


def numbered(results: Iterable[Result]) -> Result:
    """Joined results of several places; if there are several, their keys get its number."""
    every = list(results)
    if len(every) > 1:
        every = [_keyed(each, number) for number, each in enumerate(every, start=1)]
    return joined(every)


def _keyed(result: Result, number: int) -> Result:
    return replace(
        result,
        tables=tuple(replace(each, key=f"{each.key}-{number}") for each in result.tables),
        figures=tuple(replace(each, key=f"{each.key}-{number}") for each in result.figures),
    )


def of_each_place(
    trials: Iterable[TrialData],
    own: Sequence[str],
    analyse: Callable[[tuple[TrialData, ...]], Result],
) -> Result:
    """Joined results of each sweep point, without the conditions named in `own`."""
    return numbered(map(analyse, grouped(trials, own).values()))


def compensation_of(bench: Bench, name: str) -> Any:
    """The options of a compensation. Raises ValueError if the bench has none of that name."""
    if name not in bench.compensation:
        named = ", ".join(bench.compensation) or "none"
        raise ValueError(f"the bench '{bench.name}' has no compensation '{name}'; it has {named}")
    return bench.compensation[name]


def parameter_paths(
    interfaces: Mapping[str, Mapping[str, Any]], where: str, parameter: str
) -> dict[str, float]:
    """Dotted path to value (SI) of a parameter, in every interface and direction that has it."""
    return {
        f"{where}.{name}.{prefix}{parameter}": float(table[parameter])
        for name, model in interfaces.items()
        for prefix, table in (("", model), ("negative.", model.get("negative") or {}))
        if isinstance(table.get(parameter), float | int)
    }


def with_changes(bench: Bench, changes: Mapping[str, Any]) -> Tree:
    """The normalized bench with other values (SI) at dotted paths, for `TrialRequest.bench`.

    `with_changes(bench, {"friction.load.coulomb_torque": 30.0})`. Raises ValueError, with a message
    for the user, for a path that the bench does not have and for an invalid value.
    """
    tree: Tree = bench.model_dump(mode="json")
    for path, value in changes.items():
        *above, last = path.split(".")
        table: Any = tree
        for key in above:
            table = table.get(key) if isinstance(table, dict) else None
        if not isinstance(table, dict) or last not in table:
            close = difflib.get_close_matches(path, list(_paths(bench.model_dump(mode="json"))), 1)
            hint = f"; the nearest is '{close[0]}'" if close else ""
            raise ValueError(f"the bench '{bench.name}' has no '{path}'{hint}")
        table[last] = value
    try:
        return Bench.model_validate(tree, context={"si": True}).model_dump(mode="json")
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(key) for key in first["loc"])
        message = first["msg"].removeprefix("Value error, ")
        raise ValueError(f"the bench '{bench.name}' cannot have {where}: {message}") from None


def _paths(tree: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    for key, value in tree.items():
        yield prefix + key
        if isinstance(value, dict):
            yield from _paths(value, f"{prefix}{key}.")
