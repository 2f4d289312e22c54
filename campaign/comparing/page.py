"""The comparison as a folder: one self-contained page, its tables and its figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from campaign.axis_kind import speaking_of, words_here
from campaign.comparing.comparison import Against, Comparison
from campaign.comparing.judging import Pair
from campaign.comparing.overlays import Letters, overlays
from campaign.comparing.pairing import PairedTest
from campaign.comparing.pictures import draw_side_by_side, with_names
from campaign.comparing.tables import (
    alone_table,
    bare_differing,
    change_of,
    changes_table,
    headline,
    not_judged,
    pair_table,
    sentences,
    shorter,
)
from campaign.estimation.family import RATE
from campaign.references.judged import Verdict
from campaign.report.content.tables import table_csv
from campaign.report.drawing.drawn import Drawn
from campaign.report.drawing.figures import draw
from campaign.report.output import refuse_other, write_page
from campaign.report.page.changes import changes_figure
from campaign.report.page.folder import Download, Folder, ShownFigure, ShownTable
from campaign.report.page.making import Making
from campaign.report.page.packaged import fill_packaged
from campaign.report.palette import variables
from campaign.result import Figure, Table

PAGE = "comparison.html"
UNTOLD = ("test", "quantity", "conditions", "p")
"""Columns that a test's own tables leave to the table of all pairs."""
HEADLINES = 12
"""Most declared differences that are told on top of the page."""


@dataclass(frozen=True)
class ShownTest:
    """One test of the reference beside its partner.

    Attributes:
        title: of the reference's test, with the other's name where that differs.
        judged, rest: pairs that were judged, and those that were not; None without any.
        not_judged: why, with how many.
        cancelled: sources of systematic parts that cancel.
        notes: figures that cannot be laid over each other.
    """

    anchor: str
    title: str
    judged: ShownTable | None
    rest: ShownTable | None
    not_judged: tuple[str, ...]
    cancelled: tuple[str, ...]
    figures: tuple[ShownFigure, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class ShownAgainst:
    """One run against the reference, drawn and numbered."""

    against: Against
    anchor: str
    sentences: tuple[str, ...]
    headlines: tuple[str, ...]
    more: int
    bare: tuple[str, ...]
    picture: ShownFigure | None
    download: Download
    tests: tuple[ShownTest, ...]
    alone: ShownTable | None
    changes: ShownTable


def write_comparison(comparison: Comparison, output: Path, packaged_templates: Path) -> Path:
    """Write `comparison.html`, `tables/` and `figures/` into the folder `output`; the page's path.

    The same archives give the same bytes. Raises UsageError when `output` is anything but a
    comparison that was written here, or cannot be written.
    """
    refuse_other(output, PAGE)
    html, files = render(comparison, packaged_templates)
    return write_page(output, PAGE, {PAGE: html, **files})


def render(comparison: Comparison, packaged_templates: Path) -> tuple[str, dict[str, str]]:
    """The page's text, and the other files by name; nothing is written."""
    making = Making()
    making.problems += [problem for side in comparison.sides for problem in side.problems]
    several = len(comparison.against) > 1
    shown = [_against(each, comparison, making, several=several) for each in comparison.against]
    context = {
        "comparison": comparison,
        "shown": shown,
        "rate": f"{100 * RATE:g} %",
        "problems": making.problems,
        "colours": variables(),
    }
    return fill_packaged("compare.html", context, packaged_templates), making.folder.files


def _against(
    against: Against, comparison: Comparison, making: Making, *, several: bool
) -> ShownAgainst:
    letters = Letters(against.reference.letter, against.other.letter)
    both = (letters.reference, letters.other)
    prefix = f"{letters.other.lower()}-" if several else ""
    folder = making.folder
    table = pair_table("pairs", "All pairs", against.pairs, both)
    declared = against.of(Verdict.DIFFERENT)
    return ShownAgainst(
        against=against,
        anchor=f"against-{letters.other.lower()}",
        sentences=tuple(sentences(against, comparison.tested)),
        headlines=tuple(headline(pair) for pair in declared[:HEADLINES]),
        more=max(0, len(declared) - HEADLINES),
        bare=tuple(headline(pair) for pair in bare_differing(against)[:HEADLINES]),
        picture=making.attempt(
            "the picture of all changes",
            lambda: changes_figure(with_names(against.pairs), folder, f"{prefix}changes"),
        ),
        download=folder.table(table_csv(shorter(table, "finding")), f"{prefix}pairs"),
        tests=tuple(_tests(against, letters, prefix, making)),
        alone=_optional(alone_table(against), f"{prefix}only-in-one", folder),
        changes=folder.shown_table(
            changes_table(against.changes, both), (), f"{prefix}circumstances"
        ),
    )


def _optional(table: Table | None, name: str, folder: Folder) -> ShownTable | None:
    return None if table is None else folder.shown_table(table, (), name)


def _tests(against: Against, letters: Letters, prefix: str, making: Making) -> Iterator[ShownTest]:
    for place, tested in enumerate(against.pairing.tests, start=1):
        pairs = [pair for pair in against.pairs if pair.test is tested.reference]
        if not pairs:
            continue
        name, title = tested.reference.name, tested.reference.title
        if tested.other.name != name:
            title += f" ({letters.other}: {tested.other.title})"
        order = list(Verdict)
        judged = [pair for pair in pairs if pair.verdict is not Verdict.NOT_JUDGED]
        judged.sort(key=lambda pair: order.index(pair.verdict))
        rest = [pair for pair in pairs if pair.verdict is Verdict.NOT_JUDGED]
        both = (letters.reference, letters.other)
        tables = (
            shorter(pair_table("judged", "Found in both runs", judged, both), *UNTOLD, "reason"),
            shorter(pair_table("not-judged", "Not judged", rest, both), *UNTOLD, "verdict"),
        )
        shown = [
            making.folder.shown_table(table, (), f"{prefix}{name}-{table.key}")
            if table.rows
            else None
            for table in tables
        ]
        figures, notes = _figures(tested, pairs, letters, f"{prefix}{name}", making)
        with speaking_of(tested.reference.sides):
            cancelled = sorted(map(words_here, against.shared.get(name, ())))
        yield ShownTest(
            anchor=f"{letters.other.lower()}-test-{place}",
            title=title,
            judged=shown[0],
            rest=shown[1],
            not_judged=tuple(not_judged(rest)),
            cancelled=tuple(cancelled),
            figures=figures,
            notes=notes,
        )


def _figures(
    tested: PairedTest, pairs: Sequence[Pair], letters: Letters, name: str, making: Making
) -> tuple[tuple[ShownFigure, ...], tuple[str, ...]]:
    """Numbers side by side, figures over each other, and why some are not."""
    folder = making.folder
    found = [
        making.attempt(
            f"{name}: numbers side by side", lambda: _side_by_side(pairs, letters, name, folder)
        )
    ]
    notes = []
    for each in overlays(tested.reference, tested.other, letters):
        if isinstance(each, str):
            notes.append(each)
        else:
            drawn = partial(_drawn, each, letters, name, folder)
            found.append(making.attempt(f"{name}: {each.key}", drawn))
    return tuple(figure for figure in found if figure is not None), tuple(notes)


def _drawn(figure: Figure, letters: Letters, name: str, folder: Folder) -> ShownFigure:
    """Each run in the look that it has in all pictures of the page."""
    chosen = dict(zip((letters.reference, letters.other), letters.looks, strict=True))
    svg = draw(figure, chosen=chosen)
    return folder.figure(figure, Drawn.of(svg, figure), (), f"{name}-{figure.key}", looks=chosen)


def _side_by_side(
    pairs: Sequence[Pair], letters: Letters, name: str, folder: Folder
) -> ShownFigure | None:
    svg = draw_side_by_side(pairs, letters)
    if svg is None:
        return None
    words = "; ".join(f"{pair.quantity}: {change_of(pair)}" for pair in pairs[:12])
    return folder.picture(
        Drawn.of(svg),
        f"Numbers of {letters.reference} and {letters.other} side by side",
        "With their 95 % intervals; what was declared different is in bold.",
        f"Changes: {words}.",
        f"{name}-side-by-side",
    )
