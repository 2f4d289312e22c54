"""The page and its folder: complete, valid, bounded, safe, and the same every time."""

from __future__ import annotations

import base64
import csv
import dataclasses
import hashlib
import io
import os
import re
import subprocess
import sys
import zlib
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote

import numpy as np
import pytest

from campaign.errors import UsageError
from campaign.experiments.interface import Experiment, TestData
from campaign.recording import Ending, Outcome
from campaign.report.build import Report
from campaign.report.one_figure import WRITTEN, write_figures
from campaign.report.output import MARKER, replaced_folder
from campaign.report.page.drawings import Drawing
from campaign.report.page.folder import LINKED, Folder
from campaign.result import Axis, Column, Curve, Figure, Panel, Result, Table
from tests.html_pages import Page

pytestmark = pytest.mark.usefixtures("drawings_kept")


@pytest.fixture(scope="module")
def page(report: Report) -> Page:
    return Page(report.path.read_text(encoding="utf-8"))


def contents(folder: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def scoreboard(folder: Path) -> list[dict[str, str]]:
    text = (folder / "tables" / "scoreboard.csv").read_text(encoding="utf-8")
    return list(csv.DictReader(io.StringIO(text)))


@pytest.mark.slow
def test_the_folder_has_the_page_its_tables_and_its_figures(report: Report) -> None:
    assert set(contents(report.path.parent)) == {
        MARKER,
        "report.html",
        "report.json",
        "figures/figure-4.11.csv",
        "figures/figure-4.11.svg",
        "figures/figure-5.4.csv",
        "figures/figure-5.4.svg",
        "figures/figure-5.9.csv",
        "figures/figure-5.9.svg",
        "figures/scoreboard.svg",
        "tables/scoreboard.csv",
        "tables/stabilization-stabilization-error.csv",
        "tables/table-4.3.csv",
        "tables/table-4.5.csv",
        "tables/closeness.csv",
        "tables/table-5.2.csv",
        "tables/table-5.8.csv",
        "tables/text-4.2.1.csv",
        "tables/velocity-map-truth.csv",
    }


def test_tags_are_balanced_and_ids_are_unique(page: Page) -> None:
    assert page.mistakes == []
    assert page.open == []
    ids = [attrs["id"] for _, attrs in page.elements if "id" in attrs]
    assert len(ids) == len(set(ids))


def test_every_internal_link_leads_somewhere(page: Page) -> None:
    ids = {attrs["id"] for _, attrs in page.elements if "id" in attrs}
    links = [a["href"] for a in page.all("a") if a["href"].startswith("#")]
    assert {link[1:] for link in links} <= ids
    assert {"#scoreboard", "#test-1", "#test-3", "#failed", "#provenance"} <= set(links)
    labels = [a[k].split() for _, a in page.elements for k in ("aria-labelledby",) if k in a]
    assert {name for label in labels for name in label} <= ids


def test_the_page_asks_nobody_for_anything(report: Report, page: Page) -> None:
    """Only a file to download may be a file beside the page."""
    beside = {path for path in contents(report.path.parent) if path.endswith(".csv")}
    for tag, attrs in page.elements:
        for name in ("src", "href", "xlink:href", "action", "srcset", "poster"):
            there = attrs.get(name, "#")
            inside = there.startswith(("#", "data:"))
            assert inside or ("download" in attrs and there in beside), (tag, attrs)
    (policy,) = [a["content"] for a in page.all("meta") if "http-equiv" in a]
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy
    assert {"iframe", "object", "embed"}.isdisjoint(tag for tag, _ in page.elements)
    (script,) = re.findall("<script>(.*?)</script>", report.path.read_text(), re.DOTALL)
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{allowed}'" in policy
    style = report.path.read_text(encoding="utf-8").split("</style>")[0]
    assert "@import" not in style
    assert "url(" not in style


def test_everything_seen_is_also_said(page: Page) -> None:
    plots = [a for a in page.all("svg") if a.get("role") == "img"]
    assert len(plots) == len(page.all("svg")) == len(page.all("figure")) == 4
    assert page.all("th")
    assert all(a.get("scope") in ("col", "row", "rowgroup") for a in page.all("th"))
    assert page.all("html")[0]["lang"] == "en"
    assert len(page.all("h1")) == 1


def test_each_downloaded_table_is_the_file(report: Report, page: Page) -> None:
    links = [a for a in page.all("a") if "download" in a]
    files = {path.name: path for path in report.path.parent.rglob("*.csv")}
    assert {link["download"] for link in links} == files.keys()
    assert len(links) == len(files) == 12
    for link in links:
        if link["href"].startswith("data:"):
            text = unquote(link["href"].split(",", 1)[1])
            assert text == files[link["download"]].read_text()
        else:
            assert report.path.parent / link["href"] == files[link["download"]]


def test_the_page_carries_small_tables_as_plain_text_and_names_the_place_of_large_ones() -> None:
    """Base64 would cost a page that is served compressed half as much again."""
    folder, values = Folder(), np.random.default_rng(1).random(150)
    small = folder.table("error_%,µ\n" + "".join(f"{each!r},#1\n" for each in values), "small")
    text = folder.files[small.file]
    assert unquote(small.href.split(",", 1)[1]) == text
    compressed = [len(zlib.compress(each.encode())) for each in (small.href, text)]
    assert compressed[0] < 1.2 * compressed[1]
    large = folder.table("name,unit\n" + "x,1\n" * LINKED, "large")
    assert large.href == large.file == "tables/large.csv"


def test_a_figure_has_few_stops_of_the_tab_key(page: Page) -> None:
    """Its large view and its numbers; nothing within the drawing."""
    within = [figure for figure, _ in page.stops if figure]
    stops = {figure: within.count(figure) for figure in within}
    assert stops == {"figure-1": 2, "figure-2": 1, "figure-3": 2, "figure-4": 2}


def test_a_figure_opens_large_and_says_where_it_comes_from(page: Page) -> None:
    sheets = {a["id"] for a in page.all("div") if "popover" in a}
    buttons = [a["popovertarget"] for a in page.all("button")]
    assert len(buttons) == len(sheets) == 4
    assert set(buttons) == sheets
    text = " ".join(" ".join(page.words).split())
    run = "2026-11-21T09-36-58-made-up"
    assert f"Trials 1 to 3. figures/figure-5.9.svg figure-5.9.csv Drawn again by {DRAW}" in text
    assert f"figures/scoreboard.svg Drawn again by campaign report {run}" in text


DRAW = "campaign report 2026-11-21T09-36-58-made-up --only-figure stabilization/position-error"


@pytest.mark.parametrize("figures", [1, 12, 47, 120])
def test_any_figure_is_soon_reached(
    made_up: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, figures: int
) -> None:
    """By the second skip link and the list of figures: at most 25 stops from the top."""
    x = np.arange(3.0)
    panel = Panel(Axis("x"), Axis("y"), [Curve(x, x)])
    drawn = Drawing(Figure("f", "Figure", "c", "a", (panel,))).made()
    monkeypatch.setattr(Drawing, "made", lambda drawing: drawn)  # what they show is no matter
    many = [Figure(f"f{n}", f"Figure of {n}", "c", "a", (panel,)) for n in range(figures)]

    def analyse(data: TestData) -> Result:
        return Result(figures=tuple(many))

    kind = dataclasses.replace(made_up.EXPERIMENTS["velocity_map"], analyse=analyse)
    run = made_up.made_up_run(tmp_path, tests={"velocity_map": ()})
    found = made_up.build(run, tmp_path / "out", experiments={"velocity_map": kind})
    page = Page(found.path.read_text(encoding="utf-8"))
    skips = [a["href"] for a in page.all("a") if a.get("class") == "skip"]
    assert skips == ["#content", "#figures"]
    order = [(tag, attrs.get("href", "")) for tag, attrs in page.elements]
    begin = next(n for n, (_, attrs) in enumerate(page.elements) if attrs.get("id") == "figures")
    behind = order[begin:]
    groups = [n for n, (tag, _) in enumerate(behind) if tag == "summary"]
    for number in range(1, figures + 1):
        link = behind.index(("a", f"#figure-{number}"))
        before = [place for place in groups if place < link]
        within = sum(tag == "a" for tag, _ in behind[before[-1] : link + 1])
        assert len(skips) + len(before) + within <= 25


def test_a_published_table_has_its_own_file(report: Report) -> None:
    text = (report.path.parent / "tables" / "table-5.8.csv").read_text()
    rows = {row["row"]: row for row in csv.DictReader(io.StringIO(text))}
    assert list(rows) == ["none", "static", "lugre", "observer"]
    assert float(rows["none"]["deviation_percent"]) == pytest.approx(0.82783, abs=1e-5)


def test_a_failing_analysis_is_one_line_and_costs_nobody_else(report: Report, page: Page) -> None:
    text = " ".join(page.words)
    assert report.problems == (
        "breakaway: the analysis failed: ValueError: no recording reached breakaway",
    )
    assert "no recording reached breakaway" in text
    assert "second line" not in text
    assert "Traceback" not in text
    assert "Friction torque over rate" in text


def test_an_analysis_that_leaves_the_program_costs_its_test_only(
    made_up: ModuleType, tmp_path: Path
) -> None:
    def analyse(data: TestData) -> Result:
        raise SystemExit(0)

    kind = dataclasses.replace(made_up.EXPERIMENTS["velocity_map"], analyse=analyse)
    run = made_up.made_up_run(tmp_path, tests={"velocity_map": ()})
    found = made_up.build(run, tmp_path / "out", experiments={"velocity_map": kind})
    assert [each.partition(": ")[2] for each in found.problems] == [
        "the analysis failed: SystemExit: 0"
    ]


def test_failed_trials_are_shown_with_their_reasons(page: Page) -> None:
    text = " ".join(page.words)
    assert text.count("current 93.1 A is over the limit of 90 A") == 3 + 1  # and on top, once


def test_contradictions_are_told_with_their_reasons(page: Page) -> None:
    text = " ".join(page.words)
    assert "Table 4.4 prints 35.2 (set 5,6), and under the opposite direction" in text
    assert "the rows of Table 4.1 give 69.5 %" in text


def test_conditions_are_in_units_people_read(page: Page) -> None:
    text = " ".join(page.words)
    assert "0.24 Hz" in text
    assert "18 deg/s²" in text


def test_provenance_comes_from_the_archive(made_up: ModuleType, page: Page, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path)
    text = " ".join(page.words)
    assert run.sha256 in text
    assert "ab" * 32 in text
    assert "campaign run made-up.toml" in text
    assert 'kind = "stabilization"' in text


def test_the_command_repeats_what_was_asked(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(
        tmp_path,
        tests={},
        only=("a b",),
        overrides={"bench.gear.ratio": "100"},
        backend="serial",
    )
    made_up.build(run, tmp_path / "out")
    text = " ".join(Page((tmp_path / "out" / "report.html").read_text()).words)
    assert (
        "campaign run made-up.toml --backend serial --only 'a b' --set bench.gear.ratio=100" in text
    )


def test_options_of_the_backend_are_told_in_words(made_up: ModuleType, tmp_path: Path) -> None:
    """Neither Python nor JSON: an option that says nothing is left out, a number is SI."""
    options = {"check_step": False, "longest_step": None, "timeout": 2.0}
    run = made_up.made_up_run(tmp_path, tests={}, backend_options=options)
    made_up.build(run, tmp_path / "out")
    text = " ".join(Page((tmp_path / "out" / "report.html").read_text()).words)
    assert "sim, check step: no, timeout: 2 (SI)" in text


@pytest.mark.slow
def test_the_same_archive_gives_the_same_bytes_anywhere(
    made_up: ModuleType, report: Report, tmp_path: Path
) -> None:
    script = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1]); import made_up\n"
        "from campaign.report.build import build_report\n"
        "build_report(made_up.made_up_run(Path(sys.argv[2])), Path(sys.argv[2]) / 'elsewhere',"
        " experiments=made_up.EXPERIMENTS, packaged_templates=made_up.TEMPLATES)\n"
    )
    environment = os.environ | {
        "PYTHONHASHSEED": "4711",
        "TZ": "Asia/Kathmandu",
        "LC_ALL": "C",
        "PYTHONPATH": str(made_up.ROOT),
        "MPLCONFIGDIR": str(tmp_path),
    }
    (tmp_path / "matplotlibrc").write_text("lines.linewidth: 9\nsvg.fonttype: path\n")
    command = [sys.executable, "-c", script, str(Path(__file__).parent), str(tmp_path)]
    subprocess.run(command, check=True, env=environment, cwd=tmp_path)
    assert contents(tmp_path / "elsewhere") == contents(report.path.parent)
    assert str(tmp_path).encode() not in (tmp_path / "elsewhere" / "report.html").read_bytes()


def test_hostile_names_are_only_names(made_up: ModuleType, tmp_path: Path) -> None:
    hostile = "<script>alert(1)</script>\"'& $x {{ 7*7 }} ../../etc"
    x = np.arange(3.0)

    def analyse(data: TestData) -> Result:
        axis = Axis(hostile)
        panel = Panel(axis, axis, [Curve(x, x, hostile, hostile)], hostile)
        figure = Figure(hostile, hostile, hostile, hostile, (panel,), (hostile,))
        return Result((), (figure,), (), (hostile,))

    kind = made_up.EXPERIMENTS["stabilization"]
    run = made_up.made_up_run(
        tmp_path,
        tests={"stabilization": (hostile,)},
        title=hostile,
        description=hostile,
        sources={hostile: hostile},
        notes=hostile,
    )
    made_up.build(
        run,
        tmp_path / "out",
        experiments={"stabilization": dataclasses.replace(kind, analyse=analyse)},
    )
    page = Page((tmp_path / "out" / "report.html").read_text())
    assert page.mistakes == []
    assert len(page.all("script")) == 1
    assert "49" not in "".join(page.words).replace("0.49", "")[:400]
    written = {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()}
    assert all(path.startswith("out/") or path == "made-up.nxs" for path in written)


def test_own_templates_win_one_by_one(made_up: ModuleType, tmp_path: Path) -> None:
    own = tmp_path / "own"
    own.mkdir()
    (own / "provenance.html").write_text("<p>Made at {{ header.name }}</p>")
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ("5.2",)})
    made_up.build(run, tmp_path / "out", templates=own)
    text = " ".join(Page((tmp_path / "out" / "report.html").read_text()).words)
    assert "Made at 2026-11-21T09-36-58-made-up" in text
    assert "Archive SHA-256" not in text
    assert "Scoreboard" in text


@pytest.mark.parametrize(
    ("template", "message"),
    [
        ("{{ nothing }}", "there is no name 'nothing'"),
        ("{% if %}", "provenance.html:1"),
        ("{% include 'none.html' %}", "none.html"),
    ],
)
def test_a_wrong_template_is_told_and_the_old_report_stays(
    made_up: ModuleType, tmp_path: Path, template: str, message: str
) -> None:
    run = made_up.made_up_run(tmp_path, tests={})
    before = contents(made_up.build(run, tmp_path / "out").path.parent)
    own = tmp_path / "own"
    own.mkdir()
    (own / "provenance.html").write_text(template)
    with pytest.raises(UsageError, match=re.escape(message)):
        made_up.build(run, tmp_path / "out", templates=own)
    assert contents(tmp_path / "out") == before


def test_templates_in_the_working_directory_are_not_used(
    made_up: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "report.html").write_text("hijacked")
    (tmp_path / "templates").mkdir()
    (tmp_path / "templates" / "report.html").write_text("hijacked")
    monkeypatch.chdir(tmp_path)
    found = made_up.build(made_up.made_up_run(tmp_path, tests={}), tmp_path / "out")
    assert "hijacked" not in found.path.read_text()


OWN = """
source = "Our own paper"
[[table]]
name = "1"
title = "Ours"
quantity = "stabilization_error"
unit = "urad"
rows = { condition = "compensation" }
column.error = {}
[table.cells]
none = [500]
"""


def test_a_laboratory_compares_with_its_own_numbers(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ("1",)}, published=OWN)
    made_up.build(run, tmp_path / "out")
    (row,) = scoreboard(tmp_path / "out")
    assert (row["table"], row["unit"], row["published"]) == ("1", "urad", "500.0")
    assert float(row["deviation_percent"]) == pytest.approx(-2.318, abs=1e-3)
    assert "Our own paper" in (tmp_path / "out/report.html").read_text()


def test_nothing_published_is_a_report_without_a_scoreboard(
    made_up: ModuleType, tmp_path: Path
) -> None:
    run = made_up.made_up_run(
        tmp_path, tests={"stabilization": ("5.2",)}, normalised={"published": "none"}
    )
    made_up.build(run, tmp_path / "out")
    assert not (tmp_path / "out/tables/scoreboard.csv").exists()
    assert "Scoreboard" not in (tmp_path / "out/report.html").read_text()


@pytest.mark.parametrize(("sampled", "column"), [(False, "simulation"), (True, "experimental")])
def test_a_continuous_bench_speaks_to_simulations_and_a_sampled_one_to_hardware(
    made_up: ModuleType, tmp_path: Path, sampled: bool, column: str
) -> None:
    bench = made_up.bench()
    if sampled:
        controller = bench.controller.model_copy(update={"sample_rate": 1000.0})
        bench = bench.model_copy(update={"controller": controller})
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ("6.1",)}, bench=bench)
    made_up.build(run, tmp_path / "out")
    rows = [row for row in scoreboard(tmp_path / "out") if row["reproduced"]]
    assert {row["column"] for row in rows} == {column}


def test_an_unknown_experiment_is_a_problem_not_an_end(made_up: ModuleType, tmp_path: Path) -> None:
    found = made_up.build(made_up.made_up_run(tmp_path), tmp_path / "out", experiments={})
    assert len(found.problems) == 3
    assert "no experiment is called 'stabilization' here" in found.problems[0]


def test_long_tables_fold_and_lose_nothing(made_up: ModuleType, tmp_path: Path) -> None:
    """All rows are in the page, for paper and for who has no such browser; the rest is CSS.

    Those of a longer table are lines of text in the appendix.
    """
    rows = tuple({"n": n} for n in range(400))
    tables = [
        Table(f"t{length}", f"Of {length}", (Column("n", "N"),), rows[:length])
        for length in (18, 19, 400)
    ]
    kind = dataclasses.replace(
        made_up.EXPERIMENTS["velocity_map"], analyse=lambda data: Result(tuple(tables))
    )
    run = made_up.made_up_run(tmp_path, tests={"velocity_map": ()})
    page = made_up.build(run, tmp_path / "out", experiments={"velocity_map": kind}).path
    text = page.read_text(encoding="utf-8")
    assert text.count('<tr><th scope="row" class="n">') == 18 + 19 + 12
    (further,) = re.findall(r'<pre class="rows" tabindex="0">(.*?)</pre>', text, re.DOTALL)
    assert [line.strip() for line in further.split("\n")] == ["N", *map(str, range(12, 300))]
    assert text.index('href="#table-3-rows">288 more rows') < text.index('id="table-3-rows"')
    assert "100 more rows are in the file" in text
    folds = re.findall(r'<details class="fold"><summary>(.*?)</summary>', text)
    assert folds == ["All 19 rows"]
    style = text.partition("</style>")[0]
    screen, paper = style.split("@media print")
    assert ":has(> .fold:not([open])) tbody tr:nth-child(n + 13) { display: none; }" in screen
    assert "tr:nth-child(n + 13) { display: table-row; }" in paper
    assert "details::details-content { display: block;" in paper


def test_the_scoreboard_shows_one_status_at_a_time(report: Report, page: Page) -> None:
    choices = [a["id"] for a in page.all("input")]
    assert choices[0] == "every-status"
    assert len(choices) > 2
    style = next(text for text in page.code if "#scoreboard" in text)
    for choice in choices[1:]:
        status = choice.removeprefix("only-")
        assert f"#scoreboard:has(#{choice}:checked)" in style
        assert any(a.get("class") == status for a in page.all("li"))
    places = {a["id"] for _, a in page.elements if "id" in a}
    cells = [a for a in page.all("li") if a.get("class", "").startswith(("st-", "muted"))]
    assert len(cells) == len(scoreboard(report.path.parent))
    assert {f"table-{n}" for n in range(1, 6)} <= places


def test_one_figure_is_drawn_as_the_report_has_it(
    made_up: ModuleType, report: Report, tmp_path: Path
) -> None:
    run = made_up.made_up_run(tmp_path)
    wanted = "stabilization/position-error"
    (drawn,), damaged = write_figures(run, wanted, tmp_path / "f", experiments=made_up.EXPERIMENTS)
    assert drawn == tmp_path / "f/figure-5.9.svg"
    assert not damaged
    theirs = contents(report.path.parent / "figures")
    written = contents(tmp_path / "f")
    assert written.pop(WRITTEN)
    assert written == {name: theirs[name] for name in ("figure-5.9.csv", "figure-5.9.svg")}


def test_a_figure_that_the_run_does_not_have_is_told(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path)
    with pytest.raises(UsageError, match="did you mean 'stabilization/position-error'"):
        write_figures(
            run, "stabilization/position-eror", tmp_path / "f", experiments=made_up.EXPERIMENTS
        )
    assert not (tmp_path / "f").exists()
    (tmp_path / "f").write_text("a file")
    with pytest.raises(UsageError, match="cannot be written"):
        write_figures(
            run, "stabilization/position-error", tmp_path / "f", experiments=made_up.EXPERIMENTS
        )


def test_a_figure_that_cannot_be_drawn_costs_only_itself(
    made_up: ModuleType, tmp_path: Path
) -> None:
    def analyse(data: TestData) -> Result:
        good = made_up.velocity_map(data)
        wrong = Figure("wrong", "w", "w", "w", (Panel(Axis("x", "m", "kg"), Axis("y"), ()),))
        return dataclasses.replace(good, figures=(wrong, *good.figures))

    kinds = {"velocity_map": Experiment("v", "v", made_up.ShakeOptions, lambda o, b: (), analyse)}
    run = made_up.made_up_run(tmp_path, tests={"velocity_map": ("4.3",)})
    found = made_up.build(run, tmp_path / "out", experiments=kinds)
    assert len(found.problems) == 1
    assert "wrong cannot be shown" in found.problems[0]
    assert (tmp_path / "out/figures/figure-4.11.svg").is_file()


def test_two_tests_with_one_published_figure_have_two_files(
    made_up: ModuleType, tmp_path: Path
) -> None:
    analyse = made_up.velocity_map
    kinds = {
        k: Experiment(k, k, made_up.ShakeOptions, lambda o, b: (), analyse) for k in ("one", "two")
    }
    run = made_up.made_up_run(tmp_path, tests={"one": ("4.3",), "two": ("4.3",)})
    made_up.build(run, tmp_path / "out", experiments=kinds)
    files = {path.name for path in (tmp_path / "out").rglob("*.*")}
    assert {"figure-4.11.svg", "figure-4.11-two-map.svg", "table-4.3.csv"} <= files
    assert not any(name.startswith("table-4.3-") for name in files)


@pytest.mark.slow
def test_thousands_of_failed_trials_stay_a_page(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, tests={"stabilization": ("5.8",)})
    failed = dataclasses.replace(run.trials[0], ending=Ending(Outcome.DIVERGED, "rate is infinite"))
    many = dataclasses.replace(run, trials=(failed,) * 5000)
    found = made_up.build(many, tmp_path / "out")
    text = found.path.read_text()
    assert text.count("rate is infinite") == 200 + 1  # and on top, once
    assert "4800 more are in the archive" in text


# --- the folder -----------------------------------------------------------------------------


def test_a_newer_report_replaces_the_older_as_a_whole(tmp_path: Path) -> None:
    output = tmp_path / "deep" / "report"
    for name in ("old", "new"):
        with replaced_folder(output) as folder:
            (folder / name).write_text(name)
    assert {p.name for p in output.iterdir()} == {MARKER, "new"}
    assert [p.name for p in output.parent.iterdir()] == ["report"]


def test_a_failed_build_leaves_the_old_report(tmp_path: Path) -> None:
    with replaced_folder(tmp_path / "report") as folder:
        (folder / "old").write_text("old")
    with pytest.raises(KeyboardInterrupt), replaced_folder(tmp_path / "report"):
        raise KeyboardInterrupt
    assert (tmp_path / "report" / "old").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["report"]


@pytest.mark.parametrize("kind", ["folder", "file"])
def test_somebody_s_other_files_are_left_alone(tmp_path: Path, kind: str) -> None:
    precious = tmp_path / "precious"
    if kind == "folder":
        precious.mkdir()
        (precious / "thesis.tex").write_text("years of work")
    else:
        precious.write_text("years of work")
    with pytest.raises(UsageError, match="no report of campaign"), replaced_folder(precious):
        pytest.fail("must refuse before anything is built")
    assert precious.exists()


def test_an_empty_folder_may_become_a_report(tmp_path: Path) -> None:
    (tmp_path / "empty").mkdir()
    with replaced_folder(tmp_path / "empty") as folder:
        (folder / "page").write_text("x")
    assert (tmp_path / "empty" / "page").is_file()


def test_a_folder_that_cannot_be_written_is_told(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("x")
    with (
        pytest.raises(UsageError, match="cannot be written"),
        replaced_folder(tmp_path / "file" / "report"),
    ):
        pytest.fail("must not come here")


def test_what_somebody_put_into_a_report_stays(tmp_path: Path) -> None:
    output = tmp_path / "report"
    for text in ("old", "new"):
        with replaced_folder(output) as folder:
            for name in ("page", "main.tex", "only-" + text):
                (folder / name).write_text(text)
        if text == "old":
            (output / "own").mkdir()
            (output / "own/notes.txt").write_text("mine")
            (output / "main.tex").write_text("edited")
    found = {p.relative_to(output).as_posix(): p.read_text() for p in contents_of(output)}
    assert found.pop(MARKER)
    assert found == {
        "page": "new",
        "main.tex": "new",
        "main.tex.edited": "edited",
        "only-new": "new",
        "own/notes.txt": "mine",
    }


def contents_of(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def test_the_list_of_figures_tells_whose_each_is(report: Report) -> None:
    """Several tests have figures of one title."""
    text = report.path.read_text()
    listed = text[text.index('<section id="figures">') :].split("</section>")[0]
    lines = re.findall(r"<li>.*?</li>", listed)
    assert lines
    assert len({re.sub(r"<a .*?</a>", "", line) for line in lines}) == len(lines)
