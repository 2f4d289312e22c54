"""A parameter set that several friction models share, and its scales."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from pydantic import JsonValue, ValidationError
from scipy.optimize import brentq

from campaign.experiments.shared.friction_models import model_called
from campaign.physics.bench import Bench
from campaign.physics.friction import friction_models
from campaign.physics.friction.interface import FrictionOptions
from campaign.trial import Tree

FAR = 1e6
"""Rate (rad/s) far above a Stribeck curve."""


def options_of(model: str, given: Mapping[str, JsonValue], *, own: bool) -> FrictionOptions:
    """Options of a model with those of the given parameters that it has.

    Args:
        own: without the parameters that its source does not have (`FrictionModel.added`).

    Raises ValueError, with a message for the user.
    """
    known = model_called(model)
    fields = known.options.model_fields.keys() - (known.added if own else ())
    tree = {name: value for name, value in given.items() if name in fields} | {"model": model}
    try:
        return known.options.model_validate(tree)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, first["loc"]))
        raise ValueError(f"model '{model}': {where}: {first['msg']}") from None


def with_friction(bench: Bench, options: FrictionOptions) -> Tree:
    """The normalized bench with this friction as its only interface, named as its first."""
    name = next(iter(bench.friction))
    return bench.with_friction({name: options}).model_dump(mode="json")


def _dry(options: Any, rate: float) -> float:
    """Torque (N m) of steady sliding at a rate (rad/s), without the viscous part."""
    model = friction_models()[options.model]
    steady = float(model.steady_state(options, np.array([rate]))[0])
    return steady - model.viscous(options) * rate


@dataclass(frozen=True)
class Scale:
    """The sizes of a parameter set's own model, on an inertia (kg m^2).

    Attributes:
        static, coulomb: Ts and Tc (N m), the dry torque of slowest and of fastest sliding.
        velocity: vs (rad/s), where 37 % of Ts - Tc is left.
        viscous: sigma2 (N m s/rad).
        stiffness: sigma0 (N m/rad).
        own: s(0) (N m), the friction of slowest sliding of the tested model.
    """

    inertia: float
    static: float
    coulomb: float
    velocity: float
    viscous: float
    stiffness: float
    own: float

    @classmethod
    def of(cls, given: Mapping[str, JsonValue], inertia: float, tried: str) -> Self:
        """The scale of a set, for a tested model.

        Raises ValueError if the set's model has no Ts above Tc, viscous friction or stiffness.
        """
        options: Any = options_of(str(given.get("model", "")), given, own=False)
        model = friction_models()[options.model]

        def dry(rate: float) -> float:
            return _dry(options, rate)

        small = model.small_signal(options) if model.small_signal else None
        static, coulomb = dry(1.0 / FAR**2), dry(FAR)
        viscous = model.viscous(options)
        if small is None or small.stuck is None or not static > coulomb > 0.0 < viscous:
            raise ValueError(
                f'model = "{options.model}" of a set has no stiffness, no viscous friction, or no '
                "static torque above that of sliding; name one that has them, as lugre"
            )
        left = coulomb + (static - coulomb) / math.e
        exponent = brentq(lambda at: dry(math.exp(at)) - left, math.log(1.0 / FAR), math.log(FAR))
        own = _dry(options_of(tried, given, own=True), 1.0 / FAR**2)
        velocity, stiffness = math.exp(exponent), small.stuck.stiffness
        return cls(inertia, static, coulomb, velocity, viscous, stiffness, own)

    @property
    def excess(self) -> float:
        """Ts - Tc (N m)."""
        return self.static - self.coulomb

    @property
    def deflection(self) -> float:
        """Ts / sigma0 (rad): deflection of linear bristles before sliding."""
        return self.static / self.stiffness

    @property
    def amplitude(self) -> float:
        """s(0) / 2 sigma0 (rad): half the deflection of the tested model's bristles."""
        return 0.5 * self.own / self.stiffness

    @property
    def natural_rate(self) -> float:
        """Natural frequency (rad/s) of the load on the stiffness."""
        return math.sqrt(self.stiffness / self.inertia)
