"""What a run does besides its trials: retries, skips, aborts, rests, and steps for a person."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ExitCode
from campaign.execution.operator_prompts import wait_unless
from campaign.execution.stop import StopSwitch
from campaign.policy import Response, Rest
from campaign.recording import Ending, Fault, Outcome
from campaign.trial import Trial
from tests.execution.fakes import COMPLETED, Lab, make_trials

LOST = Ending(Outcome.FAULT, "no word for 3 s", fault=Fault.LOST_CONNECTION)
LIMIT = Ending(Outcome.LIMIT, "too fast")


def in_turn(*endings: Ending) -> Callable[[Callable[[], bool]], Ending]:
    """What a trial does, attempt by attempt."""
    waiting = iter(endings)
    return lambda stopped: next(waiting)


def test_a_trial_is_executed_again_after_a_pause_and_only_its_last_attempt_counts():
    retry = Response(do="retry", times=3, pause="5 s")
    lab = Lab(2, {1: in_turn(LOST, LOST, COMPLETED)}, faults={"lost-connection": retry})
    run = lab.run()
    assert lab.archive.attempts == [
        *((1, Outcome.FAULT), (1, Outcome.FAULT), (1, Outcome.COMPLETED)),
        (2, Outcome.COMPLETED),
    ]
    assert lab.pauses == [5.0, 5.0]
    assert lab.remarks == ["trial-00001 is executed again in 5 s"] * 2
    assert lab.archive.decisions == [("retry", 1), ("retry", 1)]
    assert run.outcomes == {Outcome.COMPLETED: 2}
    assert (run.status, run.exit_code) == (RunStatus.COMPLETE, ExitCode.DONE)
    assert [p.left for p in lab.progress if p.ended] == [2, 2, 1, 0]


@pytest.mark.parametrize(
    ("then", "executed", "status"),
    [("skip", 4, RunStatus.FAILED_TRIALS), ("abort", 2, RunStatus.FAULT)],
)
def test_when_the_last_retry_fails_the_policy_says_what_then(then, executed, status):
    retry = Response(do="retry", times=1, then=then)
    lab = Lab(3, {1: in_turn(LOST, LOST)}, faults={"default": retry})
    run = lab.run()
    assert len(lab.executed) == executed
    assert lab.archive.decisions == [("retry", 1), (then, 1)]
    assert "after 1 retry" in lab.archive.reasons[-1]
    assert run.status is status
    assert run.exit_code is ExitCode.LIMIT_OR_FAULT


def test_each_occasion_has_its_own_response_and_a_limit_is_one():
    lab = Lab(3, {1: in_turn(LOST), 2: in_turn(LIMIT)}, faults={"limit": "abort"})
    run = lab.run()
    assert lab.archive.decisions == [("skip", 1), ("abort", 2)]
    assert run.status is RunStatus.FAULT
    assert run.reason == "aborted after trial-00002: limit: too fast"


def test_policies_work_for_parallel_trials():
    behaviour = {n: in_turn(LOST, COMPLETED) for n in range(1, 9)}
    lab = Lab(8, behaviour, faults={"default": "retry"})
    run = lab.run(workers=3)
    assert run.outcomes == {Outcome.COMPLETED: 8}
    assert sorted(lab.archive.decisions) == [("retry", n) for n in range(1, 9)]
    assert sorted(lab.remarks) == [f"trial-0000{n} is executed again" for n in range(1, 9)]


def test_the_bench_rests_between_trials_after_so_much_bench_time():
    lab = Lab(5, {}, rest=Rest(every="4 s", pause="60 s"))  # each trial lasts 2 s
    lab.run()
    assert lab.pauses == [60.0, 60.0]
    assert lab.archive.decisions == [("rest", None), ("rest", None)]
    assert lab.archive.reasons == ["60 s after 4 s of bench time"] * 2
    assert lab.remarks == ["the bench rests for 60 s"] * 2


def test_nothing_moves_while_the_bench_rests_or_hands_are_at_it():
    """Trial 2 goes on until somebody rests or is asked beside it, or long enough."""
    disturbed, moving = threading.Event(), threading.Event()

    def second(stopped: Callable[[], bool]) -> Ending:
        moving.set()
        assert not disturbed.wait(0.3)
        moving.clear()
        return COMPLETED

    def first(stopped: Callable[[], bool]) -> Ending:
        assert moving.wait(60)
        return COMPLETED

    class Hands:
        def confirm(self, trial: Trial, step: str, stop: Callable[[], bool]) -> str | None:
            disturbed.set()
            assert not moving.is_set()
            return "done"

    for rest, setups in (({"every": "3 s", "pause": "60 s"}, ()), (None, ("preload",))):
        disturbed.clear()
        lab = Lab(set_up((), (), setups, setups), {1: first, 2: second}, rest=rest)
        lab.operator, lab.pause = Hands(), lambda seconds: disturbed.set()
        run = lab.run(workers=2)
        assert disturbed.is_set()
        assert run.outcomes == {Outcome.COMPLETED: 4}


def test_a_run_that_was_stopped_neither_rests_nor_asks_anybody():
    def stops(stopped: Callable[[], bool]) -> Ending:
        lab.stop.request("Ctrl-C")
        return COMPLETED

    lab = Lab(set_up((), ("preload",)), {1: stops}, rest=Rest(every="1 s", pause="60 s"))
    lab.run()
    assert (lab.pauses, lab.archive.decisions, lab.archive.steps) == ([], [], [])
    lab = Lab(set_up((), ("preload",)), {}, rest=Rest(every="1 s", pause="60 s"))
    lab.pause = lambda seconds: lab.stop.request("Ctrl-C")  # in the rest itself
    lab.run()
    assert lab.archive.steps == []
    assert lab.executed == ["trial-00001"]


def test_a_rest_asks_for_nothing_that_has_been_done():
    one = ("preload to 1 N m",)
    lab = Lab(set_up(one, one, (), one), {}, rest=Rest(every="1 s", pause="60 s"))
    lab.run()
    assert lab.archive.steps == [(1, "preload to 1 N m", "simulated")]
    assert lab.pauses == [60.0] * 3


def test_nothing_rests_for_a_trial_that_does_not_come():
    lab = Lab(2, {}, rest=Rest(every="4 s", pause="60 s"))
    lab.run()
    assert lab.pauses == []


def test_a_stop_during_the_pause_before_a_retry_interrupts_the_run():
    lab = Lab(2, {1: in_turn(LOST, COMPLETED)}, faults={"default": "retry"})
    lab.pause = lambda seconds: lab.stop.request("Ctrl-C")
    run = lab.run()
    assert lab.executed == ["trial-00001"]
    assert run.status is RunStatus.INTERRUPTED
    assert lab.archive.decisions == [("retry", 1)]


def test_a_pause_ends_at_once_when_the_run_is_stopped_already():
    stop = StopSwitch()
    stop.request("Ctrl-C")
    wait_unless(1e9, stop)  # does not come back otherwise


def set_up(*setups: tuple[str, ...]) -> list[Trial]:
    trials = make_trials(len(setups))
    pairs = zip(trials, setups, strict=True)
    return [trial.model_copy(update={"setup": setup}) for trial, setup in pairs]


def test_steps_are_confirmed_before_the_first_trial_for_which_they_differ():
    one, two = ("preload to 1 N m",), ("demount the gear", "preload to 2 N m")
    lab = Lab(set_up(one, one, (), two, two, one), {})
    lab.run()
    assert lab.archive.steps == [
        (1, "preload to 1 N m", "simulated"),
        (4, "demount the gear", "simulated"),
        (4, "preload to 2 N m", "simulated"),
        (6, "preload to 1 N m", "simulated"),
    ]


def test_a_resume_shows_the_steps_again_and_repeats_nothing_that_is_done():
    lab = Lab(set_up(("preload",), ("preload",), ("preload",)), {})
    run = lab.run(finished={1: Outcome.COMPLETED, 2: Outcome.LIMIT})
    assert lab.executed == ["trial-00003"]
    assert lab.archive.steps == [(3, "preload", "simulated")]
    assert run.outcomes == {Outcome.COMPLETED: 2, Outcome.LIMIT: 1}
    assert run.status is RunStatus.FAILED_TRIALS
    assert lab.progress[0].left == 1


def test_a_person_who_says_stop_interrupts_the_run_before_anything_moves():
    class Unwilling:
        def confirm(self, trial: Trial, step: str, stop: Callable[[], bool]) -> str | None:
            return None

    lab = Lab(set_up((), ("preload",)), {})
    lab.operator = Unwilling()
    run = lab.run()
    assert lab.executed == ["trial-00001"]
    assert lab.archive.steps == [(2, "preload", "stop")]
    assert (run.status, run.reason) == (RunStatus.INTERRUPTED, "stopped by the operator")
