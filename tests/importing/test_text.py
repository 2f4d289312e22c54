"""Tables of text: what is written in them is found, and what is wrong in them is placed."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from campaign.importing.formats import open_recordings
from campaign.importing.interface import RecordingError, Table
from tests.importing.files import CSV, GERMAN
from tests.importing.whole import headings, opened, whole


def table(path: Path, content: str | bytes) -> Table:
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    (only,) = opened(path, "text")
    return only


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recording.csv"


def test_names_units_and_numbers_are_as_written(path):
    found = table(path, CSV)
    assert headings(found) == [("time", "s"), ("rate", "deg/s"), ("torque", "N m")]
    np.testing.assert_array_equal(
        whole(found), [[0, 1.5, -2], [0.01, 1.6, -2.25], [0.02, 1.7, -2.5]]
    )
    np.testing.assert_array_equal(whole(found, [2, 0]), [[-2, 0], [-2.25, 0.01], [-2.5, 0.02]])


def test_a_decimal_comma_groups_thousands_with_points(path):
    found = table(path, GERMAN)
    assert headings(found) == [("Zeit", "ms"), ("Drehzahl", "1/min"), ("Moment", "Nm")]
    np.testing.assert_array_equal(whole(found)[0], [0, 1234.5, -0.2])


@pytest.mark.parametrize("codec", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_the_encoding_is_found(path, codec):
    found = table(path, "t [µs];Kraft [N] für Achse\n0;1,5\n1;2,5\n2;3,5\n".encode(codec))
    assert [column.name for column in found.columns] == ["t", "Kraft [N] für Achse"]
    assert whole(found)[:, 1].tolist() == [1.5, 2.5, 3.5]


AMPLIFIER = (
    "Sampling time interval(ms),0.667,\nTime,Analog 1,Analog 2\n"
    "ms,Servo motor speed,Torque\n0,1,2\n1,2,3\n2,3,4\n"
)
LOGGER = (
    'Interval,0.1,Interval,0.1\nChannel name,"Force",Channel name,"RMV"\n'
    'Unit,"N",Unit,"V"\n0,1,0,2\n1,2,1,3\n'
)


@pytest.mark.parametrize(
    ("content", "names", "units", "last"),
    [
        ("0,000 1,25\n0,001 1,30\n0,002 1,31\n", ["column 1", "column 2"], ["", ""], [0.002, 1.31]),
        ("Time\tChannel A\n(us)\t(V)\n\n0.1\t2.5\n0.2\t2.6\n", ["Time", "Channel A"], ["us", "V"],
         [0.2, 2.6]),
        ("# Rig: 7\n# made today\n#t q\n0 1\n1 2\n", ["t", "q"], ["", ""], [1, 2]),
        ("t,a\n0,1,\n1,2,\n2,3,\n", ["t", "a"], ["", ""], [2, 3]),
        ("t,A,V\n0,1,2\n1,2,3\n", ["t", "A", "V"], ["", "", ""], [1, 2, 3]),
        ("t\ta\n0\t1\n1\t2\nEOF\n", ["t", "a"], ["", ""], [1, 2]),
        ('"t","a, b"\n"0","1"\n"1","2"\n', ["t", "a, b"], ["", ""], [1, 2]),
        ("t;a\n0;1D-3\n1;2D+01\n", ["t", "a"], ["", ""], [1, 20]),
        ("Operator: me\nSampling time interval(ms),0.667\n\nt,a\n0,1\n1,2\n2,3\n", ["t", "a"],
         ["", ""], [2, 3]),
        (AMPLIFIER, ["Time", "Servo motor speed", "Torque"], ["ms", "", ""], [2, 3, 4]),
        (LOGGER, ["time", "Force", "time", "RMV"], ["", "N", "", "V"], [1, 2, 1, 3]),
        ("x-axis,1,2\nsecond,Volt,Volt\n0,1,2\n1,2,3\n", ["x-axis", "1", "2"],
         ["second", "Volt", "Volt"], [1, 2, 3]),
        ("Sample Interval,1e-3\nVertical Units,V,A\n\nTIME,CH1,CH2\n0,1,2\n1,2,3\n",
         ["TIME", "CH1", "CH2"], ["", "V", "A"], [1, 2, 3]),
    ],
)  # fmt: skip
def test_habits_of_other_programs(path, content, names, units, last):
    found = table(path, content)
    assert [column.name for column in found.columns] == names
    assert [column.unit for column in found.columns] == units
    assert whole(found)[-1].tolist() == last


def test_words_are_no_numbers_and_columns_keep_their_places(path):
    found = table(path, "time,mode,q\n0,IDLE,1\n0.1,RUN,2\n0.2,RUN,3\n")
    assert [column.numeric for column in found.columns] == [True, False, True]
    assert whole(found).tolist() == [[0, 1], [0.1, 2], [0.2, 3]]


def test_lost_numbers_are_nan(path):
    rows = whole(table(path, "t,a\n0,1\n1,\n2,nan\n3,inf\n4,4\n5,#N/A\n6,7\n"))
    assert np.isnan(rows[:, 1]).tolist() == [False, True, True, True, False, True, False]


def test_two_ways_of_reading_are_a_doubt(path):
    assert table(path, CSV).doubts == ()
    (doubt,) = table(path, "1,2\n2,3\n3,4\n").doubts
    assert "decimal comma" in doubt


@pytest.mark.parametrize(
    ("content", "place", "what"),
    [
        ("t,a,b\n0,1,2\n1,2\n2,3,4\n3,4,5\n4,5,6\n", "3:1", "2 cells where the rows above have 3"),
        ("t,a\n0,1\n1,2\n1,2,3\n2,3\n2,2\n2,1\n", "4:1", "3 cells where the rows above have 2"),
        ("t,a\n0,1\n1,x2\n3,3\n4,4\n5,5\n6,5\n", "3:3", "'x2' is no number"),
        ("t  a\n0  1\n1  2\n2  x1\n3  2\n4  3\n5  3\n", "4:4", "'x1' is no number"),
    ],
)
def test_a_broken_row_is_refused_by_line_and_column(path, content, place, what):
    """It is never padded, never dropped, and rows above it are no heading."""
    with pytest.raises(RecordingError) as caught:
        whole(table(path, content))
    assert f"{path}:{place}: {what}" in str(caught.value)


def test_a_row_is_broken_far_behind_the_sample(path):
    rows = [f"{k},{k % 7}" for k in range(5000)]
    rows[4200] = "4200,3,9"
    with pytest.raises(RecordingError, match=rf"{path}:4202:1: 3 cells"):
        whole(table(path, "t,a\n" + "\n".join(rows) + "\n"))


def test_a_long_file_is_read_in_blocks(path, monkeypatch):
    monkeypatch.setattr("campaign.importing.rows.ROWS", 100)
    found = table(path, "t,a\n" + "".join(f"{k},{k * k}\n" for k in range(1234)))
    blocks = list(found.read([1]))
    assert max(map(len, blocks)) == 100
    assert np.concatenate(blocks).ravel().tolist() == [k * k for k in range(1234)]


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"", "it is empty"),
        (b"hello\nworld\n", "no table of numbers"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "in none of the formats"),
        (b"t,a\n" + b"0,1\n" * 20_000 + b"0,\x00\n", "20002:3: a zero byte"),
        (b"1," * 600_000, "a line of over"),
    ],
)
def test_what_is_no_table_is_told_in_one_line(path, content, what):
    with pytest.raises(RecordingError) as caught:
        whole(table(path, content))
    assert what in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(RecordingError, match="cannot be opened: No such file"):
        open_recordings(tmp_path / "none.csv")


@pytest.mark.parametrize("lost", ["1.#QNAN", "-1.#IND", "---"])
def test_rows_that_begin_without_a_number_are_rows(path, lost):
    rows = [f"{k},{k * 2},{lost if k < 100 else k}" for k in range(400)]
    found = table(path, "t,a,b\n" + "\n".join(rows) + "\n")
    assert [column.name for column in found.columns] == ["t", "a", "b"]
    assert len(whole(found)) == 400


@pytest.mark.parametrize("broken", ["{k},{k},?", "{k},{k}"])
def test_broken_rows_at_the_beginning_are_no_heading(path, broken):
    rows = [(broken if k < 100 else "{k},{k},{k}").format(k=k) for k in range(400)]
    with pytest.raises(RecordingError, match=rf"{path}:2:"):
        whole(table(path, "t,a,b\n" + "\n".join(rows) + "\n"))


def test_a_row_too_long_does_not_make_up_for_one_too_short(path):
    rows = [f"{k / 100},{k},1" for k in range(100)]
    rows[60:62] = ["0.6,60,1,1", "0.61,61"]
    found = table(path, "\n".join(["time [s],rate [deg/s],torque [N m]", *rows, ""]))
    with pytest.raises(RecordingError) as refused:
        whole(found, [0, 1])
    assert [problem.line for problem in refused.value.problems] == [62, 63]
