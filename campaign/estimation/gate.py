"""Admission of a parameter: is it determined, and physically possible?

A parameter is *determined* if its interval is narrow relative to its value, or to a relevant size
on this rig. It is *possible* if a rig can have it. A parameter that may be zero and cannot be
negative has an upper bound as result. A refused parameter keeps value and interval, and is *not
determined*, with a reason: it has no key, and no place in a bench file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from campaign.estimate import Estimate, Origin
from campaign.reason import Cause, Reason

USELESS = 0.5
"""Largest half-width of a determined parameter, over the larger of value and relevant size."""
MATTERS = 0.05
"""Share of the largest recorded force below which a force is irrelevant on a rig."""
NOT_NEGATIVE = {
    "breakaway", "bristle", "coefficient", "coulomb", "damping", "inertia", "static", "stiffness",
    "stribeck", "viscous",
}  # fmt: skip
"""Words in names of nonnegative parameters; names of ratios and changes contain `over`."""
FRICTION = ("friction_positive", "friction_negative")
"""Names of friction at one speed."""

TOO_WIDE = Cause("interval too wide", "its interval is wider than ±{percent:.0f} % of it")
UNPHYSICAL = Cause("unphysical", "it is negative, which no rig has: {cause}")
OPPOSITE_SIGNS = Cause(
    "opposite signs",
    "inertia and friction both are, so force and motion have opposite signs (`sign = -1` in the "
    "mapping reverses one)",
)
COMPENSATED = Cause(
    "friction compensated",
    "the inertia is not, so the recorded force was probably compensated for friction before "
    "(record the whole force)",
)
SCALE_OR_DELAY = Cause(
    "scale or delay",
    "friction is not, so the acceleration is not that of this force (check scale, time base and "
    "filters of the motion)",
)
CONSTANT_FORCE = Cause(
    "constant force",
    "only in one direction, so a constant force is larger than friction (subtract the zero of the "
    "sensor, or the weight)",
)
ONE_SIDED = Cause("counterpart unphysical", "friction of the other direction is negative: {cause}")
NEGATIVE = Cause("negative", "check sign, scale and zero of force and motion")


def admitted(estimate: Estimate, matters: float = 0.0, cause: Reason | None = None) -> Estimate:
    """Estimate for the report: unchanged, as an upper bound, or refused.

    Args:
        matters: size (in the estimate's unit) below which it is irrelevant on this rig; 0: unknown.
        cause: likely cause of a negative value.
    """
    if estimate.origin is not Origin.MEASURED or estimate.kind != "number":
        return estimate
    positive, (low, high) = cannot_be_negative(estimate.name), estimate.combined
    if _is_negative(estimate):
        return refused(estimate, UNPHYSICAL(cause=cause or NEGATIVE()))
    if estimate.half_width > USELESS * max(abs(estimate.value), matters):
        return refused(estimate, TOO_WIDE(percent=100.0 * USELESS))
    if positive and low is not None and high is not None and low <= 0.0:
        unknown = tuple(p for p in estimate.systematic if p.standard_uncertainty is None)
        return replace(
            estimate, value=high, low=None, high=None, standard_error=None, freedom=None,
            kind="at most", systematic=unknown,
        )  # fmt: skip
    return estimate


def admitted_together(
    found: Mapping[str, Estimate], matters: Mapping[str, float]
) -> dict[str, Estimate]:
    """Parameters of one model, by name; the set of negative ones determines the likely cause."""
    negative = {name for name, one in found.items() if _is_negative(one)}
    passed = {}
    for name, one in found.items():
        other = _counterpart(name) in negative
        alone = name.startswith("coulomb") and (name in negative) != other
        cause = CONSTANT_FORCE() if alone else _likely(negative, found)
        passed[name] = admitted(one, matters.get(name, 0.0), cause)
        if alone and name not in negative and one.origin is Origin.MEASURED:
            passed[name] = refused(one, ONE_SIDED(cause=cause))
    return passed


def mattering(name: str, force: float, rate: float) -> float:
    """Size of a friction parameter below which it is irrelevant (N m, or N m s/rad).

    force, rate: the largest recorded ones (N m, rad/s).
    """
    return MATTERS * force / (rate if name.startswith("viscous") else 1.0)


def refused(estimate: Estimate, reason: Reason) -> Estimate:
    """Not determined, with unchanged value and interval, so that a reader sees the uncertainty."""
    return replace(estimate, origin=Origin.NOT_DETERMINED, reason=reason)


def cannot_be_negative(name: str) -> bool:
    """Whether a parameter of this name is nonnegative on every rig."""
    words = set(name.split("_"))
    return name in FRICTION or (bool(words & NOT_NEGATIVE) and "over" not in words)


def _is_negative(one: Estimate) -> bool:
    """Whether a nonnegative parameter has a negative interval, or value without an interval."""
    high = one.combined[1]
    return cannot_be_negative(one.name) and (one.value if high is None else high) < 0.0


def _counterpart(name: str) -> str:
    """Name of the other direction; the same name where there is none."""
    swapped = {"positive": "negative", "negative": "positive"}
    stem, _, side = name.rpartition("_")
    return f"{stem}_{swapped[side]}" if side in swapped else name


def _likely(negative: set[str], found: Iterable[str]) -> Reason:
    if any("inertia" in name for name in negative):
        return OPPOSITE_SIGNS() if len(negative) > 1 else SCALE_OR_DELAY()
    dry = any("coulomb" in name for name in negative)
    return COMPENSATED() if dry and any("inertia" in name for name in found) else NEGATIVE()
