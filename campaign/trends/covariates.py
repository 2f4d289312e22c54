"""Covariates of trends: time, order, temperature, a tag, or another number."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from campaign.channels import TEMPERATURE
from campaign.errors import UsageError
from campaign.text import capitalized, pretty_unit
from campaign.trends.members import Member
from campaign.trends.series import Series
from campaign.units import factor, split_quantity

TIME, ORDER = "time", "order"
DAY = 86_400.0
MONTH = 30.4375
"""Days of a month: a twelfth of 365.25."""
ZERO_CELSIUS = 273.15
BLURRED = 0.1
"""Largest share of own errors in the variance of a covariate. Above it, slopes are underestimated
by more than 10 %."""


@dataclass(frozen=True)
class Covariate:
    """Independent variable of trends.

    Attributes:
        label: text at an axis.
        unit: of its values.
        per: unit of an effect, such as `month` or `K`.
        step: `per` in `unit`.
        ordered: whether it orders the runs, so that numbers can jump.
        at: its value for a test of a run ("": for the whole run); NaN if unknown.
        of: series of the covariate, if it is a number of the runs.
    """

    name: str
    label: str
    unit: str
    per: str
    step: float
    ordered: bool
    at: Callable[[Member, str], float]
    of: Series | None = None


def covariate_of(over: str, members: Sequence[Member], series: Sequence[Series]) -> Covariate:
    """Covariate of `--over`. Raises UsageError, with the valid names, for an unknown one."""
    if over == TIME:
        return _time(members)
    if over == ORDER:
        return Covariate(
            ORDER, "Run", "", "run", 1.0, ordered=True, at=lambda member, _: float(member.number)
        )
    tags = [_tagged(member, over) for member in members]
    if over == TEMPERATURE:
        return _temperature(members)
    if any(tag is not None for tag in tags):
        return _tag(over, members)
    return _finding(over, members, series)


def _time(members: Sequence[Member]) -> Covariate:
    first = members[0].created
    if members[-1].created == first:
        raise UsageError("all runs began at the same time; `--over order` takes them as they come")
    days = {m.number: (m.created - first).total_seconds() / DAY for m in members}
    # For runs within days, a drift per month is not a useful unit.
    last = days[members[-1].number]
    per, step = ("month", MONTH) if last > 14 else ("day", 1.0) if last > 0.5 else ("h", 1 / 24)
    label, unit, size = ("Time since", "d", 1.0) if last > 0.5 else ("Time since", "h", 24.0)
    return Covariate(
        TIME,
        f"{label} {first:%Y-%m-%d %H:%M} UTC",
        unit,
        per,
        step * size,
        ordered=True,
        at=lambda member, _: size * days[member.number],
    )


def _temperature(members: Sequence[Member]) -> Covariate:
    known: dict[tuple[int, str], float] = {}

    def at(member: Member, test: str) -> float:
        key = (member.number, test)
        if key not in known:
            known[key] = _measured_temperature(member, test)
        return known[key]

    if not any(math.isfinite(at(member, "")) for member in members):
        raise UsageError(
            "no run has a channel `temperature`, or a tag such as `temperature=23.5`: nothing is "
            "known to follow"
        )
    return Covariate(TEMPERATURE, "Temperature", "degC", "K", 1.0, ordered=False, at=at)


def _measured_temperature(member: Member, test: str) -> float:
    """Temperature (degC): median of the trials' medians, else the tag; NaN if unknown.

    Trials that the analyses exclude do not count. Raises ArchiveError for damaged temperatures, and
    UsageError for a tag with another unit than degC or K.
    """
    medians = []
    for each in (trial for one in member.tests for trial in one.trials):
        if not each.is_completed_measurement or test not in ("", each.trial.test):
            continue
        unit = next((c.unit for c in each.channels() if c.name == TEMPERATURE), None)
        if unit is None or each.not_kept:
            continue
        samples = each.recording()[TEMPERATURE]
        samples = samples[np.isfinite(samples)]
        if samples.size:
            medians.append(float(np.median(samples)) - (ZERO_CELSIUS if unit == "K" else 0.0))
    if medians:
        return float(np.median(medians))
    tag = _tagged(member, TEMPERATURE)
    if tag is None:
        return math.nan
    value, unit = tag
    if unit in ("", "degC", "°C", "C"):
        return value
    if unit == "K":
        return value - ZERO_CELSIUS
    raise UsageError(f"{member.name}: tag temperature={value:g} {unit}: write it in degC or in K")


def _tagged(member: Member, name: str) -> tuple[float, str] | None:
    """Number and unit of a tag `name=...`; None without the tag or without a finite number."""
    for tag in member.run.header.tags:
        key, sign, text = tag.partition("=")
        if sign and key.strip() == name:
            try:
                value, unit = split_quantity(text.strip())
            except ValueError:
                return None
            return (value, unit.strip()) if math.isfinite(value) else None
    return None


def _tag(name: str, members: Sequence[Member]) -> Covariate:
    tags = {m.number: tag for m in members if (tag := _tagged(m, name)) is not None}
    unit = next(iter(tags.values()))[1]
    values: dict[int, float] = {}
    for number, (value, own) in tags.items():
        try:
            values[number] = value if own == unit else value * float(factor(own, unit))
        except ValueError:
            raise UsageError(
                f"{members[number - 1].name}: its tag {name} is in {own or 'no unit'}, "
                f"that of others in {unit or 'no unit'}"
            ) from None
    return Covariate(
        name,
        capitalized(name),
        unit,
        pretty_unit(unit) or f"unit of {name}",
        1.0,
        ordered=False,
        at=lambda member, _: values.get(member.number, math.nan),
    )


def _finding(over: str, members: Sequence[Member], series: Sequence[Series]) -> Covariate:
    """Covariate from a number of the runs, by its quantity or by unique words of its name."""
    wanted = over.replace("_", " ").lower().split()
    named = [s for s in series if s.quantity == over]
    matches = named or [
        s
        for s in series
        if all(w in f"{s.test} {s.quantity} {s.name}".replace("_", " ").lower() for w in wanted)
    ]
    if not matches:
        tags = sorted({t.partition("=")[0] for m in members for t in m.run.header.tags if "=" in t})
        quantities = list(dict.fromkeys(s.quantity for s in series))
        more = " ..." if len(quantities) > 8 else ""
        raise UsageError(
            f"--over {over!r}: is neither time, order nor temperature, nor a tag NAME=NUMBER "
            f"({', '.join(tags) or 'there are none'}), nor found by the runs "
            f"({', '.join(quantities[:8])}{more})"
        )
    if len(matches) > 1:
        names = "; ".join(f"{s.test}: {s.name}" for s in matches[:6])
        raise UsageError(
            f"--over {over!r}: means {len(matches)} numbers; add words of one of them ({names})"
        )
    return _of_series(matches[0])


def _of_series(one: Series) -> Covariate:
    if one.reason:
        raise UsageError(f"--over: {one.name}: {one.reason}")
    own, values = np.diag(one.own()[0]), one.values
    if one.bare or float(np.mean(own)) > BLURRED * float(np.var(values, ddof=1)):
        raise UsageError(
            f"--over: {one.name} varies too little between runs for how well each knows it: "
            "trends along it would come out too flat"
        )
    shown = {p.member.number: one.scale * p.estimate.value for p in one.points}
    return Covariate(
        f"{one.test}: {one.name}",
        capitalized(one.name),
        one.display,
        pretty_unit(one.display) or "unit",
        1.0,
        ordered=False,
        at=lambda member, _: shown.get(member.number, math.nan),
        of=one,
    )


def together(members: Sequence[Member], one: Covariate, other: Covariate) -> float:
    """Correlation of two covariates over runs; NaN if constant or known in fewer than three."""
    pairs: Mapping[int, tuple[float, float]] = {
        m.number: (one.at(m, ""), other.at(m, "")) for m in members
    }
    known = np.array([pair for pair in pairs.values() if np.all(np.isfinite(pair))])
    if len(known) < 3 or np.any(np.ptp(known, axis=0) == 0):
        return math.nan
    return float(np.corrcoef(known.T)[0, 1])
