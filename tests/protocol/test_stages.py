"""What a plan knows of the trials that may follow from its own."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import pytest

from campaign.errors import ProtocolError
from campaign.protocol import as_tree, make_plan
from campaign.protocol.expand import LARGEST_PLAN
from campaign.protocol.plan_tree import planned_stage
from campaign.trial import Most, TrialRequest
from tests.protocol.conftest import KINDS, Desk

SWING = """
[[test]]
name = "swing"
kind = "swing"
bench = "simulink"
frequency = "1 Hz"
seed = 3

[test.matrix]
cycles = [1, 2, 3]
"""


class Twice:
    """As many trials as there are cycles, from two on."""

    name = "again"
    why = "to be sure"

    def most(self, options, bench) -> Most:
        return Most(options.cycles if options.cycles > 1 else 0, 10.0 * options.cycles, 1000)


@pytest.fixture
def staged(monkeypatch: pytest.MonkeyPatch):
    def use(*stages: object) -> None:
        monkeypatch.setitem(KINDS, "swing", replace(KINDS["swing"], stages=stages))

    use(Twice())
    return use


def test_stages_are_planned_by_point_where_the_options_ask_for_them(desk: Desk, staged) -> None:
    plan = make_plan(desk.load(SWING))
    stages = plan.tests[0].stages
    assert [(s.number, s.name, s.point, s.seed) for s in stages] == [
        (2, "again", {"cycles": 2}, 3),
        (2, "again", {"cycles": 3}, 3),
    ]
    assert plan.following == Most(5, 50.0, 2000)
    assert len(plan.trials) == 3, "they are not among the planned trials"
    assert plan.duration == pytest.approx(6.0), "nor is their time"


def test_a_plan_says_them_as_json_and_the_archive_reads_them_back(desk: Desk, staged) -> None:
    plan = make_plan(desk.load(SWING))
    tree = json.loads(json.dumps(as_tree(plan)))
    assert tree["following"] == {"trials": 5, "duration_s": 50.0, "samples": 2000}
    read = [planned_stage("swing", stage) for stage in tree["tests"][0]["stages"]]
    assert tuple(read) == plan.stages


def test_what_may_follow_counts_in_the_size(desk: Desk, staged) -> None:
    protocol = desk.load(SWING)
    with_stages = make_plan(protocol, seed=1).size
    staged()
    plain = make_plan(desk.load(SWING), seed=1).size
    # Eleven channels and the time of 2000 samples, and five trials' structure.
    assert with_stages - plain > 2000 * 12 * 8 + 5 * 32_000


@pytest.mark.parametrize(
    ("most", "told"),
    [
        (
            Most(LARGEST_PLAN // 3, 1.0, 1),
            "with the trials that may follow, the plan has over 100000",
        ),
        (Most(10**9, 1.0, 1), "of memory; a plan"),
        (Most(1, math.inf, 1), "the stage 'again' has no bound of its duration"),
    ],
)
def test_a_plan_that_stages_make_too_large_is_refused(desk: Desk, staged, most, told) -> None:
    stage = Twice()
    stage.most = lambda options, bench: most  # type: ignore[method-assign]
    staged(stage)
    with pytest.raises(ProtocolError, match=told) as caught:
        make_plan(desk.load(SWING))
    assert all(problem.line for problem in caught.value.problems)


def test_many_trials_may_follow_where_large_plans_are_allowed(desk: Desk, staged) -> None:
    stage = Twice()
    stage.most = lambda options, bench: Most(40_000, 1.0, 1)  # type: ignore[method-assign]
    staged(stage)
    assert make_plan(desk.load(SWING), allow_large=True).following.trials == 120_000


def test_what_a_stage_cannot_bound_is_a_problem_of_the_file(desk: Desk, staged) -> None:
    def cannot(options, bench) -> Most:
        raise ValueError("no bound for this bench")

    stage = Twice()
    stage.most = cannot  # type: ignore[method-assign]
    staged(stage)
    with pytest.raises(ProtocolError, match=r"'swing' at cycles = 1: no bound for this bench"):
        make_plan(desk.load(SWING))


def test_trials_of_another_point_or_bench_can_have_no_stages(desk, staged, monkeypatch):
    swing = KINDS["swing"]

    def on_its_own(options, bench):
        for request in swing.trials(options, bench):
            yield TrialRequest(request.task, bench=bench.model_dump(mode="json"))

    monkeypatch.setitem(KINDS, "swing", replace(swing, trials=on_its_own))
    with pytest.raises(ProtocolError, match="benches of their own can have no stages"):
        make_plan(desk.load(SWING))

    def its_own_cycles(options, bench):
        for request in swing.trials(options, bench):
            yield replace(request, point={"cycles": 7})

    monkeypatch.setitem(KINDS, "swing", replace(KINDS["swing"], trials=its_own_cycles))
    with pytest.raises(ProtocolError, match="choose cycles, which is swept, themselves can have"):
        make_plan(desk.load(SWING))


def test_checks_leave_the_stages_as_they_are(desk: Desk, staged) -> None:
    plan = make_plan(desk.load(f'check = {{ test = "swing", every = 1 }}\n{SWING}'))
    assert len(plan.trials) == 6
    assert [stage.point for stage in plan.stages] == [{"cycles": 2}, {"cycles": 3}]
