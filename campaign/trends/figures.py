"""Figures of numbers over runs: points with intervals, lines, jumps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from campaign.estimation.difference import in_unit
from campaign.estimation.intervals import LEVEL
from campaign.estimation.trends.changes import Trend
from campaign.result import Axis, Curve, Figure, Mark, Panel
from campaign.text import capitalized
from campaign.trends.covariates import Covariate
from campaign.trends.rig_trends import Trends, TrendSeries, Verdict

ALONG = 25
"""Number of points of a line and its band."""
SMALL = 12
"""Largest number of small panels."""
TITLE = 38
"""Largest number of characters in the title of a small panel."""


def declared_figure(each: TrendSeries, trends: Trends, headline: str, place: int) -> Figure:
    """Figure of one declared number."""
    return Figure(
        f"declared-{place}",
        capitalized(each.series.name),
        f"{headline}. Bars are 95 % intervals of each run alone"
        + ("; the band is that of the line." if each.verdict is not Verdict.JUMPED else
           "; lines are the levels before and behind."),
        headline,
        (_panel(each, trends.covariate, small=False),),
    )  # fmt: skip


def small_multiples(rest: Sequence[TrendSeries], covariate: Covariate) -> Figure | None:
    """Figure of judged numbers without a trend, in their order; None without any."""
    shown = rest[:SMALL]
    if not shown:
        return None
    more = f" {len(rest) - SMALL} more are in the table." if len(rest) > SMALL else ""
    return Figure(
        "no-trend-shown",
        "No trend shown",
        "Points: runs with their 95 % intervals. Lines and bands: what a trend would be, and its "
        f"95 % interval, as far as a horizontal line fits into it.{more}",
        "; ".join(each.series.name for each in shown),
        tuple(_panel(each, covariate, small=True) for each in shown),
        across=2,
    )


def _panel(each: TrendSeries, covariate: Covariate, *, small: bool) -> Panel:
    series = each.series
    estimates = [in_unit(point.estimate, series.display) for point in series.points]
    curves = [Curve.of(each.x, estimates, "" if small else "runs", "measured")]
    marks: list[Mark] = []
    if each.verdict is Verdict.JUMPED:
        curves += _levels(each)
        marks = [_mark(each, jump.place) for jump in each.jumps]
    elif each.trend is not None:
        curves.append(_line(each, each.trend, "" if small else "trend"))
    name, _, words = capitalized(series.name).partition(", ")
    title = f"{series.test}: {words}" if words else series.test
    title = title if len(title) <= TITLE else f"{title[: TITLE - 1]}…"
    return Panel(
        Axis(covariate.label if not small else _short(covariate), covariate.unit),
        Axis(name, series.display),
        tuple(curves),
        title if small else "",
        tuple(marks),
    )


def _short(covariate: Covariate) -> str:
    return "Time" if covariate.label.startswith("Time since") else covariate.label


def _line(each: TrendSeries, trend: Trend, label: str) -> Curve:
    x = np.linspace(float(np.min(each.x)), float(np.max(each.x)), ALONG)
    own = each.series.scale
    known = [trend.at(float(at)) for at in x]
    ends = own * np.array([mixture.interval(LEVEL) for mixture in known])
    y = own * np.array([mixture.value for mixture in known])
    low, high = np.minimum(*ends.T), np.maximum(*ends.T)
    return Curve(x, y, label, "fit", "line", low=low, high=high)


def _levels(each: TrendSeries) -> list[Curve]:
    """Unweighted mean of each segment between jumps."""
    values = np.array([
        in_unit(point.estimate, each.series.display).value for point in each.series.points
    ])  # fmt: skip
    places = [0, *(jump.place for jump in each.jumps), len(values)]
    curves = []
    for n, (first, stop) in enumerate(pairwise(places)):
        level = float(np.mean(values[first:stop]))
        ends = each.x[[first, stop - 1]]
        curves.append(Curve(ends, np.array([level, level]), "" if n else "mean level", "fit"))
    return curves


def _mark(each: TrendSeries, place: int) -> Mark:
    before, behind = float(each.x[place - 1]), float(each.x[place])
    number = each.series.points[place].member.number
    return Mark(f"before run {number}", x=0.5 * (before + behind), series="alternative")
