"""Conclusions of a breakaway test: breakaway torque and stiffness."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from campaign.estimate import OF_ONE_TRIAL
from campaign.experiments.shared.conclusion_parts import (
    Part,
    Parts,
    Settings,
    between,
    conclusion,
    count,
    ends_of,
    listed,
    of,
    ramps,
    ratio_of,
    setting,
    shown_by,
    varied,
)
from campaign.result import Amount, Conclusion, Factor, Finding, Value

TORQUE, STIFFNESS, AT_REST = "breakaway_torque", "bristle_stiffness", "stiffness_at_rest"
IN_NEGATIVE = ("more in the negative", "less in the negative")
OF_RAMP = ("direction", "statistic", "position", "measurement")


def breakaway_conclusions(
    findings: Sequence[Finding],
    rates: Sequence[float],
    settings: Settings,
    *,
    inertia_known: bool = True,
    slid: bool = False,
) -> tuple[Conclusion, ...]:
    """Of the means over positions, and of the range of positions.

    Args:
        rates: slopes of the ramps (N m/s).
        slid: whether the load slid in any of them.
    """
    findings = [_marked(each, findings) for each in findings]
    means = _top([each for each in findings if each.conditions.get("statistic") == "mean"])
    torques = of(means, TORQUE)
    if not torques and not inertia_known:
        return (conclusion("No breakaway torque: the inertia is not known"),)
    if not torques and slid:
        told = "The load slid, and no recording shows at which torque it broke away"
        return (conclusion(told),)
    if not torques:
        return (conclusion("No ramp came to a breakaway torque"),)
    ramp = ramps(rates)
    places = [_place(each) for each in torques]
    if len(torques) > 1:
        paths = varied(places)
        return tuple(_over_sweep(means, ramp, paths, settings))
    return tuple(_of_one(findings, torques[0], of(means, STIFFNESS), of(means, AT_REST), ramp))


def _place(finding: Finding) -> dict[str, Value]:
    return {k: v for k, v in finding.conditions.items() if k not in OF_RAMP}


def _marked(finding: Finding, findings: Sequence[Finding]) -> Finding:
    """A mean with the remark that its interval is of one trial, where a direction has one ramp."""
    told = finding.known
    if finding.conditions.get("statistic") != "mean" or not told.has_interval or told.reason:
        return finding
    ramps = [
        str(each.conditions.get("direction"))
        for each in findings
        if each.quantity == finding.quantity
        and "statistic" not in each.conditions
        and _place(each) == _place(finding)
    ]
    way = str(finding.conditions.get("direction"))
    counts = [ramps.count(each) for each in (set(ramps) if way == "both" else {way})]
    if 1 not in counts:
        return finding
    return Finding.of(replace(told, reason=OF_ONE_TRIAL()), finding.conditions)


def _top(means: Sequence[Finding]) -> list[Finding]:
    """Of each place that of both directions, where there are two."""
    both = [each for each in means if each.conditions.get("direction") == "both"]
    with_both = [(each.quantity, _place(each)) for each in both]
    alone = [each for each in means if (each.quantity, _place(each)) not in with_both]
    return [*both, *alone]


def _of_one(
    findings: Sequence[Finding],
    mean: Finding,
    stiffness: Sequence[Finding],
    at_rest: Sequence[Finding],
    ramp: Parts,
) -> Iterator[Conclusion]:
    by_direction = {
        way: of(findings, TORQUE, statistic="mean", direction=way)
        for way in ("positive", "negative")
    }
    way = str(mean.conditions.get("direction"))
    directions: list[Part] = [f" in the {way} direction"]
    one, other = by_direction["positive"], by_direction["negative"]
    if way == "both" and one and other:
        directions = [" (mean of both directions): ", Amount(one[0].known), " in the positive, "]
        directions += [Amount(other[0].known), " in the negative direction, "]
        sides = other[0].known, one[0].known
        directions += [Factor(shown_by(ratio_of(*sides), *sides), *IN_NEGATIVE)]
    yield conclusion(*ramp, " the load breaks away at ", Amount(mean.known), directions)
    single = [e for e in findings if e.quantity == TORQUE and "statistic" not in e.conditions]
    ends = ends_of(single)
    # Of one ramp in each direction the sentence before told both.
    if ends is not None and len(single) > len({e.conditions.get("direction") for e in single}):
        ramps = count(len(single), "ramp")
        yield conclusion(f"Over {ramps} it is from ", _ramp(ends[0]), " to ", _ramp(ends[1]))
    told: list[Parts] = []
    if stiffness:
        told.append(("the presliding stiffness σ0 is ", Amount(stiffness[0].known)))
    if at_rest:
        told.append(("the stiffness at rest ", Amount(at_rest[0].known)))
    if told:
        yield conclusion(listed(told))
    else:
        yield conclusion("No presliding stiffness was found: ", NO_CURVE)


NO_CURVE = "no ramp shows enough of the curve of bristles"


def _ramp(finding: Finding) -> Parts:
    """The torque of a ramp, with its place."""
    position = finding.conditions.get("position")
    where: list[Part] = [" (", str(finding.conditions.get("direction", ""))]
    if isinstance(position, int | float):
        where += [", at ", setting(position, "rad", "deg")]
    return (Amount(finding.known), *where, ")")


def _over_sweep(
    means: Sequence[Finding], ramp: Parts, paths: Sequence[str], settings: Settings
) -> Iterator[Conclusion]:
    told = between(of(means, TORQUE), settings, paths)
    yield conclusion(*ramp, " the load breaks away at torques ", *told)
    stiffness = of(means, STIFFNESS)
    if stiffness:
        told = between(stiffness, settings, paths)
        yield conclusion("The presliding stiffness σ0 is ", *told)
    else:
        yield conclusion("No presliding stiffness was found: ", NO_CURVE)
