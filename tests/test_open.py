"""`campaign.open`: what an archive holds, as pandas and xarray objects."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import campaign
from campaign.api.estimates import findings_table
from campaign.archive.reading.open_run import open_run
from campaign.errors import UsageError
from campaign.estimate import Estimate, Systematic
from campaign.reason import Cause
from campaign.recording import Channel, Ending, Outcome, Recording
from campaign.result import NOT_FOUND, Finding, Result
from tests.archives import archived, plan_of, simulated_run

PAGE = (Path(__file__).parents[1] / "docs" / "reading-archives.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where `results` holds one simulated run."""
    folder = tmp_path_factory.mktemp("open")
    simulated_run(folder)
    return folder


@pytest.fixture
def run(folder: Path) -> campaign.api.RunView:
    return campaign.open(results=folder / "results")


def test_a_run_is_found_by_path_name_and_beginning(folder):
    (path,) = (folder / "results").glob("*.nxs")
    results = folder / "results"
    for name in (path, str(path), path.stem, path.stem[:12]):
        assert campaign.open(name, results).path == path
    with pytest.raises(UsageError, match="there is no run 'nonsense'"):
        campaign.open("nonsense", results)


def test_tests_and_trials_are_tables(run):
    assert run.tests.loc["stabilization", ["planned", "executed", "completed"]].tolist() == [2] * 3
    trials = run.trials
    assert list(trials.index) == [1, 2]
    assert list(trials["compensation"]) == ["none", "static"]
    assert list(trials["outcome"]) == ["completed"] * 2
    assert trials["started"].iloc[0] == pd.Timestamp("2026-11-21T09:37:00Z")
    assert list(trials["seed"]) == [view.trial.seed for view in run]


def test_a_trial_goes_by_its_number_and_by_its_name(run):
    for name in ("trial-00002", "trial_2", "2"):
        assert run.trial(name).number == 2
    with pytest.raises(UsageError, match="trial 7 is not among the 2 planned"):
        run.trial("trial-00007")
    with pytest.raises(UsageError, match="'second' is neither the number nor the name"):
        run.trial("second")


def test_a_frame_has_every_sample_of_the_archive(run):
    whole = open_run(run.path).trials[1].recording()
    frame = run.trial(2).frame()
    assert list(frame.columns) == list(whole.channels)
    assert frame.index.name == "time"
    np.testing.assert_array_equal(frame.index, whole.time)
    for name, channel in whole.channels.items():
        np.testing.assert_array_equal(frame[name], channel.samples)
        assert frame.attrs["units"][name] == channel.unit


def test_the_window_is_that_of_the_analysis_or_a_given_one(run):
    trial = run.trial(1)
    first, last = trial.trial.task.window
    window = trial.window().frame()
    assert first == 0.5
    assert window.index[0] == pytest.approx(first, abs=1e-9)
    assert last - 2e-3 < window.index[-1] < last
    assert trial.window(0.1, 0.2).frame().shape == (100, window.shape[1])


def test_a_dataset_has_units_and_the_time_as_coordinate(run):
    pytest.importorskip("xarray")
    dataset, frame = run.trial(1).dataset(), run.trial(1).frame()
    assert dataset["gyro_rate"].dims == ("time",)
    assert dataset["gyro_rate"].attrs["units"] == "rad/s"
    assert dataset["time"].attrs == {"units": "s", "long_name": "Time"}
    np.testing.assert_array_equal(dataset["gyro_rate"], frame["gyro_rate"])
    near = dataset["gyro_rate"].sel(time=1.0, method="nearest")
    assert float(near) == frame["gyro_rate"].iloc[1000]


def test_without_xarray_it_says_what_to_install(run, monkeypatch):
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(UsageError, match=r"campaign\[xarray\]"):
        run.trial(1).dataset()


def test_a_test_gives_the_tables_of_its_analysis(run):
    table = run.test("stabilization").tables["stabilization-error"].set_index("compensation")
    window = run.trial(1).window().recording()
    error = window["pointing_error"]
    assert table.loc["none", "error"] == pytest.approx(np.std(error), rel=1e-2)
    assert [view.number for view in run.test("stabilization")] == [1, 2]


def test_nothing_is_read_before_it_is_asked_for(run, monkeypatch):
    def refuse(*arguments: object) -> None:
        raise AssertionError("samples were read")

    monkeypatch.setattr("campaign.archive.reading.series.Series.read", refuse)
    assert [view.number for view in run] == [1, 2]
    assert len(run.trials) == len(run) == 2
    assert "2 of 2 trials" in repr(run)
    assert "compensation=static" in repr(run.trial(2).window())
    with pytest.raises(AssertionError, match="samples were read"):
        run.trial(2).frame()


def test_what_is_not_there_is_said(run):
    with pytest.raises(UsageError, match="trial 3 is not among the 2 planned"):
        run.trial(3)
    with pytest.raises(UsageError, match="did you mean 'stabilization'"):
        run.test("stabilisation")


def test_a_trial_without_samples_and_one_that_diverged(tmp_path):
    first, second = plan_of(tmp_path).trials
    samples = np.array([1.0, np.inf, np.nan])
    channel = Channel("gyro_rate", "rad/s", "Rate", "deg/s", samples)
    recording = Recording(np.arange(3.0), {"gyro_rate": channel}, (), Ending(Outcome.DIVERGED, "!"))
    run = campaign.open(archived(tmp_path, [(first, None), (second, recording)]))
    assert run.trial(1).frame().shape == (0, 0)
    assert list(run.trials["reason"]) == ["no power at 5 °C", "!"]
    np.testing.assert_array_equal(run.trial(2).frame()["gyro_rate"], samples)


def test_importing_the_package_imports_nothing_heavy():
    code = (
        "import sys, campaign; print([m for m in ('numpy', 'pandas', 'h5py') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("block", re.findall(r"^```python\n(.*?)^```$", PAGE, re.M | re.S))
def test_the_examples_of_the_page_run(block, folder, monkeypatch):
    for module in ("xarray", "h5netcdf", "nexusformat"):
        if module in block:
            pytest.importorskip(module)
    monkeypatch.chdir(folder)
    exec(compile(block, "reading-archives.md", "exec"), {})


def test_plain_xarray_finds_the_time_coordinate(run):
    xarray = pytest.importorskip("xarray")
    pytest.importorskip("h5netcdf")
    expected = run.trial(1).frame()["gyro_rate"]
    with xarray.open_dataset(run.path, engine="h5netcdf", group="/trial_00001/data") as dataset:
        assert "time" in dataset.coords
        assert dataset["gyro_rate"].dims == ("time",)
        np.testing.assert_array_equal(dataset["gyro_rate"], expected)


@pytest.mark.skipif(shutil.which("h5dump") is None, reason="h5dump is not installed")
def test_h5dump_reads_the_samples(run):
    command = ["h5dump", "-m", "%.17g", "-y", "-w", "1", "-d", "/trial_00001/data/gyro_rate"]
    done = subprocess.run([*command, run.path], capture_output=True, text=True, check=True)
    listed = done.stdout.split("DATA {")[1].split("}")[0].replace(",", " ").split()
    np.testing.assert_array_equal(np.array(listed, float), run.trial(1).frame()["gyro_rate"])


CONDITIONS = {"compensation": "lugre", "frequency": 0.24, "unit": "given", "method": 3}
BOTH_PARTS = Estimate(
    "gain",
    2.0,
    "dB",
    1.5,
    2.75,
    0.95,
    "mean of 4 repeats",
    standard_error=0.25,
    freedom=3.0,
    systematic=(Systematic("inertia", 0.1), Systematic("alignment")),
)


SINGLE = Cause("single trial", "a single trial")


def test_findings_are_one_table_with_intervals_reasons_and_conditions():
    alone = Estimate.without_interval("lag", 0.5, "s", SINGLE(count=1))
    findings = [
        Finding.of(BOTH_PARTS, CONDITIONS),
        Finding.of(alone, {"frequency": 2.0}),
        Finding("of a plug-in", 7.0, "N m", {}),
        Finding("lost", float("nan"), "N m", {}),
    ]
    table = findings_table(findings)
    assert list(table["quantity"]) == ["gain", "lag", "of a plug-in", "lost"]
    first = table.iloc[0]
    assert (first["value"], first["scatter_low"], first["scatter_high"]) == (2.0, 1.5, 2.75)
    assert (first["standard_error"], first["freedom"]) == (0.25, 3.0)
    assert (first["origin"], first["kind"], first["unit"]) == ("measured", "number", "dB")
    assert first["systematic"] == {"inertia": 0.1, "alignment": None}
    wide = 1.959964 * 0.1
    assert first["low"] == pytest.approx(2.0 - np.hypot(0.5, wide))
    assert first["high"] == pytest.approx(2.0 + np.hypot(0.75, wide))
    assert (first["compensation"], first["frequency"]) == ("lugre", 0.24)
    assert (first["condition.unit"], first["condition.method"]) == ("given", 3)
    assert list(table["reason"]) == [
        "",
        "a single trial",
        "the analysis gives no interval",
        "the analysis did not find it",
    ]
    assert list(table["reason_code"]) == ["", "single trial", "no interval given", NOT_FOUND.code]
    assert list(table["reason_values"]) == [{}, {"count": 1}, {}, {}]
    assert np.isnan(table["low"].iloc[1:].to_numpy()).all()
    assert table["origin"].iloc[3] == "not determined"
    assert (table.dtypes[["value", "low", "high", "scatter_high"]] == "float64").all()


def test_no_findings_are_an_empty_table_with_the_same_columns():
    table = findings_table([])
    assert len(table) == 0
    assert list(table.columns)[:3] == ["quantity", "value", "unit"]


def test_a_test_has_its_findings_and_metrics_and_goes_by_its_name(run):
    test = run["stabilization"]
    assert test.name == run.test("stabilization").name
    result = test.result
    assert list(test.findings["value"]) == [finding.value for finding in result.findings]
    assert test.findings.attrs["damaged"] == []
    assert len(test.metrics) == 0  # of a run that was not executed by the runner
    assert {"trial", "quantity", "measured_by"} <= set(test.metrics.columns)
    with pytest.raises(UsageError, match="did you mean 'stabilization'"):
        run["stabilisation"]


def test_in_a_notebook_each_shows_itself_and_hostile_text_is_only_text(run):
    html = run._repr_html_()
    assert html.startswith("<p><code>&lt;run ")
    assert "<table" in html
    assert "stabilization" in html
    trial = run.trial(1)._repr_html_()
    assert trial.startswith("<p><code>&lt;trial-00001")
    results = run.results
    for quantity in results.key_numbers["quantity"]:
        assert f"<td>{quantity}</td>" in results._repr_html_()
    hostile = "<script>alert(1)</script>"
    (test,) = results.found.tests
    named = replace(test.result.findings[0], quantity=hostile)
    bad = replace(test, name=hostile, problem=hostile, result=Result(key_numbers=(named,)))
    found = replace(results.found, tests=(bad,))
    assert "<script" not in replace(results, found=found)._repr_html_()
