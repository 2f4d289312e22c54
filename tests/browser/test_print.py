"""On paper nothing is hidden, nothing is cut, and every page has its number."""

from __future__ import annotations

import re
from dataclasses import dataclass

import pytest

from tests.browser.conftest import missing
from tests.browser.pages import FIGURES, ROWS

A4 = (595.0, 842.0)
"""Points."""
MARGIN = 72.0
"""Points from an edge within which a page's number stands."""


@dataclass(frozen=True)
class Sheet:
    """A page of paper: its size in points, its text, and what stands at its edges."""

    size: tuple[float, float]
    text: str
    edges: str


@pytest.fixture(scope="module")
def printed(browser, page_file, tmp_path_factory):
    """The sheets that a report is printed on: `printed("long")`, made and read once."""
    try:
        import pypdf
    except ImportError:
        missing("no pypdf")
    made = {}

    def sheets(name):
        if name not in made:
            context = browser.new_context(color_scheme="dark")
            page = context.new_page()
            page.goto(page_file(name).as_uri())
            # Lines and marks take long to read back, and move no text.
            page.add_style_tag(content="svg path, svg use, svg image { display: none }")
            path = tmp_path_factory.mktemp("print") / f"{name}.pdf"
            page.pdf(path=path, prefer_css_page_size=True)
            context.close()
            made[name] = [sheet(each) for each in pypdf.PdfReader(path).pages]
        return made[name]

    return sheets


def sheet(page):
    edges = []

    def at_an_edge(text, current, matrix, font, size):
        y = current[1] * matrix[4] + current[3] * matrix[5] + current[5]
        if not MARGIN < y < A4[1] - MARGIN:
            edges.append(text)

    text = page.extract_text(visitor_text=at_an_edge)
    return Sheet(tuple(map(float, page.mediabox[2:])), squeezed(text), "".join(edges))


def squeezed(text):
    """Letters alone: a line may have been broken anywhere, and headings set in capitals."""
    return re.sub(r"\s+", "", text).casefold()


@pytest.mark.slow
@pytest.mark.parametrize("name", ["usual", "damaged", "long"])
def test_what_is_folded_on_the_screen_is_on_paper(show, printed, name):
    paper = "".join(sheet.text for sheet in printed(name))
    page = show(name).page
    words, elsewhere = page.evaluate(
        """() => {
          const found = [[], []];
          const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
          for (let text = walker.nextNode(); text; text = walker.nextNode()) {
            const not = "style, script, svg, summary, label, button, .download, .copy";
            if (text.parentElement.closest(not)) continue;
            const words = text.data.split(/\\s+/).filter((word) => word.length > 1);
            found[text.parentElement.closest("details") ? 0 : 1].push(...words);
          }
          return found;
        }"""
    )
    assert set(words) - set(elsewhere)  # or this would show nothing
    lost = [word for word in words if squeezed(word) not in paper]
    assert lost == []


@pytest.mark.parametrize("name", ["usual", "long"])
def test_every_page_of_paper_has_its_number(printed, name):
    sheets = printed(name)
    assert len(sheets) > 3
    for number, each in enumerate(sheets, start=1):
        assert each.size == pytest.approx(A4, abs=2.0)
        assert re.search(rf"(?<!\d){number}(?!\d)", each.edges), f"sheet {number}"


def test_no_figure_is_cut(printed):
    """First and last text of each figure's drawing, and its caption, are on one page."""
    pages = [sheet.text for sheet in printed("long")]

    def where(text):
        text = squeezed(text)
        return [number for number, page in enumerate(pages, start=1) if text in page]

    for number in range(FIGURES):
        last = number % 3
        first = set(where(f"Panel{number}x0"))
        assert first, f"figure {number} is not on paper"
        assert first & set(where(f"Time{number}x{last}")) & set(where(f"Caption{number}."))


@pytest.mark.parametrize("name", ["usual", "long"])
def test_no_figure_is_larger_than_a_page(show, name):
    """A4 without margins of 20 and 18 mm, in CSS pixels; a larger box would be cut or shrunk."""
    wide, high = (210 - 36) / 25.4 * 96, (297 - 40) / 25.4 * 96
    page = show(name, width=int(wide), height=int(high)).page
    page.emulate_media(media="print")
    boxes = page.eval_on_selector_all(
        "figure",
        "all => all.map((e) => e.getBoundingClientRect())"
        ".map((box) => [box.left, box.right, box.height])",
    )
    assert boxes
    for left, right, height in boxes:
        assert left >= -0.5
        assert right <= wide + 0.5
        assert height <= high


def test_long_tables_are_whole(printed):
    """The table of 300 rows: twelve with their head, the others as text in the appendix."""
    pages = [sheet.text for sheet in printed("long")]
    pairs = [f"{row}{row}.5{row + 1}{row + 1}.5" for row in range(ROWS - 1)]
    with_rows = [page for page in pages if any(pair in page for pair in pairs)]
    assert len(with_rows) > 2
    rows = "".join(with_rows)
    assert all(f"{row}.5" in rows for row in range(ROWS))
    assert "error(mrad)" in with_rows[0]
    assert "|error(mrad)" in rows


def test_what_only_unfolds_is_not_on_paper(printed):
    """Of a fold, its rows are on paper, and nothing that offers to show them."""
    text = "".join(sheet.text for sheet in printed("long"))
    assert f"all{ROWS}rows" not in text


def test_a_heading_is_on_one_page_with_what_follows(show):
    """Otherwise a heading of two lines has one on each page."""
    page = show("usual").page
    page.emulate_media(media="print")
    found = page.eval_on_selector_all(
        "h2, h3",
        "all => all.map((e) => getComputedStyle(e))"
        ".map((style) => [style.breakInside, style.breakAfter])",
    )
    assert {tuple(each) for each in found} == {("avoid", "avoid")}


def test_paper_is_white(show):
    page = show("usual", color_scheme="dark").page
    page.emulate_media(media="print", color_scheme="dark")
    background, ink = page.evaluate(
        "[getComputedStyle(document.body).backgroundColor, getComputedStyle(document.body).color]"
    )
    assert background in ("rgb(255, 255, 255)", "rgba(0, 0, 0, 0)")
    assert max(map(int, re.findall(r"\d+", ink)[:3])) < 80
