"""`campaign.open(...).results`: what analysis found, read where it may be, or analysed by now."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
import subprocess
import warnings
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import campaign
from campaign.api.results import results_of
from campaign.archive.layout.names import results_path
from campaign.archive.layout.results_text import from_text, to_text
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.results_file import read_results
from campaign.cli.report import report_run
from campaign.errors import ArchiveError, ExitCode, UsageError
from campaign.estimate import Estimate
from campaign.result import Finding, Result
from tests.archives import PROTOCOL, simulated_run, write_results
from tests.drawings import keep_drawings
from tests.system.user import completed

PAGE = (Path(__file__).parents[1] / "docs" / "results-as-data.md").read_text(encoding="utf-8")
MORE = (
    PROTOCOL.replace("[[test]]", 'published = "thesis"\n\n[[test]]', 1)
    .replace('kind = "stabilization"', 'kind = "stabilization"\nreproduces = ["5.2", "5.8"]')
    .replace('"2 Hz"', '"0.24 Hz"')
)


@pytest.fixture(scope="module", autouse=True)
def drawn_once() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        keep_drawings(patch)
        yield


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A simulated run of which a report was made."""
    run = simulated_run(tmp_path_factory.mktemp("results"), MORE)
    return report(run)


def report(
    run: Path, output: Path | None = None, code: ExitCode = ExitCode.DONE, **options: bool
) -> Path:
    """Make a report of it, as the command does; the run."""
    assert report_run(str(run), run.parent, output, None, **options)[1] == code
    return run


def command(*arguments: str) -> subprocess.CompletedProcess[str]:
    return completed(Path.cwd(), *arguments)


@pytest.fixture
def run(reported: Path, tmp_path: Path) -> Path:
    """A copy of it."""
    for path in (reported, results_path(reported)):
        shutil.copy(path, tmp_path)
    return tmp_path / reported.name


def alone(run: Path) -> Path:
    """The run without its results."""
    results_path(run).unlink()
    return run


def everything(found: campaign.api.Results) -> str:
    """All of it, arrays included; but for the figure that a report chose to open with."""
    arrays: dict[str, np.ndarray] = {}

    def place(array: np.ndarray) -> str:
        values = np.asarray(array, dtype=float)
        name = hashlib.sha256(values.tobytes()).hexdigest()
        arrays[name] = values
        return name

    text = to_text(replace(found.found, telling=None), place)
    return to_text(from_text(text, arrays.__getitem__), place)  # 5 is 5.0 where a number is meant


@pytest.mark.slow
def test_what_is_read_is_what_analysis_finds(run):
    read = campaign.open(run).results
    computed = campaign.open(alone(run)).results
    assert read.origin == f"read from {results_path(run)}"
    assert "analysed by campaign" in computed.origin
    assert "there is no file of results" in computed.origin
    assert everything(read) == everything(computed)


def test_numbers_are_those_of_the_analysis_of_each_test(run):
    opened = campaign.open(run)
    found, test = opened.results, opened["stabilization"]
    both = found.findings
    assert list(both["test"].unique()) == ["stabilization"]
    pd.testing.assert_frame_equal(both.drop(columns="test"), test.findings)
    assert list(found.tables) == [f"stabilization/{key}" for key in test.tables]
    for key, table in test.tables.items():
        pd.testing.assert_frame_equal(found.tables[f"stabilization/{key}"], table)
        assert found.tables[f"stabilization/{key}"].attrs["units"] == table.attrs["units"]
    for figure in test.result.figures:
        again = found.figures[f"stabilization/{figure.key}"]
        assert again.caption == figure.caption
        for panel, same in zip(again.panels, figure.panels, strict=True):
            for curve, other in zip(panel.curves, same.curves, strict=True):
                np.testing.assert_array_equal(curve.x, other.x)
                np.testing.assert_array_equal(curve.y, other.y)


def test_numbers_in_the_file_are_those_of_the_findings(run):
    """For whoever opens the file without this program."""
    findings = campaign.open(run)["stabilization"].findings
    with h5py.File(results_path(run)) as file:
        kept = file["results/stabilization/findings"]
        for name in ("value", "low", "high", "standard_error"):
            np.testing.assert_array_equal(kept[name], findings[name].astype(float))
        assert list(kept["quantity"].asstr()) == list(findings["quantity"])
        assert list(kept["units"].asstr()) == list(findings["unit"])
        assert file["results/run/sha256"][()].decode() == campaign.open(run).archive.root
        assert file["results/run/file_name"][()].decode() == run.name


def test_the_scoreboard_is_a_table(run):
    board = campaign.open(run).results.published
    assert {"5.2", "5.8"} <= set(board["table"])
    tried = board[board["reproduced"].notna()]
    again = 100 * (tried["reproduced"] - tried["published"]) / tried["published"]
    told = tried["deviation"].notna()
    assert told.any()
    np.testing.assert_allclose(tried["deviation"][told], again[told], atol=1e-9)


@pytest.mark.slow
def test_the_same_run_gives_the_same_bytes_wherever_and_whenever(run, tmp_path, monkeypatch):
    before = results_path(run).read_bytes()
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    shutil.copy(run, elsewhere)
    for name, value in (("TZ", "Asia/Tokyo"), ("PYTHONHASHSEED", "7"), ("LC_ALL", "C")):
        monkeypatch.setenv(name, value)  # and so in a Python of its own
    done = command("report", str(elsewhere / run.name))
    assert done.returncode == ExitCode.DONE, done.stderr
    assert results_path(elsewhere / run.name).read_bytes() == before


@pytest.mark.slow
def test_a_report_of_a_run_writes_beside_the_run_wherever_the_page_goes(run, tmp_path):
    sealed = run.read_bytes()
    page = tmp_path / "page"
    report(alone(run), page)
    assert results_path(run).is_file()
    assert not list(page.glob("*.nxs"))
    assert run.read_bytes() == sealed


@pytest.mark.slow
def test_something_else_in_its_place_is_left_alone_and_said(run, capsys):
    path = results_path(run)
    path.write_text("mine")
    report(run)
    assert path.read_text() == "mine"
    assert (run.with_name(f"{run.stem}-report") / "report.html").is_file()
    said = " ".join(capsys.readouterr().err.split())
    assert said.count("no results file: ") == 1
    assert f"{path} is there already, holds no results of campaign and stays" in said
    assert f"; {path}" not in said  # among what was written


@pytest.mark.slow
def test_a_folder_that_cannot_be_written_costs_the_results_and_not_the_page(
    run, tmp_path, monkeypatch, capsys
):
    def full(part: Path, final: Path) -> None:
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr("campaign.archive.writing.results_file.publish", full)
    report(run, tmp_path / "page")
    assert (tmp_path / "page" / "report.html").is_file()
    told = " ".join(capsys.readouterr().err.split())
    assert "results cannot be written: Read-only file system" in told


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"root": "ef" * 32}, "results of another run"),
        ({"version": "0.0.1"}, "was made by other code: campaign 0.0.1"),
        ({"sources": "ef" * 32}, "was made by other code"),
        ({"measured_anew": True}, "measured anew"),
        ({"damaged": ("trial 1",)}, "was made when the run was damaged: trial 1"),
    ],
)
def test_a_file_of_something_else_is_not_used_and_one_line_says_why(run, change, why):
    computed = everything(campaign.open(run).results)
    kept = read_results(results_path(run), campaign.open(run).archive.root)
    write_results(run, replace(kept, tests=(), **change))
    with pytest.warns(campaign.ArchiveWarning, match=why) as caught:
        found = campaign.open(run).results
    assert len(caught) == 1
    assert "\n" not in str(caught[0].message)
    assert caught[0].filename == __file__
    assert why in found.origin
    assert everything(found) == computed
    opened = campaign.open(run, strict=True)
    if "root" in change:
        with pytest.raises(ArchiveError, match=why):
            _ = opened.results
    else:
        with pytest.warns(campaign.ArchiveWarning, match=why):
            assert everything(opened.results) == computed


def test_a_damaged_file_is_not_used(run):
    path = results_path(run)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    with pytest.warns(campaign.ArchiveWarning, match=r"-results\.nxs: .*the run is analysed"):
        found = campaign.open(run).results
    assert len(found.findings) > 0
    with pytest.raises(ArchiveError, match=r"-results\.nxs"):
        _ = campaign.open(run, strict=True).results


def test_a_file_of_another_layout_is_not_used_and_is_no_damage(run, monkeypatch):
    opened = campaign.open(run)
    monkeypatch.setattr("campaign.archive.writing.results_file.FORMAT", 1)
    write_results(run, opened.results.found)
    with pytest.warns(campaign.ArchiveWarning, match="has results of layout 1"):
        assert len(campaign.open(run, strict=True).results.key_numbers) > 0


@pytest.mark.slow
def test_results_measured_anew_are_told_from_others(run):
    report(run, measure_anew=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "read from" in campaign.open(run, measure_anew=True).results.origin
    with pytest.warns(campaign.ArchiveWarning, match="measured anew"):
        _ = campaign.open(run).results


def test_a_damaged_trial_is_left_out_and_told_of(run):
    alone(run)
    with h5py.File(run) as file:
        place = file["trial_00002/data/pointing_error"].id.get_chunk_info(0).byte_offset
    content = bytearray(run.read_bytes())
    content[place + 20] ^= 1
    run.write_bytes(content)
    with pytest.warns(campaign.ArchiveWarning, match="trial"):
        found = campaign.open(run).results
    assert any("trial-00002" in damage for damage in found.found.damaged)
    assert found.findings.attrs["damaged"] == list(found.found.damaged)
    with pytest.raises(ArchiveError):
        _ = campaign.open(run, strict=True).results


@pytest.mark.slow
def test_a_report_of_a_damaged_run_keeps_what_was_found_when_it_was_whole(run, tmp_path, capsys):
    before = results_path(run).read_bytes()
    with h5py.File(run) as file:
        place = file["trial_00002/data/pointing_error"].id.get_chunk_info(0).byte_offset
    content = bytearray(run.read_bytes())
    content[place + 20] ^= 1
    run.write_bytes(content)
    report(run, tmp_path / "report", ExitCode.ARCHIVE)
    assert "not changed: it was made" in " ".join(capsys.readouterr().err.split())
    assert results_path(run).read_bytes() == before
    report(alone(run), tmp_path / "report", ExitCode.ARCHIVE)
    assert "not changed: it was made" not in " ".join(capsys.readouterr().err.split())
    assert read_results(results_path(run), open_run(run).identity).damaged


def test_damaged_results_are_told_by_verify(run):
    path = results_path(run)
    path.write_bytes(path.read_bytes().replace(b"Results: ", b"Remarks: "))
    verified = command("verify", str(path))
    assert verified.returncode == ExitCode.ARCHIVE
    assert "does not match its own hash" in verified.stdout


def test_an_analysis_that_failed_is_a_problem_and_costs_no_other(run, monkeypatch):
    from campaign.api import analysis

    def broken(*_: object) -> Result:
        raise ValueError("no recording is of use")

    monkeypatch.setattr(analysis, "result_of", broken)
    found = campaign.open(alone(run)).results
    assert "no recording is of use" in found.problems["stabilization"]
    assert found.findings.empty


def test_key_numbers_are_findings_and_conditions_may_be_called_anything(run):
    found = Estimate("error", 5e-4, "rad", 4e-4, 6e-4, 0.95)
    findings = (Finding.of(found, {"test": "mine", "value": 3.0}),)
    opened = campaign.open(run)
    from campaign.api.analysis import analyse_run
    from campaign.experiments import experiments
    from campaign.published.scoreboard import Scoreboard

    (test,) = analyse_run(opened.archive, experiments())
    made = replace(test, result=Result(findings=findings, key_numbers=findings))
    write_results(run, results_of(opened.archive, [made], Scoreboard()))
    results = opened.results
    assert results.key_numbers.equals(results.findings)
    (row,) = results.findings.to_dict("records")
    assert (row["test"], row["condition.test"], row["condition.value"]) == (
        "stabilization",
        "mine",
        3.0,
    )
    assert results.published.empty


@pytest.mark.slow
def test_a_run_in_progress_has_results_of_what_there_is(tmp_path):
    from campaign.archive.writing.writer import RunWriter
    from campaign.backends.sim import SimBackend, SimOptions
    from campaign.protocol import as_tree
    from tests.archives import _header, plan_of

    plan = plan_of(tmp_path)
    results = tmp_path / "results"
    writer = RunWriter.create(results, _header(as_tree(plan)["tests"], results), plan.trials)
    recorder = writer.begin(plan.trials[0])
    ending = SimBackend(SimOptions()).execute(plan.trials[0], recorder, lambda: False)
    recorder.finish(ending, "2026-11-21T09:37:00Z", "2026-11-21T09:37:02Z")
    report(writer.folder)
    assert "read from" in campaign.open(writer.folder).results.origin
    recorder = writer.begin(plan.trials[1])
    ending = SimBackend(SimOptions()).execute(plan.trials[1], recorder, lambda: False)
    recorder.finish(ending, "2026-11-21T09:37:00Z", "2026-11-21T09:37:02Z")
    with pytest.warns(campaign.ArchiveWarning, match="before it was gone on with"):
        _ = campaign.open(writer.folder).results


@pytest.mark.slow
@pytest.mark.parametrize("block", re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S))
def test_the_examples_of_the_page_run(block, run, monkeypatch):
    for module in ("xarray", "h5netcdf"):
        if module in block:
            pytest.importorskip(module)
    results = run.parent / "results"
    results.mkdir()
    for path in (run, results_path(run)):
        path.rename(results / path.name)
    report(results / run.name)
    monkeypatch.chdir(run.parent)
    exec(compile(block, "results-as-data.md", "exec"), {})


def test_silx_opens_on_what_nexus_says(run):
    pytest.importorskip("silx", reason="silx is not installed")
    import silx.io
    from silx.io.nxdata import get_default

    with silx.io.open(str(results_path(run))) as file:
        shown = get_default(file)
        assert shown.is_valid
        assert shown.group.name == "/results/stabilization/figure_position_error_1"
        assert [axis.attrs["units"] for axis in shown.axes] == ["s"]


def test_silx_plots_every_trial_figure_and_table(run):
    pytest.importorskip("silx", reason="silx is not installed")
    import silx.io
    from silx.io.nxdata import NXdata

    for path in (run, results_path(run)):
        with silx.io.open(str(path)) as file:
            groups: list[object] = []
            file.visititems(lambda _, each, all_of=groups: all_of.append(each))
            plots = [NXdata(g) for g in groups if g.attrs.get("NX_class") == "NXdata"]
            assert plots
            assert [issue for each in plots for issue in each.issues] == []
            assert all(each.is_curve for each in plots)


def test_results_are_no_run_to_any_command(run):
    listed = command("list", "--results", str(run.parent))
    assert f"{run.stem}-results" not in listed.stdout + listed.stderr
    every = sorted(map(str, run.parent.glob("*.nxs")))
    assert len(every) == 2
    verified = command("verify", *every)  # as a shell makes it from *.nxs
    assert verified.returncode == ExitCode.DONE, verified.stdout
    assert f"{results_path(run)}: sound (results of a run, not a run)" in verified.stdout
    assert json.loads(command("verify", "--json", *every).stdout)[0]["sound"]
    with pytest.raises(ArchiveError, match="holds no run but what was found in one"):
        campaign.open(results_path(run))
    with pytest.raises(UsageError):
        campaign.open(f"{run.stem}-res", run.parent)
