"""`[check]`: one trial again and again, and nothing else changed."""

from __future__ import annotations

import re

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import Plan, make_plan
from campaign.trial import Role

from .conftest import Desk

TESTS = """\
[[test]]
name = "reference"
kind = "swing"
bench = "simulink"
frequency = "0.24 Hz"
seed = 3

[[test]]
name = "map"
kind = "speeds"
bench = "simulink"
speeds = ["1 deg/s", "2 deg/s"]
seed = 4
repeat = 3
"""
CHECK = '[check]\ntest = "reference"\nevery = 3\n\n'


def plan(desk: Desk, text: str, **how: object) -> Plan:
    return make_plan(desk.load(text), seed=1, **how)  # type: ignore[arg-type]


def test_after_every_third_measurement(desk: Desk) -> None:
    made = plan(desk, CHECK + TESTS)
    # One measurement of the reference; then three times a warm-up and two measurements.
    letters = {Role.MEASUREMENT: "m", Role.WARM_UP: "w", Role.CHECK: "c"}
    assert "".join(letters[t.role] for t in made.trials) == "mwmmcwmmwmcm"
    assert [t.number for t in made.trials] == list(range(1, 13))
    assert [t.label for t in made.trials if t.role is Role.CHECK] == [
        "reference (check)",
        "reference (check) #2",
    ]


def test_a_check_is_the_reference_with_other_noise(desk: Desk) -> None:
    made = plan(desk, CHECK + TESTS)
    original, *checks = (t for t in made.trials if t.test == "reference")
    for check in checks:
        assert (check.task, check.bench, check.options) == (
            original.task,
            original.bench,
            original.options,
        )
    assert len({t.seed for t in made.trials}) == len(made.trials)
    assert len({t.fingerprint for t in made.trials}) == len(made.trials)


def test_the_other_trials_change_only_in_number(desk: Desk) -> None:
    def rest(made: Plan) -> list[dict[str, object]]:
        trials = (t for t in made.trials if t.role is not Role.CHECK)
        return [t.model_dump(exclude={"number"}) for t in trials]

    assert rest(plan(desk, CHECK + TESTS)) == rest(plan(desk, TESTS))


def test_what_is_said_of_the_tests_counts_the_checks(desk: Desk) -> None:
    made = plan(desk, CHECK + TESTS)
    reference, other = made.tests
    assert reference.numbers == (1, 5, 11)
    assert other.numbers == (2, 3, 4, 6, 7, 8, 9, 10, 12)
    assert made.duration == pytest.approx(3 * 2 / 0.24 + 9 * 2.0)
    for test in made.tests:
        for use in test.closest:
            assert made.trials[use.trial - 1].test == test.name


def test_it_determines_the_plan(desk: Desk) -> None:
    with_it, without = plan(desk, CHECK + TESTS), plan(desk, TESTS)
    assert with_it.normalised["check"] == {"test": "reference", "every": 3}
    assert "check" not in without.normalised
    assert with_it.fingerprint != without.fingerprint
    assert plan(desk, CHECK + TESTS).trials == with_it.trials


def test_only(desk: Desk) -> None:
    def checks(*only: str) -> int:
        made = plan(desk, CHECK.replace("3", "1") + TESTS, only=only)
        return sum(t.role is Role.CHECK for t in made.trials)

    assert (checks(), checks("reference"), checks("map")) == (7, 1, 0)


def test_the_first_as_written_whatever_the_order(desk: Desk) -> None:
    shuffled = TESTS.replace("seed = 4", 'seed = 4\norder = "shuffled"').replace("repeat = 3\n", "")
    check = CHECK.replace("reference", "map").replace("3", "1")
    for seed in range(3, 8):
        made = plan(desk, check + shuffled.replace("seed = 4", f"seed = {seed + 1}"))
        speeds = {t.point["speed"] for t in made.trials if t.role is Role.CHECK}
        assert list(speeds) == [pytest.approx(0.0174533, rel=1e-4)]


def test_a_test_of_an_included_protocol(desk: Desk) -> None:
    desk.write("part.toml", CHECK.replace("3", "1") + TESTS)
    assert plan(desk, 'include = ["part.toml"]\n' + CHECK).tests[0].numbers == (1, 5, 11)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[check]\ntest = §"refrence"\nevery = 3\n', r"no test is called.*'reference'\?"),
        ('§[check]\ntest = "reference"\n', r"'every' is missing"),
        ('[check]\ntest = "reference"\nevery = §0\n', r"at least 1"),
        ('[check]\ntest = "reference"\nevery = §"3 min"\n', r"'3 min' is not a whole number"),
    ],
)
def test_mistake(desk: Desk, text: str, message: str) -> None:
    (problem,) = desk.problems(text + TESTS)
    assert re.search(message, problem.message)


def test_nothing_to_repeat(desk: Desk) -> None:
    text = CHECK + TESTS.replace('kind = "swing"', 'kind = "still"')
    protocol = desk.load(text.replace('frequency = "0.24 Hz"\n', ""))
    with pytest.raises(ProtocolError, match=r"protocol.toml:2:8: .*no measurement"):
        make_plan(protocol)
