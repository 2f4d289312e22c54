"""What the virtual experiments on friction share: one bench with its friction in several models."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from pydantic import JsonValue, ValidationError

from campaign.experiments.common import grouped
from campaign.experiments.interface import TrialData
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.result import Column, Value
from campaign.trial import Tree

LABELS = {"stribeck": "static model", "lugre": "LuGre model"}
SERIES = {"stribeck": "static"}
"""Models that are drawn like the compensation built on them; any other has its own name's look."""


def model_label(name: str) -> str:
    """A friction model as it is called on the page."""
    return LABELS.get(name, f"{name} model")


def model_series(name: str) -> str:
    """The series, and so the look, of a friction model's curves."""
    return SERIES.get(name, name)


def in_models(
    bench: Bench, models: Sequence[str]
) -> Iterator[tuple[dict[str, JsonValue], Tree | None]]:
    """Sweep point and bench for each model; the bench as it is (None) when none is named."""
    if not models:
        yield {}, None
    for name in models:
        yield {"model": name}, with_model(bench, name)


def with_model(bench: Bench, name: str) -> Tree:
    """The normalised bench with every friction interface described by the model `name`.

    Parameters that both models have are kept; others are dropped, and with them what scatter and
    preload say of them. Raises ValueError, with a message for the user, for an unknown model and
    for one that needs more than the bench says.
    """
    known = friction_models()
    if name not in known:
        close = difflib.get_close_matches(name, list(known), 1)
        hint = f"; did you mean '{close[0]}'?" if close else ""
        raise ValueError(
            f"no friction model is called '{name}'; there are {', '.join(known)}{hint}"
        )
    options = known[name].options
    tree: Any = bench.model_dump(mode="json", include={"friction"})
    friction: dict[str, Any] = {}
    for interface, fields in tree["friction"].items():
        kept = {k: v for k, v in fields.items() if k in options.model_fields} | {"model": name}
        try:
            friction[interface] = options.model_validate(kept, context={"si": True})
        except ValidationError as error:
            where = ", ".join(".".join(map(str, e["loc"])) for e in error.errors())
            raise ValueError(
                f"friction.{interface} of the bench '{bench.name}' cannot be described by the "
                f"model '{name}': see {where}"
            ) from None
    described: Tree = bench.with_friction(friction).model_dump(mode="json")
    return described


@dataclass(frozen=True)
class Place:
    """Trials that differ only in what their experiment varies itself.

    Attributes:
        point: the rest of the sweep that they share.
        label: the same for people; empty when there is nothing to tell apart.
    """

    point: dict[str, Value]
    label: str
    trials: tuple[TrialData, ...]

    @property
    def columns(self) -> tuple[Column, ...]:
        """Of a table that lists several places."""
        return tuple(Column(path, "Model" if path == "model" else path) for path in self.point)


def places(trials: Iterable[TrialData], own: Sequence[str]) -> tuple[Place, ...]:
    """Trials by model and sweep, in plan order; `own` is what the experiment varies itself."""
    found = []
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
        found.append(Place(point, ", ".join(words), group))
    return tuple(found)
