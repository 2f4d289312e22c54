"""Values come back in the unit, and with the digits, that the protocol wrote them with."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from campaign.report.content.tables import show
from campaign.report.content.truth import conditions_text
from campaign.report.content.written_units import TestUnits, short_number, units_of
from campaign.result import Column, Result, Table
from tests.report.planned import SHIPPED, conditions, planned

PROTOCOL = """
[[test]]
name = "presliding"
kind = "presliding_hysteresis"
bench = "specimen-lugre-1995"
amplitudes = ["3 urad", "6 urad", "12.5 urad"]
frequency = "100 mHz"

[[test]]
name = "map"
kind = "velocity_map"
bench = "simulink"
speeds = ["3 deg/min", "60 deg/min", "600 deg/min"]
settle_angle = "20 mrad"
settle_time = "280 ms"
max_travel = "1.5 rad"

[[test]]
name = "stabilization"
kind = "stabilization"
bench = "platform"
acceleration = "300 mrad/s^2"
motion = { kind = "sine" }

[test.matrix]
frequency = { start = "200 mHz", stop = "1000 mHz", step = "400 mHz" }
"bench.gear.preload.torque" = ["0.033 kN m", "0.05 kN m"]
bench.axis.inertia = ["350000 kg cm^2"]
"""


@pytest.fixture
def protocol(tmp_path: Path) -> Path:
    path = tmp_path / "units.toml"
    path.write_text(PROTOCOL, encoding="utf-8")
    return path


def test_lists_options_and_sweeps_come_back_as_written(protocol: Path) -> None:
    found = conditions(protocol)
    assert found["presliding"]["amplitude (swept)"] == "3, 6, 12.5 µrad"
    assert "amplitudes" not in found["presliding"], "the sweep has said it"
    assert found["presliding"]["frequency"] == "100 mHz"
    sliding = found["map"]
    assert sliding["speed (swept)"] == "3, 60, 600 deg/min"
    assert sliding["settle angle"] == "20 mrad"
    assert sliding["settle time"] == "280 ms"
    assert sliding["max travel"] == "1.5 rad"
    assert sliding["rest"] == "0.5 s", "a default has the quantity's own unit"
    stabilization = found["stabilization"]
    assert stabilization["frequency (swept)"] == "200, 600, 1000 mHz"
    assert stabilization["gear preload torque (swept)"] == "0.033, 0.05 kN·m"
    assert stabilization["axis inertia (swept)"] == "350000 kg·cm²"
    assert stabilization["acceleration"] == "300 mrad/s²"
    assert stabilization["motion"] == "sine"


def test_the_command_line_has_the_last_word(protocol: Path) -> None:
    found = conditions(
        protocol,
        'presliding.frequency="0.2 Hz"',
        "stabilization.acceleration=0.4 rad/s^2",
        'stabilization.matrix.frequency=["0.3 Hz", "0.4 Hz"]',
        'map.speeds=["0.1 rpm", "1 rpm", "10 rpm"]',
    )
    assert found["presliding"]["frequency"] == "0.2 Hz"
    assert found["stabilization"]["acceleration"] == "0.4 rad/s²"
    assert found["stabilization"]["frequency (swept)"] == "0.3, 0.4 Hz"
    assert found["map"]["speed (swept)"] == "0.1, 1, 10 rpm"


def test_a_whole_matrix_may_be_set(protocol: Path) -> None:
    setting = (
        'stabilization.matrix={frequency = { start = "0.0005 kHz", stop = "0.001 kHz", num = 2 }}'
    )
    found = conditions(protocol, setting)
    assert found["stabilization"]["frequency (swept)"] == "0.0005, 0.001 kHz"


def test_units_of_one_test_are_not_those_of_another(tmp_path: Path) -> None:
    path = tmp_path / "two.toml"
    test = '[[test]]\nname = "{}"\nkind = "stabilization"\nbench = "simulink"\n{}\n'
    path.write_text(test.format("a", 'acceleration = "0.3 rad/s^2"') + test.format("b", ""))
    found = conditions(path)
    assert found["a"]["acceleration"] == "0.3 rad/s²"
    assert found["b"]["acceleration"] == "18 deg/s²"


def test_what_only_a_data_sheet_calls_a_speed(tmp_path: Path) -> None:
    """`1/min` is a speed where a speed is meant, and only there."""
    path = tmp_path / "sheet.toml"
    path.write_text(
        '[[test]]\nname = "m"\nkind = "velocity_map"\nbench = "simulink"\n'
        'speeds = ["0.5 1/min", "1 1/min", "2 1/min"]\n'
    )
    assert conditions(path)["m"]["speed (swept)"] == "0.5, 1, 2 1/min"


def test_tables_of_options_are_told_in_words(tmp_path: Path) -> None:
    path = tmp_path / "ship.toml"
    path.write_text(
        '[[test]]\nname = "s"\nkind = "stabilization"\nbench = "simulink"\n'
        'motion = { kind = "ship", significant_height = "250 cm", peak_period = "8800 ms" }\n'
    )
    told = conditions(path)["s"]["motion"]
    assert told.startswith("ship, significant height 250 cm, peak period 8800 ms, ")
    assert not re.search(r"[{}\"_:=]", told)


RAW = re.compile(
    r"[{}\[\]\"]|\de-\d|\bNone\b|\bnull\b|\bTrue\b|\bFalse\b|\btrue\b|\bfalse\b|\(SI\)"
)


LONG = {"draws", "thesis"}
"""Some thousand trials of the tests that the other protocols have, too."""


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({path.stem for path in SHIPPED.glob("*.toml")} - LONG))
def test_no_shipped_protocol_shows_what_only_programs_write(name: str) -> None:
    for test, found in conditions(SHIPPED / f"{name}.toml").items():
        for label, text in found.items():
            assert not RAW.search(text), (test, label, text)
            assert "." not in label, (test, label)


def test_every_number_with_a_dimension_has_a_unit() -> None:
    """Of what the shipped protocols sweep, and the experiments tell their trials apart by."""
    bare = {"measurement", "repetition", "change", "factor", "variation day", "variation seed"}
    for name in ("quickstart", "friction_behaviour", "observer_gain", "preload", "breakaway"):
        for test, found in conditions(SHIPPED / f"{name}.toml").items():
            for label, text in found.items():
                swept = label.removesuffix(" (swept)")
                if swept != label and swept not in bare and re.search(r"\d", text):
                    assert re.search(r"[A-Za-z°]+(/|·|²|$)", text.split()[-1]), (test, label, text)


def test_a_table_says_what_was_set_in_the_same_units(protocol: Path) -> None:
    tests, header = planned(protocol)
    units = units_of(tests.values(), header)["stabilization"]
    path = "bench.gear.preload.torque"
    table = Table(
        "t",
        "T",
        (
            Column("frequency", "Frequency", "Hz", "Hz", exact=True),
            Column(path, path, exact=True),
            Column("acceleration", "Found acceleration", "rad/s^2", "deg/s^2"),
            Column("compensation", "Compensation"),
            Column("unit", "Unit"),
        ),
        ({"frequency": 0.6, path: 33.0, "acceleration": 0.1, "unit": "N m s/rad"},),
    )
    shown = show(units.table(table))
    assert shown.headers == (
        "Frequency (mHz)",
        "Gear preload torque (kN·m)",
        "Found acceleration (deg/s²)",  # measured: as the analysis would have it
        "Compensation",
        "Unit",
    )
    assert [cell.text for cell in shown.rows[0]] == ["600", "0.033", "5.730", "–", "N·m·s/rad"]
    assert conditions_text({"frequency": 0.6, path: 33.0, "direction": "up"}, units) == (
        "frequency 600 mHz, gear preload torque 0.033 kN·m, direction up"
    )


def test_what_an_experiment_alone_knows_has_the_unit_of_its_tables(protocol: Path) -> None:
    tests, _ = planned(protocol)
    table = Table("t", "T", (Column("lag", "Lag", "s", "ms"),), ())
    test = replace(tests["stabilization"], result=Result((table,)))
    assert TestUnits(test).value("lag", 0.002) == "2 ms"
    assert TestUnits(replace(test, experiment=None)).value("lag", 0.002) == "2 ms"
    assert TestUnits(test).value("nobody.knows", 0.002) == "0.002"


def test_a_wrong_unit_is_not_believed(protocol: Path) -> None:
    """An archive of another program may say anything."""
    test = planned(protocol)[0]["stabilization"]
    units = TestUnits(test, {"frequency": "kg", "acceleration": "furlong"})
    assert units.value("frequency", 0.24) == "0.24 Hz"
    assert units.value("acceleration", 0.3141592653589793) == "18 deg/s²"


def test_sources_that_cannot_be_read_cost_only_their_units(protocol: Path) -> None:
    tests, header = planned(protocol)
    for text in ("[[test", "a,b\n1,2", 'test = "x"', "test = [1]", "a = [" * 5000):
        broken = header.model_copy(update={"sources": {"x": text}})
        units = units_of(tests.values(), broken)
        assert units["stabilization"].value("frequency", 0.24) == "0.24 Hz"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "0"),
        (18.000000000000004, "18"),
        (1 / 3, "0.333333"),
        (3e-6, "3 × 10⁻⁶"),
        (-0.25, "−0.25"),
        (350000.0, "350000"),
        (1234567.0, "1234570"),
        (7, "7"),
    ],
)
def test_numbers_have_the_digits_that_they_were_written_with(value: float, text: str) -> None:
    assert short_number(value) == text
