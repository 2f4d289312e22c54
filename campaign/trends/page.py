"""The folder of trends: page, tables, figures, JSON."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from campaign import __version__
from campaign.api.estimates import row_of
from campaign.axis_kind import in_axis_terms
from campaign.estimation.difference import in_unit
from campaign.estimation.family import RATE
from campaign.estimation.trends.changes import POWER
from campaign.report.article import write_article
from campaign.report.content.tables import table_csv
from campaign.report.formats.interface import Format
from campaign.report.page.article import Article, PageParts, Part, damage_text, problems_part
from campaign.report.page.folder import Folder
from campaign.report.page.pieces import Files, Items, Paragraph, Piece
from campaign.text import capitalized
from campaign.trends.figures import declared_figure, small_multiples
from campaign.trends.rig_trends import WITHIN, Trends, TrendSeries, Verdict
from campaign.trends.tables import (
    beside_the_jump,
    circumstances_table,
    detectable,
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

NAME = "trend"
HEADLINES = 20
"""Largest number of declared numbers that the page lists at the top and draws."""


def write_trends(
    trends: Trends,
    output: Path,
    packaged_templates: Path,
    command: str,
    templates: Path | None = None,
    formats: Sequence[Format] = (),
) -> Path:
    """Write the trends into the folder `output`; return the page's path. As `write_article`."""
    make = partial(article_of, trends, command)
    return write_article(NAME, make, output, packaged_templates, templates, formats)


def article_of(trends: Trends, command: str) -> Article:
    """Page of the trends."""
    making = PageParts()
    making.problems += [problem for member in trends.members for problem in member.problems]
    making.problems += [problem for fitted in trends.fitted for problem in fitted.problems]
    parts = tuple(_parts(trends, making))
    damage = [damage_text(each.name, each.damaged) for each in trends.members if each.damaged]
    first, last = trends.members[0], trends.members[-1]
    header = first.run.header
    return Article(
        kind="Trends",
        command=command,
        title=title_of(trends),
        lede="Do the rig's numbers drift, have they jumped, do they follow something? From "
        f"{first.name} to {last.name}.",
        facts=(
            (
                "",
                (
                    ("First run", header.created),
                    ("Last run", last.run.header.created),
                    ("Samples from", header.source or header.backend or "not stated"),
                    ("Program", f"campaign {__version__}"),
                ),
            ),
        ),
        parts=(*problems_part("these runs", [*damage, *making.problems]), *parts),
        folder=making.folder,
        content=content_of(trends),
    )


def _parts(trends: Trends, making: PageParts) -> Iterator[Part]:
    folder = making.folder
    declared = trends.declared[:HEADLINES]
    shown = [_declared(each, trends, making, n) for n, each in enumerate(declared, start=1)]
    headlines = [headline for headline, _ in shown]
    if more := max(0, len(trends.declared) - HEADLINES):
        headlines.append(f"and {more} more, in the table")
    yield Part(
        "changes",
        "What changes",
        (
            Paragraph(" ".join(sentences(trends)), "lead"),
            *([Items(tuple(headlines))] if headlines else []),
            *(piece for _, pieces in shown for piece in pieces),
        ),
    )
    multiples = small_multiples(trends.of(Verdict.NOT_SHOWN), trends.covariate)
    small = None if multiples is None else making.drawn(multiples)
    if small is not None:
        yield Part("rest", "What shows no trend", (small,))
    yield Part("numbers", "All numbers", tuple(_numbers(trends, folder)))
    runs = folder.shown_table(runs_table(trends), (), "runs")
    circumstances = circumstances_table(trends)
    same = "Apart from their results, the archives of neighbouring runs do not differ."
    yield Part(
        "runs",
        "The runs",
        (
            runs,
            folder.shown_table(circumstances, (), "circumstances")
            if circumstances.rows
            else Paragraph(same),
        ),
    )
    yield Part("how", "How it was judged", tuple(map(Paragraph, _how(trends))))


def _numbers(trends: Trends, folder: Folder) -> Iterator[Piece]:
    judged = [each for each in trends.followed if each.change is not None]
    if judged:
        yield folder.shown_table(page_table(judged, trends.covariate), (), "judged")
    if why := tuple(not_judged(trends)):
        yield Paragraph("Not judged, and why:")
        yield Items(why)
    every = followed_table(trends.followed, trends.covariate)
    files = (
        (
            "All numbers with all p values, scatter and notes:",
            folder.table(table_csv(every), "followed"),
        ),
        ("All points:", folder.table(table_csv(points_table(trends)), "points")),
    )
    yield Files(files)


def _how(trends: Trends) -> Iterator[str]:
    yield (
        "A series is one quantity under the same conditions, in tests of the same kind. Each point "
        "counts with its own interval and with the scatter between runs, which may be correlated "
        "from run to run. Its size and correlation are integrated out, up to a correlation of 0.9. "
        "Intervals are of 95 %; of few runs they are wide."
    )
    sides = trends.members[0].sides
    cancelled = {
        in_axis_terms(source, sides) for each in trends.followed for source in each.cancelled
    }
    if cancelled:
        yield (
            "All runs rest on the same value of these, which moves all points alike and is in no "
            f"trend: {', '.join(sorted(cancelled))}."
        )
    if trends.covariate.ordered:
        yield (
            "A jump needs five runs, two on each side of it. Its p value is that of the likeliest "
            "place times the number of places. A line and a jump are distinguished where one "
            "fits at least three times as well as the other. A drift looks like a jump to a test "
            "for jumps, and the other way round: both are in the family."
        )
    yield (
        f"All {trends.tested} p values are one family: of what is declared, at most {100 * RATE:g} "
        "% is expected to be false (Benjamini and Hochberg). “Seen from” is the smallest effect "
        f"that would have been declared here with a probability of {100 * POWER:g} %, at the "
        "scatter that these runs have. Of what is only just declared, sizes tend to look larger "
        "than they are. A trend says nothing of its cause."
    )


def title_of(trends: Trends) -> str:
    """Title of the page."""
    benches = {test.bench.name for m in trends.members for test in m.tests if test.bench}
    rig = " and ".join(sorted(benches)) or "runs"
    return f"{rig}: {len(trends.members)} runs over {trends.covariate.name}"


def _declared(
    each: TrendSeries, trends: Trends, making: PageParts, place: int
) -> tuple[str, tuple[Piece, ...]]:
    """Headline of a declared number, and its pieces."""
    sentence = headline(each, trends)
    drawn = making.drawn(declared_figure(each, trends, sentence, place))
    notes = (f"{capitalized(note)}." for note in each.notes if note != WITHIN)
    beside = filter(None, (*notes, *(beside_the_jump(each, jump, trends) for jump in each.jumps)))
    caution = f"; {WITHIN}" if WITHIN in each.notes else ""
    pieces: list[Piece] = [] if drawn is None else [drawn]
    pieces += [Paragraph(text, "note") for text in beside]
    return f"{sentence}{caution}.", tuple(pieces)


def content_of(trends: Trends) -> dict[str, Any]:
    """JSON tree: every number with its points and verdict."""
    covariate = trends.covariate
    return {
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


def _tree(each: TrendSeries, trends: Trends) -> dict[str, Any]:
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
    return tree | {
        "mean": row_of(each.mean),
        "trend": row_of(effects[0]),
        "trend_share": row_of(effects[1]),
        "p": each.p,
        "adjusted": dict(each.adjusted or {}),
        "shape": each.change.shape,
        "detectable": {
            name: detectable(each, name, trends.covariate) for name in each.detectable or {}
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
