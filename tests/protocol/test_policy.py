"""`[faults]` and `[rest]`: what a protocol wants done besides its trials."""

from __future__ import annotations

import re
from typing import get_args

import pytest

from campaign.policy import Occasion, Policy, Response, Rest
from campaign.protocol import as_tree, make_plan
from campaign.recording import Ending, Fault, Outcome

from .conftest import Desk

TEST = '[[test]]\nname = "t"\nkind = "swing"\nbench = "simulink"\nfrequency = "0.24 Hz"\nseed = 3\n'
WRITTEN = """\
[faults]
default = "abort"
limit = "skip"
over-temperature = { do = "retry", times = 3, pause = "5 min", then = "skip" }

[rest]
every = "1 h"
pause = "10 min"

"""


def test_what_is_written_is_what_applies(desk: Desk) -> None:
    policy = make_plan(desk.load(WRITTEN + TEST)).protocol.policy
    assert policy.rest == Rest.model_construct(every=3600.0, pause=600.0)
    hot = policy.response(Ending(Outcome.FAULT, fault=Fault.OVER_TEMPERATURE))
    assert (hot.do, hot.times, hot.pause, hot.then) == ("retry", 3, 300.0, "skip")
    assert policy.response(Ending(Outcome.LIMIT)).do == "skip"
    assert policy.response(Ending(Outcome.DIVERGED)).do == "abort"
    assert policy.response(Ending(Outcome.FAULT)).do == "abort"


def test_every_fault_is_an_occasion() -> None:
    assert {*Fault} < set(get_args(Occasion))


def test_without_tables_a_failed_trial_is_skipped(desk: Desk) -> None:
    policy = desk.load(TEST).policy
    assert policy == Policy()
    assert policy.response(Ending(Outcome.FAULT, fault=Fault.DRIVE)) == Response(do="skip")


def test_the_policy_determines_no_trial(desk: Desk) -> None:
    with_it, without = make_plan(desk.load(WRITTEN + TEST)), make_plan(desk.load(TEST))
    assert with_it.protocol.policy != without.protocol.policy
    assert with_it.fingerprint == without.fingerprint
    assert with_it.normalised == without.normalised


def test_only_the_top_files_policy_applies(desk: Desk) -> None:
    desk.write("part.toml", WRITTEN + TEST)
    assert desk.load('include = ["part.toml"]\n').policy == Policy()
    assert desk.load('include = ["part.toml"]\n[rest]\nevery = "1 h"\npause = "1 s"\n').policy.rest


def test_mistakes_of_an_included_policy_are_mistakes(desk: Desk) -> None:
    desk.write("part.toml", '[faults]\ndefault = §"retyr"\n' + TEST)
    desk.problems('include = ["part.toml"]\n')


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[faults]\ndefault = §"abrot"\n', r"'abrot' is not allowed here.*did you mean 'abort'\?"),
        ('[faults]\n§over-temp = "skip"\n', r"'over-temp' is not allowed.*'over-temperature'\?"),
        ("[faults]\ndefault = §3\n", r"3 is not a table"),
        ('[faults]\ndrive = { do = §"rety" }\n', r"did you mean 'retry'\?"),
        ('[faults]\ndrive = { do = "retry", §tims = 2 }\n', r"unknown key 'tims'.*'times'\?"),
        ('[faults]\ndrive = { do = "retry", times = §0 }\n', r"at least 1"),
        ('[faults]\ndrive = { do = "retry", pause = §5 }\n', r"5 has no unit"),
        ('[faults]\ndrive = §{ pause = "5 s" }\n', r'belong to do = "retry"'),
        ('[faults.drive]\ndo = "retry"\nthen = §"retry"\n', r"allowed are skip, abort"),
        ('§[rest]\nevery = "1 h"\n', r"'pause' is missing: a time"),
        ('[rest]\nevery = §"0 s"\npause = "1 s"\n', r"greater than 0 s"),
        ('rest = §"1 h"\n', r"'1 h' is not a table"),
    ],
)
def test_mistake(desk: Desk, text: str, message: str) -> None:
    (problem,) = desk.problems(text + TEST)
    assert re.search(message, problem.message)


def test_set(desk: Desk) -> None:
    settings = ("faults.default=skip", "rest.pause=1 min", "faults.sensor={do='retry'}")
    policy = desk.load(WRITTEN + TEST, *settings).policy
    assert policy.rest.pause == 60.0
    assert policy.faults["default"].do == "skip"
    assert policy.faults["sensor"].do == "retry"
    assert policy.faults["limit"].do == "skip"  # the others stay


def test_the_plan_as_data_has_it(desk: Desk) -> None:
    tree = as_tree(make_plan(desk.load(WRITTEN + TEST)))
    assert tree["policy"]["rest"] == {"every": 3600.0, "pause": 600.0}
    assert tree["policy"]["faults"]["default"]["do"] == "abort"
