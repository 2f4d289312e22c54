"""A first mapping by guess: most roles are right, and no unit that stands plainly is wrong."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from campaign.importing.guess import Basis, TableGuess, guess, mapping_text
from campaign.unit_grammar import parse_unit
from tests.importing.wild import Wild
from tests.importing.wild_binary import all_of_them

FILES = range(40)
SHARED = Path(__file__).parents[3] / "shared" / "data" / "emps"


@cache
def wild_files() -> list[Wild]:
    return all_of_them()


def made(folder: Path, wild: Wild) -> Path:
    wild.write(folder / wild.name)
    return folder / wild.name


@pytest.fixture(scope="module")
def guesses(tmp_path_factory):
    """Of each file by its number, made when it is first asked for; and their folder."""
    folder = tmp_path_factory.mktemp("wild")
    return cache(lambda number: guess([made(folder, wild_files()[number])])), folder


@pytest.mark.slow
def test_there_are_forty_of_them():
    assert len(FILES) == len({wild.name for wild in wild_files()}) == len(wild_files())


@pytest.mark.slow
def test_nine_of_ten_roles_are_right(guesses):
    guessed, _ = guesses
    right, wrong = 0, []
    for number, wild in enumerate(wild_files()):
        for table in guessed(number):
            for column in table.columns:
                is_role, _ = wild.columns[column.name]
                if column.role in is_role.split("|"):
                    right += 1
                else:
                    wrong.append(f"{wild.name}: {column.name} is {is_role}, not {column.role}")
    assert right >= 0.9 * (right + len(wrong)), wrong


@pytest.mark.parametrize("number", FILES)
def test_no_unit_that_stands_plainly_is_wrong(guesses, number):
    """Judged by the text, as its reader has it."""
    guessed, folder = guesses
    wild, found = wild_files()[number], guessed(number)
    told = tomllib.loads(mapping_text(found, folder))
    assert {each["columns"] for test in told["test"] for each in test["recording"]} >= set(
        told.get("columns", {})
    )
    for section in told.get("columns", {}).values():
        for channel in section.values():
            if "unit" in channel:
                unit = wild.columns[name_of(channel, found)][1]
                assert unit is not None
                assert parse_unit(channel["unit"]) == parse_unit(unit)
            given = {"column", "unit", "table"}
            assert set(channel) <= given, "or something was guessed that never is"


def name_of(channel: dict[str, object], found: list[TableGuess]) -> str:
    """The column's name, which stands as a place where two have it."""
    column = channel["column"]
    return column if isinstance(column, str) else found[0].columns[column - 1].name


def test_what_is_not_stated_is_marked(tmp_path):
    (tmp_path / "a.csv").write_text(
        "t,angle [deg],speed,torque\n"
        + "".join(
            # 30 deg amplitude, 2 rad/s: the rate is 60 deg/s at most, or 1.047 rad/s.
            f"{k / 100},{30 * np.sin(k / 50)},{np.pi / 3 * np.cos(k / 50)},3\n"
            for k in range(800)
        )
    )
    found = guess([tmp_path / "a.csv"])
    time, angle, speed, torque = found[0].columns
    assert (time.unit, time.basis) == ("s", Basis.LIKELY)
    assert (angle.unit, angle.basis) == ("deg", Basis.STATED)
    assert (speed.unit, speed.basis) == ("rad/s", Basis.LIKELY)
    assert "R² 1.0" in speed.unit_why
    assert (torque.unit, torque.basis) == ("", Basis.UNKNOWN)
    text = mapping_text(found, tmp_path)
    assert '# ? unit = "rad/s"  # likely: 0.017' in text
    assert '\nunit = "deg"\n' in text
    assert '# ? unit = "..."  # not stated' in text


def test_axes_in_one_file_are_tests_of_their_own(tmp_path):
    wild = next(each for each in wild_files() if each.name == "two_joints_15ms.csv")
    told = tomllib.loads(mapping_text(guess([made(tmp_path, wild)]), tmp_path))
    assert [test["name"] for test in told["test"]] == ["axis_1", "axis_2"]
    one, two = (test["recording"][0] for test in told["test"])
    assert one["file"] == two["file"] == wild.name
    for number, each in enumerate((one, two), start=1):
        columns = {key: value["column"] for key, value in told["columns"][each["columns"]].items()}
        assert columns == {
            "time": "t",
            "relative_angle": f"j{number}_pos_deg",
            "relative_rate": f"j{number}_vel_deg_s",
            "drive_torque": f"j{number}_tau",
        }


def test_channels_in_tables_of_their_own_are_one_recording(tmp_path):
    wild = next(each for each in wild_files() if each.name == "messung.csv")
    told = tomllib.loads(mapping_text(guess([made(tmp_path, wild)]), tmp_path))
    (only,) = told["test"][0]["recording"]
    assert "table" not in only
    assert told["columns"]["messung"] == {
        "time": {"column": "time", "unit": "ms"},
        "relative_angle": {"column": "ActPos", "table": "ActPos", "unit": "deg"},
        "drive_torque": {"column": "ActTorque", "table": "ActTorque", "unit": "percent"},
        "command": {"column": "SetVelo", "table": "SetVelo"},
    }


def test_a_linear_axis_is_asked_for(tmp_path):
    by_name = {each.name: each for each in wild_files()}
    asked = "is the axis linear?"
    assert asked in mapping_text(guess([made(tmp_path, by_name["tribometer.txt"])]))
    assert asked not in mapping_text(guess([made(tmp_path, by_name["pruefstand.csv"])]))


def test_columns_of_one_name_are_told_by_their_place(tmp_path):
    (tmp_path / "a.csv").write_text("t,pos,pos\n0,1,2\n1,2,4\n2,4,3\n3,3,1\n")
    text = mapping_text(guess([tmp_path / "a.csv"]), tmp_path)
    assert tomllib.loads(text)["columns"]["a"]["relative_angle"] == {"column": 2}
    assert "# column = 3" in text


def test_names_from_anywhere_are_strings_and_comments(tmp_path):
    odd = 'a"b\\c\u007f\u0085 [rad]'
    (tmp_path / 'o\'dd "x".csv').write_text(f"t;{odd};posit\u0001ion\n0;1;2\n1;2;3\n2;3;5\n3;4;9\n")
    found = guess([tmp_path / 'o\'dd "x".csv'])
    text = mapping_text(found, tmp_path)
    told = tomllib.loads(text)
    assert told["test"][0]["recording"][0]["file"] == 'o\'dd "x".csv'
    assert all(c.isprintable() or c == "\n" for c in text)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the measured files are not here")
@pytest.mark.parametrize("name", ["DATA_EMPS.mat", "DATA_EMPS_PULSES.mat"])
def test_a_measured_axis(name):
    (table,) = guess([SHARED / name])
    roles = {column.name: column.role for column in table.columns}
    assert roles["t"] == "time"
    assert (roles["qm"], roles["qg"]) == ("relative_angle", "reference")
    assert roles["vir"] == "drive_torque"
    assert roles.get("pulses_N", "unknown") == "unknown"
    assert {column.basis for column in table.columns} == {Basis.LIKELY, Basis.UNKNOWN}
    assert table.step == pytest.approx(1e-3, rel=1e-4)
