"""`[[test.operator]]`: what a person does, filled in at each point of the matrix."""

from __future__ import annotations

import re

import pytest

from campaign.protocol import as_tree, make_plan

from .conftest import Desk

TEST = """\
[[test]]
name = "t"
kind = "swing"
bench = "platform"
frequency = "0.24 Hz"
seed = 3
"""
SPRING = """\
[[test.operator]]
text = "Preload the spring to {bench.gear.preload.torque}, {{firmly}}"
sets = ["bench.gear.preload.torque"]
"""
SWEEP = '[test.matrix]\n"bench.gear.preload.torque" = ["33 N m", "50 N m"]\ncycles = [1, 2]\n'


def setups(desk: Desk, text: str) -> list[tuple[str, ...]]:
    return [trial.setup for trial in make_plan(desk.load(text)).trials]


def test_filled_in_at_each_point(desk: Desk) -> None:
    plan = make_plan(desk.load(TEST + SPRING + SWEEP))
    soft, hard = (f"Preload the spring to {value} N m, {{firmly}}" for value in ("33", "50"))
    assert [trial.setup for trial in plan.trials] == [(soft,), (soft,), (hard,), (hard,)]
    assert {trial.set_by_operator for trial in plan.trials} == {("bench.gear.preload.torque",)}


def test_in_the_unit_people_read(desk: Desk) -> None:
    text = "{acceleration} {frequency} {cycles} {gain} {style} {flag} {bench.axis.inertia}"
    step = f'acceleration = "1 rad/s^2"\n[[test.operator]]\ntext = "{text}"\n'
    ((shown,),) = setups(desk, TEST + step)
    assert shown == "57.2958 deg/s^2 0.24 Hz 2 1 slow false 69.1773 kg m^2"


def test_without_placeholders_it_holds_for_the_whole_test(desk: Desk) -> None:
    step = '[[test.operator]]\ntext = "Remove the lock"\n[[test.operator]]\ntext = "Stand back"\n'
    assert setups(desk, TEST + step + SWEEP) == [("Remove the lock", "Stand back")] * 4


def test_a_value_that_the_text_does_not_tell_is_added(desk: Desk) -> None:
    silent = '[[test.operator]]\ntext = "Mount it"\nsets = ["cycles"]\n'
    matrix = "[test.matrix]\ncycles = [1, 2]\n"
    assert setups(desk, TEST + silent + matrix) == [
        ("Mount it (cycles = 1)",),
        ("Mount it (cycles = 2)",),
    ]


def test_it_is_part_of_what_a_resume_compares(desk: Desk) -> None:
    plain, asked = make_plan(desk.load(TEST + SWEEP)), make_plan(desk.load(TEST + SPRING + SWEEP))
    assert "operator" not in plain.normalised["tests"][0]
    assert plain.fingerprint != asked.fingerprint
    assert [t.fingerprint for t in plain.trials] == [t.fingerprint for t in asked.trials]


def test_the_plan_as_data_has_it(desk: Desk) -> None:
    trial = as_tree(make_plan(desk.load(TEST + SPRING + SWEEP)))["trials"][0]
    assert trial["setup"] == ["Preload the spring to 33 N m, {firmly}"]
    assert trial["set_by_operator"] == ["bench.gear.preload.torque"]


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ('text = §"To {bench.gear.preload.toque}"\n', r"did you mean 'bench.gear.preload.torque'"),
        ('text = §"To {cycels}"\n', r"nothing is called 'cycels'.*did you mean 'cycles'\?"),
        ('text = §"To {bench.axis}"\n', r"'bench.axis' is a table; name a single value"),
        ('text = §"To {bench}"\n', r"'bench' is a table"),
        ('text = §"To {}"\n', r"nothing is called ''"),
        ('text = §"To {cycles.__class__}"\n', r"nothing is called 'cycles.__class__'"),
        ('text = §"To {cycles:03}"\n', r"a placeholder is a path in braces, no more"),
        ('text = §"To {cycles!r}"\n', r"a placeholder is a path in braces, no more"),
        ('text = §"To {cycles"\n', r"a brace itself is written twice"),
        ('text = §"To }"\n', r"a brace itself is written twice"),
        ('text = §""\n', r"at least 1 character"),
        ("text = §3\n", r"3 is not text in quotes"),
        ('text = "Do"\nsets = [§"gain"]\n', r"'gain' is not swept.*allowed are bench.*, cycles"),
        ('text = "Do"\nsets = [§"cycels"]\n', r"did you mean 'cycles'\?"),
        ('text = "Do"\n§set = ["cycles"]\n', r"unknown key 'set'.*did you mean 'sets'\?"),
    ],
)
def test_mistake(desk: Desk, step: str, message: str) -> None:
    (problem,) = desk.problems(f"{TEST}[[test.operator]]\n{step}{SWEEP}")
    assert re.search(message, problem.message)
