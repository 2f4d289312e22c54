"""Friction models as sets of unknowns, and their residual force along motions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import FilterSettings, Motion, decimated, first_kept
from campaign.estimation.inverse.rows import all_rows, late_force, moving
from campaign.estimation.inverse.terms import TERMS, Term
from campaign.estimation.objective import Values
from campaign.estimation.unknowns import Unknown
from campaign.experiments.shared.friction_models import model_called
from campaign.physics.friction import friction_models
from campaign.physics.friction.unknowns import EXPONENT, DerivedOption, FrictionUnknown, Sizes
from campaign.physics.friction_response import Along

USUAL = ("stribeck", "lugre")
"""Models that are fitted by default; the first one with directions alike, too."""
EXPONENT_FREE = ", exponent free"
"""Suffix of the name of a model with a fitted exponent."""
WAYS = (("directions alike", False), ("by direction", True))


@dataclass(frozen=True)
class Model:
    """A friction model with both directions alike, or each with its own torques.

    Attributes:
        name: `lugre by direction`.
        model: name of the friction model.
        numbers: fitted ones.
        derived: options that follow from several of them.
    """

    name: str
    model: str
    numbers: tuple[FrictionUnknown, ...]
    derived: tuple[DerivedOption, ...] = ()

    @property
    def unknowns(self) -> tuple[Unknown, ...]:
        """Unknowns of `numbers`, in that order."""
        return tuple(
            Unknown(each.name, each.low, each.high, each.start, each.logarithmic)
            for each in self.numbers
        )

    def with_exponent_free(self, values: Mapping[str, float]) -> Model | None:
        """The model with the exponent of its Stribeck curve as a further unknown.

        None without an exponent, or if it is free already. values: of a fit, to start from.
        """
        has_exponent = "stribeck_exponent" in friction_models()[self.model].options.model_fields
        names = {each.name for each in self.numbers}
        if not has_exponent or EXPONENT.name in names or "stribeck_velocity" not in names:
            return None
        numbers = (*(replace(each, start=values[each.name]) for each in self.numbers), EXPONENT)
        return replace(self, name=f"{self.name}{EXPONENT_FREE}", numbers=numbers)

    def options(self, values: Mapping[str, float]) -> dict[str, Any]:
        """An interface's options (SI) from the values of unknowns, by name."""
        flat = {each.key: values[each.name] for each in self.numbers if each.key}
        flat |= {each.key: each.value(values) for each in self.derived}
        tree: dict[str, Any] = {"model": self.model}
        for key, value in flat.items():
            head, _, tail = key.partition(".")
            if tail:
                tree.setdefault(head, {})[tail] = value
            else:
                tree[head] = value
        return tree


def models(sizes: Sizes, names: Sequence[str] = USUAL) -> Sequence[Model]:
    """Models to fit, in order; the first one with directions alike, too.

    Raises ValueError for an unknown model, and for one that declares no unknowns.
    """
    found: list[Model] = []
    for name in names:
        unknowns = model_called(name).unknowns
        if unknowns is None:
            known = friction_models()
            fitted = ", ".join(each for each in known if known[each].unknowns is not None)
            raise ValueError(f"{name} does not say what is fitted of it; there are {fitted}")
        for suffix, by_direction in WAYS[1:] if found else WAYS:
            stated = unknowns(sizes, by_direction)
            numbers = tuple(each for each in stated if isinstance(each, FrictionUnknown))
            derived = tuple(each for each in stated if isinstance(each, DerivedOption))
            found.append(Model(f"{name}, {suffix}", name, numbers, derived))
    return found


STEPS = 10
"""Fewest simulated steps of a row: rates of a motion are low-passed, and rows even more."""
KEPT = 16
"""Simulations in the cache: more than a model has numbers. Derivatives by inertia, delay and linear
terms use the friction of the point itself."""


def steps_between(filtering: FilterSettings) -> int:
    """Samples from one simulated step to the next, a divisor of the distance of rows."""
    most = max(1, filtering.decimation // STEPS)
    return next(n for n in range(most, 0, -1) if filtering.decimation % n == 0)


class Residuals:
    """Residual force of a model along motions; only friction is nonlinear and filtered again."""

    def __init__(
        self,
        names: Sequence[str],
        model: Model,
        extra: Sequence[Term],
        motions: Sequence[Motion],
        filtering: FilterSettings,
        every: int = 1,
    ) -> None:
        """names: of the values. every: samples from one simulated step to the next."""
        terms = (TERMS["inertia"], *extra)
        self._places = [names.index(term.name) for term in terms]
        self._own = [names.index(each.name) for each in model.unknowns]
        self._delay = names.index("delay")
        self._model = model
        self._forces = [late_force(motion, filtering) for motion in motions]
        self._columns = [all_rows(motion, terms, filtering).columns for motion in motions]
        self._moves = [moving(motion, filtering) for motion in motions]
        self._along = [Along.rates(*_thinned(motion, every)) for motion in motions]
        self._counts = [-(-(len(each.time) - filtering.skip) // every) for each in motions]
        self._decimation = filtering.decimation // every
        self._friction = lru_cache(KEPT)(self._simulated)

    def __call__(self, values: Values) -> list[Array]:
        """Residuals, shape (n,) for each motion; zero in rows in which the axis does not move."""
        return [
            (force - modelled) * moves
            for force, modelled, moves in zip(
                self.forces(values), self.modelled(values), self._moves, strict=True
            )
        ]

    def forces(self, values: Values) -> list[Array]:
        """Rows of the recorded forces at the delay."""
        return [each(values[self._delay]) for each in self._forces]

    def modelled(self, values: Values) -> list[Array]:
        """Forces of the model."""
        linear = np.array([values[place] for place in self._places])
        friction = self._friction(tuple(values[place] for place in self._own))
        return [
            columns @ linear + each for columns, each in zip(self._columns, friction, strict=True)
        ]

    def _simulated(self, own: Values) -> list[Array]:
        named = {u.name: value for u, value in zip(self._model.unknowns, own, strict=True)}
        options = self._model.options(named)
        return [
            decimated(each.friction(options)[-count:, None], self._decimation)[:, 0]
            for each, count in zip(self._along, self._counts, strict=True)
        ]


def _thinned(motion: Motion, every: int) -> tuple[Array, float, float]:
    """Each `every`-th rate including the last, their sample rate, and the position at the first."""
    first = first_kept(len(motion.rate), every)
    rates = motion.rate[first::every]
    return rates, motion.sample_rate / every, float(motion.position[first])
