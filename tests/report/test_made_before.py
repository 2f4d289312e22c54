"""What a report's folder has besides the page stays, is never stale, and is told of."""

from __future__ import annotations

import gc
import hashlib
import json
import os
import pickle
import shutil
import signal
from pathlib import Path

import pytest

from campaign import processes as worker
from campaign.archive.layout.names import results_path
from campaign.cli.report import report_run
from campaign.errors import ExitCode, UsageError
from campaign.gc_threshold import GC_THRESHOLD
from campaign.report import processes
from campaign.report.previous_report import MADE
from tests.archives import simulated_run
from tests.system.user import completed

pytestmark = pytest.mark.usefixtures("drawings_kept")


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sealed run of which every trial completed."""
    return simulated_run(tmp_path_factory.mktemp("results"))


def report(run: Path, output: Path, *formats: str, **options: object) -> Path:
    """The report's folder, made as the command makes it."""
    templates = options.pop("templates", None)
    more = {"formats": formats} | options
    page, code = report_run(str(run), run.parent, output, templates, **more)
    assert code == ExitCode.DONE
    return page.parent


@pytest.fixture(scope="module")
def made(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report with Markdown; to be copied, not changed."""
    return report(run, tmp_path_factory.mktemp("made") / "out", "markdown")


@pytest.fixture(scope="module")
def made_alone(run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report without another format; to be copied, not changed."""
    return report(run, tmp_path_factory.mktemp("alone") / "out")


@pytest.fixture
def earlier(made: Path, tmp_path: Path) -> Path:
    """An earlier report with Markdown, in `out`."""
    return Path(shutil.copytree(made, tmp_path / "out"))


def names(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.slow
def test_formats_and_trials_pages_are_made_anew_with_the_page(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = report(run, tmp_path / "out", "markdown", trials="1")
    told = capsys.readouterr().err
    assert "written: report.html, report.json, report.md; " in told
    assert "trials/trial-00001.html" in told
    before = names(folder)
    own = tmp_path / "own"
    own.mkdir()
    text = '{% extends "campaign/trial.html" %}{% block settings %}<p>New.</p>{% endblock %}'
    (own / "trial.html").write_text(text)
    # The page of trial 1 is not the old one, although nobody has asked for it.
    folder = report(run, tmp_path / "out", trials="2", templates=own)
    assert names(folder) == before | {"trials/trial-00002.html"}
    assert "<p>New.</p>" in (folder / "trials/trial-00001.html").read_text(encoding="utf-8")


def test_what_was_removed_by_hand_is_not_made_again(run: Path, tmp_path: Path) -> None:
    folder = report(run, tmp_path / "out", "markdown", trials="1,2")
    (folder / "report.md").unlink()
    (folder / "trials" / "trial-00002.html").unlink()
    folder = report(run, tmp_path / "out")
    assert "report.md" not in names(folder)
    assert [path.name for path in (folder / "trials").iterdir()] == ["trial-00001.html"]


def test_pages_of_another_run_do_not_stay(run: Path, tmp_path: Path) -> None:
    folder = report(run, tmp_path / "out", "markdown", trials="1")
    tree = json.loads((folder / MADE).read_bytes())
    plain = names(report(run, tmp_path / "plain"))
    # As it would be, had the folder been that of another run.
    marker = folder / ".campaign-report"
    text = (folder / MADE).read_text(encoding="utf-8").replace(tree["run"], "other")
    lines = [line for line in marker.read_text(encoding="utf-8").splitlines() if MADE not in line]
    digest = hashlib.sha256(text.encode()).hexdigest()
    marker.write_text("\n".join([*lines, f"{digest}  {MADE}\n"]), encoding="utf-8")
    (folder / MADE).write_text(text, encoding="utf-8")
    assert names(report(run, tmp_path / "out")) == plain


@pytest.mark.parametrize("text", ["[]", "{", '{"run": 3}', '{"run": NAME, "formats": [1]}'])
def test_notes_that_make_no_sense_are_none(
    run: Path, made_alone: Path, tmp_path: Path, text: str
) -> None:
    folder = Path(shutil.copytree(made_alone, tmp_path / "out"))
    (folder / MADE).write_text(text.replace("NAME", f'"{run.stem}"'), encoding="utf-8")
    assert "report.md" not in names(report(run, tmp_path / "out"))


def test_a_format_of_before_that_cannot_be_made_costs_itself(
    run: Path,
    earlier: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def lacking(names: list[str]) -> None:
        raise UsageError("it needs what is not here")

    monkeypatch.setattr("campaign.report.previous_report.chosen_formats", lacking)
    folder = report(run, earlier)
    assert "report.md" not in names(folder)  # it would be of the older report
    told = "markdown, which the earlier report had, is left out: it needs what is not here"
    assert capsys.readouterr().err.count(told) == 1


def test_that_no_trial_failed_is_said(
    run: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = report(run, tmp_path / "out", trials="failed")
    assert "--trials failed: no such trial" in capsys.readouterr().err
    assert not (folder / "trials").exists()


def test_the_page_tells_the_command_as_it_was_typed(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = report(run, tmp_path / "out", measure_anew=True)
    page = (folder / "report.html").read_text(encoding="utf-8")
    # No folder of the machine that it was made on is on the page.
    assert f"campaign report {run.stem} --results FOLDER --measure-anew --only-figure " in page
    assert str(run.parent) not in page
    (tmp_path / "results").symlink_to(run.parent)
    monkeypatch.chdir(tmp_path)
    folder = report(Path("results") / run.name, tmp_path / "out")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert f"campaign report {run.stem} --only-figure " in page
    assert "--measure-anew --only" not in page


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--only-figure", ""), "'' is no figure of this run; allowed are "),
        (
            ("--only-figure", "a/b", "--format", "nonsense", "--trials", "x", "--open"),
            "--only-figure writes a figure and no page; leave --open, --format, --trials out",
        ),
    ],
)
def test_one_figure_and_a_page_do_not_go_together(
    run: Path, tmp_path: Path, options: tuple[str, ...], told: str
) -> None:
    done = completed(tmp_path, "report", str(run), *options)
    assert done.returncode == ExitCode.USAGE
    assert told in done.stderr
    assert not done.stdout
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_document_that_was_removed_stays_away_whatever_its_figures(
    run: Path, tmp_path: Path
) -> None:
    folder = report(run, tmp_path / "out", "latex")
    (folder / "report.tex").unlink()
    assert any(path.suffix == ".pdf" for path in (folder / "figures").iterdir())
    folder = report(run, tmp_path / "out")
    assert not {path.name for path in folder.iterdir()} & {"report.tex", "main.tex"}


def test_a_report_that_fails_leaves_older_results(run: Path, tmp_path: Path) -> None:
    report(run, tmp_path / "out")
    kept = results_path(run)
    os.utime(kept, (1, 1))
    before = kept.read_bytes(), kept.stat().st_mtime
    own = tmp_path / "own"
    own.mkdir()
    (own / "report.html").write_text("{{ nobody.has_this }}")
    with pytest.raises(UsageError):
        report(run, tmp_path / "out", templates=own)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError):
        report(run, tmp_path / "mine")
    assert (kept.read_bytes(), kept.stat().st_mtime) == before
    assert [path.name for path in run.parent.iterdir() if path.name.endswith(".part")] == []


@pytest.mark.parametrize("note", [b"\xff\xfe", b'{"run": 1}', b"[" * 100_000])
def test_a_note_that_is_none_counts_as_nothing(run: Path, earlier: Path, note: bytes) -> None:
    (earlier / MADE).write_bytes(note)
    assert "report.html" in names(report(run, earlier))


def test_a_name_that_no_file_can_have_is_not_there(run: Path, earlier: Path) -> None:
    tree = json.loads((earlier / MADE).read_bytes())
    tree["formats"]["markdown"] = ["x" * 5000, "\0"]
    (earlier / MADE).write_text(json.dumps(tree))
    assert "report.html" in names(report(run, earlier))


def test_a_process_seldom_looks_for_garbage() -> None:
    before = gc.get_threshold()
    signals = signal.getsignal(signal.SIGINT)
    try:
        worker._begin(pickle.dumps((processes._begin, (None, {}))))
        assert gc.get_threshold() == GC_THRESHOLD
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()
        signal.signal(signal.SIGINT, signals)
