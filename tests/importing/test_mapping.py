"""Mappings: what they make of columns, and what they say of mistakes, with file:line:column."""

from __future__ import annotations

import os
import re
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.backends import backends
from campaign.backends.imported import BACKEND
from campaign.backends.replay import ReplayOptions
from campaign.cli.import_command import import_recordings
from campaign.cli.prepare import Request, prepare
from campaign.cli.rerun import rerun_trial
from campaign.cli.verify import verify_archives
from campaign.errors import ExitCode, ProtocolError, UsageError
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording

COLUMNS = """\
[columns.rig.time]
column = "t"
unit = "ms"
[columns.rig.relative_angle]
column = "pos"
unit = "deg"
[columns.rig.drive_torque]
column = "i"
unit = "A"
times = "2.5 N m/A"
uncertainty = "0.05 N m/A"
offset = 0.5
sign = -1
"""
TEST = """\
[[test]]
name = "any"
kind = "motion"
bench = "platform"
"""
ENTRY = '[[test.recording]]\nfile = "a.csv"\n'


def write(folder: Path, text: str, rows: str = "", name: str = "a.csv") -> str:
    if not rows:
        time = np.arange(400)
        rows = "t,pos,i,run\n" + "\n".join(
            f"{k},{0.05 * k:.6g},{1.0 + 0.001 * k:.6g},{1 + k // 100}" for k in time
        )
    (folder / name).write_text(rows)
    (folder / "m.toml").write_text(text)
    return str(folder / "m.toml")


def planned(folder: Path, text: str, rows: str = ""):
    return prepare(Request(write(folder, text, rows), backend="import")).plan


def served(trial) -> tuple[Recording, Ending]:
    recorder = MemoryRecorder()
    with BACKEND.open(BACKEND.options()) as backend:
        assert backend.refuses(trial) is None
        ending = backend.execute(trial, recorder, lambda: False)
    return recorder.recording(ending), ending


def refused(folder: Path, text: str, rows: str = "") -> str:
    with pytest.raises(ProtocolError) as caught:
        planned(folder, text, rows)
    return str(caught.value)


def test_columns_become_channels_with_units_signs_and_constants(tmp_path: Path):
    (trial,) = planned(tmp_path, COLUMNS + TEST + ENTRY).trials
    recording, ending = served(trial)
    k = np.arange(400)
    assert ending.outcome is Outcome.COMPLETED
    assert trial.task.sample_rate == pytest.approx(1000.0)
    np.testing.assert_allclose(recording.time, k / 1000.0, atol=1e-12)
    np.testing.assert_allclose(recording["relative_angle"], np.deg2rad(0.05 * k), rtol=1e-5)
    np.testing.assert_allclose(recording["drive_torque"], -2.5 * (1.0 + 0.001 * k - 0.5), rtol=1e-5)
    # What the experiment needs and nobody recorded follows from what there is, and that is told.
    np.testing.assert_allclose(recording["relative_rate"], np.deg2rad(50.0), rtol=1e-4)
    assert any(
        "relative_rate is the derivative of relative_angle" in e.text for e in recording.events
    )
    made = trial.recording["channels"][1]
    assert made["relative_uncertainty"] == pytest.approx(0.02)
    assert len(trial.recording["files"][0]["sha256"]) == 64


@pytest.mark.parametrize(
    ("line", "trials", "rows"),
    [
        ("", 1, [400]),
        ('start = "100 ms"\nstop = "300 ms"', 1, [200]),
        ('where = { column = "run", equals = 3 }', 1, [100]),
        ('each = "run"', 4, [100] * 4),
        ('trigger = { column = "run", level = 1.5, duration = "50 ms" }', 1, [50]),
    ],
)
def test_a_file_may_hold_several_trials(tmp_path: Path, line: str, trials: int, rows: list[int]):
    plan = planned(tmp_path, COLUMNS + TEST + ENTRY + line)
    assert len(plan.trials) == trials
    assert [len(served(trial)[0].time) for trial in plan.trials] == rows
    if line.startswith("each"):
        assert [trial.point["run"] for trial in plan.trials] == [1, 2, 3, 4]
        second, _ = served(plan.trials[1])
        assert second["relative_angle"][0] == pytest.approx(np.deg2rad(5.0))


def test_a_pattern_is_a_recording_for_each_file(tmp_path: Path):
    text = COLUMNS + TEST + ENTRY.replace("a.csv", "*.csv")
    rows = "t,pos,i\n" + "\n".join(f"{k},{k},{k}" for k in range(100))
    write(tmp_path, text, rows, "b.csv")
    assert len(planned(tmp_path, text, rows).trials) == 2


def test_a_pattern_finds_files_in_folders_below_and_through_links_that_stay_there(tmp_path: Path):
    text = COLUMNS + TEST + ENTRY.replace("a.csv", "*/[ab].csv")
    rows = "t,pos,i\n" + "\n".join(f"{k},{k},{k}" for k in range(100))
    (tmp_path / "day").mkdir()
    write(tmp_path / "day", text, rows, "b.csv")
    (tmp_path / "day" / "a.csv").symlink_to(tmp_path / "a.csv")
    (tmp_path / "again").symlink_to(tmp_path / "again")  # a link to itself is nowhere
    assert len(planned(tmp_path, text, rows).trials) == 2


@pytest.mark.parametrize(
    ("pattern", "what"),
    [
        ("/*", "a pattern"), ("../*.csv", "a pattern"), ("day/../../*.csv", "a pattern"),
        ("out/*.csv", "the link 'out'"), ("*/*.csv", "the link 'out'"),
        ("o*/*/*/*", "the link 'out'"), ("*.csv", "the link 'far.csv'"),
    ],
)  # fmt: skip
def test_a_pattern_does_not_lead_out_of_its_folder(
    tmp_path: Path, pattern: str, what: str, monkeypatch: pytest.MonkeyPatch
):
    """And nothing outside is looked at: a pattern of the root would walk through all files."""
    inside, outside = tmp_path / "in", tmp_path / "outside"
    (inside / "day").mkdir(parents=True)
    (outside / "deep").mkdir(parents=True)
    write(outside, "", "t,pos\n0,1\n", "far.csv")
    (inside / "out").symlink_to(outside)
    (inside / "far.csv").symlink_to(outside / "far.csv")
    looked: list[Path] = []
    scan = os.scandir

    def seen(path):
        looked.append(Path(path).resolve())
        return scan(path)

    monkeypatch.setattr(os, "scandir", seen)
    told = refused(inside, COLUMNS + TEST + ENTRY.replace("a.csv", pattern))
    assert re.search(r"m\.toml:19:8: ", told)
    assert f"{what} leads out of the mapping's folder" in told
    assert all(path.is_relative_to(inside) for path in looked if path.is_relative_to(tmp_path))
    assert Path("/") not in looked


def test_a_filter_of_the_drive_is_told(tmp_path: Path):
    filtered = COLUMNS.replace("sign = -1", 'sign = -1\nfilter = "first order, 8 ms"')
    (trial,) = planned(tmp_path, filtered + TEST + ENTRY).trials
    recording, _ = served(trial)
    said = [event.text for event in recording.events]
    assert "drive_torque was filtered before it was recorded: first order, 8 ms" in said


def test_conditions_are_numbers_with_units_or_words(tmp_path: Path):
    line = 'conditions = { load = "10 N", oil = "dry", speed = "90 deg/s" }'
    (trial,) = planned(tmp_path, COLUMNS + TEST + ENTRY + line).trials
    assert trial.point == {"load": 10.0, "oil": "dry", "speed": pytest.approx(np.pi / 2)}


def test_a_file_that_changes_after_it_was_mapped_is_a_fault(tmp_path: Path):
    (trial,) = planned(tmp_path, COLUMNS + TEST + ENTRY).trials
    with (tmp_path / "a.csv").open("a") as file:
        file.write("\n400,20,1,4")
    _, ending = served(trial)
    assert ending.outcome is Outcome.FAULT
    assert "it has changed since it was mapped" in ending.reason


@pytest.mark.parametrize(
    ("was", "now", "where", "what"),
    [
        ('column = "pos"', 'column = "poss"', "m.toml:5:", "no column 'poss'.*mean 'pos'"),
        ('unit = "deg"', 'unit = "mm"', "m.toml:4:", "relative_angle is in rad, and 'mm' is no"),
        ('unit = "deg"', "", "m.toml:4:", "the file states no unit of column 'pos'"),
        ('unit = "ms"', 'unit = "deg"', "m.toml:3:", "'deg' is no unit of time"),
        ("N m/A", "N/A", "m.toml:7:", "drive_torque is in N m"),
        ('"0.05 N m/A"', '"5 A"', "m.toml:7:", "has another unit than 'times'"),
        ("[columns.rig.relative_angle]", "[columns.rig.bananas]", "m.toml:4:", "a 'label'"),
        ("rig.relative_angle", "rig.Angle", "m.toml:1:10:",
         "'Angle': must be a lower-case letter, then lower-case letters, digits and _"),
        (ENTRY, "", "m.toml:14:", "has no recordings"),
        ("sign = -1", "sign = -2", "m.toml:13:", "-2 is not allowed here; allowed are 1, -1"),
        ('"a.csv"', '"b.csv"', "b.csv", "cannot be opened"),
        ('"a.csv"', '"*.dat"', "m.toml:19:", "no file of that name"),
        ('file = "a.csv"', 'file = "a.csv"\ntrial = 1', "m.toml:14:", "nothing to plan"),
        ('file = "a.csv"', 'file = "a.csv"\ncolumns = "rgi"', "m.toml:20:", "did you mean 'rig'"),
        ('file = "a.csv"', 'file = "a.csv"\neach = "pso"', "m.toml:20:", "did you mean 'pos'"),
        ('"a.csv"', '"a.csv"\nstart = "9 s"', "m.toml:20:", "its times are 0 to 0.399"),
    ],
)  # fmt: skip
def test_mistakes_are_told_with_their_place(
    tmp_path: Path, was: str, now: str, where: str, what: str
):
    told = refused(tmp_path, (COLUMNS + TEST + ENTRY).replace(was, now))
    assert where in told
    assert re.search(what, told), told


def test_a_run_does_not_execute_what_was_executed_elsewhere(tmp_path: Path):
    path = write(tmp_path, COLUMNS + TEST + ENTRY)
    with pytest.raises(UsageError, match="campaign import"):
        prepare(Request(path))


def test_an_imported_run_is_verified_and_replayed_and_not_rerun(tmp_path: Path, capsys):
    text = COLUMNS + TEST + ENTRY + 'each = "run"\n'
    path = write(tmp_path, text)
    code = import_recordings([path], tmp_path / "r")
    assert code is ExitCode.DONE
    archive = next((tmp_path / "r").glob("*.nxs"))
    assert verify_archives([str(archive)], tmp_path / "r", as_json=False) is ExitCode.DONE
    with pytest.raises(UsageError, match="is imported and cannot be repeated"):
        rerun_trial(str(archive), "2", tmp_path / "r")
    capsys.readouterr()
    trials = open_run(archive).trials
    with backends()["replay"].open(ReplayOptions(run=str(archive))) as backend:
        recorder = MemoryRecorder()
        ending = backend.execute(trials[1].trial, recorder, lambda: False)
        again = recorder.recording(ending)
    np.testing.assert_array_equal(again["drive_torque"], trials[1].recording()["drive_torque"])


def slower(folder: Path, begin: int, step: int) -> tuple[str, str]:
    """A mapping of two files on one clock, the second with a value of its own at each step (ms),
    and the rows of the first."""
    slow = "t,i\n" + "\n".join(f"{begin + step * k},{k}" for k in range(20))
    (folder / "slow.csv").write_text(slow)
    text = COLUMNS.replace("offset = 0.5\nsign = -1\n", "") + TEST
    text += '[[test.recording]]\nfile = ["a.csv", "slow.csv"]\n'
    return text, "t,pos\n" + "\n".join(f"{k},{k}" for k in range(200))


@pytest.mark.parametrize("begin", [0, 5])
def test_a_slower_table_is_held(tmp_path: Path, begin: int):
    """It is told how often new; what it was before its first value nobody knows."""
    (trial,) = planned(tmp_path, *slower(tmp_path, begin, 10)).trials
    recording, _ = served(trial)
    torque = recording["drive_torque"]
    assert np.isnan(torque[:begin]).all()
    np.testing.assert_allclose(torque[begin:], 2.5 * (np.arange(200 - begin) // 10))
    assert recording.channels["drive_torque"].own_rate == pytest.approx(100.0)


@pytest.mark.parametrize(("begin", "step"), [(1_000_000, 10), (0, 1), (-5000, 10)])
def test_clocks_that_do_not_cover_each_other_are_refused(tmp_path: Path, begin: int, step: int):
    """A value that nobody measured is not held: neither before the first nor behind the last."""
    told = refused(tmp_path, *slower(tmp_path, begin, step))
    assert "slow.csv has times " in told
    assert "s, the trial 0 to 0.199 s; cut it" in told
