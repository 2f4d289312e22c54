"""Means of the ramps of a breakaway test, effects of ramp rate and dwell, and parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from campaign.estimate import OF_ONE_TRIAL, Estimate, Origin
from campaign.estimation.gate import admitted
from campaign.estimation.intervals import (
    difference,
    of_repeats,
    shifted_by,
    student,
    welch,
    with_error,
)
from campaign.estimation.presliding import Presliding
from campaign.experiments.interface import TrialData
from campaign.experiments.shared.systematic import shared_parts
from campaign.parameter import Parameter
from campaign.reason import NONE
from campaign.result import Value

MEASURED = ("breakaway_torque", "bristle_stiffness", "stiffness_at_rest")
"""Quantities that a ramp measures."""
QUANTITIES = (*MEASURED, "bristle_damping")
CAUSES = {"ramp rate": "torque_rate", "dwell": "rest"}
"""Causes that may shift all ramps of a test equally; the option whose sweep shows the shift."""
BOTH = "both"
OF_A_RAMP = ("measurement", "position", "direction")
"""Conditions in which the ramps of one place differ, and which a mean does not have."""


@dataclass(frozen=True)
class Ramps:
    """The ramps of one place in the sweep.

    Attributes:
        trials: completed trials, one for each ramp.
        places: conditions of each trial, with its direction.
        found: metrics of each trial, by name.
    """

    trials: tuple[TrialData, ...]
    places: tuple[Mapping[str, Value], ...]
    found: tuple[Mapping[str, Estimate], ...]

    @property
    def directions(self) -> tuple[str, ...]:
        """Directions in the order of execution."""
        return tuple(dict.fromkeys(str(place["direction"]) for place in self.places))

    def values(self, quantity: str, direction: str = BOTH) -> list[Estimate]:
        """Estimates of a quantity from the ramps of a direction that have it."""
        return [
            own[quantity]
            for place, own in zip(self.places, self.found, strict=True)
            if quantity in own and direction in (BOTH, place["direction"])
        ]


def means_of(ramps: Ramps) -> dict[str, dict[str, Estimate]]:
    """Means over positions by direction (`both` first, if there are two) and quantity."""
    by_direction = {
        direction: {
            quantity: mean(quantity, values)
            for quantity in QUANTITIES
            if (values := ramps.values(quantity, direction))
        }
        for direction in ramps.directions
    }
    if len(by_direction) < 2:
        return by_direction
    one, other = by_direction.values()
    both = {name: _between(one[name], other[name]) for name in one if name in other}
    return {BOTH: both, **by_direction}


def mean(quantity: str, found: Sequence[Estimate]) -> Estimate:
    """Mean over ramps: Student's t over them; the interval is not narrower than theirs imply.

    If a ramp has no interval, the mean has one only if the ramps scatter at least three times as
    much as their standard errors explain. A bound among the ramps makes the mean a bound.
    """
    value = float(np.mean([each.value for each in found]))
    unit, count = found[0].unit, len(found)
    systematic = shared_parts(found)
    base = next((each for each in found if each.is_bound or _assumed(each)), None)
    if base is not None:
        lacking = next((each for each in found if math.isnan(_end(each, base))), None)
        if lacking is not None:
            more = {"systematic": systematic, "origin": lacking.origin}
            return Estimate.without_interval(quantity, value, unit, lacking.reason, **more)
        value = float(np.mean([_end(each, base) for each in found]))
        return replace(
            base, value=value, low=None, high=None, level=None, standard_error=None, freedom=None,
            systematic=systematic,
        )  # fmt: skip
    own = [each.standard_error or 0.0 for each in found]
    inner = math.sqrt(float(np.mean(np.square(own))) / count)
    inner_freedom = float(sum(each.freedom or 0.0 for each in found))
    reason = next((each.reason for each in found if not each.has_interval), NONE)
    rule = found[0].origin is Origin.ASSUMED
    if count == 1:
        alone = found[0].reason or (OF_ONE_TRIAL() if found[0].has_interval else NONE)
        return replace(found[0], systematic=systematic, reason=alone)
    outer = float(np.std([each.value for each in found], ddof=1)) / math.sqrt(count)
    if reason and outer < 3.0 * inner:
        return Estimate.without_interval(quantity, value, unit, reason, systematic=systematic)
    method = f"mean of {count} ramps, Student's t"
    scatter = with_error(quantity, value, unit, outer, count - 1, method, systematic=systematic)
    within = with_error(quantity, value, unit, inner, inner_freedom, method, systematic=systematic)
    widest = max((scatter, within), key=lambda each: each.half_width if each.has_interval else 0.0)
    return _as_assumed(widest, found[0]) if rule else admitted(widest)


def _as_assumed(estimate: Estimate, rule: Estimate) -> Estimate:
    """An estimate with origin and reason of a rule; its interval covers the measured part only."""
    return replace(estimate, origin=rule.origin, reason=rule.reason)


def _assumed(estimate: Estimate) -> bool:
    """Whether an estimate is assumed and has no interval."""
    return estimate.origin is Origin.ASSUMED and not estimate.has_interval


def _end(estimate: Estimate, told: Estimate) -> float:
    """Contribution to a mean with bounds like `told`: the end on that side, or NaN without one."""
    if not told.is_bound or estimate.kind == told.kind:
        return estimate.value
    end = estimate.low if told.kind == "at least" else estimate.high
    return math.nan if end is None else end


def _between(one: Estimate, other: Estimate) -> Estimate:
    """Mean of the means of two directions with independent ramps."""
    systematic = shared_parts((one, other))
    base = next(
        (each for each in (one, other) if not each.has_interval and not each.is_bound), None
    )
    base = base or next((each for each in (one, other) if each.is_bound), None)
    if base is not None:
        value = 0.5 * (_end(one, base) + _end(other, base))
        more = {"origin": base.origin, "kind": base.kind, "method": base.method}
        return Estimate.without_interval(
            one.name, value, one.unit, base.reason, systematic=systematic, **more
        )
    errors = [each.standard_error or 0.0 for each in (one, other)]
    freedom = welch((errors[0], one.freedom), (errors[1], other.freedom))
    value, method = 0.5 * (one.value + other.value), "mean of both directions, Welch"
    error = 0.5 * math.hypot(*errors)
    average = with_error(one.name, value, one.unit, error, freedom, method, systematic=systematic)
    return _as_assumed(average, one) if one.origin is Origin.ASSUMED else admitted(average)


def compared(ramps: Ramps, groups: Sequence[Ramps]) -> Ramps:
    """Ramps with systematic parts of ramp rate and dwell, by comparison with the other groups."""
    sizes = {
        (quantity, source): _shift(ramps, groups, quantity, source)
        for quantity in MEASURED
        for source in CAUSES
    }
    metrics = tuple(
        {
            name: _with_parts(each, [(source, sizes[name, source]) for source in CAUSES])
            if name in MEASURED
            else each
            for name, each in own.items()
        }
        for own in ramps.found
    )
    return replace(ramps, found=metrics)


def _with_parts(estimate: Estimate, parts: Sequence[tuple[str, float | None]]) -> Estimate:
    for source, size in parts:
        estimate = shifted_by(estimate, source, size)
    return estimate


def _shift(ramps: Ramps, groups: Sequence[Ramps], quantity: str, source: str) -> float | None:
    """Shift of a quantity by ramp rate or dwell (1 sigma); None if no other group shows it.

    The shift of a ramp rate is extrapolated linearly to rate zero; that of a dwell is the
    difference. A difference that is not significant counts as 0.
    """
    option = CAUSES[source]
    sizes = []
    for other in groups:
        if not _differ_only_in(option, ramps, other):
            continue
        own, beside = ramps.values(quantity), other.values(quantity)
        if not own or not beside:
            continue
        change = difference(quantity, mean(quantity, own), mean(quantity, beside), own[0].unit)
        scatter = student(change.freedom or math.inf) * (change.standard_error or 0.0)
        significant = abs(change.value) > scatter
        sizes.append(abs(change.value) * _reach(option, ramps, other) if significant else 0.0)
    return max(sizes) / math.sqrt(3.0) if sizes else None  # evenly likely up to there (GUM 4.3.7)


def option_of(ramps: Ramps, name: str) -> float:
    """An option of the ramps (SI) by name; NaN without one."""
    value = ramps.trials[0].trial.options.get(name)
    return float(value) if isinstance(value, int | float) else math.nan


def _reach(option: str, ramps: Ramps, other: Ramps) -> float:
    if option != "torque_rate":
        return 1.0
    own, beside = option_of(ramps, option), option_of(other, option)
    return own / abs(beside - own)


def _differ_only_in(option: str, one: Ramps, other: Ramps) -> bool:
    if one is other or option_of(one, option) == option_of(other, option):
        return False
    return _rest(one, option) == _rest(other, option)


def _rest(ramps: Ramps, option: str) -> dict[str, Value]:
    own = (*OF_A_RAMP, option)
    return {name: value for name, value in ramps.places[0].items() if name not in own}


BREAKAWAY, STRONGEST = "breakaway_torque", "strongest_stiffness"
WEAKER = "weaker_share"
OF_RAMPS = {BREAKAWAY: BREAKAWAY, STRONGEST: "bristle_stiffness"}
"""Quantity that the ramps measure, by parameter of the rig."""
MEANINGS = {
    BREAKAWAY: "Torque at which the load begins to slide.",
    STRONGEST: "Stiffness of the interface that carries the largest torque, by itself.",
    WEAKER: "Share of the torque that other interfaces carry, which slip before that one.",
}
ADVICE = {
    BREAKAWAY: "more ramps",
    STRONGEST: "more ramps, and faster ones where noise hides the beginning",
    WEAKER: "more, and slower, ramps",
}


def parameters_of(
    groups: Sequence[Ramps], curve_of: Callable[[TrialData, float], Presliding], notes: list[str]
) -> Iterator[Parameter]:
    """Parameters of all ramps together; of both directions if there are two.

    curve_of: the presliding curve of a ramp, by its breakaway torque (N m).
    """
    ramps = Ramps(
        tuple(item for each in groups for item in each.trials),
        tuple(place for each in groups for place in each.places),
        tuple(own for each in groups for own in each.found),
    )
    if not ramps.found:
        return
    mean, *_ = means_of(ramps).values()
    for name, quantity in OF_RAMPS.items():
        if quantity in mean:
            yield Parameter(replace(mean[quantity], name=name), MEANINGS[name], advice=ADVICE[name])
    shares = list(_weaker_shares(ramps, curve_of, notes))
    seen = [share for share in shares if share > 0.0]
    if 0 < len(seen) < len(shares):
        notes.append(
            f"{len(seen)} of {len(shares)} ramps show that some interfaces slip before the others; "
            "that share is not stated, since the other ramps do not."
        )
    elif seen:
        share = of_repeats(WEAKER, seen, "", "ramps")
        for cause in CAUSES:  # at 2 N m/s the interval alone held in 31 of 40 draws
            share = shifted_by(share, cause, None)
        yield Parameter(share, MEANINGS[WEAKER], "percent", advice=ADVICE[WEAKER])


def _weaker_shares(
    ramps: Ramps, curve_of: Callable[[TrialData, float], Presliding], notes: list[str]
) -> Iterator[float]:
    """Share of the torque on the weaker interfaces of each ramp; 0 if it shows only one."""
    for item, own in zip(ramps.trials, ramps.found, strict=True):
        if OF_RAMPS[STRONGEST] not in own:
            continue
        try:
            torques = [e.torque for e in curve_of(item, own[BREAKAWAY].value).interfaces]
        except (ValueError, ArithmeticError) as error:  # of metrics that another version archived
            notes.append(f"{item.trial.label} shows no interfaces: {error}.")
            continue
        yield sum(torques[1:]) / sum(torques)
