"""Conclusions as sentences: numbers with intervals; no difference without evidence."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from campaign.axis_kind import in_axis_terms
from campaign.estimate import Estimate, Origin
from campaign.estimation.stabilization_error import NO_SCATTER
from campaign.result import Amount, Conclusion, Factor
from campaign.text import NARROW, SHORT, interval, minus, number, pretty_unit
from campaign.units import convert

FLAGGED = (Origin.ASSUMED, Origin.AT_BOUND, Origin.CONTRADICTED)
"""Origins that are said behind a number, as a reader would take it for measured."""
MOST_DIGITS = 17
"""A float has no more."""
MOST_DECIMALS = 6
"""of a factor, to keep an end of its interval from looking like 1."""
WRITTEN = 8
"""Most digits that somebody is taken to have written of a setting; one with more was computed."""
LARGE = 1e6
"""Factors from here on are told with an exponent."""
NEAR = 0.8, 1.25
"""Ratios between these are told in percent: nobody says 1.065 times more."""
NO_NOISE, NO_INTERVAL = " (no noise, so no interval)", " without an interval"
"""Behind the first ratio of a sentence that has no interval, because nothing scatters or for
another reason: the remarks have it, and behind each it would hide the numbers."""


def sentence(conclusion: Conclusion) -> str:
    """The words of a conclusion, with its numbers in a reader's units."""
    said = "".join(part if isinstance(part, str) else words(part) for part in conclusion.parts)
    said = said.replace(" at at ", " at ")
    for reason in (NO_NOISE, NO_INTERVAL):
        start, own, rest = said.partition(reason)
        said = start + own + rest.replace(reason, "")
    return said


def words(part: Amount | Factor) -> str:
    """A number as it is said within a sentence."""
    return _amount(part) if isinstance(part, Amount) else _factor(part)


def alone(part: Amount | Factor) -> str:
    """A number as a table has it: a ratio as it is, and no word on why it has no interval."""
    return _amount(part if isinstance(part, Amount) else Amount(part.estimate))


def remarks(conclusions: Iterable[Conclusion]) -> Iterator[str]:
    """Sentences on what the numbers of conclusions do not say: no interval, or not all of it.

    Each reason once. What was set has none, and what is not determined says why where it stands.
    """
    parts = [p for each in conclusions for p in each.parts if not isinstance(p, str)]
    found = [part.estimate for part in parts if _measured(part.estimate)]
    without = dict.fromkeys(str(e.reason) for e in found if not _bounded(e) and e.reason)
    if without:
        yield f"Without an interval: {'; '.join(without)}."
    for reason in dict.fromkeys(str(e.reason) for e in found if e.has_interval and e.reason):
        yield f"{reason[:1].upper()}{reason[1:]}."
    if any(_narrow(each) for each in found if each.has_interval):
        yield "Where a number stands without an interval, that is narrower than its digits."
    yield from of_unknown_size(found)


def of_unknown_size(estimates: Iterable[Estimate]) -> Iterator[str]:
    """The sentence on what no interval of theirs has in it; none where there is nothing."""
    unknown = dict.fromkeys(
        each.source
        for estimate in estimates
        if estimate.has_interval
        for each in estimate.systematic
        if each.standard_uncertainty is None
    )
    if unknown:
        yield f"Of unknown size, and in no interval: {', '.join(map(in_axis_terms, unknown))}."


def is_decided(factor: Factor) -> bool:
    """Whether the data show on which side of 1 a ratio lies: only then is it more or less."""
    return _side(factor.estimate) != 0


def told_with_intervals(conclusion: Conclusion) -> int:
    """How many measured numbers of a conclusion are told with an interval, or as a bound."""
    parts = (part.estimate for part in conclusion.parts if not isinstance(part, str))
    return sum(_measured(each) and _bounded(each) and not _narrow(each) for each in parts)


def _measured(estimate: Estimate) -> bool:
    return not _open(estimate) and estimate.origin is not Origin.GIVEN and estimate.kind != "count"


def _open(estimate: Estimate) -> bool:
    return estimate.origin is Origin.NOT_DETERMINED or math.isnan(estimate.value)


def _bounded(estimate: Estimate) -> bool:
    return estimate.has_interval or estimate.kind in ("at least", "at most")


def _not_determined(estimate: Estimate) -> str:
    return "not determined" + (f" ({estimate.reason})" if estimate.reason else "")


def _amount(part: Amount) -> str:
    estimate = part.estimate
    if _open(estimate):
        return _not_determined(estimate)
    unit = part.display or estimate.unit
    ends = (estimate.value, *estimate.combined)
    value, low, high = (None if e is None else convert(e, estimate.unit, unit) for e in ends)
    sign = {"at least": "at least ", "at most": "at most "}.get(estimate.kind, "")
    if sign:
        value, low, high = (low if high is None else high), None, None
    flag = f" ({estimate.origin})" if estimate.origin in FLAGGED else ""
    if estimate.origin is Origin.GIVEN and value is not None and not estimate.has_interval:
        told = _set(value)
    else:
        told = number(value, SHORT) if _narrow(estimate) else interval(value, low, high)
    return f"{sign}{told} {pretty_unit(unit)}".rstrip() + flag


def _set(value: float) -> str:
    """What was set, as it was written: two settings of a sweep may differ late in their digits."""
    digits = (n for n in range(4, WRITTEN + 1) if math.isclose(float(f"{value:.{n}g}"), value))
    return number(value, next(digits, 4))


def _narrow(estimate: Estimate) -> bool:
    """Whether an interval is so narrow that a sentence does without it."""
    return estimate.has_interval and estimate.half_width < NARROW * abs(estimate.value)


def _side(estimate: Estimate) -> int:
    """+1 for a ratio that is surely above 1, -1 for one surely below, 0 where nobody can tell.

    Surely: the whole interval, systematic parts included, lies there, or the bound does. A ratio
    that is not positive is none, and without an interval there is nothing to be sure by.
    """
    if _open(estimate) or not estimate.value > 0 or not _bounded(estimate):
        return 0
    low, high = estimate.combined
    if low is not None and low > 1:
        return 1
    return -1 if high is not None and high < 1 else 0


def _factor(part: Factor) -> str:
    estimate, side = part.estimate, _side(part.estimate)
    if _open(estimate):
        return f"a ratio that is {_not_determined(estimate)}"
    low, high = estimate.combined
    if not estimate.value > 0:
        return f"a ratio of {interval(estimate.value, low, high)}"
    if not _bounded(estimate):
        if estimate.reason in NO_SCATTER:
            return _without_noise(part)
        return f"a ratio of {number(estimate.value, 3)}{NO_INTERVAL}"
    if side == 0:
        ends = "" if _narrow(estimate) else _ends(low, high, " times")
        return f"no difference that the data show{ends}"
    positive = all(end > 0 for end in (low, high) if end is not None)
    if NEAR[0] < estimate.value < NEAR[1] and positive and _says_side(part):
        return _in_percent(part)
    word, value = part.above, _finite(estimate.value)
    if side < 0:  # the reciprocal, whose ends change places
        word, value, low, high = part.below, _reciprocal(value), _reciprocal(high), _reciprocal(low)
    if value is not None and _narrow(estimate):
        return f"{_apart(value, SHORT)} times {word}"
    if value is None or estimate.kind in ("at least", "at most"):
        return f"at least {_number(low, low, high)} times {word}"
    return f"{_number(value, low, high)} times {word}{_ends(low, high)}"


def _says_side(part: Factor) -> bool:
    """Whether its words say of which side it is: a quarter more is, turned round, a fifth less."""
    return part.above.startswith(("less", "more"))


def _percent(part: Factor, ratio: float) -> float:
    """How many percent more or less a ratio means, as a size."""
    return 100.0 * abs((1.0 / ratio if part.above.startswith("less") else ratio) - 1.0)


def _in_percent(part: Factor) -> str:
    """A ratio near 1, and surely on one side of it, by what it is away from 1."""
    estimate = part.estimate
    word = part.above if estimate.value > 1 else part.below
    value = _percent(part, estimate.value)
    ends = sorted(_percent(part, end) for end in estimate.combined if end is not None)
    if estimate.kind in ("at least", "at most"):
        return f"at least {number(ends[0], 3)} % {word}"
    if len(ends) < 2:
        return f"{number(value, 3)} % {word} (at least {number(ends[0], 3)})"
    told = number(value, 3) if _narrow(estimate) else interval(value, *ends)
    return f"{told} % {word}"


def _without_noise(part: Factor) -> str:
    """A ratio that would come out the same again: of this simulation, and of nothing else.

    Only a computed motion repeats itself like that. Below three digits it is no difference: that
    is as far as the step of a simulation may be trusted.
    """
    value, word = part.estimate.value, part.above
    if float(f"{value:.3g}") == 1:
        return f"no difference in three digits in this simulation{NO_NOISE}"
    if value < 1:
        word = part.below
    if NEAR[0] < value < NEAR[1] and _says_side(part):
        # Three digits of the ratio are one behind the point of what it is away from 1.
        percent = round(_percent(part, value), 1)
        return f"{number(percent, 3)} % {word} in this simulation{NO_NOISE}"
    value = value if value > 1 else 1 / value
    return f"{number(value, 3, 3)} times {word} in this simulation{NO_NOISE}"


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _reciprocal(value: float | None) -> float | None:
    """None for what has none that is positive and finite: that end is open."""
    return None if value is None or not value > 0 else _finite(1 / value)


def _ends(low: float | None, high: float | None, unit: str = "") -> str:
    if low is None or high is None:
        side, end = ("at most", high) if low is None else ("at least", low)
        return f" ({side} {_number(end, low, high)}{unit})"
    return f" ({_number(low, low, high)} to {_number(high, low, high)}{unit})"


def _apart(value: float, digits: int) -> str:
    """With so many digits, or as many more as tell it from 1."""
    enough = (n for n in range(digits, MOST_DIGITS) if float(f"{value:.{n}g}") != 1)
    return number(value, digits if value == 1 else next(enough, MOST_DIGITS))


def _number(value: float | None, low: float | None, high: float | None) -> str:
    """With as many decimals as the half-width needs, and as tell each end from 1."""
    if value is None or low is None or high is None or abs(value) >= LARGE:
        return number(value) if value is None else _apart(value, 3)
    half = 0.5 * abs(high - low)
    # One digit of the half-width, or two where the first is a 1.
    decimals = max(0, -math.floor(math.log10(0.5 * half))) if half > 0 else MOST_DECIMALS
    decimals = min(decimals, MOST_DECIMALS)
    while decimals < MOST_DECIMALS and any(
        end != 1 and float(f"{end:.{decimals}f}") == 1 for end in (low, high)
    ):
        decimals += 1
    return minus(f"{value:.{decimals}f}")
