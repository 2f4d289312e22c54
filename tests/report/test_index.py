"""`campaign index`: every run of a folder on one page, whatever lies there."""

from __future__ import annotations

import base64
import hashlib
import json
import re
import shutil
from pathlib import Path
from urllib.parse import unquote

import pytest

from campaign.archive.layout.header import RunHeader
from campaign.archive.layout.names import JOURNAL
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.summarise import summarise
from campaign.archive.reading.summary import RunSummary
from campaign.archive.writing.writer import RunWriter
from campaign.errors import UsageError
from campaign.report.index.page import entry_of, render, write_index
from campaign.report.index.report_summary import summary_of_report
from campaign.report.index.sketch import sketch
from campaign.resources import templates_folder
from tests.html_pages import Page

KEPT = Path(__file__).parents[1] / "archive" / "kept" / "format-3.nxs"
HOSTILE = '"><script>alert(1)</script><img src=x onerror=alert(2)>'


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """A sealed run with a report, one in progress with a hostile title, and a damaged file."""
    folder = tmp_path / "results"
    folder.mkdir()
    shutil.copy(KEPT, folder / "sound.nxs")
    header = RunHeader(
        name="going",
        created="2026-11-21T09:36:58+00:00",
        title=HOSTILE,
        operator="A. & B.",
        tags=("x<y",),
        tests=({"name": "sea"},),
        trials=3,
    )
    RunWriter.create(folder, header, ())
    (folder / 'bad "& <b>.nxs').write_bytes(KEPT.read_bytes()[:3000])
    report = folder / "sound-report"
    (report / "figures").mkdir(parents=True)
    (report / "report.html").write_text("<p>a report</p>")
    for name in ("scoreboard", "b-late", "a-early"):
        (report / "figures" / f"{name}.svg").write_text("<svg/>")
    return folder


def shown(results: Path) -> Page:
    return Page(render(results, templates_folder()))


def told(results: Path, tree: object) -> None:
    text = tree if isinstance(tree, str) else json.dumps(tree)
    (results / "sound-report" / "report.json").write_text(text)


def test_every_run_is_there_the_partial_and_the_damaged_as_such(results: Path):
    page = shown(results)
    assert len([a for a in page.all("li") if "run" in str(a.get("class"))]) == 3
    assert "incomplete (not sealed)" in page.text
    assert 'bad "& <b>' in page.text
    assert "Cannot be read:" in page.text
    assert "1 cannot be read" in page.text
    assert "1 without an end" in page.text
    assert "A. & B." in page.text
    assert str(results) not in render(results, templates_folder())


def test_hostile_names_are_text(results: Path):
    page = shown(results)
    assert HOSTILE in page.text
    assert len(page.all("script")) == 1
    assert not any(name.startswith("on") for _, attrs in page.elements for name in attrs)
    assert all(str(a.get("src", "")).startswith("./") for a in page.all("img"))


def test_only_the_page_s_own_script_and_style_may_act(results: Path):
    html = render(results, templates_folder())
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', html)
    assert policy
    for tag, directive in (("script", "script-src"), ("style", "style-src")):
        (inner,) = re.findall(rf"<{tag}>(.*?)</{tag}>", html, re.DOTALL)
        digest = base64.b64encode(hashlib.sha256(inner.encode()).digest()).decode()
        assert f"{directive} 'sha256-{digest}';" in policy[1]
    assert "unsafe" not in policy[1]
    assert "default-src 'none'" in policy[1]
    assert "style=" not in html


def test_without_the_script_all_runs_are_shown_and_no_search_is_offered(results: Path):
    page = shown(results)
    (search,) = [a for a in page.all("p") if a.get("id") == "search"]
    assert "hidden" in search
    assert not any("hidden" in a for a in page.all("li"))


def test_a_report_is_linked_with_its_first_figure(results: Path):
    page = shown(results)
    assert [a["href"] for a in page.all("a") if "report.html" in str(a["href"])] == [
        "./sound-report/report.html"
    ]
    assert [a["src"] for a in page.all("img")] == ["./sound-report/figures/a-early.svg"]
    assert "campaign report going" in page.text


def test_what_the_report_says_is_the_verdict(results: Path):
    told(
        results,
        {
            "opening": {
                "answers": [{"test": "x", "numbers": [{"quantity": "of another test"}]},
                            {"test": "b", "figure": "late", "numbers": [
                                {"quantity": "error", "where": "LuGre", "value": "1.0 ± 0.1 mrad"},
                                *[{"quantity": "more", "value": f"{n}"} for n in range(3)]]}],
                "telling": ["b", "late"],
                "compared": "7 of 8 values reproduced.",
            },
        },
    )  # fmt: skip
    page = shown(results)
    assert "error, LuGre: 1.0 ± 0.1 mrad; more: 0; more: 1. 7 of 8 values reproduced." in page.text
    assert "of another test" not in page.text
    assert [a["src"] for a in page.all("img")] == ["./sound-report/figures/b-late.svg"]


@pytest.mark.parametrize(
    "tree",
    [
        "no JSON",
        "[" * 100_000,
        [],
        {"opening": 7},
        {"opening": {"answers": {"numbers": "x"}, "telling": "ab", "compared": ["x"]}},
        {"opening": {"answers": [7, {"numbers": [7, None]}], "telling": [None, 3]}},
        {"opening": {"telling": ["../../..", "etc/passwd"]}},
    ],
)
def test_a_report_that_says_nothing_usable_is_still_linked(results: Path, tree: object):
    told(results, tree)
    found = summary_of_report(results / "sound-report")
    assert found.page is not None
    assert (found.numbers, found.headline) == ("", "")
    assert found.figure == results / "sound-report" / "figures" / "a-early.svg"


def test_what_is_too_large_is_left_alone_and_what_is_too_long_is_cut(results: Path, monkeypatch):
    path = results / "sound-report" / "report.json"
    told(results, {"opening": {"compared": "x" * 1000}})
    assert summary_of_report(path.parent).headline == "x" * 399 + "…"
    monkeypatch.setattr("campaign.report.index.report_summary.LARGEST", 1000)
    assert summary_of_report(path.parent).headline == ""


def test_trials_are_counted(tmp_path: Path):
    run = RunSummary(
        "a", tmp_path / "a.partial", 1, created="2026-11-21T09:00:00+00:00",
        status=RunStatus.INCOMPLETE, planned=20, trials=18, failed=1, interrupted=2, title="",
        protocol="sea",
    )  # fmt: skip
    entry = entry_of(run)
    told = "15 of 20 trials completed, 1 failed, 2 interrupted, 2 not executed."
    assert entry.verdict == (told,)
    assert (entry.title, entry.status) == ("sea", "incomplete (not sealed)")
    assert (entry.when, entry.link, entry.thumbnail) == ("2026-11-21 09:00", "", "")


def test_trials_of_which_nobody_knows_are_not_told_as_not_executed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    header = RunHeader(name="a", created="2026-11-21T09:00:00+00:00", trials=3)
    folder = RunWriter.create(tmp_path, header, ()).folder
    monkeypatch.setattr("campaign.archive.reading.summarise.read_header", lambda _: header)
    entry = entry_of(summarise(folder))
    assert entry.verdict == ("0 of 3 trials completed, 3 not executed.",)
    with (folder / JOURNAL).open("ab") as journal:
        journal.write(b"rubbish\n" + (folder / JOURNAL).read_bytes())
    run = summarise(folder)
    assert run.untold == 3
    assert entry_of(run).verdict == (
        (
            "0 of 3 trials completed, of 3 the journal does not say any more whether they were"
            " executed."
        ),
    )


def test_a_figure_is_sketched_from_its_numbers(results: Path):
    many = list(range(3000))
    curves = [
        {"series": "lugre", "style": "line", "x": many, "y": [n % 7 for n in many]},
        {"series": "none", "style": "points", "x": [1, 10, 100, None, "x"], "y": [1, 2, 3, 4, 5]},
    ]  # fmt: skip
    figure = {"key": "map", "title": "Map & more", "panels": [{"curves": []}, {"curves": curves}]}
    other = figure | {"key": "first", "title": "Other", "panels": [{"curves": curves[:1]}]}
    tests = [{"name": "t", "figures": [other, figure]}]
    told(results, {"opening": {"telling": ["t", "map"]}, "tests": tests})
    page = shown(results)
    (source,) = [str(a["src"]) for a in page.all("img")]
    svg = Page(unquote(source.removeprefix("data:image/svg+xml,")))
    line, points = (str(a["d"]) for a in svg.all("path"))
    assert points.count("M") == 3  # what is no number is left out
    assert 100 < line.count("L") < 300
    assert len(source) < 10_000
    assert "Map & more" in page.text
    assert "Other" not in page.text


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_a_sketch_has_its_curves_where_they_belong(scale: str):
    curve = {"x": [1, 10, 100], "y": [0.0, 5.0, 10.0], "style": "line"}
    panel = {"x": {"scale": scale}, "y": {"scale": "linear"}, "curves": [curve]}
    (path,) = Page(sketch({"panels": [panel]})).all("path")
    (x1, y1), (x2, y2), (x3, y3) = (
        map(float, point.split()) for point in str(path["d"])[1:].split("L")
    )
    share = (x2 - x1) / (x3 - x1)
    assert share == pytest.approx(0.5 if scale == "log" else 9 / 99, abs=0.01)
    assert (y1 - y2) == pytest.approx(y2 - y3)
    assert y1 > y3


@pytest.mark.parametrize(
    "panels",
    [None, [], [3], [{"curves": 1}], [{"curves": [{"x": [True, 1e999], "y": [1, 2]}]}],
     [{"x": {"scale": "log"}, "curves": [{"x": [-1, 0], "y": [1, 2]}]}]],
)  # fmt: skip
def test_what_cannot_be_sketched_is_left_alone(panels: object):
    assert sketch({"panels": panels}) == ""


def test_addresses_are_quoted(tmp_path: Path):
    name, created = 'a#b?"<é> %', "2026-11-21T09:00:00+00:00"
    path = tmp_path / f"{name}.nxs"
    run = RunSummary(name, path, 1, created=created, status=RunStatus.COMPLETE)
    folder = tmp_path / 'a#b?"<é> %-report'
    folder.mkdir()
    (folder / "report.html").touch()
    assert entry_of(run).link == "./a%23b%3F%22%3C%C3%A9%3E%20%25-report/report.html"


def test_the_same_folder_gives_the_same_bytes(results: Path):
    first = write_index(results, templates_folder()).read_bytes()
    assert write_index(results, templates_folder()).read_bytes() == first
    (results / ".campaign-index.json").unlink()
    assert write_index(results, templates_folder()).read_bytes() == first
    assert [path.name for path in results.iterdir() if path.name.endswith(".part")] == []


def test_an_index_that_is_not_ours_stays(results: Path):
    path = results / "index.html"
    path.write_text("<h1>My own page about campaign index</h1>")
    with pytest.raises(UsageError, match="was not written by campaign"):
        write_index(results, templates_folder())
    assert path.read_text().startswith("<h1>My own")
    path.unlink()
    path.symlink_to(results / "nowhere")
    with pytest.raises(UsageError):
        write_index(results, templates_folder())


def test_a_folder_that_is_not_there_and_one_without_runs(tmp_path: Path):
    with pytest.raises(UsageError, match="there is no such folder"):
        write_index(tmp_path / "nothing", templates_folder())
    assert "0 runs" in Page(write_index(tmp_path, templates_folder()).read_text()).text


def test_runs_are_the_newest_first_and_none_is_opened_twice(results: Path, monkeypatch):
    for day in (1, 2, 3):
        shutil.copy(KEPT, results / f"2026-11-0{day}T00-00-00-run.nxs")
    names = re.findall(r"<code>([^<]*)</code>", render(results, templates_folder()))
    dated = [name for name in names if name.startswith("2026")]
    assert dated == sorted(dated, reverse=True)

    def opened(path: Path) -> RunSummary:
        raise AssertionError(f"{path} was read again")

    (results / 'bad "& <b>.nxs').unlink()
    monkeypatch.setattr("campaign.archive.reading.summarise.summarise", opened)
    render(results, templates_folder())


def test_comparisons_are_linked(results: Path):
    folder = results / "a-against-b-comparison"
    folder.mkdir()
    (folder / "comparison.html").touch()
    assert "Comparisons" not in shown(results).text
    (folder / ".campaign-report").touch()
    links = [str(a["href"]) for a in shown(results).all("a")]
    assert "./a-against-b-comparison/comparison.html" in links
    assert "a-against-b" in shown(results).text
    (folder / "comparison.html").write_text("<title>b &lt;i&gt; compared with a</title>")
    assert "b <i> compared with a" in shown(results).text
