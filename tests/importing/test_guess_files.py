"""From files that nobody described to a report, by no more than what a guessed mapping asks for."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

from campaign.cli.import_command import guess_mapping
from campaign.errors import ProtocolError
from campaign.importing.guess import Basis, ColumnGuess, guess, mapping_text
from campaign.importing.interface import RecordingError
from tests.importing import rig
from tests.importing.newcomer import completed, imported
from tests.importing.test_mapping import planned, served
from tests.importing.wild import DEG, text, together


def check_coulomb(found: Any) -> None:
    own = found[found.quantity == "coulomb_torque"]
    assert len(own)
    assert np.all(np.abs(own.value - rig.COULOMB) < 0.05 * rig.COULOMB)


@pytest.mark.slow
def test_two_joints_every_15_ms_with_odd_names(tmp_path: Path):
    """Degrees, whole milliseconds, milliamperes; no torque but what the current makes."""
    one, two = (rig.trapezoids(seed, rate=1 / 0.015, length=60.0) for seed in (70, 71))
    columns = [one.t * 1000.0]
    for m in (one, two):
        columns += [m.q * DEG, m.v * DEG, m.i * 1000.0]
    names = [f"{j}_{w}" for j in ("Schulter", "Ellbogen") for w in ("Winkel", "Geschw", "Strom")]
    head = ";".join(["Zeitstempel", *names]) + "\n"
    text(together(*columns), head, ";", ",")(tmp_path / "log.csv")
    run = imported(
        [tmp_path / "log.csv"],
        units={"motor_current": "mA", "drive_torque": "mA"},
        times=f"{rig.TORQUE_CONSTANT / 1000} N m/mA",
    )
    found = run.results.findings
    assert {"axis_schulter", "axis_ellbogen"} == set(found.test)
    for name in ("axis_schulter", "axis_ellbogen"):
        check_coulomb(found[found.test == name])


@pytest.mark.slow
def test_a_robot_joint_in_one_matrix_of_seven(tmp_path: Path):
    m = rig.trapezoids(72, rate=500.0, length=20.0)
    acceleration = np.gradient(m.v, 1 / 500.0)
    data = np.column_stack([m.t, m.q, m.v, acceleration, m.tau, m.i, 35 + m.t / 10])
    scipy.io.savemat(tmp_path / "joint3.mat", {"data": data, "robot": "arm"})
    (table,) = guess([tmp_path / "joint3.mat"])
    roles = ["time", "relative_angle", "relative_rate", *["unknown"] * 4]
    assert [column.role for column in table.columns] == roles
    assert all("by its numbers alone" in column.why for column in table.columns[:3])
    run = imported(
        [tmp_path / "joint3.mat"],
        units={"relative_angle": "rad", "relative_rate": "rad/s"},
        channels={"data(:,5)": ("drive_torque", "N m"), "data(:,7)": ("temperature", "degC")},
    )
    check_coulomb(run.results.findings)


def test_signals_beside_their_times_in_a_matrix_are_no_axes(tmp_path: Path):
    m = rig.sines(12)
    own = {"theta": np.vstack([m.t, m.target, m.q])}
    scipy.io.savemat(tmp_path / "a.mat", own)
    told = tomllib.loads(mapping_text(guess([tmp_path / "a.mat"])))
    assert [test["name"] for test in told["test"]] == ["recorded"]


@pytest.mark.slow
def test_a_tribometer_with_normal_load_and_sliding_distance(tmp_path: Path):
    """Distance only grows, and friction only opposes: its own force sensor has no direction."""
    chance = np.random.default_rng(5)
    t = np.arange(12_000) / 100.0
    speed = 0.05 * (1.0 + np.floor(t / 30.0))
    friction = 4.0 + 10.0 * speed + chance.normal(0, 0.02, len(t))
    load = 20.0 + chance.normal(0, 0.05, len(t))
    distance = np.cumsum(speed) / 100.0
    rows = together(t, load, friction, friction / load, distance, 23 + t / 50)
    head = (
        "Ball;steel\nTime [s]\tNormal load [N]\tFriction force [N]\tCOF\tSliding distance [m]\t"
        "Temp [°C]\n"
    )
    text(rows, head, "\t")(tmp_path / "pod.txt")
    mapping = mapping_text(guess([tmp_path / "pod.txt"]))
    assert completed(mapping, {}).count("[columns.pod.") == 5
    run = imported([tmp_path / "pod.txt"], units={})
    found = run.results.findings
    own = found[found.quantity == "viscous_friction"]
    assert len(own) == 1
    assert own.low.iloc[0] <= 10.0 <= own.high.iloc[0]
    assert own.unit.iloc[0] == "N s/m"


def test_files_that_are_alike_share_their_columns(tmp_path: Path):
    """Those in another unit have columns of their own, whose numbers would mislead."""
    for number, (size, unit) in enumerate([(DEG, "deg"), (DEG, "deg"), (1.0, "rad")], start=1):
        m = rig.sines(number)
        rows = together(m.t, size * m.q * number, m.tau)
        text(rows, f"time [s],angle [{unit}],torque [Nm]\n")(tmp_path / f"run{number}.csv")
    files = [tmp_path / f"run{number}.csv" for number in (1, 2, 3)]
    found = guess(files)
    told = tomllib.loads(mapping_text(found, tmp_path))
    (test,) = told["test"]
    assert [each["columns"] for each in test["recording"]] == ["run1", "run1", "run3"]
    units = {name: each["relative_angle"]["unit"] for name, each in told["columns"].items()}
    assert units == {"run1": "deg", "run3": "rad"}
    mapping = mapping_text(found)
    assert "# Columns of run1.csv and of 1 more that are alike" in mapping
    assert mapping.count("read as text") == 1  # one remark for all that are alike


def guessed(folder: Path, head: str, *columns: np.ndarray) -> list[ColumnGuess]:
    """The columns of a file a.csv below this heading."""
    text(together(*columns), f"{head}\n")(folder / "a.csv")
    return list(guess([folder / "a.csv"])[0].columns)


def recordings_of(folder: Path, **files: list[Any]) -> list[Any]:
    """What `file` is in each recording of a guess at files that hold these columns."""
    for name, columns in files.items():
        text(together(*columns), "")(folder / f"{name}.t")
    found = guess([folder / f"{name}.t" for name in files])
    (test,) = tomllib.loads(mapping_text(found, folder))["test"]
    return [each["file"] for each in test["recording"]]


def test_files_of_one_signal_each_are_one_recording(tmp_path: Path):
    """Of which channel is what only the files' names say; without times they need a rate."""
    m = rig.trapezoids(3)
    both = ["pos.t", "tau.t"]
    assert recordings_of(tmp_path, pos=[m.t, m.q], tau=[m.t, m.tau]) == [both]
    assert recordings_of(tmp_path, pos=[m.q], tau=[m.tau]) == [both]
    mapping = mapping_text(guess([tmp_path / name for name in both]), tmp_path)
    rate = '[columns.pos.time]\nsample_rate = "1 kHz"\n'
    own = completed(mapping, {"relative_angle": "rad", "drive_torque": "N m"})
    (trial,) = planned(
        tmp_path, own.replace('bench = "rig.toml"', 'bench = "platform"') + rate
    ).trials
    recording, _ = served(trial)
    np.testing.assert_allclose(recording["relative_angle"], m.q, atol=1e-8)
    np.testing.assert_allclose(recording["drive_torque"], m.tau, rtol=1e-5)


@pytest.mark.slow
def test_files_of_other_tests_are_recordings_of_their_own(tmp_path: Path):
    """The same columns; a channel twice; nothing known; several signals; rows that do not match."""
    m = rig.trapezoids(3)
    pos, tau = [m.t, m.q], [m.t, m.tau]
    assert recordings_of(tmp_path, run1=[*pos, m.tau], run2=[*pos, m.tau]) == ["run1.t", "run2.t"]
    assert recordings_of(tmp_path, pos_1=pos, pos_2=pos) == ["pos_1.t", "pos_2.t"]
    assert recordings_of(tmp_path, run1=pos, run2=tau) == ["run1.t", "run2.t"]
    assert recordings_of(tmp_path, pos=pos, both=[*pos, m.tau]) == ["pos.t", "both.t"]
    assert recordings_of(tmp_path, pos=[m.q], tau=[m.tau[:-1]]) == ["pos.t", "tau.t"]
    assert recordings_of(tmp_path, pos=pos, tau=[m.t * 1000, m.tau]) == ["pos.t", "tau.t"]


def test_columns_that_are_not_known_have_a_block_to_fill_in(tmp_path: Path):
    """In HDF5 as in text; filled in as they ask they are part of a mapping."""
    t = np.arange(400) / 100.0
    own = {"time": t, "zork": np.sin(t), "Blorb": np.cos(3 * t)}
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, values in own.items():
            file[name] = values
    text(together(*own.values()), ",".join(own) + "\n")(tmp_path / "a.csv")
    for name in ("a.h5", "a.csv"):
        mapping = mapping_text(guess([tmp_path / name]), tmp_path)
        for column in ("zork", "Blorb"):
            assert f'# [columns.a.CHANNEL]\n# column = "{column}"\n# unit = "..."' in mapping
        filled = completed(
            mapping, {}, {"zork": ("drive_torque", "N m"), "Blorb": ("temperature", "degC")}
        )
        assert tomllib.loads(filled)["columns"]["a"] == {
            "time": {"column": "time", "unit": "s"},
            "drive_torque": {"column": "zork", "unit": "N m"},
            "temperature": {"column": "Blorb", "unit": "degC"},
        }


JOINTS = ("shoulder", "elbow")


def axes_of(folder: Path, names: list[str]) -> list[str]:
    m = rig.sines(7)
    rows = together(m.t, *(m.q * (k + 1) for k in range(len(names))))
    text(rows, ",".join(["t", *names]) + "\n")(folder / "a.csv")
    told = tomllib.loads(mapping_text(guess([folder / "a.csv"])))
    return [test["name"] for test in told["test"]]


@pytest.mark.parametrize(
    ("names", "axes"),
    [
        (["q1", "q2", "q10"], ["axis_1", "axis_2", "axis_10"]),
        (["X1_ActualPosition", "Y1_ActualPosition"], ["axis_x", "axis_y"]),
        (
            [f"/js/{joint}/{what}" for what in ("position", "effort") for joint in JOINTS],
            ["axis_shoulder", "axis_elbow"],
        ),
        (
            ["observations.q[1]", "observations.q[2]", "action[1]", "action[2]"],
            ["axis_1", "axis_2"],
        ),
        (["pos[0]", "pos[1]", "tau[0]", "tau[1]"], ["axis_0", "axis_1"]),
        # Of these one alone is no axis: two thermometers, two speeds of one machine, two sides.
        (["position", "Temperature1", "Temperature2"], ["recorded"]),
        (["front speed", "rear speed"], ["recorded"]),
        (["motor_position", "load_position"], ["recorded"]),
        (["q1", "q1_filt", "tau1"], ["recorded"]),
    ],
)
def test_which_columns_are_axes_of_their_own(tmp_path: Path, names: list[str], axes: list[str]):
    assert axes_of(tmp_path, names) == axes


@pytest.mark.parametrize(
    ("head", "roles"),
    [
        # An index without a name, as data frames are written; units alone; a unit by its long name.
        (",time,q,dq\n", ["index", "time", "relative_angle", "relative_rate"]),
        ("[count];[s];[°];[Nm]\n", ["index", "time", "relative_angle", "drive_torque"]),
        # Each row ends with a separator, above as below; the index has neither a name nor a unit.
        (",Time,Winkel,Moment,\n,s,deg,Nm,\n", ["index", "time", "relative_angle", "drive_torque"]),
        ("# ,Time,Winkel,Moment\n# ,s,deg,Nm\n", ["index", "time", "relative_angle"]),
        ("T_l,Time [sec],theta_l,T_m\n", ["drive_torque", "time", "relative_angle"]),
    ],
)
def test_headings_as_programs_write_them(tmp_path: Path, head: str, roles: list[str]):
    m = rig.sines(11)
    separator = ";" if ";" in head else ","
    rows = together(np.arange(len(m.t)), m.t, m.q, m.v)
    if head.endswith(",\n"):
        rows = [[*row, ""] for row in rows]
    text(rows, head, separator)(tmp_path / "a.csv")
    (table,) = guess([tmp_path / "a.csv"])
    assert table.step == pytest.approx(1e-3)
    assert [column.role for column in table.columns][: len(roles)] == roles
    told = tomllib.loads(mapping_text(guess([tmp_path / "a.csv"])))["columns"]["a"]
    if "deg" in head:
        assert [told[role]["unit"] for role in roles[1:3]] == ["s", "deg"]


def test_times_with_holes_are_times(tmp_path: Path):
    m = rig.sines(12)
    rows = [[*row] for row in together(m.t, m.q)]
    rows[7][0] = ""
    text(rows, "time [s],angle\n")(tmp_path / "a.csv")
    (table,) = guess([tmp_path / "a.csv"])
    assert table.columns[0].role == "time"
    assert table.columns[0].doubts == ("1 of its cells hold no number",)
    assert table.step == pytest.approx(1e-3)


def test_units_that_contradict_each_other_do_not_stand(tmp_path: Path):
    """Degrees, says the heading, and the rate in rad/s is the derivative as it is."""
    m = rig.sines(9)
    head = "time [s],angle [deg],rate [rad/s],torque [Nm]"
    time, angle, rate, torque = guessed(tmp_path, head, m.t, m.q, m.v, m.tau)
    assert [each.basis for each in (angle, rate)] == [Basis.LIKELY, Basis.LIKELY]
    assert "0.017453 is due" in angle.unit_why
    assert [each.basis for each in (time, torque)] == [Basis.LIKELY, Basis.STATED]
    section = tomllib.loads(mapping_text(guess([tmp_path / "a.csv"])))["columns"]["a"]
    assert "unit" not in section["relative_angle"]
    assert "unit" not in section["relative_rate"]


def test_times_that_contradict_a_rate_do_not_stand_either(tmp_path: Path):
    m = rig.sines(9)
    columns = guessed(tmp_path, "time [s],angle [rad],rate [rad/s]", m.t * 1000.0, m.q, m.v)
    assert {each.basis for each in columns} == {Basis.LIKELY}


def test_what_follows_has_the_unit_of_what_it_follows(tmp_path: Path):
    m = rig.sines(10)
    q = m.q * DEG
    head = "time [s],angle [deg],angle_ref,setpoint,current [A],torque"
    columns = guessed(tmp_path, head, m.t, q, q + 0.01, q * 0.99, m.i, m.i * 1.7)
    _, _, reference, setpoint, _, torque = columns
    assert (reference.role, reference.unit, reference.basis) == ("reference", "deg", Basis.LIKELY)
    assert (setpoint.role, setpoint.unit, setpoint.basis) == ("reference", "deg", Basis.LIKELY)
    assert any("1.7 times current" in doubt for doubt in torque.doubts)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("angle", "rate", "roles"),
    [
        # A rate is on the side of its angle; what a name says of it stands.
        ("Winkel [deg]", "Drehzahl [1/min]", ["relative_angle", "relative_rate"]),
        ("motor angle [deg]", "Drehzahl [1/min]", ["motor_angle", "motor_rate"]),
        ("motor angle [deg]", "speed", ["motor_angle", "motor_rate"]),
        ("Winkel [deg]", "motor speed [1/min]", ["relative_angle", "motor_rate"]),
        # Of another size it is behind a gear, or its unit is wrong.
        ("Winkel [rad]", "Drehzahl [1/min]", ["relative_angle", "motor_rate"]),
    ],
)
def test_which_side_of_the_gear(tmp_path: Path, angle: str, rate: str, roles: list[str]):
    m = rig.sines(14)
    text(together(m.t, m.q * DEG, m.v * 30 / np.pi), f"time [s],{angle},{rate}\n")(
        tmp_path / "a.csv"
    )
    found = guess([tmp_path / "a.csv"])
    assert [column.role for column in found[0].columns[1:]] == roles
    agree = "rad" not in angle
    assert agree == (not any(column.doubts for column in found[0].columns))
    assert agree or "; 0.017453 in its unit" in found[0].columns[2].doubts[0]
    assert mapping_text(found).count("side of the gear not said") == ("motor angle" not in angle)


def test_a_rig_without_a_gear_is_a_direct_drive(tmp_path: Path):
    """The motor's rate is the load's; where both sides were recorded and differ it is told."""
    m = rig.sines(17)
    own = "schema = 3\nname = 'a'\n[axis]\nname = 'a'\n"
    heads = "time [s],motor speed [rad/s],torque [Nm]\n"
    text(together(m.t, m.v, m.tau), heads)(tmp_path / "motor.csv")
    mapping = mapping_text(guess([tmp_path / "motor.csv"]), tmp_path)
    for gear, ratio in (("", 1.0), ("[gear]\nratio = 50\n", 50.0)):
        (tmp_path / "rig.toml").write_text(own + gear, encoding="utf-8")
        (trial,) = planned(tmp_path, mapping).trials
        recording, _ = served(trial)
        np.testing.assert_allclose(recording["relative_rate"], m.v / ratio, atol=1e-6)
    heads = "time [s],load position [rad],motor speed [rad/s],torque [Nm]\n"
    text(together(m.t, m.q, 50 * m.v, m.tau), heads)(tmp_path / "both.csv")
    mapping = mapping_text(guess([tmp_path / "both.csv"]), tmp_path)
    assert len(planned(tmp_path, mapping).trials) == 1
    (tmp_path / "rig.toml").write_text(own, encoding="utf-8")
    with pytest.raises(ProtocolError, match="two sides of a gear of 50"):
        planned(tmp_path, mapping)


def test_a_group_of_all_columns_says_nothing(tmp_path: Path):
    m = rig.sines(15)
    for group, names, roles in (
        ("run1", ("t [s]", "x [m]", "dx [m/s]"), ["time", "relative_angle", "relative_rate"]),
        ("motor", ("t [s]", "pos [m]", "vel [m/s]"), ["time", "motor_angle", "motor_rate"]),
    ):
        columns = guessed(tmp_path, ",".join(f"{group}/{name}" for name in names), m.t, m.q, m.v)
        assert [column.role for column in columns] == roles


def test_all_that_a_mapping_lacks_is_told_at_once(tmp_path: Path):
    mapping = (
        '[columns.a.time]\ncolumn = "t"\n[columns.a.relative_angle]\ncolumn = "pos"\n'
        '[columns.a.drive_torque]\ncolumn = "j"\nunit = "N m"\n'
        '[columns.a.motor_current]\ncolumn = "i"\nunit = "V"\n'
        '[[test]]\nname = "any"\nkind = "motion"\nbench = "platform"\n'
        '[[test.recording]]\nfile = "a.csv"\n'
    )
    with pytest.raises(ProtocolError) as error:
        planned(tmp_path, mapping)
    lines = str(error.value).splitlines()
    told = ["unit of column 't'", "unit of column 'pos'", "no column 'j'", "motor_current"]
    assert len(lines) == len(told)
    for line, what in zip(lines, told, strict=True):
        assert what in line


def test_a_file_that_is_not_there_has_a_nearest(tmp_path: Path):
    (tmp_path / "Run_07.csv").write_text("t,pos\n0,1\n1,2\n")
    with pytest.raises(RecordingError, match=r"did you mean 'Run_07\.csv'"):
        guess_mapping([tmp_path / "run07.csv"])
    with pytest.raises(RecordingError, match=r"No such file or directory$"):
        guess_mapping([tmp_path / "something else entirely.mat"])
