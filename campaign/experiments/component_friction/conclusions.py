"""Conclusions of a component test: friction of each component, and their sum."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

from campaign.experiments.shared.conclusion_parts import (
    Parts,
    conclusion,
    ends_of,
    listed,
    of,
    ramps,
)
from campaign.result import Amount, Conclusion, Finding, Value

TORQUE = "breakaway_torque"


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
    parts: list[Parts] = [(*ramps(rates), ", seen at the load: ", *listed(told))]
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
        yield conclusion(ramps(rates), " over the sweep, seen at the load: ", listed(items))
