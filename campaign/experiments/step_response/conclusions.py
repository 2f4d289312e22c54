"""Conclusions on step responses: rise, settling, overshoot, remaining error."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from campaign.experiments.shared.common import loop_words
from campaign.experiments.shared.conclusion_parts import (
    Parts,
    Settings,
    between,
    conclusion,
    listed,
    of,
    setting,
    shared,
    varied,
)
from campaign.result import Amount, Conclusion, Finding, Value

STEP = {
    "rise_time": ("rises in ", "ms"),
    "settling_time": ("settles in ", "ms"),
    "overshoot": ("overshoots by ", "percent"),
    "steady_state_error": ("ends off by ", "deg/s"),
}
NEGLIGIBLE = 1e-6
"""Share of a step below which an error that stays is none."""


def step_conclusions(
    findings: Sequence[Finding], step: float, band: float, settings: Settings
) -> tuple[Conclusion, ...]:
    """Of rise, settling, overshoot and remaining error of a step (rad/s); `band` is its share."""
    places = [each.conditions for each in findings]
    if not places:
        return ()
    paths = varied(places)
    start: Parts = ("A step of ", setting(step, "rad/s", "deg/s"), " ")
    if paths:
        return tuple(
            conclusion(*start, words, " ", between(own, settings, paths, STEP[name][1]))
            for name, words in (("settling_time", "settles in"), ("overshoot", "overshoots by"))
            if (own := of(findings, name))
        )
    told = [
        (words, Amount(each.known, display))
        for name, (words, display) in STEP.items()
        for each in of(findings, name)
        if name != "steady_state_error" or not abs(each.value) < NEGLIGIBLE * abs(step)
    ]
    share = setting(band, "", "percent")
    notes = (" (rise from 10 to 90 %, settling to ", share, " of the step)")
    return (conclusion(*start, f"{_friction(shared(places))} ", listed(told), *notes),)


def _friction(place: Mapping[str, Value]) -> str:
    linear = "without friction" if place.get("linear") else "with friction"
    name = place.get("compensation", "none")
    return linear if name == "none" else f"{linear}, {loop_words(name)},"
