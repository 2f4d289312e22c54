"""Published values in a table's own rows: which belong there, and where they stand."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from types import ModuleType

import pytest

from campaign.estimate import Estimate
from campaign.experiments.interface import Experiment, TestData
from campaign.experiments.stabilization.comparisons import beside_table
from campaign.published.values import read_published, thesis
from campaign.report.build import render
from campaign.report.content.published_columns import as_compared, with_published
from campaign.report.content.tables import show, table_csv
from campaign.resources import templates_folder
from campaign.result import Result, Table

HARDWARE = {"domain": "hardware"}


def errors(frequencies: tuple[float, ...] = (0.2, 0.5), method: str = "lugre") -> Table:
    def one(value: float) -> Estimate:
        return Estimate("error", value, "rad", 0.99 * value, 1.01 * value, 0.95)

    rows = [
        {
            "compensation": method,
            "frequency": frequency,
            "acceleration": math.radians(36.0),
            "stated": one(2e-4),
            "identified": one(1e-4),
            "ratio": one(0.5),
        }
        for frequency in frequencies
    ]
    return beside_table(rows, ())


def test_what_is_published_of_a_row_stands_in_it() -> None:
    table = with_published(errors(), [thesis()["5.11"]], HARDWARE)
    # Table 5.11 has no 0.5 Hz.
    assert [row["published"] for row in table.rows] == [pytest.approx(0.13e-3), None]
    assert table.note.endswith("Published: Table 5.11.")


def test_before_what_it_is_compared_with_and_last_in_the_file() -> None:
    """As printed: 0.50, not 0.5."""
    table = with_published(errors((0.2, 0.8), "none"), [thesis()["5.11"]], HARDWARE)
    shown = show(as_compared(table))
    place = shown.headers.index("Published (mrad)")
    assert shown.headers[place + 1].startswith("Error (1σ), as stated")
    assert [row[place].text for row in shown.rows] == ["0.50", "0.70"]
    before, after = (next(csv.reader(io.StringIO(table_csv(each)))) for each in (errors(), table))
    assert after == [*before, "published_mrad"]
    assert [row["published_mrad"] for row in csv.DictReader(io.StringIO(table_csv(table)))] == [
        "0.5",
        "0.7",
    ]


@pytest.mark.parametrize(
    ("table", "known"),
    [
        ("5.10", HARDWARE),  # at another frequency and acceleration
        ("5.13", HARDWARE),  # of another preload
        ("4.5", HARDWARE),  # of something else
    ],
)
def test_nothing_is_published_under_other_conditions(table: str, known: dict[str, str]) -> None:
    assert with_published(errors(), [thesis()[table]], known) == errors()
    assert as_compared(errors()) == errors()


def test_a_claim_is_no_number_beside_another_and_doubts_are_told() -> None:
    text = """
source = "made up"
[[table]]
name = "1.1"
title = "Errors"
quantity = "stabilization_error"
unit = "mrad"
rows = { condition = "frequency", unit = "Hz" }
column.value = {}
row."0.5".relation = "at most"
cells = { "0.2" = [0.1], "0.5" = [0.2] }
[[table.mark]]
cells = ["0.2/value"]
status = "inconsistent"
reason = "printed twice"
"""
    table = with_published(errors(), list(read_published(text, "own.toml").values()), {})
    assert [row["published"] for row in table.rows] == [pytest.approx(1e-4), None]
    assert table.note.endswith("Published: Table 1.1. Inconsistent among them: 0.2.")


def test_a_report_compares_with_what_its_test_stands_for(
    made_up: ModuleType, tmp_path: Path
) -> None:
    def analyse(data: TestData) -> Result:
        return Result((errors(method="static"),))

    kinds = {
        kind: Experiment(kind, "", made_up.ShakeOptions, lambda options, bench: (), analyse)
        for kind in ("stabilization", "breakaway")
    }
    tests = {"stabilization": ("5.11",), "breakaway": ()}
    run = made_up.made_up_run(tmp_path, tests=tests, bench=_hardware(made_up))
    _, folder, _ = render(run, tmp_path, kinds, templates_folder())
    first, other = (
        next(csv.reader(io.StringIO(folder.files[f"tables/{name}-identified-beside-stated.csv"])))
        for name in ("stabilization", "breakaway")
    )
    assert first == [*other, "published_mrad"]


def _hardware(made_up: ModuleType) -> object:
    """With a sampled controller, whose numbers are compared with what was measured."""
    bench = made_up.bench()
    controller = bench.controller.model_copy(update={"sample_rate": 1000.0})
    return bench.model_copy(update={"controller": controller})
