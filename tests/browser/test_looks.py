"""Everybody can read the page: on a telephone and on a desk, in the light and in the dark."""

from __future__ import annotations

import io

import pytest
from matplotlib.image import imread

from tests.browser.pages import PAGES
from tests.report.print_checks import contrast

WIDTHS = (360, 768, 1024, 1440)
SMALLEST_LABEL = 9.0
"""Pixels."""
LARGEST_SHIFT = 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "width", "height"),
    [("light", 1440, 500), ("dark", 360, 740)],
    ids=["light-and-low", "dark-and-narrow"],
)
@pytest.mark.parametrize("name", PAGES)
def test_axe_finds_nothing(show, axe, name, scheme, width, height):
    page = show(name, color_scheme=scheme, width=width, height=height).page
    assert axe(page) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_page_is_no_wider_than_the_window(show, name):
    page = show(name, unfold=True).page
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        assert page.evaluate(WIDER) == {"wider": 0, "out": []}, width


WIDER = """() => {
  const wide = document.documentElement.clientWidth;
  const scrolls = (e) => {
    for (let up = e; up && up !== document.body; up = up.parentElement)
      if (/auto|scroll|hidden|clip/.test(getComputedStyle(up).overflowX)) return true;
    return false;
  };
  const out = [...document.body.querySelectorAll("*:not(svg *)")].filter((e) => {
    const box = e.getBoundingClientRect();
    return box.width && box.right > wide + 0.5 && box.left < 1e4 && !scrolls(e);
  });
  return {
    wider: document.documentElement.scrollWidth - wide,
    out: [...new Set(out.map((e) => `${e.tagName} ${e.className}`))].slice(0, 10),
  };
}"""


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 1440])
@pytest.mark.parametrize("name", PAGES)
def test_nothing_moves_while_it_loads_and_is_scrolled(show, name, width):
    """What is laid out later than the rest has its size before, or links far down would overlap."""
    shown = show(name, width=width)
    before = shown.page.evaluate(PLACES)
    assert len(before) > 3
    shown.scroll_through()
    assert shown.page.evaluate(PLACES) == pytest.approx(before, abs=0.5)
    assert shown.page.evaluate("window.moved()") < LARGEST_SHIFT


PLACES = """() => [...document.querySelectorAll("section, figure, table")].flatMap((e) => {
  const box = e.getBoundingClientRect();
  return [box.top + scrollY, box.height];
})"""


def test_a_shift_would_be_noticed(show):
    shown = show("usual")
    shown.page.evaluate(
        "() => { const e = document.createElement('div'); e.style.height = '300px';"
        " document.body.prepend(e); }"
    )
    assert shown.page.evaluate("window.moved()") > LARGEST_SHIFT


@pytest.mark.parametrize("width", [360, 390, 768, 1300, 1440])
def test_the_parameters_of_a_rig_are_seen_without_scrolling_sideways(show, width):
    """All of them: seven columns, of which one has keys that no line holds."""
    page = show("identification", width=width).page
    table = page.locator("#table-1")
    text = table.inner_text()
    assert "friction.load.negative.coulomb_torque" in text  # and copied without any break
    wider, wide = table.locator(".scroll").evaluate(
        "e => [e.scrollWidth - e.clientWidth, e.clientWidth]"
    )
    assert wider <= 0
    ends = table.locator("td, tbody th").evaluate_all(
        "all => all.filter((e) => e.checkVisibility()).map((e) => e.getBoundingClientRect().right)"
    )
    left = table.evaluate("e => e.getBoundingClientRect().left")
    assert max(ends) <= left + wide + 0.5
    headings = table.locator("thead th").all_inner_texts()
    assert len(headings) == 7
    if width < 800:  # a block for each row, in which each cell says what it is
        shown = (
            table.locator("tbody tr")
            .first.locator("td")
            .evaluate_all("all => all.map((e) => getComputedStyle(e, '::before').content)")
        )
        named = [each.strip('"').removesuffix(": ") for each in shown]
        assert named == [heading.replace("\u00a0", " ") for heading in headings[1:]]


EDGES = """() => [...document.querySelectorAll(".scroll, .sheet")]
  .filter((e) => e.scrollWidth > e.clientWidth + 40 && e.checkVisibility())
  .map((e) => { e.id ||= `wide-${e.parentElement.id}`; return e.id; })"""


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_what_goes_on_beyond_the_edge_says_so(show, scheme):
    """A shadow at the edge, until one is at the end; in a place where nothing is drawn."""
    page = show("long", width=360, color_scheme=scheme).page
    wide = page.evaluate(EDGES)
    assert wide
    for name in (wide[0], wide[-1]):
        box = page.locator(f"[id='{name}']")
        box.evaluate("e => e.scrollIntoView({ block: 'start' })")
        shades = []
        for end in (0, 10_000):
            left, top = box.evaluate(
                "(e, end) => { e.scrollLeft = end; const box = e.getBoundingClientRect();"
                " return [box.right - 3, box.top]; }",
                end,
            )
            strip = {"x": left, "y": top + 1, "width": 2, "height": 3}
            shot = imread(io.BytesIO(page.screenshot(clip=strip)))
            shades.append(shot[..., :3].mean())
        assert abs(shades[0] - shades[1]) > 0.08, name


@pytest.mark.parametrize("name", ["usual", "long"])
def test_captions_of_tables_are_no_wider_than_a_small_window(show, name):
    """The table below may be: what it shows must be readable without scrolling."""
    page = show(name, width=360).page
    ends = page.eval_on_selector_all("caption", "all => all.map((e) => e.offsetWidth)")
    assert ends
    assert max(ends) <= 360


LABELS = """() => [...document.querySelectorAll("figure svg text")]
  .filter((e) => e.textContent.trim() && e.getClientRects().length && e.checkVisibility())
  .map((e) => {
    const { a, b } = e.getScreenCTM();
    const pixels = (p) => parseFloat(getComputedStyle(p).fontSize);
    const indices = [...e.querySelectorAll("tspan")].map((p) => pixels(p) / 0.75);
    const size = Math.min(pixels(e), ...indices);  // an index has three quarters
    return { text: e.textContent.trim(), size: size * Math.hypot(a, b),
             figure: e.closest("figure").id };
  })"""


@pytest.mark.parametrize("name", ["usual", "long"])
def test_labels_of_figures_can_be_read(show, name):
    page = show(name).page
    for width in WIDTHS:
        page.set_viewport_size({"width": width, "height": 900})
        labels = page.evaluate(LABELS)
        assert len(labels) > 20
        assert [each for each in labels if each["size"] < SMALLEST_LABEL] == [], width


COLOURS = """() => {
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const hex = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, alpha] = canvas.getImageData(0, 0, 1, 1).data;
    return alpha === 255 ? "#" + [r, g, b].map((c) => c.toString(16).padStart(2, "0")).join("")
                         : null;
  };
  const paper = (e) => {
    for (let up = e; up; up = up.parentElement) {
      const found = hex(getComputedStyle(up).backgroundColor);
      if (found) return found;
    }
    return "#ffffff";
  };
  return [...document.querySelectorAll("figure svg text")]
    .filter((e) => e.textContent.trim() && e.checkVisibility())
    .map((e) => [e.textContent.trim(), hex(getComputedStyle(e).fill), paper(e.closest("svg"))]);
}"""


@pytest.mark.parametrize("media", ["screen", "print"])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_in_figures_stands_out_from_the_paper_it_is_on(show, scheme, media):
    """What axe does not decide for SVG; paper is white whatever the screen was."""
    page = show("usual", color_scheme=scheme).page
    page.emulate_media(media=media, color_scheme=scheme)
    found = page.evaluate(COLOURS)
    assert len(found) > 20
    assert {text: (ink, paper) for text, ink, paper in found if contrast(ink, paper) < 4.5} == {}
    papers = {paper for _, _, paper in found}
    assert (min(papers) > "#8") == (scheme == "light" or media == "print")
