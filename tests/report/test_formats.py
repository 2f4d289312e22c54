"""Markdown, LaTeX and PDF say what the page says, in its numbers, and obey nothing in it."""

from __future__ import annotations

import dataclasses
import os
import re
import shutil
import stat
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from markdown_it import MarkdownIt

from campaign import __version__
from campaign.errors import UsageError
from campaign.estimate import Estimate
from campaign.experiments.interface import TestData
from campaign.plugins import GROUPS
from campaign.reason import Reason
from campaign.report.build import Report
from campaign.report.content.citation import citation_of
from campaign.report.formats import chosen_formats, formats, pdf
from campaign.report.formats.markdown import escaped, paragraph
from campaign.report.formats.pdf import unfolded
from campaign.report.latex_text import breakable, cell_numbers, column_head, latex
from campaign.result import Axis, Column, Curve, Figure, Finding, Panel, Result, Table

HOSTILE = (
    "<script>alert(1)</script> **b** _i_ `code` | cell | ![p](x.png) [t](javascript:x) <a@b.c>"
    " https://evil.example www.evil.example :smile: $x$ ^u^ ~s~ @cite &amp; \\|"
    " \\input{/etc/passwd} \\write18{touch owned} ^^5cinput % # & _ { } ~ -- [2pt] * \\end{table}"
)


def build(made_up: ModuleType, run, folder: Path, *names: str, **more) -> Report:
    return made_up.build(run, folder, formats=chosen_formats(names), **more)


@pytest.fixture(scope="module")
def folder(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a report with Markdown and LaTeX."""
    base = tmp_path_factory.mktemp("formats")
    report = build(made_up, made_up.made_up_run(base), base / "out", "markdown", "latex")
    return report.path.parent


def hostile_analysis(data: TestData) -> Result:
    x = np.arange(3.0)
    panel = Panel(Axis("$x_"), Axis("y"), [Curve(x, x, "\\input{x}")], "% #")
    figure = Figure("a", HOSTILE, HOSTILE, HOSTILE, (panel,), ("1",))
    columns = (Column("a", HOSTILE), Column("b", "b", exact=True))
    rows = ({"a": HOSTILE, "b": 1.0}, {"a": "[2pt] first", "b": 2.0}, {"a": "* first", "b": 3.0})
    table = Table("t", HOSTILE, columns, rows, note=HOSTILE)
    long = dataclasses.replace(table, key="long", rows=rows * 20)
    return Result((table, long), (figure,), (), (HOSTILE, "1. first", "- first", "# first"))


@pytest.fixture(scope="module")
def hostile(made_up: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a report in which every text is hostile."""
    base = tmp_path_factory.mktemp("hostile")
    run = made_up.made_up_run(
        base,
        tests={"stabilization": (HOSTILE,)},
        title=HOSTILE,
        description=HOSTILE,
        notes=HOSTILE,
        operator=HOSTILE,
        tags=(HOSTILE,),
    )
    kind = dataclasses.replace(made_up.EXPERIMENTS["stabilization"], analyse=hostile_analysis)
    kinds = {"stabilization": kind}
    return build(made_up, run, base / "out", "markdown", "latex", experiments=kinds).path.parent


# --- which formats there are ----------------------------------------------------------------


def test_formats_are_kinds_like_all_others() -> None:
    assert {"markdown", "latex", "pdf"} <= set(formats())
    assert formats().group == GROUPS["report format"]
    assert [each.name for each in chosen_formats(("latex", "markdown", "latex"))] == [
        "latex",
        "markdown",
    ]


def test_an_unknown_format_is_told_with_the_nearest() -> None:
    with pytest.raises(UsageError, match=r"no report format 'markdwon'.*did you mean 'markdown'"):
        chosen_formats(("markdwon",))


@pytest.mark.slow
def test_without_formats_there_is_only_the_page(report: Report) -> None:
    written = {path.name for path in report.path.parent.iterdir()}
    assert written == {".campaign-report", "report.html", "report.json", "figures", "tables"}
    assert {path.suffix for path in (report.path.parent / "figures").iterdir()} == {".svg", ".csv"}


@pytest.mark.slow
def test_other_formats_do_not_change_the_page(folder: Path, report: Report) -> None:
    assert (folder / "report.html").read_bytes() == report.path.read_bytes()


@pytest.mark.slow
def test_the_same_archive_gives_the_same_bytes(made_up: ModuleType, folder: Path, tmp_path) -> None:
    script = (
        "import sys; from pathlib import Path; sys.path.insert(0, sys.argv[1]); import made_up\n"
        "from campaign.report.build import build_report\n"
        "from campaign.report.formats import chosen_formats\n"
        "build_report(made_up.made_up_run(Path(sys.argv[2])), Path(sys.argv[2]) / 'out',"
        " experiments=made_up.EXPERIMENTS, packaged_templates=made_up.TEMPLATES,"
        " formats=chosen_formats(['markdown', 'latex']))\n"
    )
    environment = os.environ | {"PYTHONHASHSEED": "4711", "TZ": "Asia/Kathmandu", "LC_ALL": "C"}
    environment |= {"PYTHONPATH": str(made_up.ROOT), "SOURCE_DATE_EPOCH": "1"}
    command = [sys.executable, "-c", script, str(Path(__file__).parent), str(tmp_path)]
    subprocess.run(command, check=True, env=environment, cwd=tmp_path)
    names = sorted(path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    assert sum(name.suffix == ".pdf" for name in names) == 4
    for name in names:
        assert (tmp_path / "out" / name).read_bytes() == (folder / name).read_bytes(), name


# --- Markdown -------------------------------------------------------------------------------


def tokens(text: str):
    """Every token of a Markdown text, inline ones included."""
    for token in MarkdownIt("commonmark").enable("table").parse(text):
        yield token
        yield from token.children or ()


def spoken(token) -> str:
    """The words of a token, those that stand for a picture included."""
    return "".join(map(spoken, token.children)) if token.children else token.content


def numbers(text: str, what: str) -> list[int]:
    """Of the figures or tables themselves, not of what leads to them, in the page's order."""
    return [int(number) for number in re.findall(rf'class="number"[^>]*>{what} (\d+)</a>', text)]


def test_markdown_has_the_page_s_numbers_and_files(folder: Path) -> None:
    text, page = (folder / "report.md").read_text(), (folder / "report.html").read_text()
    for what in ("Figure", "Table"):
        found = [int(number) for number in re.findall(rf"^\*\*{what} (\d+)\.", text, re.MULTILINE)]
        assert found == numbers(page, what)
    images = [token.attrs["src"] for token in tokens(text) if token.type == "image"]
    assert len(images) == 4
    links = [token.attrs["href"] for token in tokens(text) if token.type == "link_open"]
    assert len(links) == 8
    assert all((folder / file).is_file() for file in (*images, *links))


def test_markdown_s_tables_have_the_page_s_cells(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    assert "| none | 0.4844 | 0.4884 | +0.83 | differs | selected |" in text
    rows = [token for token in tokens(text) if token.type == "tr_open"]
    page = (folder / "report.html").read_text()
    tables = re.findall(r"<table.*?</table>", page, re.DOTALL)
    left_out = [table for table in tables if 'class="scored"' in table or "Symbols." in table]
    assert len(left_out) == 2  # the scoreboard's own table is a file, symbols are the page's
    lists = re.findall(r'<dl class="key">.*?</dl>', page, re.DOTALL)  # tables of their own there
    named = sum(1 + each.count("<dt>") for each in lists)
    assert len(rows) == page.count("<tr>") - sum(table.count("<tr>") for table in left_out) + named


def test_the_opening_says_in_markdown_what_it_says_on_the_page(made_up, tmp_path) -> None:
    """The question, what is missing, remarks; a test without numbers stands there as well."""
    run = made_up.made_up_run(tmp_path, tests={"stabilization": (), "velocity_map": ()})

    def says(data: TestData) -> Result:
        odd = Estimate.without_interval("rate", 1.0, "rad/s", Reason("test", "one recording only"))
        return Result(findings=(Finding.of(odd, {}),))

    kinds = {
        "stabilization": dataclasses.replace(made_up.EXPERIMENTS["stabilization"], analyse=says),
        "velocity_map": dataclasses.replace(
            made_up.EXPERIMENTS["velocity_map"], analyse=lambda data: Result(notes=("No map.",))
        ),
    }
    folder = build(made_up, run, tmp_path / "out", "markdown", experiments=kinds).path.parent
    text = (folder / "report.md").read_text().split("## Findings")[1].split("\n## ")[0]
    assert "2 tests, " in text
    assert "Without an interval: one recording only." in text
    assert "No result: No map." in text


def test_the_figure_on_top_is_shown_once_and_first(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    top, rest = text.split("\n## Scoreboard")
    assert "**Figure 1. " in top.split("## Findings")[1]
    assert "**Figure 1. " not in rest
    assert "is at the top of the report" in rest


def test_markdown_cites_the_run(folder: Path) -> None:
    text = (folder / "report.md").read_text()
    assert "```bibtex\n@misc{2026-11-21T09-36-58-made-up,\n" in text


def test_hostile_text_is_text_in_markdown(hostile: Path) -> None:
    text = (hostile / "report.md").read_text()
    found = list(tokens(text))
    kinds = {token.type for token in found}
    assert {"html_inline", "html_block", "code_inline", "em_open", "code_block"}.isdisjoint(kinds)
    linked = [token for token in found if token.type in ("link_open", "image")]
    targets = [token.attrs.get("href") or token.attrs["src"] for token in linked]
    assert all(re.fullmatch(r"(figures|tables)/[a-z0-9.-]+\.(svg|csv)", t) for t in targets)
    kinds_in_order = [token.type for token in found]
    tables = " ".join(kinds_in_order).split("table_open")[1:]  # a row too wide makes none of it
    shape = [(table.count("th_open"), table.count("tr_open")) for table in tables]
    assert shape == [(2, 1 + 3), (2, 1 + 60), (5, 1 + 1)]
    assert "https://" not in text.split("```bibtex")[0]
    assert "www." not in text.split("```bibtex")[0]
    inline = [token for token in found if token.type == "inline" and "script" in token.content]
    words = [spoken(token) for token in inline]
    assert len(words) > 8
    assert all(HOSTILE in word for word in words if "reproduces" not in word)  # which quotes it
    assert sum(token.type == "list_item_open" for token in found if token.markup == "1") == 0


@pytest.mark.parametrize("text", ["1. a", "12) a", "- a", "+ a", "= a", ": a", "% a", "# a", "> a"])
def test_no_text_begins_a_list_or_a_heading(text: str) -> None:
    found = MarkdownIt("commonmark").parse(paragraph(text))
    assert [token.type for token in found] == ["paragraph_open", "inline", "paragraph_close"]
    assert "".join(child.content for child in found[1].children) == text


def test_a_cell_is_one_line() -> None:
    assert escaped("a\n\n| b\t") == r"a \| b"


# --- LaTeX ----------------------------------------------------------------------------------


def test_latex_has_the_page_s_numbers_in_its_order(folder: Path) -> None:
    text, page = (folder / "report.tex").read_text(), (folder / "report.html").read_text()
    for what, label in (("Figure", "fig"), ("Table", "tab")):
        pattern = rf"\\label\{{{label}:2026-11-21t09-36-58-made-up:(\d+)\}}"
        found = [int(number) for number in re.findall(pattern, text)]
        assert found == numbers(page, what) == list(range(1, len(found) + 1))
    assert text.count(r"\caption") == text.count(r"\label")
    used = re.findall(r"\\includegraphics\[[^\]]*\]\{\\reportfolder/(.*?)\}", text)
    assert len(used) == 4
    assert all((folder / file).read_bytes().startswith(b"%PDF-") for file in used)


def test_the_body_has_no_preamble_and_says_what_it_needs(folder: Path) -> None:
    text = (folder / "report.tex").read_text()
    commands = re.sub(r"^%.*$", "", text, flags=re.MULTILINE)
    assert r"\documentclass" not in commands
    assert r"\usepackage" not in commands
    needed = set(re.findall(r"\{([a-z,]+)\}", (folder / "main.tex").read_text()))
    assert "array,booktabs,longtable,graphicx,siunitx,textcomp" in needed
    assert r"%   \usepackage{array,booktabs,longtable,graphicx,siunitx,textcomp}" in text


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (r"\input{/etc/passwd}", r"\textbackslash{}input\{/etc/passwd\}"),
        ("5 % of $x_1^2$ & #3 ~", r"5 \% of \$x\_1\textasciicircum{}2\$ \& \#3 \textasciitilde{}"),
        ("^^5c", r"\textasciicircum{}\textasciicircum{}5c"),
        ("a -- b,,c ''", r"a -{}- b,{},c '{}'"),
        ("3.87 ± 0.12", r"3.87 \ensuremath{\pm} 0.12"),
        ("−2 × 10⁻³ N·m/(rad/s)²", (r"\ensuremath{-}2 \ensuremath{\times} 10\ensuremath{^{-3}}"
         r" N\textperiodcentered{}m/(rad/s)\ensuremath{^{2}}")),
        ("σ₂ ≥ 5 °, ΔΩ λς", (r"\ensuremath{\sigma}\ensuremath{_{2}} \ensuremath{\geq} 5"
         r" \textdegree{}, \ensuremath{\Delta}\ensuremath{\Omega}"
         r" \ensuremath{\lambda}\ensuremath{\sigma}")),
        ("[2pt] *", r"{[}2pt{]} {*}"),
        ("Müller, 中", r"Müller, {[}U+4E2D{]}"),
        ("a\n\n\\par b", r"a \textbackslash{}par b"),
    ],
)  # fmt: skip
def test_text_is_text_in_latex(text: str, expected: str) -> None:
    assert latex(text) == expected


def test_long_words_may_break() -> None:
    assert breakable("a " + "b" * 25).count(r"\allowbreak{}") == 3
    assert breakable("b" * 24) == "b" * 24


def commands(text: str) -> set[str]:
    """Every command of a LaTeX text, those in its comments apart."""
    return set(re.findall(r"\\([a-zA-Z]+)", re.sub(r"^%.*$", "", text, flags=re.MULTILINE)))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("3.87 ± 0.12", r"\num{3.87 \pm 0.12}"),
        ("(4.01 ± 0.12) × 10⁻⁹ †", r"\num{4.01 \pm 0.12 e-9} \textdagger{}"),
        ("−12 (−14 to −9)", r"\num{-12} (\num{-14} to \num{-9})"),
        ("≥ 24.6", r"\ensuremath{\geq} \num{24.6}"),
        ("1168 ± 31 (assumed)", r"\num{1168 \pm 31} (assumed)"),
        ("4 × 10⁵", r"\num{4 e5}"),
        ("v1.2.3 of x2 is 1.2.3", "v1.2.3 of x2 is 1.2.3"),
        ("–", r"\textendash{}"),
    ],
)
def test_numbers_of_a_cell_are_set_by_siunitx(text: str, expected: str) -> None:
    assert cell_numbers(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("Error (mrad)", r"Error (\unit{\milli\radian})"),
        ("Stiffness (N·m/rad)", r"Stiffness (\unit{\newton\metre\per\radian})"),
        ("Rise (10 to 90 %) (ms)", r"Rise (10 to 90 \%) (\unit{\milli\second})"),
        ("J (kg·m²)", r"J (\unit{\kilo\gram\metre\squared})"),
        ("Share (%)", r"Share (\unit{\percent})"),
        ("Growth (1/s)", r"Growth (\unit{\per\second})"),
        ("Fitted up to (share of Ts)", r"Fitted up to (share of \ensuremath{T_\mathrm{s}})"),
    ],
)
def test_the_unit_of_a_head_is_set_by_siunitx(text: str, expected: str) -> None:
    assert column_head(text) == expected


def test_no_hostile_word_is_a_command_in_latex(folder: Path, hostile: Path) -> None:
    """What every text is written with is all that the hostile one is written with."""
    symbols = commands("".join(map(latex, HOSTILE)))
    tame, wild = (commands((each / "report.tex").read_text()) for each in (folder, hostile))
    long_tables = {"LTcapwidth", "endfirsthead", "endhead", "endfoot", "begingroup", "endgroup"}
    widths = {"raggedright", "raggedleft", "arraybackslash", "dimexpr", "relax", "noindent"}
    emphasis = {"allowbreak", "textbf", "linewidth", "addtocounter"}
    assert wild <= tame | symbols | long_tables | widths | emphasis
    assert {"input", "write"}.isdisjoint(wild)
    text = (hostile / "report.tex").read_text()
    assert not re.search(r"(?<!\\)\^\^", text)
    assert not re.search(r"\\\\\s*[\[*]", text)


def typeset(folder: Path) -> str:
    """The log of LaTeX; the test is skipped where there is none."""
    engine = shutil.which("pdflatex")
    if engine is None:
        pytest.skip("no pdflatex on the PATH (Debian: texlive-latex-recommended)")
    command = [engine, "-no-shell-escape", "-interaction=nonstopmode", "main.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, check=False)
    log = (folder / "main.log").read_text(encoding="utf-8", errors="replace")
    assert done.returncode == 0, re.findall(r"^! .*", log, re.MULTILINE)
    return log


@pytest.mark.slow
def test_latex_typesets_it(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder, tmp_path / "copy")
    log = typeset(tmp_path / "copy")
    assert not re.findall(r"^! .*|.*undefined.*", log, re.MULTILINE)


@pytest.mark.slow
def test_latex_typesets_hostile_text_and_obeys_none_of_it(hostile: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(hostile, copy)
    log = typeset(copy)
    assert "/etc/passwd" not in re.sub(r"\s", "", "".join(re.findall(r"\((/[^\s()]*)", log)))
    assert not list(tmp_path.rglob("owned"))
    if shutil.which("pdftotext"):
        done = subprocess.run(["pdftotext", "main.pdf", "-"], cwd=copy, capture_output=True)
        text = done.stdout.decode()
        assert r"\input{/etc/passwd}" in text
        assert "root:x:0" not in text


# --- citing ---------------------------------------------------------------------------------


def test_a_run_is_cited_by_what_identifies_it(made_up: ModuleType, tmp_path: Path) -> None:
    run = made_up.made_up_run(tmp_path, operator="A. Author and B. Writer")
    cited = citation_of(run)
    assert cited.sentence == (
        "A. Author and B. Writer: Friction compensation on the simulated bench. Run"
        " 2026-11-21T09-36-58-made-up of 2026-11-21, campaign 0.1.0, archive SHA-256"
        f" {run.sha256}."
    )
    assert "  author = {{A. Author and B. Writer}},\n" in cited.bibtex
    assert "  year = {2026},\n  month = nov,\n" in cited.bibtex
    assert run.sha256 in cited.bibtex


def test_nothing_ends_a_bibliography_s_field_early(made_up: ModuleType, tmp_path: Path) -> None:
    title = r"}, note = {x} \} {{ % @misc{y"
    entry = citation_of(made_up.made_up_run(tmp_path, title=title, operator="")).bibtex
    depth = 0
    for place, letter in enumerate(entry):  # as BibTeX counts: a backslash escapes no brace
        depth += {"{": 1, "}": -1}.get(letter, 0)
        assert depth > 0 or place < entry.index("{") or not entry[place + 1 :].strip()
    assert depth == 0
    assert entry.count("\n  note = ") == 1
    assert "author" not in entry


def test_the_page_says_how_to_cite_the_run(report: Report) -> None:
    text = report.path.read_text()
    assert "How to cite this run" in text
    assert "@misc{2026-11-21T09-36-58-made-up," in text


def test_the_program_can_be_cited(made_up: ModuleType) -> None:
    text = (made_up.ROOT / "CITATION.cff").read_text()
    keys = re.findall(r"^([a-z-]+):", text, re.MULTILINE)
    assert {"cff-version", "message", "title", "authors", "version"} <= set(keys)
    changes = (made_up.ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    (version, date), *_ = re.findall(
        r"^## \[([\d.]+)\] - (\d{4}-\d\d-\d\d)$", changes, re.MULTILINE
    )
    assert version == __version__
    assert f"\nversion: {version}\ndate-released: {date}\n" in text


# --- PDF ------------------------------------------------------------------------------------


def test_everything_is_unfolded_for_print() -> None:
    page = '<style>a</style><details class="x"><details open><details><p>details</p>'
    assert unfolded(page).count("<details open") == 3
    assert "counter(page)" in unfolded(page).split("</style>")[0]


def test_without_a_browser_nothing_is_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(UsageError, match=r"needs Chromium or Chrome; .* apt install chromium"):
        chosen_formats(("pdf",))


def fake_browser(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    folder.mkdir()
    browser = folder / "chromium"
    browser.write_text(f"#!/bin/sh\n{script}\n")
    browser.chmod(browser.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


def test_a_browser_that_fails_is_told_and_the_old_report_stays(
    made_up: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake_browser(tmp_path / "bin", "echo no display >&2; exit 1", monkeypatch)
    run = made_up.made_up_run(tmp_path, tests={})
    build(made_up, run, tmp_path / "out")
    before = (tmp_path / "out" / "report.html").stat().st_ino
    with pytest.raises(UsageError, match="chromium printed nothing: no display"):
        build(made_up, run, tmp_path / "out", "pdf")
    assert (tmp_path / "out" / "report.html").stat().st_ino == before


def test_a_browser_that_hangs_is_ended_with_what_it_started(
    made_up: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = f"sleep 300 & echo $! > {tmp_path}/child; wait"
    fake_browser(tmp_path / "bin", script, monkeypatch)
    monkeypatch.setattr(pdf, "SECONDS", 1.0)
    with pytest.raises(UsageError, match="did not print the page within 1 s"):
        build(made_up, made_up.made_up_run(tmp_path, tests={}), tmp_path / "out", "pdf")
    child = int((tmp_path / "child").read_text())
    for _ in range(200):  # whoever adopts it reaps it in its own time
        state = Path(f"/proc/{child}/stat")
        if not state.exists() or state.read_text().rsplit(")", 1)[1].split()[0] == "Z":
            break
        time.sleep(0.05)
    else:
        pytest.fail("the browser's child goes on")


@pytest.mark.slow
def test_the_page_is_printed_whole(made_up: ModuleType, tmp_path: Path) -> None:
    if pdf.browser() is None:
        pytest.skip("no Chromium on the PATH (Debian: chromium)")
    run = made_up.made_up_run(tmp_path, sources={"made-up.toml": "# the end of a folded text"})
    build(made_up, run, tmp_path / "out", "pdf")
    made = tmp_path / "out" / "report.pdf"
    assert made.read_bytes().startswith(b"%PDF-")
    if shutil.which("pdftotext"):
        done = subprocess.run(["pdftotext", str(made), "-"], capture_output=True)
        pages = done.stdout.decode().split("\f")[:-1]
        assert "the end of a folded text" in pages[-1]
        assert all(re.search(rf"^{n} ?/ ?{len(pages)}$", p, re.M) for n, p in enumerate(pages, 1))
