"""Files as other programs write them, made up after their documents and public samples."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

import h5py
import numpy as np
import scipy.io

N = 50
TIME = np.arange(N) * 0.01
RATE = np.round(np.sin(TIME), 6)
TORQUE = np.round(np.cos(TIME) * 3, 6)

CSV = "time [s],rate [deg/s],torque (N m)\n0.00,1.5,-2\n0.01,1.6,-2.25\n0.02,1.7,-2.5\n"

GERMAN = "Zeit [ms];Drehzahl [1/min];Moment (Nm)\n0;1.234,5;-0,2\n1;1.235,5;-0,3\n2;1.236,0;-0,1\n"

LVM = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\n"
    "Multi_Headings\tYes\nX_Columns\tOne\nTime_Pref\tRelative\nOperator\tlab\n"
    "***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t3\t3\t\nY_Unit_Label\tN m\tdeg\t\nX0\t0,0\t0,0\t\n"
    "Delta_X\t0,001\t0,001\t\n***End_of_Header***\t\t\t\n"
    "X_Value\ttorque\tangle\tComment\n"
    "0,000\t1,5\t2\tstart\n0,001\t1,6\t3\n0,002\t1,7\t4\n\n"
    "Channels\t2\t\t\nSamples\t2\t2\t\nY_Unit_Label\tN m\tdeg\t\nX0\t0,0\t0,0\t\n"
    "Delta_X\t0,001\t0,001\t\n***End_of_Header***\t\t\t\n"
    "X_Value\ttorque\tangle\tComment\n"
    "0,000\t2,5\t2\t\n0,001\t2,6\t3\t\n"
)

RIGOL = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.0e-03,2.0e-04\n0,1.5,2,\n1,1.6,3,\n"

TWINCAT = (
    "Name\tScope Project\nFile\tC:\\x.tcscopex\n"
    "Starttime of export\t133500000000000000\tMontag, 2. Mai 2024\n\n\n"
    "Name\tActPos\tName\tActTorque\tSetVelo\n"
    "Data-Type\tREAL64\tData-Type\tINT16\tREAL64\n"
    "SampleTime[ms]\t1\tSampleTime[ms]\t2\t2\n"
    "SymbolName\tAxis.ActPos\tSymbolName\tAxis.Trq\tAxis.Velo\n"
    "Unit\tdeg (Angle)\tUnit\tNm (Torque)\t(None)\n\n"
    "0\t1,5\t0\t3\t4,5\n1\t1,6\t2\t4\t4,6\n2\t1,7\t4\t5\t4,7\n3\t1,8\t\t\t\nEOF\n"
)


def mat(path: Path, version: str = "5") -> None:
    values = {"t": TIME, "w": RATE, "both": np.column_stack([RATE, TORQUE]), "gain": 35.15}
    scipy.io.savemat(path, values, format=version)


def dspace(path: Path) -> None:
    signals = [
        {"Name": "w", "Path": "Model Root/w", "Unit": "rad/s", "Data": RATE, "XIndex": 1.0},
        {"Name": "tau", "Path": "Model Root/tau", "Unit": "Nm", "Data": TORQUE[::2], "XIndex": 2.0},
    ]
    clocks = [{"Name": "", "Data": TIME}, {"Name": "", "Data": TIME[::2]}]
    scipy.io.savemat(path, {"rec1_001": {"X": clocks, "Y": signals}})


def simulink(path: Path) -> None:
    signals = [{"values": RATE, "label": "w"}, {"values": np.column_stack([RATE, TORQUE])}]
    scipy.io.savemat(path, {"out": {"time": TIME, "signals": signals}})


def mat73(path: Path) -> None:
    """As MATLAB writes it: a user block, classes as attributes, everything transposed."""

    def put(group: h5py.Group, name: str, array: np.ndarray, kind: str = "double") -> None:
        group.create_dataset(name, data=array).attrs["MATLAB_class"] = np.bytes_(kind)

    with h5py.File(path, "w", userblock_size=512) as file:
        put(file, "t", TIME[None, :])
        put(file, "both", np.vstack([RATE, TORQUE]))
        put(file, "name", np.array([[ord(c) for c in "rig"]], dtype="u2").T, "char")
        group = file.create_group("rec")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        put(group, "tau", TORQUE[None, :])
    with path.open("r+b") as file:
        text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64"
        file.write(text.ljust(124) + b"\x00\x02IM")


def hdf5(path: Path) -> None:
    with h5py.File(path, "w") as file:
        file["run/t"] = TIME
        file["run/tau"] = TORQUE
        file["run/tau"].attrs["units"] = "N m"
        file["run/itself"] = file["run"]
        file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/x")
        file["soft"] = h5py.SoftLink("/run/t")


def text(content: str, encoding: str = "utf-8") -> Callable[[Path], None]:
    return lambda path: path.write_text(content, encoding=encoding, newline="") and None


def parquet(path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet as library

    library.write_table(pa.table({"t": TIME, "w": RATE, "tau": TORQUE}), path)


def tdms(path: Path) -> None:
    import nptdms

    waveform = {"wf_increment": 0.01, "wf_start_offset": 0.0}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", "w", RATE, waveform)])


def workbook(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    book.active.append(["t [s]", "w [rad/s]"])
    for row in zip(TIME.tolist(), RATE.tolist(), strict=True):
        book.active.append(row)
    book.save(path)


def mdf(path: Path) -> None:
    import asammdf

    with asammdf.MDF(version="4.10") as file:
        file.append([asammdf.Signal(RATE, TIME, name="w", unit="rad/s")])
        file.save(path)


MADE: dict[str, Callable[[Path], None]] = {
    "plain.csv": text(CSV),
    "german.csv": text(GERMAN, "cp1252"),
    "wide.txt": text(CSV.replace(",", "\t"), "utf-16"),
    "old.lvm": text(LVM),
    "scope.csv": text(TWINCAT),
    "v5.mat": mat,
    "v4.mat": lambda path: scipy.io.savemat(path, {"t": TIME, "w": RATE}, format="4"),
    "dspace.mat": dspace,
    "simulink.mat": simulink,
    "v73.mat": mat73,
    "plain.h5": hdf5,
    "NewFile1.csv": text(RIGOL),
}
"""How each file is made, by its name."""
LIBRARIES = {"a.parquet": "pyarrow", "a.tdms": "nptdms", "a.xlsx": "openpyxl", "a.mf4": "asammdf"}
"""Of files that an optional library makes and reads, which."""
MADE |= {
    name: how
    for name, how in zip(LIBRARIES, (parquet, tdms, workbook, mdf), strict=True)
    if find_spec(LIBRARIES[name])
}
