"""Parts of conclusions: conditions, numbers, ratios, ranges over a sweep.

A sentence holds estimates, not text of numbers: units and intervals are the report's business, and
so is whether a ratio is called more or less. What was set is an estimate, too, that is `given`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from campaign.estimate import OF_ONE_TRIAL, Estimate, Origin
from campaign.estimation.intervals import LEVEL, ratio, student
from campaign.estimation.stabilization_error import NO_SCATTER
from campaign.experiments.interface import TestData, bench_of
from campaign.options import Options, describe
from campaign.reason import Cause
from campaign.result import Amount, Conclusion, Factor, Finding, Value
from campaign.units import Quantity

Part = str | Amount | Factor
Parts = tuple[Part, ...]
SET = Cause("set", "it was set")
OF_SINGLES = Cause(
    "ratio of single trials",
    "a ratio of which a side is of one trial: how trials scatter is not in it",
)
MISSING_PART = Cause("missing part", "a part is missing")
ONLY_A_BOUND = Cause("ratio of a bound", "one of the two is only a bound")
OPEN_SIDE = Cause("ratio of an open interval", "one of the two has an interval that is open")
MAY_BE_ZERO = Cause("ratio of what may be zero", "one of the two may be zero")
PICKED = Cause("picked by its size", "it was picked from {count} by its size")


def conclusion(*parts: Part | Iterable[Part]) -> Conclusion:
    """A sentence from its parts, nested ones flattened and neighbouring words joined.

    It begins with a capital letter and ends with a full stop, whatever the parts do.
    """
    flat: list[Part] = []
    for part in _flat((*parts, ".")):
        if isinstance(part, str) and flat and isinstance(flat[-1], str):
            flat[-1] += part
        else:
            flat.append(part)
    if flat and isinstance(flat[0], str):
        flat[0] = flat[0][:1].upper() + flat[0][1:]
    return Conclusion(tuple(flat))


def _flat(parts: Iterable[Part | Iterable[Part]]) -> Iterator[Part]:
    for part in parts:
        if isinstance(part, str | Amount | Factor):
            yield part
        else:
            yield from _flat(part)


def listed(items: Iterable[Parts], between: str = ", ", last: str = " and ") -> Parts:
    """`a, b and c`."""
    every = list(items)
    joined: list[Part] = []
    for number, item in enumerate(every):
        if number:
            joined.append(last if number == len(every) - 1 else between)
        joined += item
    return tuple(joined)


def setting(value: float, unit: str = "", display: str = "") -> Amount:
    """A number that was set (SI), such as the frequency of a motion."""
    given = Estimate("setting", float(value), unit, origin=Origin.GIVEN, reason=SET())
    return Amount(given, display)


def ramps(rates: Sequence[float]) -> Parts:
    """`On a ramp of 0.5 N m/s`; rates in N m/s."""
    different = sorted(set(rates))
    if not different:
        return ("On a ramp",)
    if len(different) == 1:
        return ("On a ramp of ", setting(different[0], "N m/s"))
    return ("On ramps of ", setting(different[0], "N m/s"), " to ", setting(different[-1], "N m/s"))


def error_words(high_pass: float) -> Parts:
    """`error (1σ)`, and through which high-pass (Hz) a bench sees it, where it does."""
    if not high_pass > 0:
        return ("error (1σ)",)
    corner = float(f"{high_pass:.3g}")  # one that was fitted has digits that mean nothing
    return ("error (1σ, seen through a high-pass at ", setting(corner, "Hz"), ")")


def count(number: int, one: str, many: str = "") -> str:
    """`1 map`, `3 maps`."""
    return f"{number} {one if number == 1 else many or one + 's'}"


def of(findings: Iterable[Finding], quantity: str, **conditions: Value) -> list[Finding]:
    """The findings of a quantity under these conditions, in their order."""
    wanted = conditions.items()
    return [
        each
        for each in findings
        if each.quantity == quantity
        and all(each.conditions.get(name) == value for name, value in wanted)
    ]


def determined(estimate: Estimate) -> bool:
    """Whether there is a number that says something."""
    return math.isfinite(estimate.value) and estimate.origin is not Origin.NOT_DETERMINED


# Conditions ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Settings:
    """How the numbers that a test sets are told: by option, or dotted path of its matrix."""

    known: Mapping[str, Quantity]

    @classmethod
    def of(cls, data: TestData, options: type[Options]) -> Settings:
        """Of an experiment's options, and of what the test sweeps of the bench."""
        known = {info.name: info.quantity.here for info in describe(options) if info.quantity}
        for item in data.trials[:1]:
            for path in item.trial.point:
                quantity = _of_bench(bench_of(item.trial), path)
                if quantity is not None:
                    known[path] = quantity
        return cls(known)

    def also(self, name: str, like: str) -> Settings:
        """With another name for what stands at a path."""
        own = {name: self.known[like]} if like in self.known else {}
        return Settings({**self.known, **own})

    def value(self, path: str, value: Value) -> Part:
        """`0.5 Hz`, `lugre`, `yes`."""
        if isinstance(value, bool):
            return "yes" if value else "no"
        if not isinstance(value, int | float):
            return str(value)
        quantity = self.known.get(path)
        if quantity is None:
            return setting(value)
        return setting(value, quantity.si, quantity.display)

    def told(self, path: str, value: Value) -> Parts:
        """`frequency 0.5 Hz`, `preload torque 50 N m`."""
        return f"{name_of(path)} ", self.value(path, value)

    def place(self, place: Mapping[str, Value]) -> Parts:
        """All of some conditions, one after the other."""
        told = (self.told(path, value) for path, value in place.items() if value is not None)
        return listed(told, last=", ")


def _of_bench(bench: Options, path: str) -> Quantity | None:
    """The quantity at a dotted path of a bench (`bench.axis.inertia`); None for anything else."""
    keys = path.split(".")
    if keys[0] != "bench":
        return None
    table: object = bench
    for key in keys[1:-1]:
        table = table.get(key) if isinstance(table, Mapping) else getattr(table, key, None)
    if not isinstance(table, Options):
        return None
    found = (info.quantity for info in describe(type(table)) if info.name == keys[-1])
    quantity = next(found, None)
    return quantity and quantity.here


def name_of(path: str) -> str:
    """`bench.gear.preload.torque` in words: `preload torque`."""
    keys = path.removeprefix("bench.").split(".")
    return " ".join(keys[-2:]).replace("_", " ")


def varied(places: Sequence[Mapping[str, Value]]) -> tuple[str, ...]:
    """Conditions in which some places differ, in their order."""
    names = dict.fromkeys(name for place in places for name in place)
    return tuple(
        name for name in names if any(place.get(name) != places[0].get(name) for place in places)
    )


def shared(places: Sequence[Mapping[str, Value]]) -> dict[str, Value]:
    """Conditions that all places have in common."""
    differ = varied(places)
    return {
        name: value
        for name, value in (places[0].items() if places else ())
        if name not in differ and value is not None
    }


# Numbers ------------------------------------------------------------------------------------------


def ratio_of(
    one: Estimate, other: Estimate, name: str = "ratio", *, of_same_trials: bool = False
) -> Estimate:
    """`one` over `other`, of positive estimates; not determined where either is not.

    By Welch in the logarithm where both have a standard error. Where both have only ends (brackets,
    intervals of a profile), or are of the same trials, so that their errors go together in whatever
    way: from the extremes of these, which holds the ratio whenever both intervals hold. Of bounds
    and of what has no interval there is none.
    """
    for each in (one, other):
        if not determined(each):
            return Estimate.without_interval(name, math.nan, "", each.reason or MISSING_PART())
    told = ratio(name, one, other)
    if not math.isfinite(told.value) or (told.has_interval and not of_same_trials):
        return told
    if {one.kind, other.kind} & {"at least", "at most"}:
        return Estimate.without_interval(name, told.value, "", ONLY_A_BOUND())
    low, high, other_low, other_high = one.low, one.high, other.low, other.high
    if low is None or high is None or other_low is None or other_high is None:
        return Estimate.without_interval(name, told.value, "", told.reason or OPEN_SIDE())
    if not low > 0 or not other_low > 0:
        return Estimate.without_interval(name, told.value, "", MAY_BE_ZERO())
    method = "from the ends of both intervals"
    return Estimate(name, told.value, "", low / other_high, high / other_low, LEVEL, method)


def of_one_trial(estimate: Estimate) -> bool:
    """Whether its interval is that of a single trial, without what differs between trials."""
    return estimate.reason in OF_ONE_TRIAL


def one_trial(errors: Sequence[Finding]) -> Parts:
    """That nothing was repeated, where the intervals are those of single trials."""
    # Where nothing scatters, it does not matter how many trials there were.
    single = [of_one_trial(e.known) for e in errors if e.known.reason not in NO_SCATTER]
    if not any(single):
        return ()
    return (", one trial each",) if all(single) else (", some of one trial only",)


def shown_by(ratio: Estimate, *sides: Estimate) -> Estimate:
    """A ratio as it may be told: without an interval where a side is of a single trial.

    Two such intervals are apart although nothing was changed, as friction differs from trial to
    trial. A ratio may know of its sides by its own reason.
    """
    single = of_one_trial(ratio) or (ratio.has_interval and any(map(of_one_trial, sides)))
    if not single:
        return ratio
    return replace(
        ratio,
        low=None,
        high=None,
        level=None,
        standard_error=None,
        freedom=None,
        systematic=(),
        reason=OF_SINGLES(),
    )


def held_at_once(estimate: Estimate, count: int) -> Estimate:
    """A positive estimate that was picked from `count` as the extreme one: its interval widened.

    Such that the intervals of all of them hold at once (Bonferroni); by its standard error, in the
    logarithm. One without a standard error loses its interval: nobody knows how far to widen it.
    """
    if count < 2 or not estimate.has_interval or not estimate.value > 0:
        return estimate
    if estimate.standard_error is None:
        return replace(estimate, low=None, high=None, level=None, reason=PICKED(count=count))
    level = 1.0 - (1.0 - LEVEL) / count
    half = student(estimate.freedom or math.inf, level)
    half *= estimate.standard_error / estimate.value
    low, high = estimate.value * math.exp(-half), estimate.value * math.exp(half)
    return replace(estimate, low=low, high=high)


def ends_of(findings: Sequence[Finding]) -> tuple[Finding, Finding] | None:
    """The smallest and the largest number found; None of fewer than two."""
    known = [each for each in findings if determined(each.known)]
    if len(known) < 2:
        return None
    return min(known, key=lambda each: each.value), max(known, key=lambda each: each.value)


def between(
    findings: Sequence[Finding], settings: Settings, paths: Sequence[str], display: str = ""
) -> Parts:
    """`from 0.2 mrad (frequency 2 Hz) to 0.8 mrad (frequency 0.4 Hz)`, of what was found.

    What was not determined is counted; of one number it is that number.
    """
    ends = ends_of(findings)
    if ends is None:
        known = [each for each in findings if determined(each.known)] or list(findings[:1])
        return tuple(Amount(each.known, display) for each in known)

    def one(finding: Finding) -> Parts:
        place = {path: finding.conditions[path] for path in paths if path in finding.conditions}
        told: Parts = (" (", *settings.place(place), ")") if place else ()
        return (Amount(finding.known, display), *told)

    open_ = sum(not determined(each.known) for each in findings)
    missing = f"; {open_} of {len(findings)} are not determined" if open_ else ""
    return ("from ", *one(ends[0]), " to ", *one(ends[1]), missing)
