"""What is declared of runs whose truth is known, and what is refused."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from datetime import timedelta
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.reading.run_reader import RunReader
from campaign.errors import ArchiveError, UsageError
from campaign.experiments import experiments
from campaign.report.formats.as_json import plain
from campaign.resources import templates_folder
from campaign.trends.page import content_of, write_trends
from campaign.trends.rig_trends import JUMP, TREND, Trends, Verdict, _imported, follow
from campaign.trends.tables import beside_the_jump, headline
from tests.trends.laboratory import START, STATIC, Wanted, archived


def opened(runs: Path, kind: str, *numbers: int) -> list[RunReader]:
    return [open_run(runs / f"{kind}-{n}.nxs") for n in numbers or range(8)]


@pytest.fixture(scope="module")
def drift(runs: Path) -> Trends:
    return follow(opened(runs, "drift"), experiments())


@pytest.fixture(scope="module")
def jump(runs: Path) -> Trends:
    return follow(opened(runs, "jump", 3, 0, 7, 1, 2, 6, 5, 4), experiments())


@pytest.fixture(scope="module")
def still(runs: Path) -> Trends:
    return follow(opened(runs, "still"), experiments())


@pytest.mark.slow
def test_a_drift_of_breakaway_is_declared_as_one(drift: Trends):
    quantities = {each.series.quantity for each in drift.declared}
    assert quantities == {"breakaway_torque"}
    for each in drift.declared:
        assert each.verdict is Verdict.DRIFTS
        low, high = each.change.trend.slope.interval(0.95)
        # 0.63 N m of the load's static torque in a month, less what the ramp's rate takes of it
        assert 0.35 < 30.4375 * low < 30.4375 * high < 0.65
        assert "drifts by +0." in headline(each, drift)
        assert each.detectable[TREND] < each.change.trend.slope.value


@pytest.mark.slow
def test_a_jump_is_declared_where_it_was_whatever_the_order_of_the_names(jump: Trends):
    assert [member.name for member in jump.members] == [f"jump-{n}" for n in range(8)]
    assert {each.series.quantity for each in jump.declared} == {"breakaway_torque"}
    for each in jump.declared:
        assert each.verdict is Verdict.JUMPED
        assert [found.place for found in each.jumps] == [5]
        assert "between runs 5 and 6" in headline(each, jump)
        assert each.detectable[JUMP] < each.jumps[0].size.value
        told = beside_the_jump(each, each.jumps[0], jump)
        assert "friction.load.static_torque from 20.84 N·m to 23 N·m" in told
        assert "seed" not in told


@pytest.mark.slow
def test_where_nothing_changes_nothing_is_declared_and_it_is_said_what_would_be(still: Trends):
    assert not still.declared
    assert still.judged == len(still.followed) > 5
    for each in still.followed:
        assert each.verdict is Verdict.NOT_SHOWN
        assert 0 < each.detectable[TREND] < np.inf


def test_of_one_rig_or_refused(runs: Path, tmp_path: Path):
    one, other = opened(runs, "still", 0, 1)
    with pytest.raises(UsageError, match="three runs of one rig"):
        follow([one], experiments())
    with pytest.raises(UsageError, match="campaign compare still-0 still-1"):
        follow([one, other], experiments())
    with pytest.raises(UsageError, match="are the same run"):
        follow([one, other, one], experiments())
    elsewhere = replace(one, header=one.header.model_copy(update={"source": "hardware"}))
    elsewhere = replace(elsewhere, path=tmp_path / "rig.nxs", root="another")
    with pytest.raises(UsageError, match=r"different kinds.*simulation: still-0.*hardware"):
        follow([*opened(runs, "still", 0, 1, 2), elsewhere], experiments())


def test_of_several_benches_is_refused_in_one_line(runs: Path, tmp_path: Path):
    text = (
        '[[test]]\nname = "errors"\nkind = "stabilization"\nbench = "simulink"\n'
        'frequency = "2 Hz"\nacceleration = "18 deg/s^2"\nsettle_cycles = 1\ncycles = 1\n'
    )
    other = archived(tmp_path, {"other": Wanted()}, text)["other"]
    with pytest.raises(UsageError) as told:
        follow([*opened(runs, "still"), open_run(other)], experiments())
    assert "different rigs" in str(told.value)
    assert "bench simulink: other" in str(told.value)
    assert "still-0, " in str(told.value)
    assert "\n" not in str(told.value)


@pytest.mark.slow
def test_the_same_simulation_counts_once(runs: Path, tmp_path: Path):
    """Four archives of two simulations hold two numbers, not four."""
    found = []
    for n in range(4):
        path = tmp_path / f"twin-{n}.nxs"
        shutil.copy(runs / f"still-{n % 2}.nxs", path)
        one = open_run(path)
        created = (START + timedelta(days=n)).isoformat()
        header = one.header.model_copy(update={"created": created, "name": path.stem})
        found.append(replace(one, header=header, root=f"{one.root} {n}"))
    followed = follow(found, experiments())
    assert not followed.judged
    for each in followed.followed:
        assert (
            str(each.reason) == "found in 2 runs, the same simulation as in 2: three are the least"
        )


def test_runs_of_one_moment_have_an_order_and_no_time(runs: Path):
    at_once = {"created": START.isoformat()}
    found = [
        replace(run, header=run.header.model_copy(update=at_once))
        for run in opened(runs, "still", 1, 2, 3)
    ]
    with pytest.raises(UsageError, match="--over order"):
        follow(found, experiments())
    ordered = follow(found, experiments(), "order")
    assert ordered.judged
    assert not any(JUMP in each.p for each in ordered.followed)  # three runs


@pytest.mark.slow
def test_what_follows_the_temperature_is_told_per_kelvin(tmp_path: Path):
    rng = np.random.default_rng(5)
    warm = rng.permutation(np.linspace(15, 35, 8))
    wanted = {
        f"run-{n}": Wanted(
            (f'{STATIC}="{20.84 * (1 - 0.01 * (t - 25)):.4f} N m"',),
            START + timedelta(days=n),
            (f"temperature={t:.2f} degC" if n else f"temperature={t + 273.15:.2f} K",),
            700 + n,
        )
        for n, t in enumerate(warm)
    }
    found = [open_run(path) for path in archived(tmp_path, wanted).values()]
    followed = follow(found, experiments(), "temperature")
    assert {each.series.quantity for each in followed.declared} == {"breakaway_torque"}
    for each in followed.declared:
        low, high = each.change.trend.slope.interval(0.95)
        assert -0.25 < low < high < -0.08  # N m per K
        assert "follows temperature: −0.1" in headline(each, followed)
    assert not follow(found, experiments()).declared
    lost = [replace(run, header=run.header.model_copy(update={"tags": ()})) for run in found[:6]]
    few = follow([*lost, *found[6:]], experiments(), "temperature")
    assert {str(each.reason) for each in few.followed} == {
        "temperature is known of 2 runs: too few"
    }


@pytest.mark.slow
def test_a_recorded_temperature_counts_before_a_noted_one_and_a_damaged_is_refused(tmp_path: Path):
    warm = [(20.0, "degC"), (297.15, "K"), None, (22.0, "degC")]
    wanted = {
        f"run-{n}": Wanted((), START + timedelta(days=n), ("temperature=31",), 800 + n, each)
        for n, each in enumerate(warm)
    }
    paths = list(archived(tmp_path, wanted).values())
    followed = follow([open_run(path) for path in paths], experiments(), "temperature")
    assert followed.judged
    for each in followed.followed:
        assert each.x.tolist() == pytest.approx([20.0, 24.0, 31.0, 22.0])
    with h5py.File(paths[1], "r+") as file:
        file["trial_00001/data/temperature"][7] += 1e-9
    with pytest.raises(ArchiveError, match="/trial_00001/data/temperature: does not match"):
        follow([open_run(path) for path in paths], experiments(), "temperature")


def test_another_number_of_the_runs_may_be_followed(drift: Trends, runs: Path):
    readers = [member.run for member in drift.members]
    found = follow(readers, experiments(), "breakaway torque mean")
    assert found.covariate.of.quantity == "breakaway_torque"
    assert len(found.followed) == len(drift.followed) - 1
    assert "share its errors" in found.notes[0]
    with pytest.raises(UsageError, match="means 3 numbers"):
        follow(readers[:3], experiments(), "breakaway_torque")
    with pytest.raises(UsageError, match="neither time, order nor temperature"):
        follow(readers[:3], experiments(), "humidity")
    with pytest.raises(UsageError, match="varies too little"):
        follow(readers[:3], experiments(), "rest stiffness mean")


def test_a_tag_of_mixed_units_is_one_number(runs: Path):
    def tagged(*tags: str) -> list[RunReader]:
        return [
            replace(run, header=run.header.model_copy(update={"tags": (tag,)}))
            for run, tag in zip(opened(runs, "still", 0, 1, 2, 3), tags, strict=True)
        ]

    mixed = follow(tagged("load=2 kg", "load=2500 g", "load=3 kg", "load=4 kg"), experiments(),
                   "load")  # fmt: skip
    assert mixed.followed[0].x.tolist() == pytest.approx([2, 2.5, 3, 4])
    assert mixed.covariate.per == "kg"
    with pytest.raises(UsageError, match="tag load is in N"):
        follow(tagged("load=2 kg", "load=2 N", "load=3 kg", "load=4 kg"), experiments(), "load")


@pytest.mark.slow
def test_the_page_is_whole_and_the_same_every_time(jump: Trends, tmp_path: Path, runs: Path):
    page = write_trends(jump, tmp_path / "out", templates_folder(), "campaign trend ...")
    first = {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()}
    names = {path.relative_to(tmp_path / "out").as_posix() for path in first}
    assert {"trend.html", "trend.json", "tables/followed.csv", "tables/points.csv",
            "figures/declared-1.svg", "figures/no-trend-shown.svg"} <= names  # fmt: skip
    again = follow(opened(runs, "jump"), experiments())
    write_trends(again, tmp_path / "out", templates_folder(), "campaign trend ...")
    assert {p: p.read_bytes() for p in (tmp_path / "out").rglob("*") if p.is_file()} == first
    html = page.read_text(encoding="utf-8")
    assert "cannot be shown" not in html
    assert "between runs 5 and 6" in html
    tree = json.loads((tmp_path / "out" / "trend.json").read_text(encoding="utf-8"))["content"]
    assert tree == json.loads(json.dumps(plain(content_of(jump))))
    assert tree["family"]["tests"] == jump.tested == 2 * jump.judged
    told = next(each for each in tree["numbers"] if each["verdict"] == "jumped")
    assert told["jumps"][0]["before_run"] == 6
    assert told["jumps"][0]["size"]["low"] < told["jumps"][0]["size"]["value"]
    assert len(told["points"]) == 8
    page.rename(tmp_path / "out" / "report.html")
    with pytest.raises(UsageError, match=r"has no trend\.html"):
        write_trends(jump, tmp_path / "out", templates_folder(), "")


def test_times_of_imports_are_told_to_be_no_times_of_recordings():
    run = SimpleNamespace(header=SimpleNamespace(source="recording"))
    members = [SimpleNamespace(name=f"run-{n}", run=run) for n in range(3)]
    for name, said in (("time", 1), ("order", 0)):
        notes = list(_imported(members, SimpleNamespace(name=name)))  # type: ignore[arg-type]
        assert len(notes) == said
        assert all("3 of the runs were imported" in note for note in notes)
