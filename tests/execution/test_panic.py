"""A stop from outside, as the runner meets it: the run ends, and says why with its exit code."""

from __future__ import annotations

import threading

import pytest

from campaign.errors import ExitCode
from campaign.execution.operator_prompts import AbsentOperator, Attendance, wait_unless
from campaign.recording import Ending, Fault, Outcome, PanicStop, SafeState
from tests.execution.fakes import COMPLETED, Lab, SwitchedBench

STOP = PanicStop(3, "ada")
CUT = Ending(Outcome.INTERRUPTED, str(STOP))


def stopped_in(number: int, ending: Ending = CUT) -> SwitchedBench:
    backend = SwitchedBench()

    def behave(stopped: object) -> Ending:
        backend.stop = STOP
        return ending

    backend.behaviour[number] = behave
    return backend


def test_in_a_trial_it_ends_the_run_and_is_told_before_the_bench_is_made_safe() -> None:
    lab = Lab(3, stopped_in(2))

    def made_safe() -> SafeState:
        assert lab.archive.decisions == [("panic stop", None)]
        return SafeState.CONFIRMED

    lab.backend.rest = made_safe
    outcome = lab.run()
    assert (outcome.status, outcome.reason) == ("interrupted", "panic stop by ada")
    assert outcome.exit_code is ExitCode.INTERRUPTED
    assert lab.archive.decisions == [("panic stop", None)]
    assert lab.archive.reasons == ["by ada, stop number 3"]
    assert lab.remarks == ["PANIC STOP by ada: the bench stays off until that is cleared"]
    assert list(lab.archive.endings) == [1, 2]


def test_a_bench_not_seen_at_rest_comes_first() -> None:
    backend = stopped_in(2)
    backend.rest = lambda: SafeState.NOT_CONFIRMED
    outcome = Lab(3, backend).run()
    assert outcome.exit_code is ExitCode.NOT_SAFE
    assert outcome.reason.startswith("panic stop by ada; ")


@pytest.mark.parametrize("number", [1, 3])
@pytest.mark.parametrize("asked_at_once", [False, True])
def test_between_trials_and_after_the_last_one(
    number: int, asked_at_once: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Asked at once nothing moves again; else the next trial is refused by the bench."""
    if asked_at_once:  # these trials take no time
        monkeypatch.setattr("campaign.execution.external_stop.INTERVAL", 0.0)
    lab = Lab(3, stopped_in(number, COMPLETED))
    outcome = lab.run()
    assert (outcome.exit_code, outcome.reason) == (ExitCode.INTERRUPTED, "panic stop by ada")
    assert lab.executed == [f"trial-0000{done}" for done in range(1, number + 1)]
    ends = {at for at, ending in lab.archive.endings.items() if ending == COMPLETED}
    assert ends == set(range(1, number + 1))
    assert len(lab.archive.endings) == number + (number == 1 and not asked_at_once)


def test_a_bench_is_asked_only_while_nothing_moves_also_in_parallel() -> None:
    moment = threading.Event()
    behaviour = {n: lambda stopped: moment.wait(0.02) or COMPLETED for n in range(1, 7)}
    lab = Lab(6, SwitchedBench(behaviour))
    assert lab.run(workers=2).outcomes == {Outcome.COMPLETED: 6}
    assert lab.backend.asked >= 1


def test_no_retry_follows_it_however_the_trial_ended() -> None:
    hot = Ending(Outcome.FAULT, "hot", fault=Fault.DRIVE)
    retry = {"default": {"do": "retry", "times": 5, "pause": 1e9}}
    lab = Lab(3, stopped_in(1, hot), faults=retry)
    waits = Attendance(AbsentOperator(), wait_unless)
    assert lab.run(attendance=waits).reason == "panic stop by ada"
    assert [number for number, _ in lab.archive.attempts] == [1]


def test_the_run_never_clears_it() -> None:
    backend = stopped_in(1)
    Lab(3, backend).run()
    assert "cleared" not in backend.log


def test_a_bench_that_cannot_be_asked_ends_the_run_and_not_the_archive() -> None:
    lab = Lab(3, SwitchedBench(broken=True))
    outcome = lab.run()
    assert outcome.status == "interrupted"
    assert "cannot be asked: panic_stop() failed in" in outcome.reason
    assert lab.archive.sealed is not None
