"""The bench of virtual friction experiments, with friction in several models."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import JsonValue, ValidationError

from campaign.estimate import Estimate
from campaign.estimation.intervals import shifted_by
from campaign.estimation.sampled_curve import together
from campaign.experiments.interface import Metrics, TrialData, metrics
from campaign.experiments.shared.common import by_value, grouped
from campaign.options import Options
from campaign.physics.bench import Bench
from campaign.physics.engine_version import ENGINE, TORQUE_ERRORS
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionModel
from campaign.reason import Cause
from campaign.result import Column, Value
from campaign.text import nearest, pretty_unit
from campaign.trial import Tree

LABELS = {"stribeck": "static model", "lugre": "LuGre model"}
PARAMETER_LABELS = {
    "bristle_stiffness": "bristle stiffness σ0",
    "bristle_damping": "bristle damping σ1",
    "viscous_friction": "viscous friction σ2",
    "static_torque": "static torque Ts",
    "coulomb_torque": "Coulomb torque Tc",
    "stribeck_velocity": "Stribeck velocity vs",
    "stribeck_exponent": "Stribeck exponent δ",
}
"""Labels of parameters on the page; the last word is the symbol."""
SERIES = {"stribeck": "static"}
"""Models with the curve style of the compensation built on them; others have their own style."""


def model_label(name: str) -> str:
    """Label of a friction model on the page."""
    return LABELS.get(name, f"{name} model")


def model_series(name: str) -> str:
    """The series, which sets the style, of a friction model's curves."""
    return SERIES.get(name, name)


def model_called(name: str) -> FrictionModel:
    """A friction model. Raises ValueError, with a message for the user, for an unknown one."""
    known = friction_models()
    if name not in known:
        hint = nearest(name, known) or f"; there are {', '.join(known)}"
        raise ValueError(f"there is no friction model {name!r}{hint}")
    return known[name]


def in_models(
    bench: Bench, models: Sequence[str]
) -> Iterator[tuple[dict[str, JsonValue], Tree | None]]:
    """Sweep point and bench for each model; without models the unchanged bench (None)."""
    if not models:
        yield {}, None
    for name in models:
        yield {"model": name}, with_model(bench, name)


def with_model(bench: Bench, name: str) -> Tree:
    """The normalized bench with every friction interface described by the model `name`.

    Parameters that both models have are kept. Others are dropped, with their entries in scatter and
    preload. Raises ValueError, with a message for the user, for an unknown model and for one that
    needs parameters that the bench does not state.
    """
    options = model_called(name).options
    tree: Any = bench.model_dump(mode="json", include={"friction"})
    friction: dict[str, Any] = {}
    for interface, fields in tree["friction"].items():
        kept = _shared(fields, options) | {"model": name}
        try:
            friction[interface] = options.model_validate(kept, context={"si": True})
        except ValidationError as error:
            where = ", ".join(".".join(map(str, e["loc"])) for e in error.errors())
            raise ValueError(
                f"friction.{interface} of the bench '{bench.name}' cannot be described by the "
                f"model '{name}': see {where}"
            ) from None
    return bench.with_friction(friction).model_dump(mode="json")


def _shared(given: Mapping[str, Any], options: type[Options]) -> dict[str, Any]:
    """Entries that the options have, also in nested tables."""
    entries = {}
    for name, field in options.model_fields.items():
        if name in given:
            value, inner = given[name], field.annotation
            if isinstance(inner, type) and issubclass(inner, Options):
                value = _shared(value, inner)
            entries[name] = value
    return entries


@dataclass(frozen=True)
class ConditionGroup:
    """Trials that differ only in the conditions that their experiment varies itself.

    Attributes:
        point: their common sweep point, without those conditions.
        label: the point as text; empty for an empty point.
    """

    point: dict[str, Value]
    label: str
    trials: tuple[TrialData, ...]

    @property
    def columns(self) -> tuple[Column, ...]:
        """Columns of the point, for a table that lists several groups."""
        return tuple(
            Column(path, "Model" if path == "model" else path, exact=True) for path in self.point
        )

    def by(self, name: str) -> dict[float, tuple[TrialData, ...]]:
        """Trials by the condition `name` (SI), ascending; repeats are in one group."""
        return by_value(self.trials, name)


OF_ONE = (
    "Without repeats an interval is of one recording: repeat the test to measure the scatter "
    "between trials. --check-step measures the error of the simulation's time step."
)
"""For the note of a table of virtual experiments."""
NONE_RESOLVED = Cause(
    "not resolved by the simulation", "it does not exceed the error of simulated friction, {error}"
)
RESOLVED = TORQUE_ERRORS[ENGINE]
"""of a friction torque: largest error of a simulation at its usual step."""


def simulated(found: Iterable[Estimate]) -> tuple[Estimate, ...]:
    """Numbers of a simulation, with a systematic part of unknown size for its time step.

    Neither samples nor repeats show this part. Half the step may change such a number by a
    thousandth, while its cycles agree to the last digit. Counts have no such part.
    """
    return tuple(
        each if each.kind == "count" else shifted_by(each, "time step of the simulation", None)
        for each in found
    )


def resolved(found: Estimate, friction: float) -> Estimate:
    """A difference of simulated friction; 0 if it does not exceed the error of the engine.

    friction: reference of the relative error `RESOLVED`, in the unit of `found`.
    """
    error = RESOLVED * friction
    if not found.is_determined or not abs(found.value) <= error:
        return found
    reason = NONE_RESOLVED(error=f"{error:.2g} {pretty_unit(found.unit)}".rstrip())
    parts = found.systematic
    return Estimate.without_interval(found.name, 0.0, found.unit, reason, systematic=parts)


def combined(
    trials: Sequence[TrialData], measure: Callable[[TrialData], Sequence[Estimate]]
) -> dict[str, Estimate]:
    """Metrics that all repeats have, by name, combined by `sampled_curve.together`."""
    each = [metrics(item, measure) for item in trials]
    names = [name for name in each[0] if all(name in values for values in each)]
    return Metrics({name: together([values[name] for values in each]) for name in names})


def places(trials: Iterable[TrialData], own: Sequence[str]) -> tuple[ConditionGroup, ...]:
    """Trials by sweep point, in plan order, without the conditions `own` of the experiment."""
    groups = []
    for group in grouped(trials, own).values():
        point: dict[str, Value] = {
            path: value
            for path, value in group[0].trial.point.items()
            if path not in own and isinstance(value, str | int | float | bool)
        }
        words = [
            model_label(str(value)) if path == "model" else f"{path} = {value}"
            for path, value in point.items()
        ]
        groups.append(ConditionGroup(point, ", ".join(words), group))
    return tuple(groups)
