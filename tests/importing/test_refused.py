"""What of a mapping and its files is refused or told, and which rows are which trial."""

from __future__ import annotations

import ast
import math
import os
import subprocess
import sys
from pathlib import Path

import pytest

from campaign.cli.import_command import import_recordings
from campaign.cli.prepare import Request, prepare
from campaign.errors import ProtocolError, UsageError
from campaign.importing import defects
from campaign.importing.description import file_used
from campaign.importing.formats import open_recordings
from campaign.importing.interface import RecordingError
from tests.importing.test_mapping import COLUMNS, ENTRY, TEST, planned, refused, write


def test_only_regular_files_are_opened(tmp_path: Path):
    """A pipe that nobody writes to would be waited for, here and where it is hashed."""
    for opening in (open_recordings, lambda path: file_used(path, path.name)):
        with pytest.raises(RecordingError, match="device or the like, and no regular file"):
            opening(Path(os.devnull))
        with pytest.raises(RecordingError, match="it is a folder"):
            opening(tmp_path)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes")
def test_a_pipe_is_no_recording_and_is_not_waited_for(tmp_path: Path):
    text = COLUMNS + TEST + ENTRY.replace("a.csv", "pipe")
    write(tmp_path, text)
    os.mkfifo(tmp_path / "pipe")
    for command in (["plan", "m.toml", "--backend", "import"], ["import", "--guess", "pipe"]):
        program = [sys.executable, "-m", "campaign", *command]
        how = {"capture_output": True, "text": True, "timeout": 120, "check": False}
        done = subprocess.run(program, cwd=tmp_path, **how)
        assert done.returncode == 2, done.stderr
        assert "no regular file" in done.stderr


@pytest.mark.parametrize(
    ("file", "column", "what"),
    [
        ('"none.csv"', 8, "none.csv: it cannot be opened: No such file"),
        ('["a.csv", "none.csv"]', 18, "none.csv: it cannot be opened: No such file"),
        ('"broken.csv"', 8, "broken.csv:4:1: 'x' is no number"),
        ('"broken*.csv"', 8, "'x' is no number, as the rest of its column is (1 more alike)"),
        ('""', 8, "it is empty; name the file"),
        ("[]", 8, "it is empty; name the file"),
        ('"a\\u0000b"', 8, "no file has a name with a NUL"),
    ],
)
def test_what_is_wrong_with_a_file_is_told_at_its_name(
    tmp_path: Path, file: str, column: int, what: str
):
    rows = [f"{k},{k},{k}" for k in range(50)]
    rows[2] = "x,2,2"
    for name in ("broken.csv", "broken2.csv"):
        (tmp_path / name).write_text("t,pos,i\n" + "\n".join(rows))
    told = refused(tmp_path, COLUMNS + TEST + ENTRY.replace('"a.csv"', file))
    assert f"m.toml:19:{column}: " in told
    assert what in told
    assert "\n" not in told


def test_a_mapping_that_is_to_be_simulated_is_told_to_be_recordings(tmp_path: Path):
    """Not what of its bench a simulation lacks: nobody wants to simulate it."""
    text = COLUMNS + TEST.replace('"platform"', '"./rig.toml"') + ENTRY
    rig = 'schema = 3\nname = "Rig"\n[axis]\nname = "joint"\n'
    (tmp_path / "rig.toml").write_text(rig)
    path = write(tmp_path, text)
    with pytest.raises(UsageError) as caught:
        prepare(Request(path, backend="sim"))
    told = str(caught.value)
    assert f"`campaign import {path}`" in told
    assert f"`campaign plan {path} --backend import`" in told
    assert "inertia" not in told


def cut(folder: Path, runs: list[object], line: str):
    """The plan of a file of as many rows as `runs`, which are the column `run`."""
    rows = "t,pos,i,run\n" + "\n".join(f"{k},{0.05 * k:.6g},1,{r}" for k, r in enumerate(runs))
    return planned(folder, COLUMNS + TEST + ENTRY + line, rows)


def test_stretches_that_are_alike_are_numbered(tmp_path: Path):
    runs = [1] * 20 + [2] * 20 + [1] * 20
    trials = cut(tmp_path, runs, 'each = "run"').trials
    assert [trial.point for trial in trials] == [
        {"run": 1.0, "part": 1},
        {"run": 2.0, "part": 2},
        {"run": 1.0, "part": 3},
    ]
    assert len({trial.label for trial in trials}) == 3
    trials = cut(tmp_path, runs, 'where = { column = "run", equals = 1 }').trials
    assert [trial.point["part"] for trial in trials] == [1, 2]
    line = 'trigger = { column = "run", level = 1.5, duration = "15 ms" }'
    trials = cut(tmp_path, runs * 2, line).trials
    assert [trial.point for trial in trials] == [{"part": 1}, {"part": 2}]


def test_short_stretches_are_left_out_and_told(tmp_path: Path):
    runs = [1] * 20 + [2] * 9 + [3] * 20 + [""] + [3] * 10
    trials = cut(tmp_path, runs, 'each = "run"').trials
    assert [trial.recording["rows"] for trial in trials] == [20, 20, 10]
    assert [trial.point["run"] for trial in trials] == [1, 3, 3]
    remarks = " ".join(trials[0].recording["remarks"])
    assert "1 stretch of column 'run' with fewer than 10 rows is no trial" in remarks
    assert "column 'run' has no value in 1 row, which is in no trial" in remarks


@pytest.mark.parametrize(
    ("runs", "line", "what"),
    [
        (list(range(400)), 'each = "run"',
         "makes 400 stretches, the shortest of 1 row and the longest of 1 row; a recording"),
        ([1, ""] * 20, 'where = { column = "run", equals = 1 }',
         "the longest of 1 row; a recording needs 10. Column 'run' has no value in 20 rows"),
        ([0, *[2] * 30, *[0] * 5, *[2] * 80],
         'trigger = { column = "run", level = 1, duration = "50 ms" }',
         "again in row 37, 15 rows before the end of a trial"),
        ([0] * 20 + [1] * 40, 'trigger = { column = "run", level = 0.5, duration = "9 ms" }',
         "its 'duration' holds 9 rows, and a recording needs 10"),
        ([1] * 9, "", "a.csv: it has 9 rows, and a recording needs 10"),
        ([1] * 40, 'stop = "9 ms"', "9 rows from its beginning to 0.009 s, and a recording"),
    ],
)  # fmt: skip
def test_what_holds_no_trial_is_refused(tmp_path: Path, runs: list[object], line: str, what: str):
    with pytest.raises(ProtocolError) as caught:
        cut(tmp_path, runs, line)
    told = str(caught.value)
    assert what in told
    assert "m.toml:20:" in told if line else "m.toml:19:8: " in told


def test_a_lost_value_of_a_trigger_is_no_fall(tmp_path: Path):
    runs = [0] * 10 + [2] * 20 + [""] + [2] * 60
    line = 'trigger = { column = "run", level = 1, duration = "30 ms" }'
    (trial,) = cut(tmp_path, runs, line).trials
    assert trial.recording["first"] == 10


def test_as_few_as_ten_samples_are_a_recording(tmp_path: Path):
    (trial,) = cut(tmp_path, [1] * 10, "").trials
    assert trial.recording["samples"] == 10


def test_kinds_to_accept_are_those_that_are_looked_for(tmp_path: Path):
    text = COLUMNS.replace('unit = "deg"', 'unit = "deg"\naccept = ["cliping"]') + TEST + ENTRY
    told = refused(tmp_path, text)
    assert "m.toml:7:" in told
    assert "'cliping' is nothing that is looked for" in told
    assert "did you mean 'clipping'?" in told
    assert planned(tmp_path, text.replace("cliping", "clipping")).trials


def test_every_kind_that_is_found_in_channels_can_be_accepted():
    """Of the sources: whatever is made a `Defect` of channels is in the list, and no more."""
    found = set()
    for source in Path(defects.__file__).parent.glob("*.py"):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "Defect":
                kind, channels = node.args[:2]
                assert isinstance(kind, ast.Constant)
                if not isinstance(channels, ast.Tuple) or channels.elts:
                    found.add(kind.value)
    assert found == set(defects.CHANNEL_KINDS)


def shares(folder: Path, text: str) -> dict[str, float | None]:
    """The relative uncertainty of each channel of a mapping's trial."""
    (trial,) = planned(folder, text + TEST + ENTRY).trials
    return {c["name"]: c.get("relative_uncertainty") for c in trial.recording["channels"]}


@pytest.mark.parametrize(("uncertainty", "share"), [("5 %", 0.05), ("0.1 N m/A", 0.04), ("0 %", 0)])
def test_an_uncertainty_may_be_a_share(tmp_path: Path, uncertainty: str, share: float):
    known = shares(tmp_path, COLUMNS.replace("0.05 N m/A", uncertainty))
    assert known["drive_torque"] == pytest.approx(share)


@pytest.mark.parametrize("uncertainty", ["-5 %", "-0.1 N m/A"])
def test_a_negative_uncertainty_is_refused(tmp_path: Path, uncertainty: str):
    told = refused(tmp_path, COLUMNS.replace("0.05 N m/A", uncertainty) + TEST + ENTRY)
    assert f"the uncertainty '{uncertainty}' is negative" in told
    assert "m.toml:7:" in told


def test_what_is_derived_has_the_uncertainty_of_both(tmp_path: Path):
    more = """\
[columns.rig.motor_current]
derive = "drive_torque"
times = "0.4 A/(N m)"
uncertainty = "1.5 %"
[columns.rig.joint_torque]
derive = "drive_torque"
"""
    known = shares(tmp_path, COLUMNS + more)
    assert known["drive_torque"] == pytest.approx(0.02)
    assert known["motor_current"] == pytest.approx(0.025)
    assert known["joint_torque"] == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("kind", "wrong", "known"),
    [
        ("breakaway", "rampp", "rest, ramp; did you mean 'ramp'?"),
        ("step_response", "rampp", "rest, answer"),
        ("velocity_map", "rampp", "positive, negative"),
        ("frequency_response", "stady", "steady; did you mean 'steady'?"),
        ("stabilization", "measure", "measured; did you mean 'measured'?"),
    ],
)
def test_windows_that_no_analysis_looks_for_are_refused(
    tmp_path: Path, kind: str, wrong: str, known: str
):
    line = f'windows = {{ {wrong} = ["0 s", "0.1 s"] }}'
    told = refused(tmp_path, COLUMNS + TEST.replace("motion", kind) + ENTRY + line)
    assert "m.toml:20:13: " in told
    assert f"looks for a window '{wrong}'; allowed are {known}" in told


def test_what_a_person_mistakes_most_is_told_how_to_put_right(tmp_path):
    """Recordings for a mapping, an axis of the other kind, a channel that nobody mapped."""
    (tmp_path / "a.csv").write_text("t,x,m\n" + "\n".join(f"{k},{k},1" for k in range(50)))
    with pytest.raises(UsageError, match="campaign import --guess"):
        import_recordings([str(tmp_path / "a.csv")], tmp_path / "r")
    mapping = """
[columns.c.time]
column = "t"
unit = "ms"
[columns.c.relative_angle]
column = "x"
unit = "mm"
[[test]]
name = "any"
kind = "motion"
bench = "platform"
[[test.recording]]
file = "a.csv"
"""
    (tmp_path / "m.toml").write_text(mapping)
    with pytest.raises(UsageError, match=r"axis is rotary: is it linear \(axis.kind\)"):
        prepare(Request(str(tmp_path / "m.toml"), backend="import"))
    (tmp_path / "m.toml").write_text(mapping.replace('"mm"', '"mrad"'))
    with pytest.raises(UsageError, match=r"assign a column by \[columns.NAME.drive_torque\]"):
        prepare(Request(str(tmp_path / "m.toml"), backend="import")).open_backend()


def test_all_mistakes_of_a_mapping_are_told_at_once(tmp_path: Path):
    """Of its layout, its entries, its files, the column that tells trials apart, its windows."""
    (tmp_path / "text.csv").write_text("nothing\n")
    rows = "\n".join(f"{k},{0.05 * k:.6g},1" for k in range(100))
    (tmp_path / "good.csv").write_text("t,pos,i\n" + rows)
    other = COLUMNS.replace("columns.rig", "columns.other")
    wrong = other.replace('unit = "deg"', 'accept = ["cliping", "spikee"]\nderive = "x"')
    unfit = COLUMNS.replace('column = "pos"', 'column = "poss"').replace('"ms"', '"deg"')
    good = COLUMNS.replace("columns.rig", "columns.good")
    entries = [
        'file = ["text.csv", "none.csv"]\ncolumns = "good"',
        'file = "good.csv"\ncolumns = "rig"\neach = "runn"',
        'file = "good.csv"\ncolumns = "rgi"',
        'file = "gone.csv"\ncolumns = "other"',
        'file = "good.csv"\ncolumns = "good"\nrestarts = true\nstart = "1 s"\neach = "pos"',
        'file = "good.csv"\ncolumns = "good"\nwindows = { a = ["0 s", "9 s"] }',
        'file = "good.csv"\ncolumns = "good"\nwindows = { b = ["1 s", "0 s"] }',
    ]
    text = wrong + unfit + good + TEST
    told = refused(tmp_path, text + "".join(f"[[test.recording]]\n{each}\n" for each in entries))
    for what in (
        "'cliping' is nothing that is looked for",
        "'spikee' is nothing that is looked for",
        "it is a 'column' or it is derived",
        "text.csv: no table of numbers",
        "none.csv: it cannot be opened",
        "gone.csv: it cannot be opened",
        "there is no column 'poss'",
        "'deg' is no unit of time",
        "there is no column 'runn'",
        "there is no [columns.rgi]",
        "'start' is a time, and with 'restarts'",
        "'each' and 'restarts' both separate trials; use one of them",
        "the window 'a', 0 to 9 s, is no part",
        "the window 'b', 1 to 0 s, is no part",
    ):
        assert what in told, what


def test_all_defects_of_a_recording_are_told_at_once(tmp_path: Path):
    """Two channels that drop out in the second stretch and one in the first: three in all."""
    time = range(4000)
    angle = [math.sin(0.004 * k) for k in time]
    rows = [
        f"{k},{angle[k]:.9g},{0 if k % 2000 in (700, 701) else 1.5 + math.cos(0.003 * k):.9g},"
        f"{0 if k in (2900, 2901) else 1.6 + math.sin(0.002 * k):.9g},{1 + k // 2000}"
        for k in time
    ]
    text = COLUMNS.replace('unit = "deg"', 'unit = "rad"\nsign = 1') + TEST + ENTRY
    more = '[columns.rig.motor_current]\ncolumn = "i"\nunit = "A"\n'
    more += '[columns.rig.gyro_rate]\ncolumn = "g"\nunit = "rad/s"\n'
    told = refused(
        tmp_path,
        text.replace("[[test]]", more + "[[test]]") + 'each = "run"\n',
        "t,pos,i,g,run\n" + "\n".join(rows),
    )
    assert "motor_current is zero in the middle of motion, rows 701 to 702" in told
    assert "gyro_rate is zero in the middle of motion, rows 901 to 902" in told


@pytest.mark.parametrize(("uncertainty", "share"), [("2 %", 0.02), ("", None)])
def test_the_scale_of_a_column_without_a_constant_may_be_uncertain(
    tmp_path: Path, uncertainty: str, share: float | None
):
    line = f'\nuncertainty = "{uncertainty}"' if uncertainty else ""
    known = shares(tmp_path, COLUMNS.replace('unit = "deg"', 'unit = "deg"' + line))
    assert known["relative_angle"] == share
    assert known["relative_rate"] == share  # what is made of it has its scale


def test_an_uncertainty_with_a_unit_needs_the_constant_that_it_is_of(tmp_path: Path):
    text = COLUMNS.replace('unit = "deg"', 'unit = "deg"\nuncertainty = "0.1 deg"') + TEST + ENTRY
    told = refused(tmp_path, text)
    assert "m.toml:4:" in told
    assert "'0.1 deg' needs a 'times' that it is of; without one write a share" in told
    assert "\n" not in told
