"""A page asks nothing of anybody, runs nothing, and says so to the browser."""

from __future__ import annotations

import base64
import hashlib
import re

import pytest

from tests.browser.pages import PAGES


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_no_request_leaves_and_the_policy_forbids_nothing_the_page_does(show, name):
    shown = show(name)
    shown.scroll_through()
    for link in shown.page.locator("details > summary").all():
        if link.is_visible():
            link.click()
    shown.page.wait_for_load_state("networkidle")
    assert shown.requests == []
    assert shown.violations == []
    assert shown.messages == []


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_page_states_a_policy_that_lets_nothing_in(show, name):
    policy = show(name).page.locator("meta[http-equiv=Content-Security-Policy]")
    assert policy.count() == 1
    stated = policy.get_attribute("content")
    directives = dict(re.findall(r"([a-z-]+) +([^;]*)", stated))
    assert directives["default-src"].strip() == "'none'"
    assert directives["base-uri"].strip() == "'none'"
    assert directives["form-action"].strip() == "'none'"
    assert "http" not in stated
    assert "unsafe-eval" not in stated
    assert "unsafe-inline" not in directives.get("script-src", "")
    # It must stand before whatever it is to hold.
    assert policy.evaluate(
        "e => [...document.querySelectorAll('style, script, link')]"
        ".every((other) => e.compareDocumentPosition(other) & Node.DOCUMENT_POSITION_FOLLOWING)"
    )


def test_exactly_the_scripts_of_the_page_are_allowed_by_their_hashes(show):
    page = show("interactive").page
    stated = page.get_attribute("meta[http-equiv=Content-Security-Policy]", "content")
    scripts = page.locator("script").all_text_contents()
    hashes = [base64.b64encode(hashlib.sha256(each.encode()).digest()).decode() for each in scripts]
    assert len(scripts) == 1
    assert re.search("script-src ([^;]*)", stated)[1].split() == [f"'sha256-{hashes[0]}'"]


@pytest.mark.parametrize("name", ["usual", "interactive"])
def test_a_script_that_came_in_would_not_run(show, name):
    """Not only that none is there: the policy holds."""
    shown = show(name)
    page = shown.page
    page.evaluate(
        """() => {
          const script = document.createElement("script");
          script.textContent = "window.hacked = 1";
          document.body.append(script);
          const image = new Image();
          image.src = "http://127.0.0.1:9/leak.png";
          document.body.append(image);
        }"""
    )
    shown.wait_until("window.violations.length >= 2")
    assert page.evaluate("window.hacked") is None


@pytest.mark.slow
def test_hostile_text_is_only_text(show):
    shown = show("hostile")
    page = shown.page
    assert page.evaluate("window.hacked") is None
    assert page.locator("script").count() == 1, "the page's own"
    assert page.locator("img, iframe, object, embed, form, base, textarea").count() == 0
    handlers = page.evaluate(
        "[...document.querySelectorAll('*')].flatMap((e) => e.getAttributeNames())"
        ".filter((name) => name.startsWith('on'))"
    )
    assert handlers == []
    targets = page.eval_on_selector_all(
        "[href], [src], [action]",
        "all => all.map((e) => e.getAttribute('href') ?? e.getAttribute('src'))",
    )
    assert {re.match(r"(#|data:|figures/|tables/|$)|.*", t)[1] for t in targets} <= {
        "#",
        "data:",
        "figures/",
        "tables/",
    }
    # Text was not lost either: it stands on the page as it was written.
    assert "<script>hacked = 1</script>" in page.inner_text("h1")
    assert page.title().startswith("<script>hacked = 1</script>")


def test_no_letter_turns_the_line_of_the_page(show):
    text = show("hostile").page.content()
    assert not re.findall("[\u202a-\u202e\u2066-\u2069\u200e\u200f\u061c]", text)
