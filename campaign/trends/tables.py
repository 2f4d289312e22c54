"""Tables and sentences of trends."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

from campaign.comparison.tables import counted
from campaign.estimate import Estimate
from campaign.estimation.difference import in_unit
from campaign.estimation.family import RATE
from campaign.estimation.trends.changes import LEAST_FOR_A_JUMP, Jump
from campaign.reason import Cause
from campaign.result import Cell, Column, Table
from campaign.text import capitalized, count, interval, number, pretty_unit
from campaign.trends.covariates import ORDER, TIME, Covariate
from campaign.trends.rig_trends import JUMP, TREND, Trends, TrendSeries, Verdict

MEAN_NEAR_ZERO = Cause("mean near zero", "the mean is too near 0, or too little known")
CIRCUMSTANCES = 4
"""Largest number of changes at a jump in a sentence; the table has all."""


def followed_table(rows: Sequence[TrendSeries], covariate: Covariate) -> Table:
    """Table with one row per number, each in its own unit."""
    per = covariate.per
    columns = [
        Column("test", "Test"),
        Column("quantity", "Quantity"),
        Column("unit", "Unit"),
        Column("runs", "Runs", exact=True),
        Column("mean", "Mean"),
        Column("trend", f"Trend per {per}"),
        Column("trend_share", f"Trend per {per}, share of the mean", "", "percent"),
        Column("p_trend", "p of the trend", exact=True),
        Column("p_trend_adjusted", "adjusted", exact=True),
        Column("detectable_trend", f"Seen from, per {per}", exact=True),
    ]
    if covariate.ordered:
        columns += [
            Column("jump_before", "Jump before run"),
            Column("jump", "Jump"),
            Column("jump_share", "Jump, share of the mean", "", "percent"),
            Column("p_jump", "p of a jump", exact=True),
            Column("p_jump_adjusted", "adjusted", exact=True),
            Column("detectable_jump", "Jump seen from", exact=True),
        ]
    columns += [
        Column("scatter", "Scatter between runs", exact=True),
        Column("correlation", "Correlation of neighbours", exact=True),
        Column("verdict", "Verdict"),
        Column("reason", "Why not judged"),
        Column("notes", "Notes"),
    ]
    cells = tuple(_row(each, covariate) for each in rows)
    return Table("followed", "All numbers", tuple(columns), cells)


def page_table(rows: Sequence[TrendSeries], covariate: Covariate) -> Table:
    """Short table for a page: an effect and its share of the mean in one cell."""
    columns = [
        Column("test", "Test"),
        Column("quantity", "Quantity"),
        Column("verdict", "Verdict"),
        Column("p", "p, adjusted", exact=True),
        Column("mean", "Mean"),
        Column("trend", f"Trend per {covariate.per}"),
        Column("seen", "Seen from"),
    ]
    if covariate.ordered:
        columns += [
            Column("jump", "Jump"),
            Column("before", "Before run"),
            Column("jump_seen", "Seen from"),
        ]
    cells = tuple(_page_row(each, covariate) for each in rows)
    return Table("judged", "What was followed", tuple(columns), cells)


def _page_row(each: TrendSeries, covariate: Covariate) -> dict[str, Cell]:
    mean, effects = each.mean, effect(each, covariate)
    row: dict[str, Cell] = {
        "test": each.series.test,
        "quantity": each.series.name,
        "mean": _words(mean, each, sign=False),
        "trend": "–" if effects is None else _short(*effects, each),
        "seen": detectable_words(each, TREND, covariate, per=False),
        "p": each.smallest,
        "verdict": str(each.verdict),
    }
    if each.jump is not None:
        row |= {
            "jump": _short(*jump_of(each, each.jump), each),
            "before": _before(each, each.jumps) or "–",
            "jump_seen": detectable_words(each, JUMP, covariate),
        }
    return row


def points_table(trends: Trends) -> Table:
    """Table of all points of all numbers."""
    columns = (
        Column("test", "Test"),
        Column("quantity", "Quantity"),
        Column("unit", "Unit"),
        Column("number", "Run no.", exact=True),
        Column("run", "Run"),
        Column("x", trends.covariate.label, exact=True),
        Column("value", "Value"),
    )
    rows = (
        {
            "test": each.series.test,
            "quantity": each.series.name,
            "unit": pretty_unit(each.series.display),
            "number": point.member.number,
            "run": point.member.name,
            "x": float(place) if math.isfinite(place) else None,
            "value": in_unit(point.estimate, each.series.display),
        }
        for each in trends.followed
        for place, point in zip(each.x, each.series.points, strict=True)
    )
    return Table("points", "All points", columns, tuple(rows))


def circumstances_table(trends: Trends) -> Table:
    """Table of the differences of each run from the previous run."""
    columns = (
        Column("from", "Run"),
        Column("to", "and the next"),
        Column("where", "Where"),
        Column("path", "Field"),
        Column("before", "Before"),
        Column("after", "After"),
    )
    rows = [
        {
            "from": f"{n}",
            "to": f"{n + 1}",
            "where": change.where,
            "path": change.path,
            "before": change.reference,
            "after": change.other,
        }
        for n, changes in enumerate(trends.circumstances, start=1)
        for change in changes
    ]
    return Table("circumstances", "What differs between neighbouring runs", columns, tuple(rows))


def runs_table(trends: Trends) -> Table:
    """Table of the runs, numbered in order of time."""
    columns = (
        Column("number", "No.", exact=True),
        Column("run", "Run"),
        Column("started", "Started"),
        Column("x", trends.covariate.label, trends.covariate.unit, exact=True),
        Column("status", "Status"),
        Column("damaged", "Damaged places", exact=True),
    )
    rows = (
        {
            "number": member.number,
            "run": member.name,
            "started": member.run.header.created,
            "x": x if math.isfinite(x := trends.covariate.at(member, "")) else None,
            "status": str(member.run.status),
            "damaged": len(member.damaged),
        }
        for member in trends.members
    )
    return Table("runs", "The runs", columns, tuple(rows))


def effect(each: TrendSeries, covariate: Covariate) -> tuple[Estimate, Estimate] | None:
    """Trend per `covariate.per`, in the display unit and over the mean; None without a trend."""
    if each.trend is None:
        return None
    slope, size = each.trend.slope, covariate.step
    return (
        each.estimate("trend", slope, each.series.display, size),
        _shared(each, each.estimate("trend", slope, "", size)),
    )


def jump_of(each: TrendSeries, jump: Jump) -> tuple[Estimate, Estimate]:
    """Jump in the display unit, and over the mean."""
    return (
        each.estimate("jump", jump.size, each.series.display),
        _shared(each, each.estimate("jump", jump.size, "")),
    )


def headline(each: TrendSeries, trends: Trends) -> str:
    """Sentence on a declared number, without a period."""
    phrases = [f"{capitalized(each.series.name)} ({each.series.test})"]
    if each.verdict is not Verdict.JUMPED:
        follows = trends.covariate.name in (TIME, ORDER)
        verb = "drifts by" if follows else f"follows {trends.covariate.name}:"
        if each.verdict is Verdict.CHANGED:
            verb = "changes; as a drift, by"
        phrases.append(f"{verb} {_effect_words(each, trends.covariate)}")
    jumps = each.jumps
    if each.verdict is Verdict.CHANGED and each.jump is not None:
        jumps = (each.jump,)
    for jump in jumps:
        as_ = "or as a jump" if each.verdict is Verdict.CHANGED else "jumped"
        phrases.append(f"{as_} {_jump_words(each, jump, trends)}")
    return f"{phrases[0]} {', '.join(phrases[1:])}"


def beside_the_jump(each: TrendSeries, jump: Jump, trends: Trends) -> str:
    """Sentence on other changes at the place of a jump; "" without any."""
    first, last = _runs_around(each, jump)
    changes = [c for gap in trends.circumstances[first - 1 : last - 1] for c in gap]
    if not changes:
        return ""
    listed = [
        f"{c.where}{f' {c.path}' if c.path else ''} from {c.reference} to {c.other}"
        for c in changes[:CIRCUMSTANCES]
    ]
    more = f", and {len(changes) - CIRCUMSTANCES} more" if len(changes) > CIRCUMSTANCES else ""
    return f"Between runs {first} and {last} changed, too: {'; '.join(listed)}{more}."


def sentences(trends: Trends) -> Iterator[str]:
    """Sentences that summarize the trends."""
    runs, judged = len(trends.members), trends.judged
    yield (
        f"{runs} runs have {len(trends.followed)} numbers in common, of which "
        f"{count(judged, 'is', 'are')} judged."
    )
    declared = len(trends.declared)
    along = trends.covariate.name
    if declared:
        numbers = count(declared, "is", "are")
        yield (
            f"{numbers} declared to change: at most {100 * RATE:g} % of what is declared so is "
            f"expected to be false (Benjamini and Hochberg over {trends.tested} tests)."
        )
    elif judged:
        yield (
            f"No trend over {along} is shown. That does not say that there is none: the table says "
            "of each number how large one would have been seen."
        )
    if trends.covariate.ordered and runs < LEAST_FOR_A_JUMP:
        yield f"Whether anything has jumped is not determined: that takes {LEAST_FOR_A_JUMP} runs."
    yield from trends.notes


def not_judged(trends: Trends) -> Iterator[str]:
    """Reasons for no verdict with their counts (`counted`)."""
    return counted(each.reason for each in trends.of(Verdict.NOT_JUDGED))


def detectable_words(
    each: TrendSeries, name: str, covariate: Covariate, *, per: bool = True
) -> str:
    """Smallest detectable effect: `0.12 N·m per month (1.3 %)`."""
    size = detectable(each, name, covariate)
    if size is None:
        return "–"
    share = size * each.share
    part = f" ({number(100 * share, 2)} %)" if math.isfinite(share) else ""
    unit = pretty_unit(each.series.display)
    along = f" per {covariate.per}" if per and name == TREND else ""
    return f"{number(size, 2)} {unit}".rstrip() + f"{along}{part}"


def _row(each: TrendSeries, covariate: Covariate) -> dict[str, Cell]:
    row: dict[str, Cell] = {
        "test": each.series.test,
        "quantity": each.series.name,
        "unit": pretty_unit(each.series.display),
        "runs": len(each.series.points),
        "verdict": str(each.verdict),
        "reason": str(each.reason),
        "notes": "; ".join((*each.notes, *each.series.left_out)),
    }
    effects = effect(each, covariate)
    if effects is None or each.trend is None:
        return row
    adjusted = each.adjusted or {}
    row |= {
        "mean": each.mean,
        "trend": effects[0],
        "trend_share": effects[1],
        "p_trend": each.p.get(TREND),
        "p_trend_adjusted": adjusted.get(TREND),
        "detectable_trend": detectable(each, TREND, covariate),
        "scatter": each.series.scale * each.trend.scatter,
        "correlation": each.trend.correlation,
    }
    if each.jump is None:
        return row
    size, share = jump_of(each, each.jump)
    return row | {
        "jump_before": _before(each, each.jumps or (each.jump,)),
        "jump": size,
        "jump_share": share,
        "p_jump": each.jump.p,
        "p_jump_adjusted": adjusted.get(JUMP),
        "detectable_jump": detectable(each, JUMP, covariate),
    }


def detectable(each: TrendSeries, name: str, covariate: Covariate) -> float | None:
    """Smallest detectable effect in the display unit; None if unknown."""
    size = (each.detectable or {}).get(name)
    if size is None:
        return None
    return size * each.series.scale * (covariate.step if name == TREND else 1.0)


def _shared(each: TrendSeries, estimate: Estimate) -> Estimate:
    """Estimate over the mean; NaN if the mean is too uncertain."""
    share = each.share
    if not math.isfinite(share):
        return Estimate.without_interval(estimate.name, math.nan, "", MEAN_NEAR_ZERO())
    ends = [None if end is None else share * end for end in (estimate.low, estimate.high)]
    return replace(estimate, value=share * estimate.value, unit="", low=ends[0], high=ends[1])


def _short(size: Estimate, share: Estimate, each: TrendSeries) -> str:
    """`+1.53 (1.38 to 1.70) N·m, 5.9 %`."""
    part = f", {number(100 * share.value, 2)} %" if math.isfinite(share.value) else ""
    return f"{_words(size, each)}{part}"


def _effect_words(each: TrendSeries, covariate: Covariate) -> str:
    effects = effect(each, covariate)
    if effects is None:
        return "–"
    size, share = effects
    return f"{_words(size, each)} per {covariate.per}{_percent(share)}"


def _jump_words(each: TrendSeries, jump: Jump, trends: Trends) -> str:
    size, share = jump_of(each, jump)
    first, last = _runs_around(each, jump)
    return f"by {_words(size, each)}{_percent(share)} between runs {first} and {last}"


def _words(size: Estimate, each: TrendSeries, *, sign: bool = True) -> str:
    plus = "+" if sign and size.value > 0 else ""
    unit = pretty_unit(each.series.display)
    return f"{plus}{interval(size.value, size.low, size.high)} {unit}".rstrip()


def _percent(share: Estimate) -> str:
    if not math.isfinite(share.value) or share.low is None or share.high is None:
        return ""
    return f" ({interval(100 * share.value, 100 * share.low, 100 * share.high)} %)"


def _before(each: TrendSeries, jumps: Sequence[Jump]) -> str:
    return ", ".join(str(each.series.points[jump.place].member.number) for jump in jumps)


def _runs_around(each: TrendSeries, jump: Jump) -> tuple[int, int]:
    """Numbers of the runs around a jump, which include 95 % of the weight of its places."""
    points = each.series.points
    low, high = jump.between
    return points[low - 1].member.number, points[high].member.number
