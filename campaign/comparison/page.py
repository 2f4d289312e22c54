"""The folder of a comparison: page, tables and figures."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from campaign.axis_kind import in_axis_terms
from campaign.comparison.finding_pairs import Pair
from campaign.comparison.overlays import LOOKS, Letters, overlays
from campaign.comparison.pictures import draw_side_by_side, with_names
from campaign.comparison.run_comparison import Against, Comparison, Side
from campaign.comparison.same_quantity import PairedTest
from campaign.comparison.tables import (
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
from campaign.references.verdict import Verdict
from campaign.report.article import write_article
from campaign.report.content.tables import table_csv
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.formats.interface import Format
from campaign.report.page.article import Article, PageParts, Part, damage_text, problems_part
from campaign.report.page.folder import Folder, ShownFigure
from campaign.report.page.pictures import changes_figure
from campaign.report.page.pieces import Files, FoldedSection, Items, Paragraph, Piece

NAME = "comparison"
UNTOLD = ("test", "quantity", "conditions", "p")
"""Columns of the table of all pairs that the tables of a test omit."""
HEADLINES = 12
"""Largest number of declared differences at the top of the page."""


def write_comparison(
    comparison: Comparison,
    output: Path,
    packaged_templates: Path,
    templates: Path | None = None,
    formats: Sequence[Format] = (),
) -> Path:
    """Write the comparison into the folder `output`; return the page's path. As `write_article`."""
    make = partial(article_of, comparison)
    return write_article(NAME, make, output, packaged_templates, templates, formats)


def article_of(comparison: Comparison) -> Article:
    """Page of a comparison."""
    making = PageParts()
    making.problems += [problem for side in comparison.sides for problem in side.problems]
    several = len(comparison.against) > 1
    parts = [
        part
        for each in comparison.against
        for part in _against(each, comparison, making, several=several)
    ]
    damage = [damage_text(each.letter, each.damaged) for each in comparison.sides if each.damaged]
    others = "; each of the others is compared with it" if several else ""
    return Article(
        kind="Comparison",
        command=shlex.join(["campaign", "compare", *(s.run.name for s in comparison.sides)]),
        title=comparison.title,
        lede=f"{comparison.sides[0].letter} is the reference{others}. Differences are the other "
        "less the reference.",
        facts=tuple((side.letter, tuple(_facts(side))) for side in comparison.sides),
        parts=(
            *problems_part("this comparison", [*damage, *making.problems]),
            *parts,
            Part("how", "How it was judged", tuple(map(Paragraph, _how(comparison)))),
        ),
        folder=making.folder,
    )


def _facts(side: Side) -> Iterator[tuple[str, str]]:
    header = side.run.header
    yield "Run", side.run.name
    yield "Title", side.title
    yield "Started", header.created[:16].replace("T", " ")
    yield "Status", str(side.run.status)
    yield "Samples from", header.source or header.backend or "not stated"
    yield "Program", header.versions.get("campaign", "not stated")
    if header.operator:
        yield "Operator", header.operator


def _how(comparison: Comparison) -> Iterator[str]:
    yield (
        "A pair is one quantity under the same conditions, in tests of the same "
        "kind. Their difference has the standard error of two independent numbers, with the "
        "degrees of freedom of Welch and Satterthwaite; half-widths of lopsided intervals add in "
        "squares. The change in percent is in the interval exactly where the difference is."
    )
    yield (
        f"All {comparison.tested} p values of this page are one family. Of what is declared "
        f"different, at most {100 * RATE:g} % is expected to be false (Benjamini and Hochberg). "
        "Each interval is one of 95 % by itself; of the changes that are declared, the largest "
        "tend to look larger than they are."
    )
    yield (
        "A number of a single trial is not judged: its interval does not have the scatter between "
        "trials in it. Errors that both runs share cancel, and errors of unknown size are in no "
        "interval. A difference says nothing of its cause."
    )


def _against(
    against: Against, comparison: Comparison, making: PageParts, *, several: bool
) -> Iterator[Part]:
    letters = (against.reference.letter, against.other.letter)
    named = " and ".join(letters)
    other = letters[1].lower()
    prefix = f"{other}-" if several else ""
    folder = making.folder
    picture = making.attempt(
        "the picture of all changes",
        lambda: changes_figure(with_names(against.pairs), folder, f"{prefix}changes"),
    )
    table = pair_table("pairs", "All pairs", against.pairs, letters)
    download = folder.table(table_csv(shorter(table, "finding")), f"{prefix}pairs")
    yield Part(
        f"against-{other}",
        f"{named}: what differs",
        (
            Paragraph(" ".join(sentences(against, comparison.tested)), "lead"),
            *_headlines(against),
            *([] if picture is None else [picture]),
            Files((("All pairs, with p values and reasons:", download),)),
        ),
        contents=named,
    )
    yield from _tests(against, letters, prefix, making)
    alone, changed = alone_table(against), changes_table(against.changes, letters)
    circumstances = folder.shown_table(changed, (), f"{prefix}circumstances")
    yield Part(
        f"besides-{other}",
        f"{named}: what differs besides",
        (
            circumstances if against.changes else Paragraph("No difference is archived."),
            *([] if alone is None else [folder.shown_table(alone, (), f"{prefix}only-in-one")]),
        ),
    )


def _headlines(against: Against) -> Iterator[Piece]:
    declared = [headline(pair) for pair in against.of(Verdict.DIFFERENT)]
    if len(declared) > HEADLINES:
        declared[HEADLINES:] = [f"and {len(declared) - HEADLINES} more, in the tables"]
    if declared:
        yield Items(tuple(declared))
    if bare := bare_differing(against)[:HEADLINES]:
        heading = "Simulated, without an interval, and not equal (nothing is declared of them):"
        yield Paragraph(heading)
        yield Items(tuple(map(headline, bare)))


def _tests(against: Against, letters: Letters, prefix: str, making: PageParts) -> Iterator[Part]:
    for place, tested in enumerate(against.pairing.tests, start=1):
        pairs = [pair for pair in against.pairs if pair.test is tested.reference]
        if not pairs:
            continue
        title = tested.reference.title
        if tested.other.name != tested.reference.name:
            title += f" ({letters[1]}: {tested.other.title})"
        pieces = tuple(_test(tested, pairs, against, letters, prefix, making))
        yield Part(f"{letters[1].lower()}-test-{place}", title, pieces, role="test")


def _test(
    tested: PairedTest,
    pairs: Sequence[Pair],
    against: Against,
    letters: Letters,
    prefix: str,
    making: PageParts,
) -> Iterator[Piece]:
    name, folder = f"{prefix}{tested.reference.name}", making.folder
    order = list(Verdict)
    judged = [pair for pair in pairs if pair.verdict is not Verdict.NOT_JUDGED]
    judged.sort(key=lambda pair: order.index(pair.verdict))
    rest = [pair for pair in pairs if pair.verdict is Verdict.NOT_JUDGED]
    table = shorter(pair_table("judged", "Found in both runs", judged, letters), *UNTOLD, "reason")
    if table.rows:
        yield folder.shown_table(table, (), f"{name}-judged")
    table = shorter(pair_table("not-judged", "Not judged", rest, letters), *UNTOLD, "verdict")
    if table.rows:
        why = Items(tuple(not_judged(rest)))
        shown = folder.shown_table(table, (), f"{name}-not-judged")
        yield FoldedSection(f"Found in both runs and not judged ({len(rest)})", (why, shown))
    shared = against.shared.get(tested.reference.name, ())
    cancelled = ", ".join(sorted(in_axis_terms(each, tested.reference.sides) for each in shared))
    if cancelled:
        common = "Both runs have these errors in common, so that they are in no difference"
        yield Paragraph(f"{common}: {cancelled}.", "note")
    figures, notes = _figures(tested, pairs, letters, name, making)
    yield from figures
    yield from (Paragraph(note, "note") for note in notes)


def _figures(
    tested: PairedTest, pairs: Sequence[Pair], letters: Letters, name: str, making: PageParts
) -> tuple[tuple[ShownFigure, ...], tuple[str, ...]]:
    """Figures of numbers side by side and of overlaid curves; reasons for missing overlays."""
    folder = making.folder
    figures = [
        making.attempt(
            f"{name}: numbers side by side", lambda: _side_by_side(pairs, letters, name, folder)
        )
    ]
    notes = []
    # A run has one look in all pictures of the page.
    chosen = dict(zip(letters, LOOKS, strict=True))
    for each in overlays(tested.reference, tested.other, letters):
        if isinstance(each, str):
            notes.append(each)
        else:
            figures.append(making.drawn(each, f"{name}-", chosen))
    return tuple(figure for figure in figures if figure is not None), tuple(notes)


def _side_by_side(
    pairs: Sequence[Pair], letters: Letters, name: str, folder: Folder
) -> ShownFigure | None:
    svg = draw_side_by_side(pairs, letters)
    if svg is None:
        return None
    words = "; ".join(f"{pair.quantity}: {change_of(pair)}" for pair in pairs[:12])
    return folder.picture(
        DrawingFiles.of(svg),
        f"Numbers of {' and '.join(letters)} side by side",
        "With their 95 % intervals; what was declared different is in bold.",
        f"Changes: {words}.",
        f"{name}-side-by-side",
    )
