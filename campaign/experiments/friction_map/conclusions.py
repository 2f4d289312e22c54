"""Conclusions of friction-velocity maps: parameters of each direction, repeatability."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from campaign.estimate import Estimate
from campaign.experiments.friction_map.runs import DIRECTIONS
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    Settings,
    between,
    conclusion,
    count,
    listed,
    of,
    ratio_of,
    setting,
    varied,
)
from campaign.result import Amount, Conclusion, Factor, Finding, Value
from campaign.text import quantity_words

COULOMB, STATIC = "coulomb_torque", "static_torque"
NAMES = {
    quantity: quantity_words(quantity)
    for quantity in (COULOMB, STATIC, "stribeck_velocity", "viscous_friction")
}
OF_FIT = ("direction", "exponent")


def map_conclusions(
    findings: Sequence[Finding], speeds: Sequence[float], settings: Settings
) -> tuple[Conclusion, ...]:
    """Of the parameters with the exponent free, by direction; of several maps their range.

    speeds: at which there are points (rad/s), of either sign.
    """
    free = [each for each in findings if each.conditions.get("exponent") == "free"]
    if not free:
        return (conclusion("No friction parameters were found: no map has a fit"),)
    places = [{k: v for k, v in e.conditions.items() if k not in OF_FIT} for e in free]
    paths = varied(places)
    if paths:
        return tuple(_of_several(free, paths, _span(speeds), settings))
    return tuple(_of_one(free, _span(speeds)))


def _span(speeds: Sequence[float]) -> Parts:
    """`From 0.05 deg/s to 65 deg/s, `; nothing without speeds."""
    ends = [abs(speed) for speed in speeds]
    if not ends:
        return ()
    low, high = (setting(end, "rad/s", "deg/s") for end in (min(ends), max(ends)))
    return ("from ", low, " to ", high, ", ")


def _of_one(findings: Sequence[Finding], span: Parts) -> Iterator[Conclusion]:
    start = span
    for direction in DIRECTIONS:
        if told := _told(findings, direction=direction):
            yield conclusion(*start, f"{direction} direction: ", listed(told))
        start = ()
    compared = [
        (f"{NAMES[name]} ", Factor(_asymmetry(negative[0].known, positive[0].known)))
        for name in (COULOMB, STATIC)
        for positive, negative in [[of(findings, name, direction=d) for d in DIRECTIONS]]
        if positive and negative
    ]
    if compared:
        yield conclusion(
            "The negative direction against the positive: ", listed(compared, "; ", "; ")
        )


def _asymmetry(negative: Estimate, positive: Estimate) -> Estimate:
    """A ratio of two directions, which were run in the same trials, out and back."""
    return ratio_of(negative, positive, of_same_trials=True)


def _of_several(
    findings: Sequence[Finding], paths: Sequence[str], span: Parts, settings: Settings
) -> Iterator[Conclusion]:
    """The mean of both directions, from map to map."""
    start: Parts = (*span, "mean")
    for name in (COULOMB, STATIC, "viscous_friction"):
        own = of(findings, name, direction="nominal")
        if own:
            where = between(own, settings, paths)
            yield conclusion(
                *start, f" of both directions: {NAMES[name]} of {count(len(own), 'map')} is ", where
            )
        start = ("mean",)


def repeatability_conclusions(
    findings: Sequence[Finding], maps: int, speeds: Sequence[float] = ()
) -> tuple[Conclusion, ...]:
    """Of the mean of each parameter over maps and directions, and of its relative deviation.

    speeds: of the maps (rad/s), of either sign.
    """
    if not maps:
        return (conclusion("No friction parameters were found: no map has a fit"),)
    if maps == 1:
        told = _told(findings, direction="positive")
        words = "one map says nothing of repeatability; in the positive direction it has "
        return (conclusion(*_span(speeds), words, listed(told)),)
    means = _told(findings, statistic="mean")
    scatter = [
        (f"{NAMES[each.quantity]} by ", Amount(each.known, "percent"))
        for name in NAMES
        for each in of(findings, name, statistic="relative standard deviation")
    ]
    return (
        conclusion(*_span(speeds), f"mean of {maps} maps in both directions: ", listed(means)),
        conclusion("Over maps and directions they scatter (1σ): ", listed(scatter)),
    )


def _told(findings: Sequence[Finding], **conditions: Value) -> list[Parts]:
    """`Coulomb friction Tc 25.3 N m`, each parameter."""
    return [
        (f"{NAMES[name]} ", Amount(each.known))
        for name in NAMES
        for each in of(findings, name, **conditions)
    ]


def sliding_conclusions(
    found: Mapping[str, Mapping[str, Estimate]], who: str = ""
) -> Iterator[Conclusion]:
    """Of each direction; `who` begins each sentence."""
    for way, by_name in found.items():
        parts: list[str | Amount] = []
        if "coulomb_torque" in by_name:
            parts += ["Coulomb friction is ", Amount(by_name["coulomb_torque"], "N m")]
            viscous = by_name["viscous_friction"]
            parts += [" and viscous friction ", Amount(viscous, "N m s/rad")]
        elif "friction" in by_name:
            parts += ["friction at the speeds there are is ", Amount(by_name["friction"], "N m")]
        for beginning, sliding in (("coulomb", " of fast sliding"), ("friction", "")):
            if (ratio := by_name.get(f"{beginning}_coefficient")) is not None:
                before = ", and " if parts else ""
                parts += [f"{before}the coefficient of friction{sliding} is ", Amount(ratio, "")]
        if parts:
            start = f"sliding steadily in the {way} direction, "
            yield Conclusion((f"{who}{start}" if who else start.capitalize(), *parts, "."))
