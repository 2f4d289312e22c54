"""The comparison as a folder: complete, the same every time, and inert whatever names hold."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from campaign.comparison.page import article_of, write_comparison
from campaign.comparison.run_comparison import Comparison, compare_runs
from campaign.errors import UsageError
from campaign.experiments import experiments
from campaign.report.article import article_html
from campaign.report.page.templates import Templates
from campaign.resources import templates_folder
from tests.html_pages import Page

Compare = Callable[..., Comparison]


@pytest.fixture(scope="module")
def page(results: Path) -> tuple[str, dict[str, str]]:
    runs = [open_run(results / f"{name}.nxs") for name in ("before", "after", "again")]
    return render(compare_runs(runs, experiments()))


def render(comparison: Comparison) -> tuple[str, dict[str, str]]:
    article = article_of(comparison)
    return article_html(article, Templates(templates_folder(), None)), article.folder.files


@pytest.mark.slow
def test_anchors_are_unique_and_resolve_and_nothing_is_asked_of_a_network(page):
    found = Page(page[0])
    ids = [attrs["id"] for _, attrs in found.elements if "id" in attrs]
    links = [attrs["href"] for attrs in found.all("a")]
    assert len(ids) == len(set(ids))
    assert {link[1:] for link in links if link.startswith("#")} <= set(ids)
    beside = [link for link in links if not link.startswith(("#", "data:"))]
    assert set(beside) <= set(page[1])  # what is too long for the page
    assert not found.all("script")
    assert "default-src 'none'" in page[0]


def test_results_come_before_contents_on_a_small_screen(page):
    """The contents are folded, and what the runs are wraps instead of being a wide table."""
    head, contents = re.search(r"<header.*?(?=<main)", page[0], re.S)[0].split("<nav", 1)
    assert len(Page(contents).all("details")) == 1
    assert "<details open" not in contents
    assert not Page(head).all("table")
    assert len(Page(head).all("dl")) == 3


def test_titles_are_text_whatever_is_in_them(page):
    assert "<b>the repair</b>" not in page[0]
    assert "Before and after &lt;b&gt;the repair&lt;/b&gt;" in page[0]


def test_every_pair_is_in_the_table_with_its_interval_p_value_and_verdict(page):
    rows = list(csv.DictReader(page[1]["tables/b-pairs.csv"].splitlines()))
    found = {(row["quantity"], row["conditions"]): row for row in rows}
    coulomb = found["coulomb_torque", "direction positive, exponent free"]
    assert coulomb["verdict"] == "different"
    assert coulomb["unit"] == "N·m"
    low, value, high = (
        float(coulomb[name]) for name in ("difference_low", "difference", "difference_high")
    )
    assert low < value < high
    assert value == pytest.approx(float(coulomb["other"]) - float(coulomb["reference"]))
    share = 100 * value / float(coulomb["reference"])
    assert float(coulomb["change_percent"]) == pytest.approx(share)
    assert float(coulomb["p"]) < 0.05
    errors = found["stabilization_error", next(c for q, c in found if q == "stabilization_error")]
    assert errors["verdict"] == "not judged"
    assert "one trial each" in errors["reason"]
    assert errors["unit"] == "mrad"


def test_each_of_the_others_has_its_own_files_and_the_declared_ones_stand_on_top(page):
    html, files = page
    assert {"tables/b-pairs.csv", "tables/c-pairs.csv", "figures/b-changes.svg"} <= set(files)
    assert "figures/b-map-map.svg" in files
    opening = html[html.index('id="against-b"') : html.index('id="b-test-1"')]
    assert re.search(r"<li>Coulomb friction Tc, direction positive, exponent free: \+\d", opening)
    assert "B and C" not in html


def test_figures_of_both_runs_lie_over_each_other_in_their_own_looks(page):
    svg = page[1]["figures/b-map-fit.svg"]
    assert "A: positive direction" in svg
    assert "B: positive direction" in svg
    assert "#0067b0" in svg
    assert "#c9540a" in svg


@pytest.fixture(scope="module")
def pair(results: Path) -> Comparison:
    runs = [open_run(results / f"{name}.nxs") for name in ("before", "again")]
    return compare_runs(runs, experiments())


@pytest.mark.slow
def test_the_same_archives_give_the_same_bytes_and_only_a_comparison_is_replaced(
    results: Path, tmp_path: Path
):
    def pair() -> Comparison:  # of the one test that both runs have
        runs = [open_run(results / f"{name}.nxs") for name in ("before", "waves")]
        return compare_runs(runs, experiments())

    output = tmp_path / "out"
    written = write_comparison(pair(), output, templates_folder())
    assert any((output / "figures").iterdir())
    assert written == output / "comparison.html"
    first = {path: path.read_bytes() for path in output.rglob("*") if path.is_file()}
    (output / "old.txt").write_text("of the former one")
    write_comparison(pair(), output, templates_folder())
    assert (output / "old.txt").read_text() == "of the former one"  # what somebody put there stays
    (output / "old.txt").unlink()
    assert {path: path.read_bytes() for path in output.rglob("*") if path.is_file()} == first
    (output / "comparison.html").rename(output / "report.html")
    with pytest.raises(UsageError, match=r"has no comparison\.html"):
        write_comparison(pair(), output, templates_folder())
    foreign = tmp_path / "mine"
    foreign.mkdir()
    (foreign / "thesis.tex").touch()
    with pytest.raises(UsageError, match="no report of campaign"):
        write_comparison(pair(), foreign, templates_folder())


def test_a_figure_that_cannot_be_drawn_costs_only_itself(pair: Comparison, monkeypatch):
    def broken(*_: object) -> str:
        raise ValueError("no ink")

    monkeypatch.setattr("campaign.comparison.page.changes_figure", broken)
    monkeypatch.setattr("campaign.report.page.drawings.Drawing.svg", lambda _: "<svg></svg>")
    html, files = render(pair)
    assert "the picture of all changes cannot be shown: ValueError: no ink" in html
    assert "tables/pairs.csv" in files


def test_a_test_without_result_is_a_problem_on_the_page(pair: Comparison, monkeypatch):
    monkeypatch.setattr("campaign.report.page.drawings.Drawing.svg", lambda _: "<svg></svg>")
    side = pair.sides[1]
    broken = replace(side, tests=(replace(side.tests[0], problem="the analysis failed"),))
    html, _ = render(replace(pair, sides=(pair.sides[0], broken)))
    assert "B: map: the analysis failed" in html
