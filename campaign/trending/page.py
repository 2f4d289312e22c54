"""Trends as a folder: one self-contained page, its tables and figures, and JSON."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from campaign import __version__
from campaign.access.estimates import row_of
from campaign.access.plain_json import json_text
from campaign.axis_kind import speaking_of, words_here
from campaign.estimation.difference import in_unit
from campaign.estimation.family import RATE
from campaign.estimation.trends.family import POWER
from campaign.report.content.tables import table_csv
from campaign.report.drawing.drawn import Drawn
from campaign.report.drawing.figures import draw
from campaign.report.output import refuse_other, write_page
from campaign.report.page.folder import ShownFigure
from campaign.report.page.making import Making
from campaign.report.page.packaged import fill_packaged
from campaign.report.palette import variables
from campaign.result import Figure
from campaign.trending.figures import declared_figure, small_multiples
from campaign.trending.tables import (
    beside_the_jump,
    circumstances_table,
    effect,
    followed_table,
    headline,
    jump_of,
    not_judged,
    page_table,
    points_table,
    runs_table,
    sentences,
)
from campaign.trending.trends import WITHIN, Followed, Trends, Verdict

PAGE, DATA = "trend.html", "trend.json"
HEADLINES = 20
"""Most declared numbers that are told on top, and drawn."""


def write_trends(trends: Trends, output: Path, packaged_templates: Path, command: str) -> Path:
    """Write the page, its data, tables and figures into the folder `output`; the page's path.

    The same archives give the same bytes. Raises UsageError when `output` is something else than
    trends.
    """
    refuse_other(output, PAGE)
    html, files = render(trends, packaged_templates, command)
    return write_page(output, PAGE, {PAGE: html, DATA: as_json(trends, command), **files})


def render(trends: Trends, packaged_templates: Path, command: str) -> tuple[str, dict[str, str]]:
    """The page's text, and the other files by name; nothing is written."""
    making = Making()
    folder = making.folder
    making.problems += [problem for member in trends.members for problem in member.problems]
    making.problems += [problem for fitted in trends.fitted for problem in fitted.problems]
    declared = trends.declared[:HEADLINES]
    shown = [_declared(each, trends, making, n) for n, each in enumerate(declared, start=1)]
    multiples = small_multiples(trends.of(Verdict.NOT_SHOWN), trends.covariate)
    small = None if multiples is None else _drawn(multiples, making)
    every = followed_table("followed", "All numbers", trends.followed, trends.covariate)
    judged = [each for each in trends.followed if each.change is not None]
    on_page = page_table(judged, trends.covariate)
    circumstances = circumstances_table(trends)
    with speaking_of(trends.members[0].sides):
        cancelled = {words_here(source) for each in trends.followed for source in each.cancelled}
    context = {
        "trends": trends,
        "title": title_of(trends),
        "shown": shown,
        "more": max(0, len(trends.declared) - HEADLINES),
        "small": [small] if small else [],
        "sentences": tuple(sentences(trends)),
        "judged": folder.shown_table(on_page, (), "judged") if judged else None,
        "all": folder.table(table_csv(every), "followed"),
        "points": folder.table(table_csv(points_table(trends)), "points"),
        "not_judged": tuple(not_judged(trends)),
        "runs": folder.shown_table(runs_table(trends), (), "runs"),
        "circumstances": folder.shown_table(circumstances, (), "circumstances")
        if circumstances.rows
        else None,
        "damaged": [member for member in trends.members if member.damaged],
        "cancelled": sorted(cancelled),
        "problems": making.problems,
        "rate": f"{100 * RATE:g} %",
        "power": f"{100 * POWER:g} %",
        "command": command,
        "version": __version__,
        "colours": variables(),
    }
    return fill_packaged("trend.html", context, packaged_templates), folder.files


def title_of(trends: Trends) -> str:
    """What the page is of."""
    benches = {test.bench.name for m in trends.members for test in m.tests if test.bench}
    rig = " and ".join(sorted(benches)) or "runs"
    return f"{rig}: {len(trends.members)} runs over {trends.covariate.name}"


@dataclass(frozen=True)
class ShownNumber:
    """A declared number on the page."""

    headline: str
    caution: str
    beside: tuple[str, ...]
    figures: tuple[ShownFigure, ...]


def _declared(each: Followed, trends: Trends, making: Making, place: int) -> ShownNumber:
    told = headline(each, trends)
    figure = declared_figure(each, trends, told, place)
    notes = (f"{note[:1].upper()}{note[1:]}." for note in each.notes if note != WITHIN)
    beside = (*notes, *(beside_the_jump(each, jump, trends) for jump in each.jumps))
    drawn = tuple(filter(None, [_drawn(figure, making)]))
    caution = WITHIN if WITHIN in each.notes else ""
    return ShownNumber(told, caution, tuple(filter(None, beside)), drawn)


def _drawn(figure: Figure, making: Making) -> ShownFigure | None:
    return making.attempt(
        figure.key,
        lambda: making.folder.figure(figure, Drawn.of(draw(figure), figure), (), figure.key),
    )


def as_json(trends: Trends, command: str) -> str:
    """Every number with its points and what was judged of it, for machines."""
    covariate = trends.covariate
    tree = {
        "schema": 1,
        "program": f"campaign {__version__}",
        "command": command,
        "over": {"name": covariate.name, "unit": covariate.unit, "per": covariate.per},
        "family": {"tests": trends.tested, "rate": RATE, "level": trends.level, "power": POWER},
        "runs": [
            {
                "number": member.number,
                "name": member.name,
                "digest": member.run.identity,
                "created": member.run.header.created,
                "x": covariate.at(member, ""),
                "damaged": len(member.damaged),
            }
            for member in trends.members
        ],
        "numbers": [_tree(each, trends) for each in trends.followed],
        "notes": list(trends.notes),
        "problems": [p for fitted in trends.fitted for p in fitted.problems]
        + [p for member in trends.members for p in member.problems],
    }
    return json_text(tree)


def _tree(each: Followed, trends: Trends) -> dict[str, Any]:
    series = each.series
    tree: dict[str, Any] = {
        "test": series.test,
        "quantity": series.quantity,
        "conditions": dict(series.conditions),
        "unit": series.display,
        "verdict": str(each.verdict),
        "reason": str(each.reason),
        "notes": list(each.notes),
        "left_out": list(series.left_out),
        "cancelled": list(each.cancelled),
        "points": [
            {"run": p.member.number, "x": float(x), **row_of(in_unit(p.estimate, series.display))}
            for p, x in zip(series.points, each.x, strict=True)
        ],
    }
    effects = effect(each, trends.covariate)
    if effects is None or each.change is None:
        return tree
    adjusted = dict(each.adjusted or {})
    return tree | {
        "mean": row_of(each.mean),
        "trend": row_of(effects[0]),
        "trend_share": row_of(effects[1]),
        "p": each.p,
        "adjusted": adjusted,
        "shape": each.change.shape,
        "detectable": {
            name: in_display * (trends.covariate.step if name == "trend" else 1.0)
            for name, in_display in _detectable(each).items()
        },
        "jumps": [
            {
                "before_run": series.points[jump.place].member.number,
                "between": [
                    series.points[jump.between[0] - 1].member.number,
                    series.points[jump.between[1]].member.number,
                ],
                "size": row_of(jump_of(each, jump)[0]),
                "share": row_of(jump_of(each, jump)[1]),
                "p": jump.p,
            }
            for jump in each.jumps
        ],
    }


def _detectable(each: Followed) -> dict[str, float]:
    from campaign.units import convert

    own = float(convert(1.0, each.series.unit, each.series.display))
    return {name: own * size for name, size in (each.detectable or {}).items()}
