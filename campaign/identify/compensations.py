"""Identified twins of a bench's compensations.

A compensation models the sum of all friction, for any number of interfaces. So it receives the
sliding curve of both directions, even if that belongs to no single interface of the bench. The twin
stands beside its original, so that one test can compare both. Values that were not identified,
above all gains, are those of the original.

If all interfaces yield together, one bristle has the stiffness at rest. If some interfaces slip
first, as torque ramps show, one bristle is wrong with either stiffness: that at rest or that of the
strongest interface. The twin then has two bristles. The strongest has its own stiffness and share
of the torque; one for all weaker interfaces has the remainder of both. Only the sum of the damping
is known; it goes to the strongest, which slips last.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from campaign.estimate import Estimate, Origin
from campaign.identify.identification import Identification, Section
from campaign.parameter import Parameter
from campaign.physics.compensation.identified import ENDING, identified_name, stated_name
from campaign.trial import leaves

DIGITS = 6
"""Significant digits of a number in a bench file."""
WEAKER = "weaker"
"""Name of the interface that represents all interfaces which slip before the strongest."""
TORQUES = ("coulomb_torque", "static_torque")
CURVE = (*TORQUES, "stribeck_velocity", "viscous_friction")
"""Keys that a curve needs to replace another; the exponent is 2 without an estimate."""
EXPONENT, VISCOUS = "stribeck_exponent", "viscous_friction"
STIFFNESS, DAMPING = "bristle_stiffness", "bristle_damping"
DIRECTIONS = ("", "negative.")
INERTIA = "axis.inertia"
Number = Estimate | float


@dataclass(frozen=True)
class Entries:
    """Entries of a bench file by dotted path.

    Attributes:
        values: as written.
        known: intervals and origins for `known.values`.
    """

    values: dict[str, Any] = field(default_factory=dict)
    known: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Bristles:
    """Stiffness and damping of the sum of all friction, and its division; None: unknown."""

    at_rest: Estimate | None = None
    damping: Estimate | None = None
    strongest: Estimate | None = None
    weaker: Estimate | None = None

    @property
    def apart(self) -> tuple[Estimate, Estimate, Estimate] | None:
        """Stiffness at rest, strongest, weaker share; None unless known and some slip first."""
        if self.at_rest is None or self.strongest is None or self.weaker is None:
            return None
        if not self.strongest.value < self.at_rest.value:
            return None
        return self.at_rest, self.strongest, self.weaker


def identified_compensations(found: Identification, text: str) -> Entries:
    """Twins of the compensations of the bench file `text` that receive an identified value.

    Ignores twins that the file already has: see `without_identified`.
    """
    import tomlkit

    stated = tomlkit.parse(text).unwrap().get("compensation", {})
    entries = Entries()
    for name, options in found.bench.compensation.items():
        if stated_name(name) or name not in stated:
            continue
        if options.method == "observer":
            own = dict(_of_observer(found.sections))
        elif options.method == "friction-model" and len(options.friction) == 1:
            ((key, friction),) = options.friction.items()
            own = dict(_of_friction(key, friction, found))
        else:
            continue
        if own:
            _add(entries, name, {"method": options.method, **stated[name]}, own)
    return entries


def without_identified(text: str) -> str:
    """Bench file without the twins of an earlier identification."""
    import tomlkit

    document = tomlkit.parse(text)
    compensations: Any = document.get("compensation", {})
    old = [name for name in compensations if name.endswith(ENDING)]
    if not old:
        return text
    for name in old:
        del compensations[name]
    known: Any = document.get("known", {})
    begins = tuple(f"compensation.{name}." for name in old)
    for path in [each for each in known.get("values", {}) if each.startswith(begins)]:
        del known["values"][path]
    return document.as_string()


def _add(
    entries: Entries, name: str, stated: Mapping[str, Any], own: Mapping[str, Number | str]
) -> None:
    """Add the twin of a compensation: stated values, replaced by its own identified values."""
    twin = f"compensation.{identified_name(name)}"
    replaced = {path.rpartition(".")[0] for path in own if path.endswith(".coulomb_torque")}
    for path, value in leaves(stated):
        table, _, key = path.rpartition(".")
        if key in (*CURVE, EXPONENT) and table.removesuffix(".negative") in replaced:
            continue  # `own` replaces the whole curve
        entries.values[f"{twin}.{path}"] = value
    for path, number in own.items():
        if isinstance(number, Estimate):
            entries.values[f"{twin}.{path}"] = amount(number.value, number.unit)
            entries.known[f"{twin}.{path}"] = known_of(number)
        else:
            entries.values[f"{twin}.{path}"] = number


def _of_observer(sections: Sequence[Section]) -> Iterator[tuple[str, Number]]:
    """Inertia for an observer, as in the bench file: that of the last method with an estimate."""
    inertias = [each for each in _measured(sections) if each.bench == INERTIA]
    if inertias:
        yield "inertia", inertias[-1].estimate


def _of_friction(key: str, options: Any, found: Identification) -> Iterator[tuple[str, Any]]:
    """Values for the friction model of a compensation, by path within its table."""
    fields = type(options).model_fields
    if found.bench.at_load(options) != (1.0, 1.0) or not set(CURVE) <= set(fields):
        return
    curve = _curve(found.sections)
    bristles = _bristles(found) if STIFFNESS in fields else Bristles()
    path = f"friction.{key}."
    if bristles.apart is not None and curve:
        yield from _two_bristles(path, curve, bristles.apart, bristles.damping, options.model)
        return
    yield from ((path + name, number) for name, number in curve.items())
    if bristles.at_rest is not None:
        yield path + STIFFNESS, bristles.at_rest
    if bristles.damping is not None:
        yield path + DAMPING, bristles.damping


def _two_bristles(
    path: str,
    curve: Mapping[str, Number],
    apart: tuple[Estimate, Estimate, Estimate],
    damping: Estimate | None,
    model: str,
) -> Iterator[tuple[str, Any]]:
    rest, strongest, weaker = apart
    other = f"friction.{WEAKER}."
    yield other + "model", model
    for name, number in curve.items():
        kind = name.removeprefix("negative.")
        if kind in TORQUES and isinstance(number, Estimate):
            yield path + name, _part(number, weaker, own=False)
            yield other + name, _part(number, weaker, own=True)
            continue
        yield path + name, number
        if kind != VISCOUS:
            yield other + name, number
    yield path + STIFFNESS, strongest
    yield other + STIFFNESS, _less(rest, strongest)
    if damping is not None:
        yield path + DAMPING, damping
        yield other + DAMPING, amount(0.0, damping.unit)


def _curve(sections: Sequence[Section]) -> dict[str, Number]:
    """Last curve that is complete in both directions; empty without one."""
    for section in reversed(sections):
        lumped = {e.lumped: e.estimate for e in _measured([section]) if e.lumped}
        if all(side + name in lumped for side in DIRECTIONS for name in CURVE):
            curve: dict[str, Number] = {}
            for side in DIRECTIONS:
                curve |= {side + name: lumped[side + name] for name in CURVE}
                curve[side + EXPONENT] = lumped.get(side + EXPONENT, 2.0)
            return curve
    return {}


def _bristles(found: Identification) -> Bristles:
    of_motions = _named(found.sections, "presliding")
    of_ramps = _named(found.sections, "ramps")
    known = Bristles(
        of_motions.get("stiffness_at_rest"),
        of_motions.get("bristle_damping"),
        of_ramps.get("strongest_stiffness"),
        of_ramps.get("weaker_share"),
    )
    # Several interfaces may not yield together: one bristle cannot have the sum of their stiffness.
    several = len(found.bench.friction) > 1
    return replace(known, at_rest=None) if several and known.apart is None else known


def _named(sections: Sequence[Section], method: str) -> dict[str, Estimate]:
    own = [each for each in sections if each.model.name == method]
    return {e.estimate.name: e.estimate for e in _measured(own) if e.estimate.value > 0.0}


def _measured(sections: Sequence[Section]) -> list[Parameter]:
    """Measured parameters with an interval, of any sign."""
    return [
        each
        for section in sections
        for each in section.identified.parameters
        if each.estimate.origin is Origin.MEASURED and each.estimate.has_interval
    ]


def _part(whole: Estimate, weaker: Estimate, *, own: bool) -> Estimate:
    """The weaker interfaces' share of a torque (`own`), or the remainder."""
    share = weaker.value if own else 1.0 - weaker.value
    half = math.hypot(share * whole.half_width, whole.value * weaker.half_width)
    return _around(whole, share * whole.value, half)


def _less(whole: Estimate, part: Estimate) -> Estimate:
    half = math.hypot(whole.half_width, part.half_width)
    return _around(whole, whole.value - part.value, half)


def _around(one: Estimate, value: float, half: float) -> Estimate:
    """Estimate with another value and one interval that includes the systematic parts."""
    return replace(
        one, value=value, low=value - half, high=value + half, standard_error=None, systematic=()
    )


def amount(value: float, unit: str) -> Any:
    """Text with the unit; a float without a unit."""
    return f"{value:.{DIGITS}g} {unit}" if unit else float(f"{value:.{DIGITS}g}")


def known_of(estimate: Estimate) -> dict[str, Any]:
    """Entry of an estimate in `known.values`."""
    low, high = estimate.combined
    if low is None or high is None:
        return {"origin": "measured"}
    ends = [amount(end, estimate.unit) for end in (low, high)]
    return {"interval": ends, "origin": "measured"}
