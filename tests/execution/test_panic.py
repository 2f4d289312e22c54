"""A stop from outside, as the runner meets it: the run ends, and says why with its exit code."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import pytest

from campaign.errors import ExitCode
from campaign.execution.operator_prompts import Attendance, SimulatedOperator, wait_unless
from campaign.recording import Ending, Fault, Outcome, PanicStop, Recorder, SafeState
from campaign.trial import Trial
from tests.execution.fakes import FakeBackend, Lab

STOP = PanicStop(3, "ada")
CUT = Ending(Outcome.INTERRUPTED, str(STOP))


@dataclass
class StoppableBackend(FakeBackend):
    stop: PanicStop | None = None
    broken: bool = False

    def introduce(self, run: str) -> None: ...

    def execute(self, trial: Trial, recorder: Recorder, stopped: Callable[[], bool]) -> Ending:
        if self.stop is not None:  # as a controller that refuses to arm
            return CUT
        return super().execute(trial, recorder, stopped)

    def panic_stop(self) -> PanicStop | None:
        if self.broken:
            raise RuntimeError("a bug")
        return self.stop

    def clear_stop(self, count: int) -> None:
        self.log.append("cleared")


def stopped_in(number: int, ending: Ending = CUT) -> StoppableBackend:
    backend = StoppableBackend()

    def behave(stopped: object) -> Ending:
        backend.stop = STOP
        return ending

    backend.behaviour[number] = behave
    return backend


def test_in_a_trial_it_ends_the_run_and_is_told() -> None:
    lab = Lab(3, stopped_in(2))
    outcome, archive = lab.run(), lab.archive
    assert (outcome.status, outcome.reason) == ("interrupted", "panic stop by ada")
    assert outcome.exit_code is ExitCode.INTERRUPTED
    assert archive.decisions == [("panic stop", None)]
    assert archive.reasons == ["by ada, stop number 3"]
    assert list(archive.endings) == [1, 2]


def test_a_bench_not_seen_at_rest_comes_first() -> None:
    backend = stopped_in(2)
    backend.rest = lambda: SafeState.NOT_CONFIRMED
    outcome = Lab(3, backend).run()
    assert outcome.exit_code is ExitCode.NOT_SAFE
    assert outcome.reason.startswith("panic stop by ada; ")


@pytest.mark.parametrize("number", [1, 3])
def test_between_trials_and_after_the_last_one(number: int) -> None:
    lab = Lab(3, stopped_in(number, Ending(Outcome.COMPLETED)))
    outcome, archive = lab.run(), lab.archive
    assert outcome.exit_code is ExitCode.INTERRUPTED
    assert outcome.reason == "panic stop by ada"
    done = [at for at, ending in archive.endings.items() if ending.outcome is Outcome.COMPLETED]
    assert done == list(range(1, number + 1))


def test_no_retry_follows_it_however_the_trial_ended() -> None:
    hot = Ending(Outcome.FAULT, "hot", fault=Fault.DRIVE)
    retry = {"default": {"do": "retry", "times": 5, "pause": 1e9}}
    lab = Lab(3, stopped_in(1, hot), faults=retry)
    waits = Attendance(SimulatedOperator(), wait_unless)
    assert lab.run(attendance=waits).reason == "panic stop by ada"
    assert [number for number, _ in lab.archive.attempts] == [1]


def test_the_run_never_clears_it() -> None:
    backend = stopped_in(1)
    Lab(3, backend).run()
    assert "cleared" not in backend.log


def test_a_bench_that_cannot_be_asked_ends_the_run_and_not_the_archive() -> None:
    lab = Lab(3, StoppableBackend(broken=True))
    outcome = lab.run()
    assert outcome.status == "interrupted"
    assert "cannot be asked: panic_stop() failed in" in outcome.reason
    assert lab.archive.sealed is not None
