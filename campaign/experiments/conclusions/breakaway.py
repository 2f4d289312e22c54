"""What ramps from rest come to: breakaway torque and stiffness, of an axis or its components."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from campaign.experiments.conclusions.parts import (
    Part,
    Parts,
    Settings,
    between,
    conclusion,
    count,
    ends_of,
    listed,
    of,
    ratio_of,
    setting,
    shown_by,
    varied,
)
from campaign.identification.stabilization_error import OF_ONE_TRIAL
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
        return (conclusion("No breakaway torque can be told, for the inertia is not known"),)
    if not torques and slid:
        told = "The load slid, and no recording of it tells at which torque it broke away"
        return (conclusion(told),)
    if not torques:
        return (conclusion("No ramp came to a breakaway torque"),)
    ramp = _ramps(rates)
    places = [_place(each) for each in torques]
    if len(torques) > 1:
        paths = varied(places)
        return tuple(_over_sweep(means, ramp, paths, settings))
    return tuple(_of_one(findings, torques[0], of(means, STIFFNESS), of(means, AT_REST), ramp))


def _ramps(rates: Sequence[float]) -> Parts:
    different = sorted(set(rates))
    if not different:
        return ("On a ramp",)
    if len(different) == 1:
        return ("On a ramp of ", setting(different[0], "N m/s"))
    return ("On ramps of ", setting(different[0], "N m/s"), " to ", setting(different[-1], "N m/s"))


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


def component_conclusions(
    findings: Sequence[Finding], rates: Sequence[float]
) -> tuple[Conclusion, ...]:
    """Of the mean of each component, their sum, and how far their readings scatter.

    rates: slopes of the ramps, at the load (N m/s).
    """
    means = of(findings, TORQUE, statistic="mean")
    places = [_without(each.conditions, "component") for each in means]
    if not means:
        return (conclusion("No component was seen to break away"),)
    if any(place != places[0] for place in places):
        return tuple(_components_over_sweep(means, rates))
    alone = [each for each in means if each.conditions.get("component") != "sum"]
    told = [(f"{e.conditions['component']} breaks away at ", Amount(e.known)) for e in alone]
    parts: list[Parts] = [(*_ramps(rates), ", seen at the load: ", *listed(told))]
    total, share = of(means, TORQUE, component="sum"), of(findings, "load_share")
    if total and share:
        parts.append(("together they are ", Amount(total[0].known)))
        parts.append(("the share of the load ", Amount(share[0].known, "percent")))
    scatter = of(findings, TORQUE, statistic="standard deviation")
    spread = [
        (f"{e.conditions['component']} ", Amount(replace(e.known, name="standard_deviation")))
        for e in scatter
    ]
    found = [conclusion(listed(parts, "; ", ", "))]
    if spread:
        found.append(conclusion("Standard deviation of single readings: ", listed(spread)))
    return tuple(found)


def _without(conditions: Mapping[str, Value], name: str) -> dict[str, Value]:
    return {key: value for key, value in conditions.items() if key != name}


def _components_over_sweep(
    means: Sequence[Finding], rates: Sequence[float]
) -> Iterator[Conclusion]:
    """Of several places of a sweep: from where to where each component's mean goes."""
    names = dict.fromkeys(str(each.conditions["component"]) for each in means)
    items = []
    for name in names:
        ends = ends_of(of(means, TORQUE, component=name))
        if ends is not None:
            items.append(
                (
                    f"{name} breaks away at torques from ",
                    Amount(ends[0].known),
                    " to ",
                    Amount(ends[1].known),
                )
            )
    if items:
        yield conclusion(_ramps(rates), " over the sweep, seen at the load: ", listed(items))
