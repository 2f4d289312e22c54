"""Exports of measuring programs: every channel with its clock, its unit, and nothing invented."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from scipy.io.matlab import MatlabOpaque

from campaign.importing.formats import hdf5, tdms
from campaign.importing.formats import mat as mat_format
from campaign.importing.interface import Clock, RecordingError
from tests.importing.files import LVM, MADE, RATE, RIGOL, TIME, TORQUE, TWINCAT, N, mat
from tests.importing.whole import headings, opened, whole

OPAQUE_FIELDS = ("s0", "s1", "s2", "arr")


def made(folder: Path, name: str) -> Path:
    MADE[name](folder / name)
    return folder / name


# LabVIEW


def test_blocks_of_labview_are_tables(tmp_path):
    first, second = opened(made(tmp_path, "old.lvm"), "lvm")
    assert headings(first) == [("time", "s"), ("torque", "N m"), ("angle", "deg")]
    np.testing.assert_array_equal(
        whole(first), [[0, 1.5, 2], [0.001, 1.6, 3], [0.002, 1.7, 4]]
    )  # the comment is no channel
    np.testing.assert_array_equal(whole(second), [[0, 2.5, 2], [0.001, 2.6, 3]])


def test_without_times_the_clock_is_in_the_heading(tmp_path):
    path = tmp_path / "a.lvm"
    text = LVM.replace("X_Columns\tOne", "X_Columns\tNo")
    for time in ("0,000", "0,001", "0,002"):
        text = text.replace(f"\n{time}\t", "\n\t")
    path.write_text(text)
    first, _ = opened(path, "lvm")
    assert headings(first) == [("torque", "N m"), ("angle", "deg")]
    assert first.clock == Clock(0.001)
    path.write_text(text.replace("Delta_X\t0,001\t0,001", "Delta_X\t0,001\t0,01"))
    torque, angle, *_ = opened(path, "lvm")
    assert (torque.clock, angle.clock) == (Clock(0.001), Clock(0.01))
    assert whole(angle).ravel().tolist() == [2, 3, 4]
    path.write_text(text.replace("Delta_X", "Delta_Y"))
    with pytest.raises(RecordingError, match="states no X0 and Delta_X"):
        opened(path, "lvm")


def test_channels_with_times_of_their_own_are_apart(tmp_path):
    path = tmp_path / "multi.lvm"
    text = LVM[: LVM.index("X_Value")].replace("X_Columns\tOne", "X_Columns\tMulti")
    text += "X_Value\ttorque\tX_Value\tangle\tComment\n0,0\t1\t0,5\t2\n0,1\t3\t0,6\t4\n"
    path.write_text(text)
    torque, angle = opened(path, "lvm")
    assert headings(angle) == [("time", "s"), ("angle", "deg")]
    assert whole(torque).tolist() == [[0, 1], [0.1, 3]]
    assert whole(angle).tolist() == [[0.5, 2], [0.6, 4]]


# Oscilloscopes


def test_a_scope_that_counts_samples_states_their_clock(tmp_path):
    path = tmp_path / "NewFile1.csv"
    path.write_text(RIGOL)
    (table,) = opened(path, "rigol")
    assert table.clock == Clock(2e-4, -1e-3)
    assert headings(table) == [("X", ""), ("CH1", "Volt"), ("CH2", "Volt")]
    assert whole(table).tolist() == [[0, 1.5, 2], [1, 1.6, 3]]
    path.write_text(RIGOL.replace("2.0e-04", ""))
    with pytest.raises(RecordingError, match=r"NewFile1.csv:2:1: below Start and Increment"):
        opened(path, "rigol")
    path.write_text(RIGOL.split("\n0,")[0] + "\n")
    with pytest.raises(RecordingError, match="no row of numbers"):
        opened(path, "rigol")


# TwinCAT


def test_clocks_of_twincat_are_tables(tmp_path):
    fast, slow = opened(made(tmp_path, "scope.csv"), "twincat")
    assert headings(fast) == [("time", "ms"), ("ActPos", "deg")]
    assert headings(slow) == [("time", "ms"), ("ActTorque", "Nm"), ("SetVelo", "")]
    assert whole(fast).tolist() == [[0, 1.5], [1, 1.6], [2, 1.7], [3, 1.8]]
    assert whole(slow).tolist() == [[0, 3, 4.5], [2, 4, 4.6], [4, 5, 4.7]]
    assert whole(slow, [2]).tolist() == [[4.5], [4.6], [4.7]]


def test_a_channel_of_twincat_that_skips_a_time_is_not_cut_short_silently(tmp_path):
    path = tmp_path / "scope.csv"
    path.write_text(TWINCAT.replace("2\t1,7\t4\t5\t4,7", "2\t1,7\t\t5\t4,7"))
    _, slow = opened(path, "twincat")
    with pytest.raises(RecordingError, match=r"scope.csv:14:1: values without a time"):
        whole(slow)


# MATLAB


def test_variables_of_one_length_stand_together(tmp_path):
    (table,) = opened(made(tmp_path, "v5.mat"), "mat")
    assert [name for name, _ in headings(table)] == ["t", "w", "both(:,1)", "both(:,2)"]
    np.testing.assert_array_equal(whole(table), np.column_stack([TIME, RATE, RATE, TORQUE]))


def test_version_4_has_no_mark_of_its_own(tmp_path):
    (table,) = opened(made(tmp_path, "v4.mat"), "mat")
    np.testing.assert_array_equal(whole(table), np.column_stack([TIME, RATE]))


def test_rows_of_a_matrix_are_named_as_rows(tmp_path):
    path = tmp_path / "quarc.mat"
    scipy.io.savemat(path, {"data": np.vstack([TIME, RATE])})
    (table,) = opened(path, "mat")
    assert [name for name, _ in headings(table)] == ["data(1,:)", "data(2,:)"]
    np.testing.assert_array_equal(whole(table, [1]).ravel(), RATE)


def test_objects_beside_numbers_are_left_out(tmp_path, monkeypatch):
    """A design of MATLAB's toolboxes beside a recording; of it alone there is nothing to read."""
    design = MatlabOpaque(np.array([("", "MCOS", "tf", 1)], [(k, "O") for k in OPAQUE_FIELDS]))
    numbers = {"t": TIME, "w": RATE, "fs": np.float64(1000.0), "plan": design}
    for held, columns in ((numbers, ["t", "w"]), ({"plan": design}, [])):
        monkeypatch.setattr(scipy.io, "loadmat", lambda *_, h=held, **__: {**h, "None": design})
        if not columns:
            with pytest.raises(RecordingError, match="plan is an object of a MATLAB class"):
                mat_format.tables(tmp_path / "bench.mat")
            continue
        (table,) = mat_format.tables(tmp_path / "bench.mat")
        assert [name for name, _ in headings(table)] == columns


def test_whole_numbers_do_not_wrap_around(tmp_path):
    """MATLAB writes doubles that are whole as bytes: 1 - 2 would be 255."""
    path = tmp_path / "counts.mat"
    counts = np.array([1.0, 2.0, 1.0, 250.0])
    scipy.io.savemat(path, {"n": counts.astype(np.uint8)})
    (table,) = opened(path, "mat")
    assert np.diff(whole(table).ravel()).tolist() == [1, -1, 249]


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_small_file_that_unpacks_to_too_much_is_refused_unread(tmp_path, monkeypatch, order):
    """Counted, whatever its headers say; what is measured does not pack so well."""
    noise = np.random.default_rng(1).normal(size=100_000)
    scipy.io.savemat(tmp_path / "noise.mat", {"x": noise, "y": noise[::-1]}, do_compression=True)
    packed = zlib.compress(struct.pack(f"{order}2I", 14, 48) + bytes(4 << 20))
    parts = struct.pack(f"{order}2I", 15, len(packed)) + packed
    version = b"\x00\x01IM" if order == "<" else b"\x01\x00MI"
    bomb = tmp_path / "bomb.mat"
    bomb.write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + version + 3 * parts)
    monkeypatch.setattr(mat_format, "LARGEST_PART", 1 << 20)
    mat_format.tables(tmp_path / "noise.mat")
    monkeypatch.setattr(mat_format, "LARGEST_PART", 10 << 20)
    monkeypatch.setattr(scipy.io, "loadmat", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(RecordingError, match=r"unpacks to more than 0\.0105 GB, which is too much"):
        mat_format.tables(bomb)


def test_signals_of_dspace_have_the_clock_they_name(tmp_path):
    fast, slow = opened(made(tmp_path, "dspace.mat"), "mat")
    assert headings(fast) == [("time", "s"), ("w", "rad/s")]
    assert headings(slow) == [("time", "s"), ("tau", "Nm")]
    np.testing.assert_array_equal(whole(fast), np.column_stack([TIME, RATE]))
    np.testing.assert_array_equal(whole(slow), np.column_stack([TIME[::2], TORQUE[::2]]))


def test_a_signal_whose_clock_cannot_be_told_is_not_given_one(tmp_path):
    path = tmp_path / "two.mat"
    clocks = [{"Data": TIME}, {"Data": TIME * 2}, {"Data": TIME[::2]}]
    signals = [{"Name": "w", "Data": RATE}, {"Name": "tau", "Data": TORQUE[::2]}]
    scipy.io.savemat(path, {"rec": {"X": clocks, "Y": signals}})
    (table,) = opened(path, "mat")
    assert [name for name, _ in headings(table)] == ["time", "tau"]


def test_structures_of_simulink_have_their_time(tmp_path):
    (table,) = opened(made(tmp_path, "simulink.mat"), "mat")
    assert [name for name, _ in headings(table)] == [
        "time",
        "w",
        "signals(2)(:,1)",
        "signals(2)(:,2)",
    ]
    np.testing.assert_array_equal(whole(table, [0, 3]), np.column_stack([TIME, TORQUE]))


def test_version_7_3_is_read_in_parts(tmp_path, monkeypatch):
    monkeypatch.setattr("campaign.importing.arrays.ROWS", 7)
    path = made(tmp_path, "v73.mat")
    (here,) = hdf5.tables(path)  # as the other process has it
    assert max(len(block) for block in here.read([0, 3])) == 7
    (table,) = opened(path, "hdf5")
    assert [name for name, _ in headings(table)] == ["both(:,1)", "both(:,2)", "t", "rec.tau"]
    for values in (whole(table), whole(here)):
        np.testing.assert_array_equal(values, np.column_stack([RATE, TORQUE, TIME, TORQUE]))


# HDF5


def test_nothing_outside_a_file_is_opened(tmp_path):
    (table,) = opened(made(tmp_path, "plain.h5"), "hdf5")
    assert headings(table) == [("run.t", ""), ("run.tau", "N m")]
    np.testing.assert_array_equal(whole(table), np.column_stack([TIME, TORQUE]))


# Parquet


def test_columns_of_parquet_have_their_units(tmp_path, monkeypatch):
    pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed")
    from pyarrow import parquet

    monkeypatch.setattr("campaign.importing.formats.parquet.ROWS", 7)
    fields = [
        pa.field("t", pa.float64(), metadata={"unit": "s"}),
        pa.field("w", pa.float32(), metadata={"units": "rad/s"}),
        pa.field("mode", pa.string()),
        pa.field("w", pa.int16()),
    ]
    counts = np.arange(N, dtype=np.int16)
    schema = pa.schema(fields)
    values = [TIME, RATE.astype(np.float32), ["run"] * N, counts]
    path = tmp_path / "a.parquet"
    parquet.write_table(pa.table(values, schema=schema), path)
    (table,) = opened(path, "parquet")
    assert headings(table) == [("t", "s"), ("w", "rad/s"), ("mode", ""), ("w", "")]
    assert [column.numeric for column in table.columns] == [True, True, False, True]
    np.testing.assert_array_equal(
        whole(table), np.column_stack([TIME, RATE.astype(np.float32), counts])
    )
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(RecordingError, match="this Parquet file cannot be read"):
        opened(path, "parquet")


# TDMS


def test_channels_of_tdms_have_the_clock_of_their_waveform(tmp_path, monkeypatch):
    nptdms = pytest.importorskip("nptdms", reason="npTDMS is not installed")
    monkeypatch.setattr("campaign.importing.formats.tdms.ROWS", 7)
    waveform = {"wf_increment": 0.01, "wf_start_offset": 0.5, "unit_string": "rad/s"}
    path = tmp_path / "a.tdms"
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.RootObject({"Operator": "lab"}),
                nptdms.ChannelObject("rig", "w", RATE, waveform),
                nptdms.ChannelObject("rig", "tau", TORQUE, {**waveform, "unit_string": "N m"}),
                nptdms.ChannelObject("rig", "half", TORQUE, {"wf_increment": 0.01}),
            ]
        )
    here = tdms.tables(path)[0]  # as the other process has it
    assert max(len(block) for block in here.read([0])) == 7
    np.testing.assert_array_equal(whole(here), np.column_stack([RATE, TORQUE]))
    clocked, other = opened(path, "tdms")
    assert headings(clocked) == [("w", "rad/s"), ("tau", "N m")]
    assert clocked.clock == Clock(0.01, 0.5)
    np.testing.assert_array_equal(whole(clocked), np.column_stack([RATE, TORQUE]))
    assert (headings(other), other.clock) == ([("half", "")], None)
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(RecordingError, match=r"TDMS file cannot be read|no channel of it"):
        opened(path, "tdms")


# What a hard look found


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (("0,001\t1,6\t3\n", "0,001\t1,6\t3\n\n"), "21:1: a row of numbers behind an empty line"),
        (("0,000\t2,5\t2\t\n0,001\t2,6\t3\t\n", ""), "a block without any row"),
    ],
)
def test_nothing_of_a_block_of_labview_is_left_out_silently(tmp_path, change, what):
    path = tmp_path / "a.lvm"
    path.write_text(LVM.replace(*change))
    with pytest.raises(RecordingError, match=what):
        opened(path, "lvm")


def test_a_separator_that_is_not_told_is_a_tab(tmp_path):
    path = tmp_path / "a.lvm"
    path.write_text(LVM.replace("Separator\tTab", "Separator"))
    assert len(opened(path, "lvm")) == 2


@pytest.mark.usefixtures("started")
def test_nothing_in_the_folder_of_a_file_is_run(tmp_path, monkeypatch):
    mat(tmp_path / "a.mat")
    (tmp_path / "numpy.py").write_text("open('run', 'w')\nraise SystemExit(7)\n")
    monkeypatch.chdir(tmp_path)
    (table,) = opened(tmp_path / "a.mat", "mat")
    assert len(whole(table)) == N
    assert not (tmp_path / "run").exists()


def test_empty_datasets_and_circles_are_passed_over(tmp_path):
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        file["t"] = TIME
        file["nothing"] = h5py.Empty("f8")
        file["group/root"] = file["/"]
    (table,) = opened(path, "hdf5")
    assert [name for name, _ in headings(table)] == ["t"]
