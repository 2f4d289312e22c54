"""Everything can be reached by keyboard, in few strokes, and one sees where one is."""

from __future__ import annotations

import re

import pytest

from tests.browser.keyboard import Stop, stops, strokes

FEW = 25
"""Most strokes of the Tab key from the top of a page to a figure."""
PER_FIGURE = 3


@pytest.mark.slow
@pytest.mark.parametrize("name", ["usual", "long"])
def test_figures_are_a_few_strokes_away_with_few_stops_and_focus_is_seen(show, name):
    page = show(name).page
    found = stops(page)
    places = page.evaluate(
        "() => { const order = [...document.querySelectorAll('*')];"
        " return [...document.querySelectorAll('figure')].map((e) => order.indexOf(e)); }"
    )
    assert places
    far = {place: count for place in places if (count := strokes(found, place)) > FEW}
    assert far == {}
    within = [stop.figure for stop in found if stop.figure >= 0]
    assert {n: within.count(n) for n in within if within.count(n) > PER_FIGURE} == {}
    assert [stop.what for stop in found if not stop.shown] == []


@pytest.mark.slow
def test_the_first_stop_skips_to_the_results(show):
    page = show("usual").page
    page.keyboard.press("Tab")
    first = page.evaluate("document.activeElement.getAttribute('href')")
    assert first.startswith("#")
    assert page.evaluate(
        "(() => { const box = document.activeElement.getBoundingClientRect();"
        " return box.left >= 0 && box.top >= 0 && box.height > 10; })()"
    )
    page.keyboard.press("Enter")
    page.keyboard.press("Tab")
    assert page.evaluate(
        "!!document.activeElement.closest('main') || !!document.activeElement.closest(':target')"
    )


def test_strokes_are_counted_with_jumps():
    def stop(place, target=-1):
        return Stop(place, target, -1, True, "")

    plain = [stop(10 * n) for n in range(1, 9)]
    assert strokes(plain, 75) == 8  # the eighth stop is the first within
    assert strokes([stop(1, 75), *plain], 75) == 1  # the link leads there
    assert strokes([stop(1, 65), *plain], 75) == 3  # one to the link, one to 70, one to 80
    assert strokes([stop(1, 9), stop(10, 70), *[stop(20 + n) for n in range(60)]], 70) == 2


NUMBERS = """() => [...document.querySelectorAll("#scoreboard table li")]
  .filter((e) => e.checkVisibility())
  .map((e) => getComputedStyle(e, "::before").content[1] + e.textContent.trim())"""
"""The scoreboard's published numbers that are seen; each begins with the sign of its status."""


@pytest.mark.slow
@pytest.mark.parametrize("scripts", [True, False])
def test_the_scoreboard_is_filtered_by_status_with_the_keyboard(show, scripts):
    """Each choice says its status, its sign and how many it leaves; the first leaves all."""
    page = show("usual", java_script_enabled=scripts, unfold=True).page
    everything = page.evaluate(NUMBERS)
    choices = page.locator("#scoreboard").get_by_role("radio")
    names = [choice.evaluate("e => e.labels[0].textContent.trim()") for choice in choices.all()]
    told = [re.fullmatch(r"(\S)\s+([a-z ]+) \((\d+)\)", name) for name in names[1:]]
    assert len(told) > 1
    assert sum(int(each[3]) for each in told) <= len(everything)
    assert choices.first.is_checked()
    choices.first.focus()
    for sign, status, count in (each.groups() for each in told):
        page.keyboard.press("ArrowDown")
        left = page.evaluate(NUMBERS)
        assert left == [each for each in everything if each.startswith(sign)], status
        assert len(left) == int(count)
    page.keyboard.press("ArrowDown")  # from the last to the first
    assert page.evaluate(NUMBERS) == everything


@pytest.mark.slow
@pytest.mark.parametrize("form", ["TSV", "Markdown", "LaTeX"])
def test_a_table_is_copied_by_a_button(show, form):
    page = show("usual", unfold=True, permissions=["clipboard-read", "clipboard-write"]).page
    box = page.locator(".table").first
    cells = box.locator("tbody tr").first.locator("th, td").all_text_contents()
    button = box.get_by_role("button", name=re.compile(f"as {form}"))
    button.focus()
    page.keyboard.press("Enter")
    box.get_by_text(f"copied as {form}").wait_for()
    text = page.evaluate("navigator.clipboard.readText()")
    lines = text.splitlines()
    rows = box.locator("tbody tr").count()
    cells = [" ".join(cell.replace("\u00a0", "~").split()).replace("~", "\u00a0") for cell in cells]
    if form == "TSV":
        assert lines[1].split("\t") == cells
        assert len(lines) == rows + 1
    elif form == "Markdown":
        assert lines[2] == f"| {' | '.join(cells)} |"
        assert len(lines) == rows + 2
    else:
        assert lines[1] == r"\toprule"
        assert lines[-2:] == [r"\bottomrule", r"\end{tabular}"]
        assert not re.search(r"[±−·%_](?<!\\%)(?<!\\_)", text)
        assert r"\num{" in text
        assert len(lines) == rows + 6
