"""Ten recordings as a laboratory hands them over, of rigs simulated without this program.

Inertias from 1e-4 to 1e3 kg m^2, carriages of 12 to 400 kg. Each file is what one program or one
habit makes: columns, units, headings and clocks of its own. What the laboratory knows of its rig
besides (a torque constant, counts of a turn) stands beside the file, and what is true as well.
Semi-implicit Euler; friction holds what does not overcome it (Karnopp).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
import scipy.io
from numpy.typing import NDArray

Array = NDArray[np.float64]
DEG, RPM = 180 / math.pi, 30 / math.pi
FINE = 5  # steps of integration in a sample


@dataclass(frozen=True)
class Rig:
    """What moves (SI): friction of each direction; static friction over Coulomb friction.

    Attributes:
        stribeck: rate over which static falls to Coulomb friction.
        hiss: noise of the recorded torque (1 sigma), as a share of Coulomb friction.
        step: of the recorded position; its rate is filtered from the true one.
    """

    inertia: float
    coulomb: tuple[float, float]
    viscous: tuple[float, float]
    fastest: float
    static: float = 1.0
    stribeck: float = 1.0
    hiss: float = 0.01
    step: float = 0.0

    @property
    def truth(self) -> dict[str, float]:
        """By the names and directions of parameters."""
        return {
            "inertia": self.inertia,
            "coulomb positive": self.coulomb[0],
            "coulomb negative": self.coulomb[1],
            "viscous positive": self.viscous[0],
            "viscous negative": self.viscous[1],
        }


@dataclass(frozen=True)
class Moved:
    """What sensors saw, shape (n,) each; SI."""

    t: Array
    q: Array
    v: Array
    tau: Array
    wanted: Array


@dataclass(frozen=True)
class Laboratory:
    """A hand-over.

    Attributes:
        name: what the rig is.
        files: of one hand-over, as given to `--guess`.
        write: makes the files in a folder.
        rig: what is true.
        linear: whether it moves along a line.
        units: what the laboratory knows of columns without a unit, by channel.
        channels: what it knows of columns that no rule knows: channel and unit by column.
        times: constants of channels that measure something else, such as a current.
    """

    name: str
    files: tuple[str, ...]
    write: Callable[[Path], None]
    rig: Rig
    linear: bool = False
    units: Mapping[str, str] = field(default_factory=dict)
    channels: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    times: Mapping[str, str] = field(default_factory=dict)


def staircase(rig: Rig, seconds: float, rate: float, levels: int = 4) -> Array:
    """Wanted rates: to and fro at several speeds, with ramps, shape (n,)."""
    t = np.arange(round(seconds * rate)) / rate
    stroke = seconds / (2 * levels)
    speeds = rig.fastest * np.linspace(1.0, 0.12, levels)
    place = np.minimum((t / stroke).astype(int), 2 * levels - 1)
    x = t - place * stroke
    edge = np.clip(np.minimum(x, stroke - x) / (0.15 * stroke), 0, 1)
    return np.asarray(speeds[place // 2] * np.where(place % 2, -1.0, 1.0) * edge)


def sines(rig: Rig, seconds: float, rate: float, seed: int, most: float = 2.0) -> Array:
    """Wanted rates: five sines up to `most` Hz that begin at rest, shape (n,)."""
    draw = np.random.default_rng(seed)
    t = np.arange(round(seconds * rate)) / rate
    v = sum(
        np.sin(2 * np.pi * f * t + draw.uniform(0, 6)) for f in np.geomspace(0.15, most, 5)
    ) * np.minimum(1, t)
    return np.asarray(rig.fastest * v / np.abs(v).max())


def moved(rig: Rig, rate: float, seed: int, wanted: Array, bandwidth: float = 8.0) -> Moved:
    """The rig in a position loop along a wanted rate, shape (n,); sampled at `rate`."""
    draw = np.random.default_rng(seed)
    n, h = len(wanted), 1 / rate / FINE
    omega = 2 * math.pi * bandwidth
    stiff, damped = rig.inertia * omega**2, 1.6 * rig.inertia * omega
    path = np.cumsum(wanted) / rate
    hiss = rig.hiss * rig.coulomb[0]
    shaking = draw.normal(0, hiss, n).tolist()
    q = v = 0.0
    seen = np.zeros((n, 3))
    for k, (goal, at) in enumerate(zip(wanted.tolist(), path.tolist(), strict=True)):
        measured = round(q / rig.step) * rig.step if rig.step else q
        push = stiff * (at - measured) + damped * (goal - v)
        seen[k] = measured, v, push
        for _ in range(FINE):
            fall = 1 + (rig.static - 1) * math.exp(-((v / rig.stribeck) ** 2))
            drive = push + shaking[k]
            up, down = rig.coulomb[0] * fall, rig.coulomb[1] * fall
            if v == 0:
                net = drive - up if drive > up else drive + down if drive < -down else 0.0
            elif v > 0:
                net = drive - up - rig.viscous[0] * v
            else:
                net = drive + down - rig.viscous[1] * v
            new = v + h * net / rig.inertia
            new = 0.0 if v * new < 0 else new
            q, v = q + h * (v + new) / 2, new
    t = np.arange(n) / rate
    return Moved(
        t,
        seen[:, 0],
        seen[:, 1] + draw.normal(0, 1e-3 * rig.fastest, n),
        seen[:, 2] + draw.normal(0, hiss, n),
        path,
    )


def table(
    path: Path,
    columns: Mapping[str, Array],
    *,
    separator: str = ",",
    decimal: str = ".",
    head: str = "",
    form: str = "%.9g",
    codec: str = "utf-8",
) -> None:
    rows = np.column_stack(list(columns.values()))
    lines = [separator.join(form % value for value in row) for row in rows]
    body = "\n".join(lines).replace(".", decimal)
    names = separator.join(columns)
    path.write_text(f"{head}{names}\n{body}\n", encoding=codec)


# --- the ten -------------------------------------------------------------------------------------

SPINDLE = Rig(1e-4, (4e-3, 4.4e-3), (1.2e-5, 1.5e-5), fastest=150.0, hiss=0.02)
SPINDLE_CONSTANT = 0.0235  # N m/A


def spindle(folder: Path) -> None:
    """A small DC motor on a data logger: ms, rpm and A."""
    m = moved(SPINDLE, 500, 1, staircase(SPINDLE, 8, 500))
    columns = {"time_ms": m.t * 1e3, "speed_rpm": m.v * RPM, "current_A": m.tau / SPINDLE_CONSTANT}
    table(folder / "spindle.csv", columns, form="%.7g")


TABLE = Rig(2.0, (9.0, 10.0), (4.0, 5.0), fastest=3.0, step=2e-6)


def direct_drive(folder: Path) -> None:
    """A torque motor from Simulink's To Workspace block: a structure with time."""
    m = moved(TABLE, 1000, 2, sines(TABLE, 8, 1000, 2))
    names = {"ref_pos": m.wanted, "pos": m.q, "torque": m.tau}
    signals = [
        {"values": values[:, None], "dimensions": 1.0, "label": name, "blockName": f"rig/{name}"}
        for name, values in names.items()
    ]
    whole = {"time": m.t[:, None], "signals": signals, "blockName": "rig/To Workspace"}
    scipy.io.savemat(folder / "directdrive.mat", {"simout": whole})


SLIDE = Rig(12.0, (14.0, 12.0), (40.0, 48.0), fastest=0.5, step=1e-6)


def linear_motor(folder: Path) -> None:
    """An ironless linear motor, recorded by dSPACE ControlDesk."""
    m = moved(SLIDE, 1000, 3, staircase(SLIDE, 8, 1000))
    names = {"x_meas": ("m", m.q), "x_ref": ("m", m.wanted), "F_mot": ("N", m.tau)}
    signals = [
        {"Name": f'"{n}"', "Path": f"Model Root/{n}", "Unit": unit, "Data": data, "XIndex": 1.0}
        for n, (unit, data) in names.items()
    ]
    scipy.io.savemat(
        folder / "slide_003.mat",
        {"slide_003": {"X": [{"Name": "Time", "Data": m.t}], "Y": signals}},
    )


JOINT = Rig(0.05, (0.6, 0.66), (0.03, 0.035), fastest=6.0, step=1e-5)


def joint(folder: Path) -> None:
    """A robot's joint, one signal a file, without headings."""
    m = moved(JOINT, 1000, 4, sines(JOINT, 8, 1000, 4))
    for name, values in {
        "position_rad": m.q,
        "torque_Nm": m.tau,
        "position_ref_rad": m.wanted,
    }.items():
        table(folder / f"{name}.txt", {"t": m.t, name: values}, separator="\t")


SCREW = Rig(
    80.0, (110.0, 120.0), (600.0, 700.0), fastest=0.12, static=1.3, stribeck=0.006, step=1e-7
)


def ball_screw(folder: Path) -> None:
    """A screw-driven carriage from LabVIEW: mm and N, a header of its own."""
    m = moved(SCREW, 1000, 5, staircase(SCREW, 8, 1000))
    n = len(m.t)
    head = (
        "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
        "Decimal_Separator\t.\nMulti_Headings\tNo\nX_Columns\tOne\nTime_Pref\tRelative\n"
        "Operator\tlab\nDate\t2024/05/02\nTime\t10:31:00\n***End_of_Header***\t\n\t\n"
        f"Channels\t2\t\nSamples\t{n}\t{n}\nY_Unit_Label\tmm\tN\nX_Dimension\tTime\tTime\n"
        "X0\t0.0\t0.0\nDelta_X\t0.001\t0.001\n***End_of_Header***\t\t\n"
    )
    columns = {"X_Value": m.t, "Position": m.q * 1e3, "Force": m.tau}
    table(folder / "carriage.lvm", columns, separator="\t", head=head)


INDEXER = Rig(1.0, (16.0, 16.0), (3.0, 3.0), fastest=4.0, hiss=0.01)
RATED = 80.0  # N m


def indexer(folder: Path) -> None:
    """A rotary indexer from TwinCAT Scope: a time column for each channel, torque in % of rated."""
    m = moved(INDEXER, 1000, 6, staircase(INDEXER, 8, 1000))
    head = (
        "Name\tScope Project\nFile\tC:\\scope\\indexer.tcscopex\n"
        "Starttime of export\t133500000000000000\tThursday, 2. May 2024\n\n\n"
        "Name\tActPos\tName\tActVelo\tName\tActTorque\n"
        "Data-Type\tREAL64\tData-Type\tREAL64\tData-Type\tREAL32\n"
        "SampleTime[ms]\t1\tSampleTime[ms]\t1\tSampleTime[ms]\t1\n"
        "SymbolName\tMAIN.Axis.NcToPlc.ActPos\tSymbolName\tMAIN.Axis.NcToPlc.ActVelo\t"
        "SymbolName\tMAIN.Drive.ActTorque\n"
        "Unit\tdeg (Angle)\tUnit\tdeg/s (Angular velocity)\tUnit\t%\n\n"
    )
    t = m.t * 1e3
    rows = np.column_stack([t, m.q * DEG, t, m.v * DEG, t, m.tau / RATED * 100])
    lines = ["\t".join(f"{value:.9g}" for value in row) for row in rows]
    (folder / "indexer.csv").write_text(head + "\n".join(lines) + "\nEOF\n")


TURRET = Rig(1000.0, (300.0, 330.0), (500.0, 560.0), fastest=0.5)


def turret(folder: Path) -> None:
    """A turret, from a German data logger: semicolons, decimal commas, degrees and kN m."""
    m = moved(TURRET, 500, 7, sines(TURRET, 20, 500, 7, most=1.2), bandwidth=4)
    columns = {
        "Zeit [s]": m.t,
        "Winkel [°]": m.q * DEG,
        "Drehzahl [1/min]": m.v * RPM,
        "Drehmoment [kNm]": m.tau / 1e3,
    }
    table(folder / "turm.csv", columns, separator=";", decimal=",", codec="cp1252")


FEEDER = Rig(0.02, (0.25, 0.28), (0.004, 0.005), fastest=20.0, step=2 * math.pi / 65536)
COUNTS, FEEDER_CONSTANT = 65536, 0.31  # of a turn; N m/A


def feeder(folder: Path) -> None:
    """A servo that somebody kept in a workbook: an encoder in counts, the motor's current."""
    import openpyxl

    m = moved(FEEDER, 500, 8, staircase(FEEDER, 8, 500), bandwidth=6)
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet("Recording")
    sheet.append(["Time (s)", "Encoder (counts)", "Motor current (A)"])
    counts = np.round(m.q * COUNTS / 2 / math.pi)
    for row in np.column_stack([m.t, counts, m.tau / FEEDER_CONSTANT]).tolist():
        sheet.append(row)
    book.save(folder / "feeder.xlsx")


GANTRY = Rig(400.0, (250.0, 250.0), (900.0, 900.0), fastest=1.0, step=1e-6)


def gantry(folder: Path) -> None:
    """A gantry: HDF5 with attributes of units."""
    m = moved(GANTRY, 1000, 9, sines(GANTRY, 8, 1000, 9, most=1.5), bandwidth=5)
    with h5py.File(folder / "gantry.h5", "w") as file:
        for name, (values, unit) in {
            "time": (m.t, "s"),
            "x": (m.q, "m"),
            "dx": (m.v, "m/s"),
            "force": (m.tau, "N"),
        }.items():
            file[f"run1/{name}"] = values
            file[f"run1/{name}"].attrs["units"] = unit


GIMBAL = Rig(0.3, (2.0, 2.2), (0.5, 0.6), fastest=1.5, static=1.25, stribeck=0.02, step=1e-6)
SPEEDS = (0.4,)
SWEEP = tuple(
    f"const_{'p' if sign > 0 else 'm'}{speed:g}.csv" for speed in SPEEDS for sign in (1, -1)
)


def gimbal(folder: Path) -> None:
    """A gimbal in several files: constant speeds, and a chirp."""
    t = np.arange(2000) / 1000
    for k, name in enumerate(SWEEP):
        speed = SPEEDS[k // 2] * (1, -1)[k % 2]
        goal = speed * np.clip(t / 0.3, 0, 1)
        _gimbal_file(folder / name, moved(GIMBAL, 1000, 20 + k, goal, bandwidth=6))
    t = np.arange(10000) / 1000
    chirp = GIMBAL.fastest * np.sin(2 * np.pi * (0.1 * t + (4 - 0.1) / 20 * t**2))
    _gimbal_file(folder / "chirp.csv", moved(GIMBAL, 1000, 60, chirp))


def _gimbal_file(path: Path, m: Moved) -> None:
    columns = {"t[s]": m.t, "theta[rad]": m.q, "omega[rad/s]": m.v, "T_m[Nm]": m.tau}
    table(path, columns)


LABORATORIES = (
    Laboratory("spindle", ("spindle.csv",), spindle, SPINDLE,
               times={"drive_torque": f"{SPINDLE_CONSTANT} N m/A"}),
    Laboratory("direct drive", ("directdrive.mat",), direct_drive, TABLE,
               units={"relative_angle": "rad", "reference": "rad", "drive_torque": "N m",
                      "time": "s"}),
    Laboratory("linear motor", ("slide_003.mat",), linear_motor, SLIDE, linear=True),
    Laboratory("joint", ("position_rad.txt", "torque_Nm.txt", "position_ref_rad.txt"), joint,
               JOINT),
    Laboratory("ball screw", ("carriage.lvm",), ball_screw, SCREW, linear=True),
    Laboratory("indexer", ("indexer.csv",), indexer, INDEXER,
               times={"drive_torque": f"{RATED / 100} N m/%"}),
    Laboratory("turret", ("turm.csv",), turret, TURRET),
    Laboratory("feeder", ("feeder.xlsx",), feeder, FEEDER,
               times={"relative_angle": f"1/{COUNTS} rev/count",
                      "drive_torque": f"{FEEDER_CONSTANT} N m/A"}),
    Laboratory("gantry", ("gantry.h5",), gantry, GANTRY, linear=True),
    Laboratory("gimbal", (*SWEEP, "chirp.csv"), gimbal, GIMBAL),
)  # fmt: skip
