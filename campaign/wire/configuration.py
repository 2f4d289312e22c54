"""A trial as named values for a controller, and back to a tree.

Names are dotted paths; `docs/developers/serial-protocol.md` lists them. All values are SI. `task.`,
`controller.`, `limits.` and `compensation.` apply to every controller, `rehearsal.` only to a
simulated bench.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from campaign.physics.bench import UNLIMITED
from campaign.trial import Trial, leaves
from campaign.wire.parameters import Value

REHEARSAL = "rehearsal"
ENDLESS = 1e300
"""Sent in place of an `"unlimited"` limit: numbers on the line are finite."""
SIMULATED_TASK = ("base_acceleration", "disturbance", "start_angle")
"""Fields of the task that apply only to a simulated bench."""


def configuration_of(trial: Trial) -> dict[str, Value]:
    """All settings of a rehearsal controller for `trial`, by name.

    Of the bench, it contains only the controller's part: gains, limits and selected compensation;
    and, under `rehearsal.bench.`, the fields set by the operator.
    """
    task = trial.task.model_dump(mode="python", exclude={"window"})
    simulated = {name: task.pop(name) for name in SIMULATED_TASK}
    bench: Mapping[str, Any] = trial.bench
    limits = {k: ENDLESS if v == UNLIMITED else v for k, v in bench["limits"].items()}
    tree: dict[str, Any] = {
        "task": task,
        "controller": bench["controller"],
        "limits": limits,
        REHEARSAL: {"seed": trial.seed, **simulated},
    }
    method = trial.task.compensation
    methods = trial.bench.get("compensation")
    if isinstance(methods, dict) and method in methods:
        tree["compensation"] = {method: methods[method]}
    settings = dict(flatten(tree))
    for path in trial.set_by_operator:
        value = at_path({"bench": trial.bench}, path)
        if value is not None:
            settings |= flatten({f"{REHEARSAL}.{path}": value})
    return settings


def flatten(tree: Mapping[str, Any]) -> Iterator[tuple[str, Value]]:
    """Every leaf of `tree` with its dotted name, except None."""
    for name, value in leaves(tree):
        if isinstance(value, list | tuple):
            yield name, tuple(float(each) for each in value)
        elif value is not None:
            yield name, value


def nest(settings: Mapping[str, Value]) -> dict[str, Any]:
    """Inverse of `flatten`. Raises ValueError if a name is both a value and a table."""
    tree: dict[str, Any] = {}
    for name, value in settings.items():
        *path, last = name.split(".")
        table = tree
        for key in path:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                raise ValueError(f"{name!r}: {key!r} is set to a value already")
        if last in table:
            raise ValueError(f"{name!r} is set twice")
        table[last] = value
    return tree


def at_path(tree: Mapping[str, Any], path: str) -> Any:
    """The value at the dotted `path`, or None."""
    value: Any = tree
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
