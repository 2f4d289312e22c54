"""Formats of optional libraries: Excel and MDF."""

from __future__ import annotations

import datetime as dt
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from campaign.importing.formats import excel, mdf
from campaign.importing.interface import RecordingError
from tests.importing.files import RATE, TIME, TORQUE
from tests.importing.whole import headings, opened, whole


@pytest.mark.parametrize(
    ("module", "library", "what"),
    [(excel, "openpyxl", r"campaign\[excel\]"), (mdf, "asammdf", r"campaign\[mdf\]")],
)
def test_without_its_library_a_format_says_what_to_install(
    tmp_path, monkeypatch, module, library, what
):
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / "a"
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("[Content_Types].xml", "")
    with pytest.raises(RecordingError, match=what):
        module.tables(path)


# Excel


@pytest.fixture
def workbook():
    return pytest.importorskip("openpyxl", reason="openpyxl is not installed").Workbook()


def saved(workbook, folder: Path) -> Path:
    workbook.save(folder / "a.xlsx")
    return folder / "a.xlsx"


def test_sheets_are_tables_with_names_and_units(tmp_path, workbook):
    one = workbook.active
    one.title = "Messung 1"
    one.append(["Rig 7", None, "2 May"])
    one.append([])
    one.append(["Zeit", "Winkel", "Moment"])
    one.append(["s", "deg", "(Nm)"])
    for row in zip(TIME.tolist(), RATE.tolist(), TORQUE.tolist(), strict=True):
        one.append(row)
    workbook.create_sheet("notes").append(["nothing here"])
    two = workbook.create_sheet("slow")
    for k in range(5):
        two.append([k, k * k])
    first, second = opened(saved(workbook, tmp_path), "excel")
    assert (first.name, second.name) == ("Messung 1", "slow")
    assert headings(first) == [("Zeit", "s"), ("Winkel", "deg"), ("Moment", "Nm")]
    np.testing.assert_allclose(whole(first), np.column_stack([TIME, RATE, TORQUE]), atol=1e-12)
    assert headings(second) == [("column A", ""), ("column B", "")]
    assert whole(second, [1]).ravel().tolist() == [0, 1, 4, 9, 16]


def test_merged_cells_name_what_is_below_them(tmp_path, workbook):
    sheet = workbook.active
    sheet["A1"], sheet["B1"] = "Time", "Motor"
    sheet["B2"], sheet["C2"] = "pos", "cur"
    sheet.merge_cells("B1:C1")
    sheet.merge_cells("A1:A2")
    for k in range(5):
        sheet.append([k / 10, k, -k])
    (table,) = opened(saved(workbook, tmp_path), "excel")
    assert [name for name, _ in headings(table)] == ["Time", "pos", "cur"]


def test_text_with_decimal_commas_is_numbers_and_a_doubt(tmp_path, workbook):
    sheet = workbook.active
    sheet.append(["t", "q", "note"])
    for k in range(4):
        sheet.append([k, f"1,{k}5", "ok"])
    sheet.append([4, "#DIV/0!", "bad"])
    (table,) = opened(saved(workbook, tmp_path), "excel")
    assert [column.numeric for column in table.columns] == [True, True, False]
    values = whole(table, [1]).ravel()
    assert values[:4].tolist() == [1.05, 1.15, 1.25, 1.35]
    assert np.isnan(values[4])
    assert "decimal comma" in table.doubts[0]


def test_dates_and_times_are_seconds(tmp_path, workbook):
    sheet = workbook.active
    sheet.append(["when", "q"])
    start = dt.datetime(2024, 5, 2, 12, 0, 0)  # noqa: DTZ001 - as Excel has it
    for k in range(5):
        sheet.append([start + dt.timedelta(milliseconds=100 * k), k])
    (table,) = opened(saved(workbook, tmp_path), "excel")
    assert headings(table)[0] == ("when", "s")
    np.testing.assert_allclose(np.diff(whole(table, [0]).ravel()), 0.1, atol=2e-5)
    assert any("10 us" in doubt for doubt in table.doubts)
    sheet.append([7, 8])
    with pytest.raises(RecordingError, match=r"Sheet!A7: '7, no time' is no number"):
        whole(opened(saved(workbook, tmp_path), "excel")[0])


def test_a_formula_without_a_value_is_told(tmp_path, workbook):
    sheet = workbook.active
    sheet.append(["t", "q"])
    for k in range(5):
        sheet.append([k, f"=A{k + 2}*2"])
        sheet.append([k + 0.5, 3])
    with pytest.raises(RecordingError, match=r"Sheet!B2: a formula whose value is not in the file"):
        opened(saved(workbook, tmp_path), "excel")


def test_words_among_numbers_are_told_by_their_cell(tmp_path, workbook):
    sheet = workbook.active
    sheet.append(["t", "q"])
    for k in range(300):
        sheet.append([k, "oops" if k == 250 else k])
    (table,) = opened(saved(workbook, tmp_path), "excel")
    with pytest.raises(RecordingError, match=r"Sheet!B252: 'oops' is no number"):
        whole(table)


@pytest.mark.slow
def test_workbooks_that_are_none(tmp_path):
    pytest.importorskip("openpyxl", reason="openpyxl is not installed")
    path = tmp_path / "a.xlsx"
    path.write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600))
    with pytest.raises(RecordingError, match=r"save it as .xlsx"):
        opened(path, "excel")
    path.write_bytes(b"PK\x03\x04 xl/ and nothing else")
    with pytest.raises(RecordingError, match="workbook cannot be read"):
        opened(path, "excel")
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("[Content_Types].xml", "<a/>")
        with packed.open("xl/sharedStrings.xml", "w", force_zip64=True) as part:
            for _ in range(300):
                part.write(bytes(1 << 20))
    assert path.stat().st_size < 1e6
    with pytest.raises(RecordingError, match="which is too much"):
        opened(path, "excel")


# MDF


@pytest.fixture
def asammdf():
    return pytest.importorskip("asammdf", reason="asammdf is not installed")


@pytest.mark.slow
def test_groups_are_tables_with_clocks_of_their_own(tmp_path, asammdf, monkeypatch):
    told = {"name": "tau", "unit": "Nm", "conversion": {"a": 0.01, "b": 0.0}}
    fast = [
        asammdf.Signal(RATE, TIME, name="w", unit="rad/s"),
        asammdf.Signal((TORQUE * 100).astype("i2"), TIME, **told),
    ]
    states = np.array([b"on", b"off"] * 13)[: len(TIME[::2])]
    slow = [
        asammdf.Signal(-RATE[::2], TIME[::2], name="w"),
        asammdf.Signal(states, TIME[::2], name="state", encoding="utf-8"),
    ]
    path = tmp_path / "a.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.append(fast, acq_name="fast")
        file.append(slow)
        file.save(path)
    one, two = opened(path, "mdf")
    assert headings(one) == [("time", "s"), ("w", "rad/s"), ("tau", "Nm")]
    np.testing.assert_allclose(
        whole(one), np.column_stack([TIME, RATE, np.trunc(TORQUE * 100) / 100]), atol=1e-12
    )
    assert [column.numeric for column in two.columns] == [True, True, False]
    np.testing.assert_array_equal(whole(two, [0, 1]), np.column_stack([TIME, -RATE])[::2])
    with monkeypatch.context() as changed:
        changed.setattr("campaign.importing.formats.mdf.ROWS", 7)
        blocks = list(mdf.tables(path)[0].read([0]))
    assert max(map(len, blocks)) == 7
    np.testing.assert_array_equal(np.concatenate(blocks).ravel(), TIME)
    content = path.read_bytes()
    cycles = (50).to_bytes(8, "little")
    path.write_bytes(content.replace(cycles, (60).to_bytes(8, "little"), 1))
    broken = mdf.tables(path)
    with pytest.raises(RecordingError, match=r"group 1 ends after 50 of 60 samples"):
        whole(broken[0], [1])
    path.write_bytes(content.replace(cycles, (10**12).to_bytes(8, "little"), 1))
    with pytest.raises(RecordingError, match=r"1000000000000 samples of \d+ bytes, more than"):
        opened(path, "mdf")
    path.write_bytes(content[:300])
    with pytest.raises(RecordingError, match=r"MDF file cannot be read|no group of it|fell over"):
        opened(path, "mdf")
    path.write_bytes(b"UnFinMF " + bytes(600))
    with pytest.raises(RecordingError, match="never finished"):
        opened(path, "mdf")
