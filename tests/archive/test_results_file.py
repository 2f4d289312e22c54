"""Results beside a run: what is read is what was written, of this run; or a clear refusal."""

from __future__ import annotations

import hashlib
import json
import math
import os
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import xarray
from h5py import h5o
from nexusformat.nexus import nxload

from campaign.archive.layout.files import sha256_of
from campaign.archive.layout.names import results_path
from campaign.archive.layout.results import ENTRY, HASH, ResultsOfTest, RunResults
from campaign.archive.layout.results_text import from_text, to_text
from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.results_file import OtherLayoutError, read_results
from campaign.archive.reading.run_list import find_run, list_runs
from campaign.cli.keep_results import _found_when_whole
from campaign.cli.verify import _of_results
from campaign.errors import ArchiveError, UsageError
from campaign.estimate import Estimate, Origin, Systematic
from campaign.reason import Cause
from campaign.result import Axis, Column, Curve, Figure, Finding, Mark, Panel, Result, Table
from tests.archive.recorded_calls import recorded
from tests.archive.test_nexus import nxcheck
from tests.archives import write_results

ROOT = "ab" * 32
TIMES = ("atime", "mtime", "ctime", "btime")
NAME = "2026-11-21T09-36-58-tiny"
ALONE = Cause("single trial", "one of {count} trial")
RATE, TORQUE = Axis("Rate", "rad/s", "deg/s"), Axis("Friction torque", "N m")


def estimate(value: float, half: float | None = 0.1, **more: object) -> Estimate:
    ends = {} if half is None else {"low": value - half, "high": value + half, "level": 0.95}
    return Estimate("coulomb_torque", value, "N m", **ends, **more)


def map_figure() -> Figure:
    down = np.array([-3.0, -2.0, -1.0])
    up = np.array([1.0, 2.0, 4.0])
    fine = np.linspace(-3, 4, 50)
    panel = Panel(
        RATE,
        TORQUE,
        [
            Curve(fine, 2 * fine, "fit", "fit"),
            Curve.of(down, [estimate(v) for v in (-7.0, -6.0, -5.0)], "down", "negative"),
            Curve.of(up, [estimate(v) for v in (5.0, 6.0, 8.0)], "up", "positive"),
        ],
        "Both",
        [Mark("vs", x=0.02, series="fit")],
    )
    edge = Curve(up, up + 1, "", "fit", "band", y_low=up - 1, conditions={"direction": "up"})
    return Figure("the-map", "Friction map", "It falls.", "A map.", (panel, replace_curves(edge)))


def replace_curves(*curves: Curve) -> Panel:
    return Panel(Axis("Rate", "rad/s", "deg/s", "log", (1e-3, 1.0)), TORQUE, curves)


def table() -> Table:
    columns = (
        Column("direction", "Direction"),
        Column("speed", "Speed", "rad/s", "deg/s", exact=True),
        Column("torque", "Coulomb torque", "N m"),
        Column("mixed", "Mixed"),
        Column("row", "Row"),
    )
    shares = (Systematic("gain", 0.1), Systematic("x"))
    alone = estimate(6.0, None, reason=ALONE(count=1), systematic=shares)
    not_determined = Estimate("c", math.nan, "N m", origin=Origin.NOT_DETERMINED)
    rows = (
        {"direction": "up", "speed": 1.0, "torque": estimate(5.0), "mixed": True, "row": 1},
        {"direction": "down ↘", "speed": 2, "torque": alone, "mixed": "x", "row": None},
        {"speed": math.inf, "torque": not_determined, "mixed": -0.1},
    )
    return Table("parameters", "Parameters", columns, rows, ("5.2",), "A note.")


def results(**fields: object) -> RunResults:
    found = estimate(5.0, standard_error=0.05, freedom=7.0, method="least squares")
    findings = (
        Finding.of(found, {"direction": "up", "speed": 1.0, "count": 3, "on": True, "no": None}),
        Finding("static_torque", math.nan, "N m", {"direction": "down"}),
    )
    result = Result((table(),), (map_figure(),), findings, ("Beware.",), findings[:1], "the-map")
    tests = (
        ResultsOfTest("map", "velocity_map", "A map", result),
        ResultsOfTest("broken", "breakaway", "Broken", Result(), problem="it failed"),
    )
    found = RunResults(
        NAME, f"{NAME}.nxs", ROOT, "2026-11-21T09:40:00Z", "0.1.0", "cd" * 32, tests,
        damaged=("trial 3",), published=table(), telling=("map", "the-map"),
    )  # fmt: skip
    return replace(found, **fields)


def told(found: RunResults) -> str:
    """All of it as one text, arrays included: equal for equal results."""
    return to_text(found, lambda a: f"{a.dtype}{a.shape}{a.tobytes().hex()}")


@pytest.fixture
def run(tmp_path: Path) -> Path:
    return tmp_path / f"{NAME}.nxs"


def refused(path: Path, root: str = ROOT) -> str:
    with pytest.raises(ArchiveError) as caught:
        read_results(path, root)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def rehash(path: Path) -> None:
    """What somebody does who changes a file on purpose."""
    with h5py.File(path) as file:
        offset = file[f"{ENTRY}/{HASH}"].id.get_offset()
    digest = sha256_of(path, (offset, 64))
    with path.open("r+b") as raw:
        raw.seek(offset)
        raw.write(digest.encode())


# What was written is read.


def test_what_is_read_is_what_was_written_to_the_last_bit(run):
    found = results()
    again = read_results(write_results(run, found), ROOT)
    assert told(again) == told(found)
    assert list(again.tests[0].result.findings[0].conditions) == [
        "direction", "speed", "count", "on", "no",
    ]  # fmt: skip
    assert again.tests[0].result.key_numbers == again.tests[0].result.findings[:1]
    curve = again.tests[0].result.figures[0].panels[0].curves[1]
    np.testing.assert_array_equal(curve.x, [-3.0, -2.0, -1.0])  # of those that share an x


def test_sound_results_of_another_layout_are_told_from_damaged_ones(run, monkeypatch):
    """Of a damaged run they may be all that is left: nothing takes their place."""
    monkeypatch.setattr("campaign.archive.writing.results_file.FORMAT", 1)
    path = write_results(run, results())
    with pytest.raises(OtherLayoutError, match="layout 1; this program reads 2"):
        read_results(path, ROOT)
    assert _of_results(path).problems == ()
    assert _found_when_whole(SimpleNamespace(path=run, root=ROOT))  # type: ignore[arg-type]
    path.write_bytes(path.read_bytes()[:-1])
    assert not _found_when_whole(SimpleNamespace(path=run, root=ROOT))  # type: ignore[arg-type]
    assert _of_results(path).problems


def test_arrays_that_no_plot_can_show_are_kept(run):
    """A plug-in's: lists, and a y of another length."""
    odd = Curve([1, 2, 3], [1, 2, 3], "a", "a")  # type: ignore[arg-type]
    short = Curve(np.arange(3.0), np.arange(2.0), "b", "b")
    figure = Figure("odd", "Odd", "", "", (replace_curves(odd, short),))
    tests = (ResultsOfTest("t", "k", "T", Result(figures=(figure, figure))),)
    (again, *_) = read_results(write_results(run, results(tests=tests)), ROOT).tests
    curves = again.result.figures[1].panels[0].curves
    assert [list(each.y) for each in curves] == [[1.0, 2.0, 3.0], [0.0, 1.0]]


@pytest.mark.slow
def test_any_names_make_a_file(run):
    names = ("../up", "a/b", "", "ü b", "7", "published", "record", "run", "arrays", "title")
    result = Result((table(), table()), (map_figure(), map_figure()))
    tests = tuple(ResultsOfTest(name, "k", name, result) for name in (*names, "7", "run"))
    found = results(tests=tests, telling=("7", "the-map"))
    assert told(read_results(write_results(run, found), ROOT)) == told(found)
    assert nxcheck(results_path(run))[:2] == (0, 0)


def test_no_results_at_all_are_a_file_too(run):
    found = results(tests=(), published=None, telling=None)
    assert told(read_results(write_results(run, found), ROOT)) == told(found)


def test_a_finding_has_its_reason_as_text_and_as_data(run):
    alone = estimate(5.0, None, reason=ALONE(count=1))
    findings = (Finding.of(alone, {}), Finding.of(estimate(6.0), {}))
    tests = (ResultsOfTest("map", "k", "T", Result(findings=findings)),)
    path = write_results(run, results(tests=tests, telling=None))
    with h5py.File(path) as file:
        group = file[f"{ENTRY}/map/findings"]
        assert list(group["reason"].asstr()) == ["one of 1 trial", ""]
        assert list(group["reason_code"].asstr()) == ["single trial", ""]
        assert list(group["reason_values"].asstr()) == ['{"count":1}', "{}"]
    again = read_results(path, ROOT).tests[0].result.findings[0].known
    assert again.reason == ALONE(count=1)


# The same results, the same bytes; and no way out of the file.


def test_the_same_results_give_the_same_bytes_and_no_object_knows_when(tmp_path):
    paths = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        paths.append(write_results(tmp_path / name / f"{NAME}.nxs", results()))
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with h5py.File(paths[0]) as file:
        items = [file["/"]]
        file.visititems(lambda _, item: items.append(item))
        told = {(i.name, t): getattr(h5o.get_info(i.id), t) for i in items for t in TIMES}
        assert set(told.values()) == {0}, told
        assert file.attrs["file_time"] == file[f"{ENTRY}/map/date"][()].decode()


def test_no_link_leads_anywhere(run):
    with h5py.File(write_results(run, results())) as file:
        groups = [file]
        file.visititems(lambda _, i: groups.append(i) if isinstance(i, h5py.Group) else None)
        kinds = {group.id.links.get_info(name).type for group in groups for name in group.id}
        assert kinds == {h5py.h5l.TYPE_HARD}
        external = [
            name
            for group in groups
            for name, item in group.items()
            if isinstance(item, h5py.Dataset) and (item.is_virtual or item.external)
        ]
        assert external == []


def test_the_run_itself_is_not_touched_and_is_told_apart(sealed):
    before = hashlib.sha256(sealed.read_bytes()).hexdigest()
    path = write_results(sealed, results())
    assert hashlib.sha256(sealed.read_bytes()).hexdigest() == before
    assert [each.path for each in list_runs(sealed.parent)] == [sealed]
    assert find_run(sealed.parent) == sealed
    assert find_run(sealed.parent, "2026") == sealed  # what begins both means the run
    with pytest.raises(ArchiveError, match="holds no run but what was found in one") as refused:
        open_run(path)
    assert str(refused.value).endswith(f"; name the run, {sealed}")


def test_results_are_no_run_when_their_run_is_gone_and_a_run_may_be_called_so(sealed):
    path = write_results(sealed, results())
    called_so = sealed.read_bytes()
    sealed.rename(sealed.parent / "moved")
    assert list_runs(sealed.parent) == []
    with pytest.raises(UsageError, match="there are no runs"):
        find_run(sealed.parent)
    path.write_bytes(called_so)
    (sealed.parent / "moved").rename(sealed)
    assert {each.path for each in list_runs(sealed.parent)} == {path, sealed}
    path.write_bytes(b"damaged")
    assert [each.path for each in list_runs(sealed.parent)] == [sealed]


# Whole or not at all.


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="names are had from /proc")
def test_content_then_name_then_folder(run):
    write_results(run, results())
    with recorded() as calls:
        path = write_results(run, results(damaged=()))
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    calls.in_order(("fsync", part), ("rename", path), ("fsync", path.parent))
    renamed = calls.index("rename", path)
    assert not [c for c in calls.listed[renamed:] if c.name == "write"]


def test_what_was_there_stays_when_the_disk_is_full(run, monkeypatch):
    path = write_results(run, results())
    before = path.read_bytes()

    def full(part: Path, final: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("campaign.archive.writing.results_file.publish", full)
    with pytest.raises(ArchiveError, match="cannot be written: No space left on device"):
        write_results(run, results(damaged=()))
    assert path.read_bytes() == before
    assert list(path.parent.iterdir()) == [path]


def test_only_results_of_ours_are_replaced(run, sealed):
    path = results_path(run)
    for content in (b"mine", b"", sealed.read_bytes()):
        path.write_bytes(content)
        with pytest.raises(UsageError, match="holds no results of campaign and stays"):
            write_results(run, results())
        assert path.read_bytes() == content
    path.unlink()
    path.mkdir()
    with pytest.raises(UsageError, match="once it is moved away"):
        write_results(run, results())


# What is not right is refused in one line.


def test_results_of_another_run_are_refused(run):
    assert "results of another run" in refused(write_results(run, results()), "ef" * 32)


def test_a_file_that_was_cut_or_changed_is_refused(run):
    path = write_results(run, results())
    whole = path.read_bytes()
    rng = np.random.default_rng(13)
    for place in rng.integers(0, len(whole), 60):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0x40]) + whole[place + 1 :])
        refused(path)
    for length in (0, 100, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:length])
        refused(path)
    path.unlink()
    refused(path)


def test_what_is_no_file_of_results_is_refused(run, sealed):
    assert "holds no results" in refused(sealed)
    run.write_text("results")
    assert "is not an archive" in refused(run)


def test_a_newer_layout_is_refused(run):
    path = write_results(run, results())
    with h5py.File(path, "r+") as file:
        item = file[f"{ENTRY}/run/format"]
        item[()] = 99
        item.attrs["sha256"] = hashlib.sha256(np.int64(99).tobytes()).hexdigest()
    rehash(path)
    assert "layout 99" in refused(path)


@pytest.mark.parametrize("kind", ["soft", "external"])
def test_a_link_in_place_of_an_array_is_not_followed(run, kind, tmp_path):
    """Even where somebody made the hash anew."""
    path = write_results(run, results())
    other = tmp_path / "other.h5"
    with h5py.File(other, "w") as file:
        file["x"] = np.zeros(3)
    link = h5py.SoftLink("/results/map") if kind == "soft" else h5py.ExternalLink(other, "/x")
    with h5py.File(path, "r+") as file:
        group = file[f"{ENTRY}/map/figure_the_map_1"]
        del group["rate"]
        group["rate"] = link
    rehash(path)
    assert "is a link, and links are not followed" in refused(path)


@pytest.mark.parametrize(
    "text",
    [
        '{"$is":"Path","args":["/etc/passwd"]}', '{"$is":"TypeAdapter"}',
        '{"$is":"Estimate","name":"x","value":"much","unit":"m"}', '{"$is":"RunResults"}',
        '{"$is":"Column","name":"x","label":"x"}', "[]", "{", '{"$array":"a/b/c"}',
    ],
)  # fmt: skip
def test_a_text_makes_results_and_nothing_else(text):
    def array(place: str) -> np.ndarray:
        raise LookupError(place)

    with pytest.raises((ValueError, TypeError, LookupError)):
        from_text(text, array)


def test_a_forged_text_is_an_archive_error(run):
    path = write_results(run, results())
    with h5py.File(path, "r+") as file:
        record = file[f"{ENTRY}/record"]
        text = record["data"][()].replace(b'"value":5.0', b'"value":"?"')
        assert b'"?"' in text
        del record["data"]
        record["data"] = np.array(text, dtype=f"S{len(text)}")
        record["data"].attrs["sha256"] = hashlib.sha256(text).hexdigest()
    rehash(path)
    assert "number" in refused(path)


# What every other program sees.


def test_viewers_open_on_the_most_telling_panel(run):
    tree = nxload(write_results(run, results()))
    plotted = tree.plottable_data
    assert plotted.nxpath == "/results/map/figure_the_map_1"
    assert plotted.nxsignal.nxname == "negative"
    assert [axis.nxname for axis in plotted.nxaxes] == ["rate"]
    assert plotted.nxerrors.nxname == "negative_errors"
    assert plotted.attrs["auxiliary_signals"] == "positive"  # both directions, not the fit's line
    assert str(plotted.title) == "Friction map: Both"
    assert plotted["rate"].attrs["units"] == "rad/s"
    assert plotted["negative"].attrs["long_name"] == "Friction torque (N m)"
    np.testing.assert_array_equal(plotted["rate"].nxdata, [-3, -2, -1, 1, 2, 4])
    np.testing.assert_array_equal(plotted["positive"].nxdata, [np.nan] * 3 + [5, 6, 8])
    np.testing.assert_allclose(plotted["positive_errors"].nxdata[3:], 0.1)
    np.testing.assert_allclose(plotted["negative_low"].nxdata[:3], [-7.1, -6.1, -5.1])


def test_single_points_of_several_methods_are_one_plot(run):
    """Viewers that show the signal alone would show one method of all."""
    methods = {"none": (7.0, 0.1), "static": (4.0, 0.2), "lugre": (2.0, None)}
    curves = [
        Curve.of(np.array([float(place)]), [estimate(value, half)], name, name)
        for place, (name, (value, half)) in enumerate(methods.items())
    ]
    axis = Axis("Compensation", places=((0.0, "none"), (1.0, "static"), (2.0, "LuGre")))
    figure = Figure("by-method", "Error", "", "", (Panel(axis, TORQUE, curves),))
    test = ResultsOfTest("errors", "stabilization", "", Result(figures=(figure,)))
    with h5py.File(write_results(run, results(tests=(test,), telling=None))) as file:
        group = file["results/errors/figure_by_method_1"]
        assert group.attrs["signal"] == "all"
        assert "auxiliary_signals" not in group.attrs
        assert list(group["all"]) == [7.0, 4.0, 2.0]
        np.testing.assert_allclose(group["all_errors"], [0.1, 0.2, np.nan])
        x = group[group.attrs["axes"][0]]
        assert x.attrs["long_name"] == "Compensation (0: none; 1: static; 2: LuGre)"
    (back,) = read_results(results_path(run), ROOT).tests[0].result.figures
    for curve, again in zip(curves, back.panels[0].curves, strict=True):
        np.testing.assert_array_equal(again.y, curve.y)
        np.testing.assert_array_equal(again.low, curve.low)


def test_another_telling_figure_is_another_default(run):
    other = replace(map_figure(), key="other")
    (test, broken) = results().tests
    tests = (replace(test, result=replace(test.result, figures=(map_figure(), other))), broken)
    path = write_results(run, results(tests=tests, telling=("map", "other")))
    assert nxload(path).plottable_data.nxpath == "/results/map/figure_other_1"


def test_without_figures_a_table_is_opened(run):
    test = results().tests[0]
    tests = (replace(test, result=replace(test.result, figures=(), telling="")),)
    path = write_results(run, results(tests=tests, telling=None))
    plotted = nxload(path).plottable_data
    assert (plotted.nxpath, plotted.nxsignal.nxname) == ("/results/map/table_parameters", "torque")


def test_the_checker_of_nexus_finds_no_fault(run):
    errors, warnings, output = nxcheck(write_results(run, results()))
    assert (errors, warnings) == (0, 0), output


def test_a_table_and_the_findings_are_columns_for_xarray(run):
    path = write_results(run, results())
    with xarray.open_dataset(path, engine="h5netcdf", group="/results/map/table_parameters") as got:
        np.testing.assert_array_equal(got["torque"], [5.0, 6.0, np.nan])
        # Of the second only the systematic part is known: no interval.
        np.testing.assert_allclose(got["torque_low"], [4.9, np.nan, np.nan])
        assert list(got["direction"].values) == ["up", "down ↘", ""]
        assert list(got["mixed"].values) == ["true", "x", "-0.1"]
        assert got["speed"].attrs["units"] == "rad/s"
        assert got["speed"].attrs["display_units"] == "deg/s"
    with xarray.open_dataset(path, engine="h5netcdf", group="/results/map/findings") as got:
        assert list(got["quantity"].values) == ["coulomb_torque", "static_torque"]
        np.testing.assert_array_equal(got["value"], [5.0, np.nan])
        assert got["condition_direction"].values[1] == "down"


def test_a_lopsided_interval_has_ends_and_no_half_width(run):
    """As where numbers are written: `±` only where both sides are the same."""
    low, high = np.array([0.9, 1.0]), np.array([1.1, 4.0])
    curve = Curve(np.arange(2.0), np.array([1.0, 2.0]), "m", "m", low=low, high=high)
    figure = Figure("f", "F", "", "", (replace_curves(curve),))
    path = write_results(
        run, results(tests=(ResultsOfTest("t", "k", "T", Result(figures=(figure,))),))
    )
    with h5py.File(path) as file:
        group = file[f"{ENTRY}/t/figure_f_1"]
        assert set(group) == {"m", "m_low", "m_high", "rate", "title"}
        assert json.loads(group.attrs["SILX_style"])["axes_scale_types"] == ["log"]
