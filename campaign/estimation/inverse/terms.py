"""Terms of an inverse dynamic model: the columns of its regression.

    force = inertia * acceleration + viscous * rate + coulomb * sign(rate) + offset + ...

Units are those of a rotary axis; `campaign.axis_kind` converts them for a linear one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.arrays import Array
from campaign.estimation.inverse.motion import Motion

Terms = Sequence["Term"]


@dataclass(frozen=True)
class Term:
    """One column.

    Attributes:
        name: of its coefficient.
        symbol: in the model's formula.
        unit: of the coefficient (SI, rotary).
        meaning: one sentence.
        column: of shape (n,), from a motion before decimation.
        family: terms of one family describe the same effect. A model has at most one of them,
            because with two neither coefficient has a meaning.
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    column: Callable[[Motion], Array]
    family: str = ""


def _positive(motion: Motion) -> Array:
    return np.asarray(motion.rate > 0, dtype=float)


def _negative(motion: Motion) -> Array:
    return np.asarray(motion.rate < 0, dtype=float)


WARM = 20.0
"""Reference temperature (degC), at which the terms over temperature are zero."""


def _warmer(motion: Motion) -> Array:
    if motion.temperature is None:
        raise ValueError("no temperature was recorded")
    return motion.temperature - WARM


ALL = (
    Term("inertia", "a", "kg m^2", "What resists acceleration.", lambda m: m.acceleration),
    Term("viscous", "v", "N m s/rad", "Friction that grows with the rate.", lambda m: m.rate),
    Term("viscous_positive", "v+", "N m s/rad", "Viscous friction, positive direction.",
         lambda m: m.rate * _positive(m)),
    Term("viscous_negative", "v-", "N m s/rad", "Viscous friction, negative direction.",
         lambda m: m.rate * _negative(m)),
    Term("coulomb", "sign v", "N m", "Dry friction.", lambda m: np.sign(m.rate)),
    Term("coulomb_positive", "(v > 0)", "N m", "Dry friction, positive direction.", _positive),
    Term("coulomb_negative", "-(v < 0)", "N m", "Dry friction, negative direction.",
         lambda m: -_negative(m)),
    Term("offset", "1", "N m", "A constant: a sensor's zero, or a constant load.",
         lambda m: np.ones_like(m.rate)),
    Term("gravity_sine", "sin q", "N m", "Weight out of balance, across.",
         lambda m: np.sin(m.position), family="place"),
    Term("gravity_cosine", "cos q", "N m", "Weight out of balance, along.",
         lambda m: np.cos(m.position)),
    Term("spring", "q", "N m/rad", "A cable's stiffness.", lambda m: m.position, family="place"),
    Term("square_root", "sign v √|v|", "N m s/rad",
         "Friction that bends, as of thin films: times √(|v| · v₁), with v₁ = 1 in SI units.",
         lambda m: np.sign(m.rate) * np.sqrt(np.abs(m.rate)), family="bend"),
    Term("quadratic", "v |v|", "N m s^2/rad^2", "Drag.", lambda m: m.rate * np.abs(m.rate),
         family="bend"),
    Term("coulomb_over_temperature", "ΔT sign v", "N m/K",
         "How dry friction changes with heat, from that at 20 °C on.",
         lambda m: _warmer(m) * np.sign(m.rate)),
    Term("viscous_over_temperature", "ΔT v", "N m s/(rad K)",
         "How viscous friction changes with heat, from that at 20 °C on.",
         lambda m: _warmer(m) * m.rate),
    Term("coulomb_over_temperature_squared", "ΔT² sign v", "N m/K^2",
         "How that change bends, as of a viscosity that falls exponentially.",
         lambda m: _warmer(m) ** 2 * np.sign(m.rate)),
    Term("viscous_over_temperature_squared", "ΔT² v", "N m s/(rad K^2)",
         "How that change bends, as of a viscosity that falls exponentially.",
         lambda m: _warmer(m) ** 2 * m.rate),
)  # fmt: skip
"""All terms except those of a spatial period, which `periodic` returns."""
TERMS: Mapping[str, Term] = {term.name: term for term in ALL}
SYMMETRIC = ("inertia", "viscous", "coulomb", "offset")
DIRECTIONAL = (
    "inertia",
    "viscous_positive",
    "viscous_negative",
    "coulomb_positive",
    "coulomb_negative",
)
"""Separate terms of both directions; an offset would be the difference of two of them."""


def periodic(period: float) -> tuple[Term, ...]:
    """Terms of force and friction with a `period` (rad, or m): sine and cosine of each."""

    def wave(motion: Motion, shape: Callable[[Array], Array]) -> Array:
        return np.asarray(shape(2.0 * np.pi * motion.position / period))

    cogging = "Force over position, whatever the direction."
    ripple = "Friction over position."
    return (
        Term("cogging_sine", "sin(2πq/p)", "N m", cogging, lambda m: wave(m, np.sin)),
        Term("cogging_cosine", "cos(2πq/p)", "N m", cogging, lambda m: wave(m, np.cos)),
        Term("ripple_sine", "sign v sin(2πq/p)", "N m", ripple,
             lambda m: np.sign(m.rate) * wave(m, np.sin)),
        Term("ripple_cosine", "sign v cos(2πq/p)", "N m", ripple,
             lambda m: np.sign(m.rate) * wave(m, np.cos)),
    )  # fmt: skip


def columns(motion: Motion, terms: Terms) -> Array:
    """Columns of all terms, shape (n, k)."""
    return np.column_stack([term.column(motion) for term in terms])
