"""Key numbers of the first screen, told apart by their conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest

from campaign.archive import RunReader
from campaign.estimate import Estimate
from campaign.report.build import render
from campaign.report.content.document import document_of
from campaign.report.content.first_screen import FEWEST, ROOM, Answer
from campaign.report.content.key_numbers import KeyNumber
from campaign.result import Finding, Value
from tests.report.test_opening import experiments, figure, says

pytestmark = pytest.mark.usefixtures("drawings_kept")


def found(name: str, value: float, unit: str = "N m", **conditions: Value) -> Finding:
    return Finding.of(Estimate(name, value, unit, value - 0.1, value + 0.1, 0.95), conditions)


def answers(
    made_up: ModuleType,
    folder: Path,
    tests: Mapping[str, Sequence[str]],
    **findings: Sequence[Finding],
) -> tuple[Answer, ...]:
    run = made_up.made_up_run(folder, tests=tests)
    kinds = {kind: says(*own) for kind, own in findings.items()}
    return document_of(run, experiments(made_up, **kinds)).opening.shown


def test_a_condition_that_is_no_option_has_its_unit(made_up: ModuleType, tmp_path: Path):
    one = found("stabilization_error", 1e-3, "rad", average_friction=33.0)
    (own,) = answers(made_up, tmp_path, {"breakaway": ()}, breakaway=[one])
    assert own.numbers[0].where == "average friction 33 N·m"


def test_a_number_has_its_interval_and_the_unit_of_its_test(made_up: ModuleType, tmp_path: Path):
    one = found("breakaway_torque", 31.4, direction="positive")
    (own,) = answers(made_up, tmp_path, {"breakaway": ()}, breakaway=[one])
    assert (own.test, own.title, own.where) == ("breakaway", "Breakaway", "")
    assert own.numbers == (KeyNumber("breakaway torque", "positive", "31.40 ± 0.10 N·m"),)


def test_what_all_of_a_test_share_is_said_once(made_up: ModuleType, tmp_path: Path):
    several = [
        found("breakaway_torque", 31.4 + k, direction=way, statistic="mean")
        for k, way in enumerate(("positive", "negative"))
    ]
    (own,) = answers(made_up, tmp_path, {"breakaway": ()}, breakaway=several)
    assert own.where == "mean"
    assert [each.where for each in own.numbers] == ["positive", "negative"]


def test_the_first_screen_has_room_for_so_many(made_up: ModuleType, tmp_path: Path):
    many = [found("breakaway_torque", 31.4 + k, parameter=k) for k in range(2 * ROOM)]
    for folder in ("1", "6"):
        (tmp_path / folder).mkdir()
    (own,) = answers(made_up, tmp_path / "1", {"breakaway": ()}, breakaway=many)
    assert len(own.numbers) == ROOM
    kinds = [f"kind_{k}" for k in range(6)]
    several = answers(
        made_up,
        tmp_path / "6",
        dict.fromkeys(kinds, ()),
        **dict.fromkeys(kinds, many),
    )
    assert {len(each.numbers) for each in several} == {ROOM // 6} != {FEWEST}


OWN = """
source = "Our own paper"
[[table]]
name = "1"
title = "Ours"
quantity = "breakaway_torque"
unit = "N m"
rows = { condition = "direction" }
column.torque = {}
[table.cells]
positive = [31.4]
negative = [40.0]
"""


def test_published_values_stand_beside_and_a_mark_says_which_agree(
    made_up: ModuleType, tmp_path: Path
):
    ways = [
        found("breakaway_torque", 31.4 + k, direction=way)
        for k, way in enumerate(("positive", "negative"))
    ]
    run = made_up.made_up_run(tmp_path, tests={"breakaway": ("1",)}, published=OWN)
    kinds = experiments(made_up, breakaway=says(*ways))
    (own,) = document_of(run, kinds).opening.shown
    assert [(n.published, n.agrees) for n in own.numbers] == [
        ("31.4 N·m", True),
        ("40 N·m", False),
    ]


def test_true_values_of_a_simulated_bench_stand_beside(made_up: ModuleType, tmp_path: Path):
    ways = [found("coulomb_torque", 30.0, direction=way, exponent="free") for way in ("positive",)]
    (own,) = answers(made_up, tmp_path, {"velocity_map": ()}, velocity_map=ways)
    assert own.numbers[0].true == "30.235 N·m (outside)"


def _stating(run: RunReader, **stated: str) -> RunReader:
    first, *others = run.header.tests
    header = run.header.model_copy(update={"tests": ({**first, **stated}, *others)})
    return replace(run, header=header)


def test_a_protocol_chooses_the_leading_figure_and_the_groups(made_up: ModuleType, tmp_path: Path):
    run = made_up.made_up_run(tmp_path, tests={"stabilization": (), "breakaway": ()})
    kinds = experiments(
        made_up,
        stabilization=says(figures=(figure("one"), figure("two"))),
        breakaway=says(figures=(figure("three", interval=True),)),
    )
    assert document_of(run, kinds).opening.telling == ("breakaway", "three")
    stating = _stating(run, leading_figure="two", group="Errors & more")
    assert document_of(stating, kinds).opening.telling == ("stabilization", "two")
    html = render(stating, tmp_path, kinds, made_up.TEMPLATES)[0]
    assert "Errors &amp; more" not in html, "there is no other group"
    wrong = document_of(_stating(run, leading_figure="four"), kinds).opening
    assert wrong.telling == ("breakaway", "three")
    assert wrong.wrong[-1].startswith("Stabilization has no figure 'four'")
    assert wrong.wrong[-1].endswith("it has one, two.")
