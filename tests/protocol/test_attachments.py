"""Files that options name: read beside the protocol, kept among the sources, told by digest."""

from __future__ import annotations

import pytest

from campaign.errors import ProtocolError
from campaign.experiments import experiments
from campaign.protocol import load_protocol, make_plan
from campaign.signals import Polyline

from .conftest import SHIPPED

CSV = "time,value\n0,0\n1,0.5\n2,0\n3,0.25\n"
TEXT = """
[[test]]
name = "series"
kind = "stabilization"
bench = "simulink"
motion = { kind = "series", file = §"data/roll.csv", value = "deg/s" }
"""


def plan(desk, text: str = TEXT, seed: int = 1):
    path = desk.write("lab/protocol.toml", text)
    return make_plan(load_protocol(path, experiments(), shipped=SHIPPED), seed=seed)


def problem(desk, text: str = TEXT) -> str:
    with pytest.raises(ProtocolError) as caught:
        plan(desk, text)
    (only,) = caught.value.problems
    return f"{only.line}:{only.column}: {only.message}"


def test_the_text_is_a_source_and_the_samples_are_in_the_trial(desk) -> None:
    desk.write("lab/data/roll.csv", CSV)
    made = plan(desk)
    assert made.protocol.sources["data/roll.csv"] == CSV
    (trial,) = made.trials
    assert isinstance(trial.task.base_acceleration, Polyline)
    assert len(trial.task.base_acceleration.times) == 2 + 2 * 3  # lead-in, then 3 straight lines
    assert CSV not in trial.model_dump_json()


def test_other_samples_are_another_plan(desk) -> None:
    desk.write("lab/data/roll.csv", CSV)
    before = plan(desk).fingerprint
    assert plan(desk).fingerprint == before
    desk.write("lab/data/roll.csv", CSV.replace("0.5", "0.6"))
    assert plan(desk).fingerprint != before


def test_files_can_be_swept(desk) -> None:
    desk.write("lab/data/a.csv", CSV)
    desk.write("lab/data/b.csv", CSV.replace("0.25", "0.75"))
    text = TEXT.replace('file = §"data/roll.csv", ', "")
    text += 'matrix = { "motion.file" = ["data/a.csv", "data/b.csv"] }\n'
    made = plan(desk, text)
    first, second = made.trials
    assert str(first.point["motion.file"]).startswith("data/a.csv (SHA-256")
    assert first.task.base_acceleration != second.task.base_acceleration
    assert {"data/a.csv", "data/b.csv"} <= set(made.protocol.sources)


def test_a_missing_file_is_named_where_it_is_written(desk) -> None:
    found = problem(desk)
    assert found.startswith(f"{desk.marks[0][1]}:{desk.marks[0][2]}: ")
    assert "'data/roll.csv': no such file" in found


def test_a_bad_row_is_named_with_its_line(desk) -> None:
    desk.write("lab/data/roll.csv", CSV.replace("0.5", "half"))
    assert "data/roll.csv:3: 'half' is not a number" in problem(desk)


def test_what_is_no_path_is_refused(desk) -> None:
    text = TEXT.replace('§"data/roll.csv"', "7")
    assert "path of a text file" in problem(desk, text)
