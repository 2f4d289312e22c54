"""Conversion of parameters from a host to a trial on the simulated bench."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pydantic import ValidationError

from campaign.physics.bench import Bench
from campaign.physics.complete import CompleteBench, complete
from campaign.physics.limits import margins
from campaign.trial import Task, Trial
from campaign.wire.codes import NakCode
from campaign.wire.configuration import REHEARSAL, SIMULATED_TASK, nest
from campaign.wire.parameters import Value

TABLES = ("task", "controller", "limits", "compensation", REHEARSAL)
"""Valid first parts of names."""


@dataclass(frozen=True)
class ConfigurationRefusal(Exception):  # noqa: N818 - a refusal is an answer, not an error
    """Reason for the refusal of a configuration: the content of a NAK."""

    code: NakCode
    name: str
    text: str


def check_name(name: str) -> None:
    """Raise ConfigurationRefusal if `name` is not a valid parameter name."""
    if name.partition(".")[0] not in TABLES:
        raise ConfigurationRefusal(
            NakCode.UNKNOWN_NAME, name, f"names begin with one of {', '.join(TABLES)}"
        )


def make_trial(bench: CompleteBench, parameters: Mapping[str, Value]) -> Trial:
    """The trial that `parameters` describe, on `bench` (the bench of the controller).

    If the host sets limits or the gains of a loop, they replace the controller's own completely;
    other loops keep their gains. Of the bench itself, only fields set by the operator change.
    Raises ConfigurationRefusal.
    """
    try:
        tree = nest(parameters)
    except ValueError as error:
        raise ConfigurationRefusal(NakCode.WRONG_TYPE, "", str(error)) from None
    rehearsal = tree.get(REHEARSAL, {})
    changed = _bench(bench, tree, rehearsal.get("bench", {}))
    task = _task(tree.get("task", {}), rehearsal)
    if task.compensation != "none" and task.compensation not in changed.compensation:
        raise ConfigurationRefusal(
            NakCode.OUT_OF_RANGE, "task.compensation", f"there is no {task.compensation!r}"
        )
    _check_limits(bench, changed, task)
    seed = rehearsal.get("seed", 0)
    if isinstance(seed, bool) or not isinstance(seed, int) or seed < 0:
        raise ConfigurationRefusal(
            NakCode.OUT_OF_RANGE, f"{REHEARSAL}.seed", "a whole number, not below 0"
        )
    tree = changed.model_dump(mode="json")
    return Trial(number=1, test=REHEARSAL, kind=REHEARSAL, seed=seed, bench=tree, task=task)


def _bench(
    bench: CompleteBench, tree: Mapping[str, Any], by_person: Mapping[str, Any]
) -> CompleteBench:
    base = bench.model_dump(mode="json")
    own = base["controller"]
    for table in ("controller", "limits"):
        if table in tree:
            base[table] = tree[table]
    if isinstance(
        base["controller"], Mapping
    ):  # a host that knows no gains leaves them as they are
        gains = {loop: own[loop] for loop in ("rate", "current")}
        base["controller"] = {**gains, **base["controller"]}
    base["compensation"] = {**base["compensation"], **tree.get("compensation", {})}
    base = _merged(base, by_person)
    try:
        return complete(Bench.model_validate(base, context={"si": True}))
    except ValidationError as error:
        raise _refused(error, "") from None


def _task(tree: Mapping[str, Any], rehearsal: Mapping[str, Any]) -> Task:
    simulated = {name: rehearsal[name] for name in SIMULATED_TASK if name in rehearsal}
    window = (0.0, tree.get("duration", 0.0))  # the host selects a window: a bench records all
    try:
        return Task.model_validate({**tree, **simulated, "window": window}, context={"si": True})
    except ValidationError as error:
        raise _refused(error, "task.") from None


def _check_limits(own: CompleteBench, bench: CompleteBench, task: Task) -> None:
    for name, bound in own.limits:
        wanted = getattr(bench.limits, name)
        if wanted > bound * (1 + 1e-9):
            text = f"{wanted:g} is beyond the controller's own limit of {bound:g}"
            raise ConfigurationRefusal(NakCode.OUT_OF_RANGE, f"limits.{name}", text)
    for margin in margins(bench, task):
        if margin.broken:
            text = f"the {margin.called} would be {margin.value:.6g} {margin.unit}"
            text += f"; the limit is {margin.bound:.6g}"
            raise ConfigurationRefusal(NakCode.LIMIT, f"limits.{margin.limit}", text)


def _merged(tree: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    out = dict(tree)
    for key, value in changes.items():
        before = out.get(key)
        both = isinstance(before, Mapping) and isinstance(value, Mapping)
        out[key] = _merged(before, value) if both else value  # type: ignore[arg-type]
    return out


def _refused(error: ValidationError, prefix: str) -> ConfigurationRefusal:
    """Refusal from the first error of pydantic."""
    first = error.errors(include_url=False)[0]
    name = prefix + ".".join(str(key) for key in first["loc"])
    kind = first["type"]
    if kind == "missing":
        code = NakCode.INCOMPLETE
    elif kind == "extra_forbidden":
        code = NakCode.UNKNOWN_NAME
    else:
        code = NakCode.WRONG_TYPE if kind.endswith(("_type", "_parsing")) else NakCode.OUT_OF_RANGE
    return ConfigurationRefusal(code, name, first["msg"])
