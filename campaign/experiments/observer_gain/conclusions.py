"""Conclusions of the observer-gain study: benefit and cost of the gain."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from campaign.experiments.shared.conclusion_parts import (
    Parts,
    conclusion,
    determined,
    error_words,
    of,
    one_trial,
    ratio_of,
    setting,
    shown_by,
)
from campaign.result import Amount, Conclusion, Factor, Finding

ERROR, NOISE, LIMIT = "stabilization_error_at_gain", "noise_rate", "unstable_corner_frequency"


def observer_conclusions(
    findings: Sequence[Finding], own: float, unstable: str, high_pass: float = 0.0
) -> tuple[Conclusion, ...]:
    """Of the bench's own gain against none, of the gain with the least error, of instability.

    Args:
        own: corner frequency of the bench's own gain (Hz).
        unstable: why the trial at that gain ended early; empty when it did not.
        high_pass: through which the bench sees the error (Hz); 0 for none.
    """
    errors = [each for each in of(findings, ERROR) if determined(each.known)]
    if not errors:
        return ()
    return (
        *_own(findings, errors, own, unstable, high_pass),
        *_least(errors, own),
        *_limit(findings),
    )


def _corner(finding: Finding) -> float:
    value = finding.conditions["corner"]
    return float(value) if isinstance(value, int | float) else math.nan


def _own(
    findings: Sequence[Finding],
    errors: Sequence[Finding],
    own: float,
    unstable: str,
    high_pass: float,
) -> Iterator[Conclusion]:
    told = errors[0].conditions
    frequency, acceleration = (float(str(told[name])) for name in ("frequency", "acceleration"))
    start: Parts = (
        *("At ", setting(frequency, "Hz"), ", "),
        *(setting(acceleration, "rad/s^2", "deg/s^2"), ", the observer with its own gain (corner "),
        *(setting(own, "Hz"), ")", *one_trial(errors), ","),
    )
    chosen = next((each for each in errors if math.isclose(_corner(each), own)), None)
    without = next((each for each in errors if _corner(each) == 0), None)
    if chosen is None:
        yield conclusion(*start, f" has no error that was measured: {unstable or 'it was not run'}")
        return
    words = error_words(high_pass)
    parts: Parts = (" leaves an ", *words, " of ", Amount(chosen.known, "mrad"))
    if without is not None:
        ratio = ratio_of(without.known, chosen.known)
        factor = Factor(shown_by(ratio, without.known, chosen.known), above="less", below="more")
        parts = (*parts, " of ", Amount(without.known, "mrad"), ", ", factor)
    measured = of(findings, "observer_corner_frequency")
    if measured:
        parts = (*parts, "; by what it takes off a disturbance its corner is ",
                 Amount(measured[0].known))  # fmt: skip
    yield conclusion(*start, parts)


def _least(errors: Sequence[Finding], own: float) -> Iterator[Conclusion]:
    """The gain with the smallest error found, where that is not the bench's own."""
    least = min(errors, key=lambda each: each.value)
    if len(errors) > 2 and not math.isclose(_corner(least), own):
        yield conclusion(
            "The smallest error found is at a corner of ",
            *(setting(_corner(least), "Hz"), ": "),
            Amount(least.known, "mrad"),
        )


def _limit(findings: Sequence[Finding]) -> Iterator[Conclusion]:
    for each in of(findings, LIMIT)[:1]:
        if each.lower_bound:
            yield conclusion(
                "No gain that was tried is unstable: the corner may be ", Amount(each.known)
            )
        elif not each.known.low:
            yield conclusion("The loop is unstable at a corner of ", setting(each.value, "Hz"),
                             ", the lowest that was tried")  # fmt: skip
        else:
            yield conclusion(
                *("The loop is stable up to a corner of ", setting(each.known.low, "Hz")),
                *(" and unstable at ", setting(each.value, "Hz"), ", the next that was tried"),
            )
