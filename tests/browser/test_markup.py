"""Two checkers find nothing to say of the markup; every link within the page leads somewhere."""

from __future__ import annotations

import json
import subprocess
from collections import Counter
from pathlib import Path

import pytest

from tests.browser.conftest import HERE
from tests.browser.pages import PAGES

NU = "vnu-jar/build/dist/vnu.jar"
HTML_VALIDATE = "html-validate/bin/html-validate.mjs"


def nu(java, jar, paths):
    """By path, what the Nu Html Checker says of it: errors, warnings and remarks."""
    found = subprocess.run(
        [java, "-Xss8m", "-jar", jar, "--format", "json", "--exit-zero-always", *paths],
        capture_output=True,
        check=True,
        text=True,
    )
    messages = json.loads(found.stderr)["messages"] if found.stderr.strip() else []
    said = {path: Counter() for path in paths}
    for message in messages:
        (path,) = (path for path in paths if message["url"].endswith(path.as_posix()))
        said[path][message["message"]] += 1
    return said


def html_validate(node, script, paths, output):
    """By path, rule and message of everything html-validate finds."""
    config = ("--config", HERE / "htmlvalidate.cjs")
    subprocess.run(
        [node, script, *config, "--formatter", f"json={output}", *paths],
        capture_output=True,
        check=False,  # it ends with 1 when it found something
        text=True,
        cwd=HERE,
    )
    said = {path: Counter() for path in paths}
    for file in json.loads(output.read_text(encoding="utf-8")):
        said[Path(file["filePath"])].update(
            f"{each['ruleId']}: {each['message']}" for each in file["messages"]
        )
    return said


@pytest.fixture(scope="module")
def all_pages(page_file):
    return {name: page_file(name) for name in PAGES}


@pytest.fixture(scope="module")
def said_by_nu(program, package, all_pages):
    return nu(program("java"), package(NU), [*all_pages.values()])


@pytest.fixture(scope="module")
def said_by_html_validate(node, package, all_pages, tmp_path_factory):
    output = tmp_path_factory.mktemp("found") / "found.json"
    return html_validate(node, package(HTML_VALIDATE), [*all_pages.values()], output)


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_the_nu_checker_has_nothing_to_say(said_by_nu, all_pages, name):
    assert said_by_nu[all_pages[name]] == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_html_validate_has_nothing_to_say(said_by_html_validate, all_pages, name):
    assert said_by_html_validate[all_pages[name]] == {}


@pytest.mark.slow
def test_both_checkers_would_say_something(program, node, package, tmp_path):
    bad, output = tmp_path / "bad.html", tmp_path / "found.json"
    bad.write_text("<!doctype html><title>x</title><p><div></p><img src=x><a href='#no'>y</a>")
    assert nu(program("java"), package(NU), [bad])[bad]
    assert html_validate(node, package(HTML_VALIDATE), [bad], output)[bad]


@pytest.mark.slow
@pytest.mark.parametrize("name", PAGES)
def test_anchors_lead_somewhere_and_ids_are_unique(show, name):
    found = show(name).page.evaluate(
        """() => {
          const ids = [...document.querySelectorAll("[id]")].map((e) => e.id);
          const links = [...document.querySelectorAll("[href^='#'], [*|href^='#']")];
          const named = ["aria-labelledby", "aria-describedby", "aria-controls", "for"];
          return {
            ids,
            targets: links.map((e) => decodeURIComponent(
              (e.getAttribute("href") ?? e.getAttribute("xlink:href")).slice(1))),
            named: named.flatMap((name) => [...document.querySelectorAll(`[${name}]`)]
              .flatMap((e) => e.getAttribute(name).split(/\\s+/))),
          };
        }"""
    )
    assert [name for name, count in Counter(found["ids"]).items() if count > 1] == []
    assert found["targets"]
    assert set(found["targets"]) - set(found["ids"]) == set()
    assert set(found["named"]) - set(found["ids"]) == set()
