"""An article in every format: what is on its page is in Markdown, LaTeX and JSON as well."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaign.errors import UsageError
from campaign.report.article import write_article
from campaign.report.drawing.drawing_files import DrawingFiles
from campaign.report.formats import chosen_formats
from campaign.report.formats.interface import Format
from campaign.report.formats.report_data import ArticleData
from campaign.report.page.article import Article, Part, problems_part
from campaign.report.page.folder import Folder
from campaign.report.page.pieces import Facts, Files, FoldedSection, Items, Paragraph
from campaign.resources import templates_folder
from campaign.result import Axis, Column, Curve, Figure, Panel, Table


def made() -> Article:
    from campaign.report.drawing.figures import draw

    folder = Folder()
    figure = Figure(
        key="line",
        title="A line",
        caption="It rises; is told.",
        alt="a line",
        panels=(Panel(Axis("Time", "s", "s"), Axis("Rate", "rad/s", "deg/s"),
                      [Curve([0.0, 1.0], [0.0, 1.0], "up", "measured")]),),
    )  # fmt: skip
    shown = folder.figure(figure, DrawingFiles.of(draw(figure), figure), (), "line")
    table = Table("numbers", "Numbers of it", (Column("rate", "Rate", "rad/s", "deg/s"),),
                  ({"rate": 1.0}, {"rate": float("nan")}))  # fmt: skip
    grid = folder.shown_table(table, (), "numbers")
    pieces = (
        Paragraph("It leads.", "lead"),
        Paragraph("Mind this.", "warning"),
        Paragraph("A note.", "note"),
        Items(("first thing", "second thing")),
        Facts((("a fact", "stands"),)),
        shown,
        FoldedSection("Unfold", (Items(("folded thing",)), grid)),
        Files((("More in", grid.download),)),
    )
    return Article(
        "Trends", "campaign trend", "A title <b>", "What it is about.",
        (("", (("Run", "one"),)),),
        (*problems_part("it", ["what is wrong"]), Part("all", "All of it", pieces, role="test")),
        folder,
        {"own": [1.0, float("inf")]},
    )  # fmt: skip


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("article") / "out"
    formats = chosen_formats(["markdown", "latex"])
    write_article("trend", made, output, templates_folder(), formats=formats)
    return output


@pytest.mark.parametrize("name", ["trend.html", "trend.md", "trend.tex"])
def test_all_of_it_is_in_every_format_in_one_order(written: Path, name: str):
    text = (written / name).read_text(encoding="utf-8")
    plain = text.replace("\\", "").replace("*", "").replace("&lt;", "<").replace("&gt;", ">")
    plain = plain.replace("textless{}", "<").replace("textgreater{}", ">").replace("textbf{", "")
    at = [plain.find(each) for each in ("It leads", "A note", "first thing", "It rises",
                                        "folded thing", "Numbers of it", "More in")]  # fmt: skip
    assert -1 not in at
    assert at == sorted(at)
    assert "<b>" not in text.replace("\\<b\\>", "")
    for said in ("what is wrong", "What it is about", "second thing", "stands", "Mind"):
        assert said in plain


def test_latex_has_the_figure_as_pdf(written: Path):
    assert (written / "figures/line.pdf").read_bytes().startswith(b"%PDF")
    assert "figures/line.pdf" in (written / "trend.tex").read_text(encoding="utf-8")
    assert "\\input{trend.tex}" in (written / "main.tex").read_text(encoding="utf-8")
    assert not (written / "trend.bib").exists()


def test_json_has_sentences_tables_and_figures_as_a_report_has_them(written: Path):
    text = (written / "trend.json").read_text(encoding="utf-8")
    tree = json.loads(text)
    assert ArticleData.model_validate(tree).kind == "trends"
    (wrong, section) = tree["sections"]
    assert wrong["sentences"] == ["what is wrong"]
    assert section["sentences"][-1] == "folded thing"
    assert section["tables"][0]["rows"] == [{"rate": 1.0}, {"rate": None}]
    assert section["figures"][0]["panels"][0]["curves"][0]["y"] == [0.0, 1.0]
    assert tree["content"] == {"own": [1.0, None]}


def test_templates_of_a_laboratory_win(tmp_path: Path):
    own = tmp_path / "own"
    own.mkdir()
    (own / "article.html").write_text(
        '{% extends "campaign/article.html" %}{% block masthead %}Ours: {{ article.title }}'
        "{% endblock %}"
    )
    page = write_article("trend", made, tmp_path / "out", templates_folder(), own)
    assert "Ours: A title &lt;b&gt;" in page.read_text(encoding="utf-8")


def test_a_format_that_fails_leaves_no_page(tmp_path: Path):
    def broken(_: object) -> None:
        raise UsageError("no ink")

    formats = (Format("ours", "a format that fails", broken),)
    with pytest.raises(UsageError, match="no ink"):
        write_article("trend", made, tmp_path / "out", templates_folder(), formats=formats)
    assert not (tmp_path / "out").exists()
