"""`--interactive`: figures zoom and tell their values; without scripts the page is static."""

from __future__ import annotations

import re

import numpy as np
import pytest

from tests.report import made_up

SHOWN = "svg[role=img]"


def number(text):
    return float(text.replace("−", "-"))


@pytest.fixture
def shown(show):
    return show("interactive", unfold=True)


def switch(page):
    return page.get_by_role("button", name="Zoom and read values")


def zoomed(page, title):
    """The figure of that title, zoomable."""
    figure = page.locator("figure", has_text=title).first
    figure.scroll_into_view_if_needed()
    plots = figure.get_by_role("group", name=re.compile("Interactive"))
    plots.wait_for()
    return figure, plots


def read(plots, panel=0):
    """What stands under the cursor of a panel: name to value."""
    rows = plots.locator(".u-legend").nth(panel).locator("tr").all()
    pairs = ((row.locator(".u-label"), row.locator(".u-value")) for row in rows)
    told = ((name.text_content().strip(), value.text_content().strip()) for name, value in pairs)
    return {name: number(value) for name, value in told if value != "–"}


def stretch(page, plots, panel=0):
    """Where the panel's x axis begins and ends, read at its edges."""
    box = plots.locator(".u-over").nth(panel).bounding_box()
    ends = []
    for share in (0.002, 0.998):
        page.mouse.move(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        ends.append(next(iter(read(plots, panel).values())))
    return ends


def curve(title, panel=0):
    """x and y, in the page's units, of the only curve of a panel of the made-up run."""
    _, errors = made_up.stabilization(None).figures
    (only,) = errors.panels[panel].curves
    assert errors.title == title
    return only.x, 1e3 * only.y


ERRORS = "Position error by compensation method"
RATES = "Rate of the load relative to the hull"


@pytest.mark.slow
def test_the_switch_is_reached_by_keyboard_and_turns_figures_and_turns_them_back(shown):
    page = shown.page
    figure = page.locator("figure", has_text=ERRORS).first
    figure.scroll_into_view_if_needed()
    before, picture = figure.inner_html(), figure.screenshot()
    switch(page).focus()
    page.keyboard.press("Enter")
    zoomed(page, ERRORS)
    assert figure.locator(SHOWN).first.is_hidden()
    assert figure.locator("canvas").count() == 4
    switch(page).focus()
    page.keyboard.press("Space")
    assert figure.locator("canvas").count() == 0
    assert figure.locator(SHOWN).first.is_visible()
    figure.scroll_into_view_if_needed()
    assert figure.inner_html() == before
    assert figure.screenshot() == picture
    assert shown.requests == shown.violations == shown.messages == []


@pytest.mark.slow
def test_the_cursor_tells_the_data_to_float32(shown):
    page = shown.page
    switch(page).click()
    for panel in range(4):
        x, y = curve(ERRORS, panel)
        narrow_x, narrow_y = x.astype(np.float32), y.astype(np.float32)
        _, plots = zoomed(page, ERRORS)
        plots.focus()
        for _ in range(7):
            page.keyboard.press("ArrowRight")
            at, value = read(plots, panel).values()
            (place,) = np.flatnonzero(narrow_x == np.float32(at))
            assert np.float32(value) == narrow_y[place]


def test_every_curve_of_a_panel_tells_a_value(shown):
    page = shown.page
    switch(page).click()
    _, plots = zoomed(page, RATES)
    plots.focus()
    page.keyboard.press("ArrowRight")
    assert set(read(plots)) == {"Time (s)", *made_up.METHODS.values()}


@pytest.mark.slow
def test_dragging_zooms_and_a_key_or_a_double_click_shows_all_again(shown):
    page = shown.page
    switch(page).click()
    _, plots = zoomed(page, ERRORS)
    whole = stretch(page, plots)
    assert whole == pytest.approx([0.0, 8.0], abs=0.05)
    area = plots.locator(".u-over").first
    for back in (lambda: plots.press("0"), lambda: plots.press("Escape"), area.dblclick):
        box = area.bounding_box()
        middle = box["y"] + 0.5 * box["height"]
        page.mouse.move(box["x"] + 0.25 * box["width"], middle)
        page.mouse.down()
        page.mouse.move(box["x"] + 0.5 * box["width"], middle, steps=4)
        page.mouse.up()
        assert stretch(page, plots) == pytest.approx([2.0, 4.0], abs=0.05)
        assert stretch(page, plots, 1) == pytest.approx(whole, abs=0.05)  # a panel of its own
        back()
        assert stretch(page, plots) == pytest.approx(whole, abs=0.01)


@pytest.mark.slow
def test_keys_zoom_at_the_cursor_and_move_the_stretch(shown):
    page = shown.page
    switch(page).click()
    _, plots = zoomed(page, ERRORS)
    plots.press("+")  # without a cursor, at the middle
    assert stretch(page, plots) == pytest.approx([2.0, 6.0], abs=0.05)
    page.mouse.move(0, 0)
    plots.press("Shift+ArrowRight")
    assert stretch(page, plots) == pytest.approx([2.4, 6.4], abs=0.05)
    page.mouse.move(0, 0)
    for _ in range(3):
        plots.press("-")
    assert stretch(page, plots) == pytest.approx([0.0, 8.0], abs=0.05)  # never beyond the data


@pytest.mark.slow
def test_a_stretch_that_the_figure_asks_for_is_where_it_begins_and_comes_back_to(shown):
    page = shown.page
    switch(page).click()
    _, plots = zoomed(page, RATES)
    asked = pytest.approx([1.95, 2.25], abs=0.01)
    assert stretch(page, plots, 1) == asked
    plots.press("+")
    assert stretch(page, plots, 1) != asked
    plots.press("0")
    assert stretch(page, plots, 1) == asked


@pytest.mark.slow
def test_units_are_those_of_the_static_figure(shown):
    page = shown.page
    figure = page.locator("figure", has_text=RATES).first
    still = " ".join(figure.locator("svg text").all_text_contents())  # a label may have two lines
    switch(page).click()
    _, plots = zoomed(page, RATES)
    plots.focus()
    for _ in range(12):  # away from the reversal in the middle
        page.keyboard.press("ArrowRight")
    labels = {text.strip() for text in plots.locator(".u-label").all_text_contents()}
    assert "Rate relative to the hull (deg/s)" in still
    told = read(plots)
    assert max(map(abs, list(told.values())[1:])) > 1  # deg/s: in rad/s they are below 0.21
    assert "Time (s)" in labels
    assert "Time (s)" in still


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_in_figures_that_zoom(show, axe, scheme):
    page = show("interactive", unfold=True, color_scheme=scheme).page
    switch(page).click()
    zoomed(page, RATES)
    assert axe(page) == []


@pytest.mark.parametrize("width", [360, 768, 1440])
def test_figures_that_zoom_fit_the_window(show, width):
    shown = show("interactive", unfold=True, width=width)
    page = shown.page
    switch(page).click()
    zoomable = page.evaluate(
        "Object.keys(JSON.parse(document.getElementById('interactive-data').content.textContent))"
    )
    assert len(zoomable) > 1
    for name in zoomable:  # each is made when it comes into sight
        page.evaluate("name => document.getElementById(name).scrollIntoView()", name)
        shown.wait_until(f"document.querySelector('#{name} canvas')")
    assert page.locator("canvas").count() >= 7
    wider = "document.documentElement.scrollWidth - document.documentElement.clientWidth"
    assert page.evaluate(wider) == 0
    for canvas in page.locator("canvas").all():
        box = canvas.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= width


def test_paper_has_the_static_figures(shown):
    page = shown.page
    switch(page).click()
    figure, plots = zoomed(page, ERRORS)
    page.emulate_media(media="print")
    assert plots.is_hidden()
    assert figure.locator(SHOWN).first.is_visible()
    assert switch(page).is_hidden()


def test_colours_follow_the_page(shown):
    """From light to dark while figures are zoomed: they are drawn anew, in the other colours."""
    page = shown.page
    switch(page).click()
    figure, _ = zoomed(page, ERRORS)
    light = figure.locator("canvas").first.screenshot()
    page.eval_on_selector_all("canvas", "all => all.forEach((e) => (e.dataset.light = 1))")
    page.emulate_media(color_scheme="dark")
    shown.wait_until("!document.querySelector('canvas[data-light]')")
    figure, _ = zoomed(page, ERRORS)
    assert figure.locator("canvas").first.screenshot() != light
    assert shown.messages == []


@pytest.mark.slow
def test_without_scripts_the_page_is_the_static_one(show):
    page = show("interactive", unfold=True, java_script_enabled=False).page
    static = show("usual", unfold=True, java_script_enabled=False).page
    assert switch(page).count() == 0
    assert page.inner_text("body") == static.inner_text("body")
    assert page.screenshot(full_page=True) == static.screenshot(full_page=True)


@pytest.mark.slow
def test_hostile_names_are_only_names_in_figures_that_zoom(show):
    shown = show("hostile-interactive")
    page = shown.page
    switch(page).click()
    page.evaluate("location.hash = document.querySelector('figure').id")
    page.locator("figure canvas").first.wait_for()
    assert page.evaluate("window.hacked") is None
    assert page.locator("script").count() == 1
    assert page.locator("img").count() == 0
    assert shown.requests == shown.violations == shown.messages == []
