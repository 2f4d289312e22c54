"""Two friction models, with parameters of their own, compared in one matrix."""

from __future__ import annotations

from pathlib import Path

import pytest

from campaign.experiments.post_processing.swept_tables import table_names
from campaign.trial import canonical_json
from tests.system.user import campaign, write

LUGRE = {"model": "lugre", "coulomb_torque": 26.0, "negative": {"coulomb_torque": None}}
STRIBECK = {"model": "stribeck", "coulomb_torque": 20.0}
STIFFER = {**LUGRE, "bristle_stiffness": 3e4}
SKEWED = {**LUGRE, "negative": {"coulomb_torque": 20.0}}


@pytest.mark.parametrize(
    ("values", "names"),
    [
        ([LUGRE, STRIBECK], ["lugre", "stribeck"]),
        ([LUGRE, STIFFER], ["lugre", "lugre, bristle_stiffness = 30000"]),
        (
            [LUGRE, SKEWED, STRIBECK],
            [
                "lugre, negative.coulomb_torque = none",
                "lugre, negative.coulomb_torque = 20",
                "stribeck",
            ],
        ),
        ([{"a": 1.0}, {"a": 2.0}], ["a = 1", "a = 2"]),
        ([{"a": 1.0}], ["as given"]),
        ([{"a": 1.0}, {"a": 1.0 + 1e-9}], ["a = 1 #1", "a = 1 #2"]),
        ([{"a": None, "b": 1}, {"b": 1}], ["a = none", "as given"]),
        ([{"a": True}, {"a": 1}], ["a = True", "a = 1"]),
        ([{"a": {}}, {}], ["as given #1", "as given #2"]),
        ([1.0, "lugre", None], []),
    ],
)
def test_a_name_is_the_kind_and_what_tells_it_from_its_like(values: list, names: list[str]) -> None:
    found = table_names(values)
    tables = [value for value in values if isinstance(value, dict)]
    assert [found[canonical_json(table)] for table in tables] == names
    assert len(found) == len(tables)


MODELS = """
title = "Two models"

[[test]]
name = "sea"
kind = "stabilization"
bench = "simulink"
cycles = 1
settle_cycles = 1

[[test.matrix."bench.friction.load"]]
model = "lugre"
coulomb_torque = "26 N m"
static_torque = "32 N m"
stribeck_velocity = "0.03 rad/s"
bristle_stiffness = "18000 N m/rad"
bristle_damping = "800 N m s/rad"

[[test.matrix."bench.friction.load"]]
model = "stribeck"
coulomb_torque = "20 N m"
static_torque = "25 N m"
stribeck_velocity = "0.03 rad/s"
"""


def test_a_report_tells_them_apart(tmp_path: Path) -> None:
    write(tmp_path, MODELS)
    done = campaign(tmp_path, "run", "protocol.toml", "--report")
    folder = tmp_path / done.last_line.replace(".nxs", "-report")
    table = (folder / "tables" / "sea-stabilization-error.csv").read_text(encoding="utf-8")
    head, *rows = (line.split(",") for line in table.splitlines())
    at, error = head.index("bench_friction_load"), head.index("error_mrad")
    assert [row[at] for row in rows] == ["lugre", "stribeck"]
    assert float(rows[0][error]) > float(rows[1][error]) > 0.0  # less friction, less error
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "coulomb_torque&#34;" not in page
    shown = campaign(tmp_path, "plan", "protocol.toml").out
    assert "{" not in shown
