"""What a run does with trials that fail, backends that give up, and people who stop it."""

from __future__ import annotations

import _thread
import itertools
import json
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.errors import ArchiveError, BackendError, ExitCode, UsageError
from campaign.execution import sequence
from campaign.execution.progress import Progress
from campaign.execution.safety import AbortedError, NotSafeError, describe
from campaign.execution.supervision import Supervision
from campaign.recording import Ending, Fault, Outcome, SafeState
from campaign.trial import Trial
from tests.execution.fakes import (
    COMPLETED,
    RATE,
    FakeBackend,
    Lab,
    OwnBackend,
    SwitchedBench,
    no_space,
)


def raises(error: BaseException) -> Callable[[Callable[[], bool]], Ending]:
    def behave(stopped: Callable[[], bool]) -> Ending:
        raise error

    return behave


def insist(progress: Progress) -> None:
    """Who looks on says stop once more as soon as a trial has ended."""
    if progress.ended:
        raise KeyboardInterrupt


def stopping(bench: Lab, then: Callable[[], Ending]) -> Callable[[Callable[[], bool]], Ending]:
    """The run is stopped while a trial is executed."""

    def behave(stopped: Callable[[], bool]) -> Ending:
        bench.stop.request("Ctrl-C")
        assert stopped()
        return then()

    return behave


def ends(outcome: Outcome, reason: str = "", safe: SafeState = SafeState.CONFIRMED):
    return lambda stopped: Ending(outcome, reason, safe)


def slowly(stopped: Callable[[], bool]) -> Ending:
    time.sleep(0.1)
    return COMPLETED


def test_trials_are_executed_in_order_and_the_bench_is_made_safe_last():
    bench = Lab(3, FakeBackend())
    outcome = bench.run()
    assert bench.backend.log == ["trial-00001", "trial-00002", "trial-00003", "made safe"]
    assert outcome.status is RunStatus.COMPLETE
    assert outcome.exit_code is ExitCode.DONE
    assert bench.archive.sealed == ("complete", "", SafeState.CONFIRMED)
    assert bench.archive.samples == {1: 20, 2: 20, 3: 20}


def test_ended_trials_are_copied_while_others_are_simulated():
    may_end = threading.Event()

    def until_copied(stopped: Callable[[], bool]) -> Ending:
        assert may_end.wait(60.0)
        return COMPLETED

    bench = Lab(2, FakeBackend({2: until_copied}))
    bench.archive.on_seal_next = lambda: bench.archive.copied and may_end.set()
    assert bench.run().status is RunStatus.COMPLETE


def test_ended_trials_are_copied_while_a_bench_is_at_rest(monkeypatch):
    monkeypatch.setattr(sequence, "LOOK", 0.01)
    bench = Lab(3, SwitchedBench(dict.fromkeys((1, 2, 3), slowly)))
    moving = []

    def look() -> None:
        time.sleep(0.02)  # a trial that was submitted moves by now
        moving.extend(bench.backend.moving)

    bench.archive.on_seal_next = look
    bench.run(supervision=Supervision(live=True))
    assert moving == []
    assert bench.archive.copied == 3


def test_a_resumed_run_on_a_bench_copies_two_trials_before_the_next():
    copied = []

    def count(stopped: Callable[[], bool]) -> Ending:
        copied.append(bench.archive.copied)
        return COMPLETED

    bench = Lab(2, SwitchedBench({1: count, 2: count}))
    bench.archive.attempts = [(number, Outcome.COMPLETED) for number in range(3, 13)]
    bench.run(supervision=Supervision(live=True))
    assert copied == [2, 4]


@pytest.mark.parametrize(
    ("outcome", "code"),
    [
        (Outcome.DIVERGED, ExitCode.TRIALS_FAILED),
        (Outcome.LIMIT, ExitCode.LIMIT_OR_FAULT),
        (Outcome.FAULT, ExitCode.LIMIT_OR_FAULT),
    ],
)
def test_a_failed_trial_is_recorded_and_the_campaign_goes_on(outcome: Outcome, code: ExitCode):
    bench = Lab(3, FakeBackend({2: ends(outcome, "something")}))
    run = bench.run()
    assert bench.archive.endings == {1: COMPLETED, 2: Ending(outcome, "something"), 3: COMPLETED}
    assert run.status is RunStatus.FAILED_TRIALS
    assert run.exit_code is code


UNSAFE = ends(Outcome.FAULT, "no answer from the drive", SafeState.NOT_CONFIRMED)


def test_nothing_moves_after_an_unsafe_trial_until_the_bench_was_seen_at_rest():
    bench = Lab(3, FakeBackend({2: UNSAFE}))
    run = bench.run()
    first, second, third = (f"trial-0000{number}" for number in (1, 2, 3))
    assert bench.backend.log == [first, second, "made safe", third, "made safe"]
    assert bench.archive.decisions == [("make safe", 2), ("skip", 2)]
    assert "trial-00002: the safe state was not confirmed; now confirmed" in bench.remarks
    assert run.status is RunStatus.FAILED_TRIALS


def test_a_bench_that_is_not_seen_at_rest_after_a_trial_ends_the_run():
    bench = Lab(3, FakeBackend({2: UNSAFE}, rest=lambda: SafeState.NOT_CONFIRMED))
    run = bench.run()
    assert set(bench.archive.endings) == {1, 2}
    assert bench.archive.decisions == [("make safe", 2)]
    status, reason, safe_state = bench.archive.sealed
    assert (status, safe_state) == ("fault", SafeState.NOT_CONFIRMED)
    assert "not seen at rest with its drive off after trial-00002" in reason
    assert run.exit_code is ExitCode.NOT_SAFE


def test_a_safe_state_that_nobody_saw_comes_before_every_other_exit_code():
    bench = Lab(2, FakeBackend(rest=lambda: SafeState.NOT_CONFIRMED))
    run = bench.run()
    assert run.exit_code is ExitCode.NOT_SAFE
    assert run.status is RunStatus.COMPLETE
    assert "not seen at rest" in run.reason


def not_confirmed() -> SafeState:
    return SafeState.NOT_CONFIRMED


def drive_is_gone() -> SafeState:
    raise OSError("port is gone")


def test_a_make_safe_that_fails_is_not_taken_for_safe():
    bench = Lab(1, FakeBackend(rest=drive_is_gone))
    assert bench.run().exit_code is ExitCode.NOT_SAFE
    assert "port is gone" in bench.archive.sealed[1]


def test_a_backend_that_gives_up_ends_the_run_as_a_fault_with_the_trial_kept():
    bench = Lab(3, FakeBackend({2: raises(BackendError("the port closed"))}))
    run = bench.run()
    assert bench.archive.endings[2].outcome is Outcome.FAULT
    assert bench.archive.endings[2].reason == "the port closed"
    assert set(bench.archive.endings) == {1, 2}
    assert bench.backend.log[-1] == "made safe"
    assert (run.status, run.exit_code) == (RunStatus.FAULT, ExitCode.LIMIT_OR_FAULT)


def test_a_bug_in_a_backend_of_ours_still_seals_the_archive_and_is_not_swallowed():
    bench = Lab(3, OwnBackend({2: raises(ZeroDivisionError("oops"))}))
    with pytest.raises(ZeroDivisionError):
        bench.run()
    assert bench.backend.log[-1] == "made safe"
    status, reason, _ = bench.archive.sealed
    assert status == "fault"
    assert "ZeroDivisionError: oops" in reason


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("oops"), SystemExit(0), KeyboardInterrupt(), UsageError("oops")]
)
def test_whatever_the_backend_of_another_raises_is_a_fault_with_its_name(error: BaseException):
    bench = Lab(3, FakeBackend({2: raises(error)}))
    run = bench.run()
    assert (run.status, run.exit_code) == (RunStatus.FAULT, ExitCode.LIMIT_OR_FAULT)
    assert bench.backend.log[-1] == "made safe"
    named = "execute() failed in tests.execution.fakes" in run.reason
    assert named or isinstance(error, UsageError), run.reason
    assert describe(error) in run.reason


@pytest.mark.parametrize(
    "ending",
    [None, {"outcome": "completed"}, Ending("completed"), Ending(Outcome.FAULT, fault="x")],
)
def test_an_ending_of_another_type_is_a_fault(ending: object):
    run = Lab(2, FakeBackend({1: lambda stopped: ending})).run()
    assert (run.status, run.exit_code) == (RunStatus.FAULT, ExitCode.LIMIT_OR_FAULT)
    assert "execute() of tests.execution.fakes.FakeBackend answered with" in run.reason


def test_what_execute_says_is_archived_as_plain_text_and_json():
    telemetry = {"bad \ud800": float("nan"), "deep": [{"object": object()}], 3: True}
    telemetry |= {"counts": np.int64(7), "currents": np.array([1.5, np.inf], dtype=np.float32)}
    ending = Ending(Outcome.FAULT, "a\ud800b\x1b[2J" + "x" * 10_000, telemetry=telemetry)
    bench = Lab(1, FakeBackend({1: lambda stopped: ending}))
    bench.run()
    kept = bench.archive.endings[1]
    assert kept.reason.startswith("a?b?[2Jxxx")
    assert len(kept.reason) < 2100
    assert kept.telemetry == {
        "bad ?": "nan", "deep": [{"object": "(object, no text)"}], "(int, no text)": True,
        "counts": 7, "currents": [1.5, "inf"],
    }  # fmt: skip
    json.dumps(kept.telemetry, allow_nan=False).encode()


def test_an_archive_that_cannot_be_written_ends_the_run_unsealed_with_the_bench_safe():
    bench = Lab(3, FakeBackend())
    bench.archive.begin = no_space  # type: ignore[assignment]
    with pytest.raises(ArchiveError, match="no space left"):
        bench.run()
    assert bench.backend.log == ["made safe"]
    assert bench.archive.sealed is None


def test_a_stop_lets_the_running_trial_end_and_begins_no_other():
    bench = Lab(3, FakeBackend())
    interrupted = Ending(Outcome.INTERRUPTED, "stopped")
    bench.backend.behaviour[2] = stopping(bench, lambda: interrupted)
    run = bench.run()
    assert set(bench.archive.endings) == {1, 2}
    assert bench.archive.sealed == ("interrupted", "stopped by Ctrl-C", SafeState.CONFIRMED)
    assert run.exit_code is ExitCode.INTERRUPTED


def test_a_stop_after_the_last_trial_changes_nothing():
    bench = Lab(1, FakeBackend())
    bench.backend.behaviour[1] = stopping(bench, lambda: COMPLETED)
    assert bench.run().exit_code is ExitCode.DONE


@pytest.mark.parametrize(("said", "who"), [("emergency stop", "emergency stop"), ("", "the bench")])
def test_a_trial_interrupted_at_the_bench_interrupts_the_run(said: str, who: str):
    bench = Lab(3, FakeBackend({1: ends(Outcome.INTERRUPTED, said)}))
    run = bench.run()
    assert set(bench.archive.endings) == {1}
    assert (run.status, run.reason) == (RunStatus.INTERRUPTED, f"stopped by {who}")


def test_who_stopped_a_run_comes_before_what_then_failed():
    bench = Lab(3, FakeBackend())
    closed = raises(BackendError("the port closed"))
    bench.backend.behaviour[2] = stopping(bench, lambda: closed(bench.stop))
    run = bench.run()
    assert (run.status, run.exit_code) == (RunStatus.INTERRUPTED, ExitCode.INTERRUPTED)
    assert run.reason == "stopped by Ctrl-C; the port closed"


def test_a_run_that_ends_anyway_makes_the_bench_safe_once():
    bench = Lab(3, FakeBackend())
    bench.backend.behaviour[1] = stopping(bench, lambda: UNSAFE(bench.stop))
    bench.run()
    assert bench.backend.log == ["trial-00001", "made safe"]


def test_samples_that_were_lost_are_no_numbers():
    class Leaky(FakeBackend):
        def execute(self, trial, recorder, stopped):
            recorder.start((RATE,))
            recorder.append(np.array([0.0, 0.1]), np.array([[1.0, 2.0]]))
            recorder.lost(np.array([0.2, 0.3]))
            recorder.append(np.array([0.4]), np.array([[5.0]]))
            return Ending(Outcome.FAULT, "samples were lost", fault=Fault.LOST_SAMPLES)

    bench = Lab(1, Leaky())
    bench.run()
    recording = bench.archive.recordings[1]
    np.testing.assert_array_equal(recording["gyro_rate"], [1.0, 2.0, np.nan, np.nan, 5.0])
    (event,) = recording.events
    assert (event.time, event.text) == (0.2, "samples 2 to 3 were lost and are NaN")


def test_a_second_stop_aborts_at_once_with_the_bench_safe_and_nothing_sealed():
    bench = Lab(3, FakeBackend())

    bench.display = insist
    with pytest.raises(AbortedError) as aborted:
        bench.run()
    assert aborted.value.exit_code is ExitCode.INTERRUPTED
    assert bench.backend.log[-1] == "made safe"
    assert bench.archive.sealed is None


@pytest.mark.usefixtures("heeding_ctrl_c")
def test_a_stop_while_the_bench_is_made_safe_is_not_taken_for_safe():
    def interrupted() -> SafeState:
        _thread.interrupt_main()
        time.sleep(5.0)
        return SafeState.CONFIRMED

    bench = Lab(1, FakeBackend(rest=interrupted))
    with pytest.raises(NotSafeError, match="SAFE STATE NOT CONFIRMED") as unsafe:
        bench.run()
    assert unsafe.value.exit_code is ExitCode.NOT_SAFE
    assert "stopped at once" in str(unsafe.value)


def assert_unsafe_is_said_first(bench: Lab, *reasons: str) -> None:
    with pytest.raises(NotSafeError) as unsafe:
        bench.run()
    assert unsafe.value.exit_code is ExitCode.NOT_SAFE
    assert str(unsafe.value).startswith("SAFE STATE NOT CONFIRMED")
    for reason in reasons:
        assert reason in str(unsafe.value)


@pytest.mark.parametrize(
    ("rest", "why"), [(not_confirmed, "not seen at rest"), (drive_is_gone, "port is gone")]
)
def test_an_unsafe_bench_comes_before_an_archive_that_cannot_be_written(
    rest: Callable[[], SafeState], why: str
):
    bench = Lab(3, FakeBackend(rest=rest))
    bench.archive.begin = no_space  # type: ignore[assignment]
    assert_unsafe_is_said_first(bench, why, "no space left", "run.partial")


def test_an_unsafe_bench_comes_before_a_bug_in_the_backend():
    oops = raises(ZeroDivisionError("oops"))
    bench = Lab(3, OwnBackend({2: oops}, rest=not_confirmed))
    assert_unsafe_is_said_first(bench, "not seen at rest", "ZeroDivisionError: oops", "run.nxs")
    status, reason, safe_state = bench.archive.sealed
    assert (status, safe_state) == ("fault", SafeState.NOT_CONFIRMED)
    assert "not seen at rest" in reason


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (ArchiveError("no space left"), "no space left"),
        (RuntimeError("oops"), "RuntimeError: oops"),
        (KeyboardInterrupt(), "stopped at once"),
    ],
)
def test_an_unsafe_bench_comes_before_an_archive_that_cannot_be_sealed(
    error: BaseException, said: str
):
    bench = Lab(1, FakeBackend(rest=not_confirmed))

    def fail(*arguments: object, **more: object) -> None:
        raise error

    bench.archive.seal = fail  # type: ignore[assignment]
    assert_unsafe_is_said_first(bench, "not seen at rest", said, "run.partial")


def test_an_unsafe_bench_comes_before_a_stop_by_force():
    bench = Lab(3, FakeBackend(rest=not_confirmed))

    bench.display = insist
    assert_unsafe_is_said_first(bench, "stopped at once")


def test_parallel_trials_run_at_the_same_time_and_all_are_archived():
    together = threading.Barrier(40, timeout=60)

    def meet(stopped: Callable[[], bool]) -> Ending:
        together.wait()  # breaks, and so fails the trial, when nobody else comes
        return COMPLETED

    before = set(threading.enumerate())
    bench = Lab(80, FakeBackend(dict.fromkeys(range(1, 81), meet)))
    run = bench.run(workers=40)
    assert not set(threading.enumerate()) - before
    assert run.outcomes == {Outcome.COMPLETED: 80}
    assert set(bench.archive.endings) == set(range(1, 81))


def test_a_second_stop_waits_for_no_trial_that_does_not_end():
    let_go, hanging = threading.Event(), threading.Event()

    def hang(stopped: Callable[[], bool]) -> Ending:
        hanging.set()
        assert let_go.wait(60)
        return COMPLETED

    def end(stopped: Callable[[], bool]) -> Ending:
        assert hanging.wait(60)
        return COMPLETED

    before = set(threading.enumerate())
    bench = Lab(2, FakeBackend({1: hang, 2: end}))
    bench.display = insist
    try:
        with pytest.raises(AbortedError):
            bench.run(workers=2)
        assert 1 not in bench.archive.endings
    finally:
        let_go.set()
        for thread in set(threading.enumerate()) - before:
            thread.join(60)


def until_stopped(then: Callable[[], Ending]) -> Callable[[Callable[[], bool]], Ending]:
    def behave(stopped: Callable[[], bool]) -> Ending:
        while not stopped():
            time.sleep(0.001)
        return then()

    return behave


def test_when_the_archive_fails_the_other_trials_end_before_the_bench_is_made_safe():
    bench = Lab(2, FakeBackend())
    begin = bench.archive.begin

    def last() -> Ending:
        time.sleep(0.1)
        bench.backend.log.append("ended")
        return COMPLETED

    def full(trial: Trial, keeping: object) -> object:
        if trial.number == 2:
            raise ArchiveError("no space left")
        return begin(trial)

    bench.backend.behaviour[1] = until_stopped(last)
    bench.archive.begin = full  # type: ignore[assignment]
    before = set(threading.enumerate())
    with pytest.raises(ArchiveError, match="no space left"):
        bench.run(workers=2)
    for idle in set(threading.enumerate()) - before:
        idle.join(10)
        assert not idle.is_alive()
    assert bench.backend.log == ["trial-00001", "ended", "made safe"]


def test_of_several_faults_the_first_is_the_reason():
    def second() -> Ending:
        raise ValueError("two")

    bench = Lab(2, OwnBackend({1: raises(KeyError("one")), 2: until_stopped(second)}))
    with pytest.raises(KeyError, match="one"):
        bench.run(workers=2)
    assert "KeyError: 'one'" in bench.archive.sealed[1]
    assert "two" not in bench.archive.sealed[1]


def test_a_fault_lets_parallel_trials_end_without_calling_it_an_interruption():
    def wait_for_stop(stopped: Callable[[], bool]) -> Ending:
        waiting.set()
        while not stopped():
            pass
        return Ending(Outcome.INTERRUPTED, "stopped")

    def fail(stopped: Callable[[], bool]) -> Ending:
        assert waiting.wait(10)
        raise BackendError("the port closed")

    waiting = threading.Event()
    bench = Lab(6, FakeBackend({1: wait_for_stop, 2: fail}))
    run = bench.run(workers=2)
    assert set(bench.archive.endings) == {1, 2}
    assert (run.status, run.exit_code) == (RunStatus.FAULT, ExitCode.LIMIT_OR_FAULT)


def test_progress_adds_up_to_the_plan_and_tells_the_time_left(monkeypatch):
    clock = SimpleNamespace(monotonic=itertools.count(100.0).__next__)  # 1 s between two reports
    monkeypatch.setattr("campaign.execution.progress.time", clock)
    bench = Lab(4, FakeBackend({2: ends(Outcome.DIVERGED)}))
    bench.run()
    last = bench.progress[-1]
    assert (last.total, last.done, last.failed, last.left) == (4, 3, 1, 0)
    half_way = bench.progress[3]  # begin, end, begin, end
    assert half_way.left == 2
    assert half_way.time_left == pytest.approx(2 * 2.0)  # 2 s a trial, after the first
    assert bench.progress[0].time_left is None
    assert bench.progress[1].time_left is None
