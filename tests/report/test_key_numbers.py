"""Key numbers of the first screen, told apart by their conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from campaign.archive.reading.run_reader import RunReader
from campaign.axis_kind import BOTH_ROTARY
from campaign.estimate import OF_ONE_TRIAL, Estimate
from campaign.experiments.interface import key
from campaign.published.draws import SEED
from campaign.report.build import render
from campaign.report.content.document import document_of
from campaign.report.content.first_screen import FEWEST, ROOM, Answer
from campaign.report.content.key_numbers import KeyNumber, shown_key_numbers
from campaign.report.content.written_units import TestUnits
from campaign.result import Finding, Result, Value
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


def test_of_draws_it_is_said_that_they_are_medians() -> None:
    drawn = [SimpleNamespace(trial=SimpleNamespace(point={SEED: seed})) for seed in range(3)]
    own = (found("breakaway_torque", 31.4),)
    test: Any = SimpleNamespace(
        name="t", trials=drawn, sides=BOTH_ROTARY, experiment=None,
        result=Result(findings=own, key_numbers=own),
    )  # fmt: skip
    where, _ = shown_key_numbers(test, TestUnits(test), (), None)
    assert where == "median of 3 draws, interval of one further draw"


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


def test_beside_a_published_value_stand_its_unit_and_the_interval_of_its_verdict(
    made_up: ModuleType, tmp_path: Path
):
    """That of one trial is none of a verdict."""
    alone = Estimate("breakaway_torque", 31.4, "N m", 31.3, 31.5, 0.95, reason=OF_ONE_TRIAL())
    own = OWN.replace('"N m"', '"kN m"').replace("31.4", "0.0314")
    run = made_up.made_up_run(tmp_path, tests={"breakaway": ("1",)}, published=own)
    one = Finding.of(alone, {"direction": "positive"})
    (told,) = document_of(run, experiments(made_up, breakaway=says(one))).opening.shown
    assert [(n.value, n.published) for n in told.numbers] == [("0.0314 kN·m", "0.0314 kN·m")]


def test_what_is_meant_without_a_word_and_what_another_condition_says_is_left_out(
    made_up: ModuleType, tmp_path: Path
):
    conditions = {"statistic": "mean", "bench.gear.preload.torque": 33.0, "average_friction": 33.0}
    ways = [found("breakaway_torque", 31.4 + k, direction=way, **conditions)
            for k, way in enumerate(("positive", "negative"))]  # fmt: skip
    kinds = experiments(made_up, breakaway=says(*ways))
    declared = (key("breakaway_torque", statistic="mean"),)
    kinds = {name: replace(each, key_numbers=declared) for name, each in kinds.items()}
    run = made_up.made_up_run(tmp_path, tests={"breakaway": ()})
    (own,) = document_of(run, kinds).opening.shown
    assert own.where == "average friction 33 N·m"


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
