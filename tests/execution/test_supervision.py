"""A live backend that falls silent, hangs, or does not end a trial that is over."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from campaign.archive.layout.run_status import RunStatus
from campaign.archive.reading.archived_metrics import ArchivedMetrics, Measure
from campaign.archive.reading.archived_trial import ArchivedTrial
from campaign.backends import calls
from campaign.backends.calls import HEARTBEAT, Heartbeat
from campaign.backends.interface import Source
from campaign.errors import ArchiveError, BackendError, ExitCode
from campaign.execution.outcome import RunOutcome
from campaign.execution.recorder import LATE, SupervisingRecorder
from campaign.execution.sample_latency import Pace
from campaign.execution.supervision import Patience, SilenceWatch, Supervision, TrialStop
from campaign.recording import (
    ChannelInfo,
    Ending,
    Fault,
    MemoryRecorder,
    Outcome,
    Recorder,
    SafeState,
)
from campaign.trial import Trial
from tests.execution import fakes
from tests.execution.fakes import COMPLETED, MemoryTrial, make_trials

ANGLE = ChannelInfo("relative_angle", "rad", "Angle", "deg")
INTERRUPTED = Ending(Outcome.INTERRUPTED, "stopped")
LONG = 60.0
"""s; whoever waits for that has failed."""
PATIENT = Patience(
    first=LONG, silence=LONG, closing=LONG, grace=LONG, giving_up=LONG, tick=0.01, asleep=LONG
)
LIMITS = {"limits": {"angle": 1.0, "rate": 1.0, "acceleration": 1.0, "torque": 1.0, "current": 1.0,
                     "duration": 9.0}}  # fmt: skip


@dataclass
class Live:
    """Does `behave` in a trial; remembers what happened in which order."""

    behave: Callable[[Live, Recorder, Callable[[], bool]], Ending]
    state: SafeState = SafeState.CONFIRMED
    log: list[str] = field(default_factory=list)
    made_safe: threading.Event = field(default_factory=threading.Event)
    released: threading.Event = field(default_factory=threading.Event)

    def refuses(self, trial: Trial) -> str | None:
        return None

    def channels(self, trial: Trial) -> frozenset[str] | None:
        return None

    def execute(self, trial: Trial, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        self.log.append("begins")
        recorder.start((ANGLE,))
        try:
            return self.behave(self, recorder, stop)
        finally:
            self.log.append("returns")

    def make_safe(self) -> SafeState:
        self.log.append("made safe")
        self.made_safe.set()
        return self.state


def hand_over(recorder: Recorder, first: int, last: int, angle: float = 0.0) -> None:
    recorder.append(np.arange(first, last) / 10, np.full((1, last - first), angle))


class Lab(fakes.Lab):
    def __init__(
        self, behave: Callable[[Live, Recorder, Callable[[], bool]], Ending], trials: int = 2
    ) -> None:
        limited = [t.model_copy(update={"bench": LIMITS}) for t in make_trials(trials)]
        super().__init__(limited, Live(behave))

    def watched(self, patience: Patience = PATIENT, measure: Measure | None = None) -> RunOutcome:
        return self.run(supervision=Supervision(Source.HARDWARE, True, patience), measure=measure)


@pytest.fixture
def lab() -> Iterator[Callable[..., Lab]]:
    made: list[Lab] = []

    def make(*arguments: object, **more: object) -> Lab:
        made.append(Lab(*arguments, **more))  # type: ignore[arg-type]
        return made[-1]

    yield make
    for each in made:
        each.backend.released.set()


def once(behave: Callable[..., Ending]) -> Callable[..., Ending]:
    """In the first trial; the others are good."""
    done: list[bool] = []

    def either(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        if not done:
            done.append(True)
            return behave(live, recorder, stop)
        hand_over(recorder, 0, 20)
        return COMPLETED

    return either


def test_a_good_live_trial_is_left_alone(lab: Callable[..., Lab]) -> None:
    bench = lab(once(lambda live, recorder, stop: hand_over(recorder, 0, 20) or COMPLETED), 1)
    assert bench.watched().status is RunStatus.COMPLETE
    assert bench.backend.log == ["begins", "returns", "made safe"]
    assert bench.archive.endings[1].telemetry["longest_gap_s"] == 0.0


@pytest.fixture
def signs(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Signs of life as they are sent: whether another one follows."""
    sent: list[bool] = []
    monkeypatch.setattr(HEARTBEAT, "send", sent.append)
    monkeypatch.setattr(HEARTBEAT, "interval", 0.0)
    return sent


def test_the_loop_that_watches_a_trial_sends_signs_of_life(
    lab: Callable[..., Lab], signs: list[bool]
) -> None:
    def waits(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 20)
        first = len(signs)
        for _ in range(5000):
            if len(signs) >= first + 3:
                return COMPLETED
            live.released.wait(0.001)
        return INTERRUPTED

    assert lab(waits, 1).watched().status is RunStatus.COMPLETE
    assert signs[-1] is False


def test_so_does_one_that_waits_for_an_answer(
    lab: Callable[..., Lab], signs: list[bool], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("campaign.backends.calls.MAKING_SAFE", 1.0)
    bench = lab(lambda live, recorder, stop: hand_over(recorder, 0, 20) or COMPLETED, 1)
    monkeypatch.setattr(bench.backend, "make_safe", lambda: bench.backend.released.wait() and None)
    assert bench.watched().exit_code is ExitCode.NOT_SAFE
    assert signs[-4:] == [True, True, True, False]


def test_signs_of_life_end_with_the_last_loop_and_are_not_sent_at_every_turn() -> None:
    sent: list[bool] = []
    one = Heartbeat()
    one.send, one.interval = sent.append, LONG
    with one.expected():
        with one.expected():
            for _ in range(3):
                one.beat()
        assert sent == [True, True, True]
    assert sent == [True, True, True, False]


def test_whatever_hangs_is_told_within_40_s() -> None:
    waits = Patience()
    trial = max(waits.first, waits.silence, waits.closing, waits.grace) + waits.giving_up
    assert trial + calls.MAKING_SAFE + calls.LEAVING <= 40
    assert calls.CONNECTING + calls.MAKING_SAFE + calls.LEAVING <= 40


@pytest.mark.parametrize("breaks", [False, True])
def test_a_bench_that_was_not_seen_safe_is_made_safe_before_its_recording_is_measured(
    lab: Callable[..., Lab], breaks: bool
) -> None:
    def unsafe(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 20)
        if breaks:
            raise BackendError("the port is gone")
        return Ending(Outcome.COMPLETED, safe_state=SafeState.NOT_CONFIRMED)

    def measure(data: ArchivedTrial) -> ArchivedMetrics:
        bench.backend.log.append("measured")
        return ArchivedMetrics()

    bench = lab(unsafe, 1)
    bench.watched(measure=measure)
    assert bench.backend.log[:4] == ["begins", "returns", "made safe", "measured"]
    assert bench.archive.endings[1].safe_state is SafeState.NOT_CONFIRMED, "as the backend said"


def test_a_bench_that_falls_silent_is_made_safe_while_its_backend_hangs(
    lab: Callable[..., Lab],
) -> None:
    def hangs(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 10)
        assert live.made_safe.wait(LONG)
        assert stop()
        hand_over(recorder, 10, 20)  # too late
        return Ending(Outcome.FAULT, "its own view", fault=Fault.DRIVE)

    bench = lab(once(hangs))
    bench.watched(replace(PATIENT, silence=0.1))
    assert bench.backend.log[:4] == ["begins", "made safe", "returns", "made safe"]
    ending = bench.archive.endings[1]
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_CONNECTION)
    assert "no samples came any more for 0.1" in ending.reason
    assert ending.safe_state is SafeState.CONFIRMED
    assert bench.archive.samples[1] == 10
    assert bench.archive.endings[2].outcome is Outcome.COMPLETED  # and the run went on


def test_a_backend_that_does_not_come_back_ends_the_run_in_order(lab: Callable[..., Lab]) -> None:
    def never(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        assert live.released.wait(LONG)
        hand_over(recorder, 0, 20)
        return COMPLETED

    bench = lab(once(never), 3)
    run = bench.watched(replace(PATIENT, first=0.1, giving_up=0.1, grace=0.1))
    assert bench.backend.log == ["begins", "made safe", "made safe"]
    assert list(bench.archive.endings) == [1]
    ending = bench.archive.endings[1]
    assert ending.fault is Fault.LOST_CONNECTION
    assert "no samples came for" in ending.reason
    assert "did not come back" in ending.reason
    assert (run.status, run.exit_code) == (RunStatus.FAULT, ExitCode.LIMIT_OR_FAULT)
    bench.backend.released.set()
    while bench.backend.log[-1] != "returns":
        pass
    assert bench.archive.samples == {1: 0}


def test_a_bench_that_comes_to_rest_slowly_leaves_its_backend_time_to_return(
    lab: Callable[..., Lab], monkeypatch: pytest.MonkeyPatch
) -> None:
    def waits(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        assert live.made_safe.wait(LONG)
        live.released.wait(0.1)
        return COMPLETED

    bench = lab(once(waits))
    make_safe = bench.backend.make_safe
    slowly = lambda: bench.backend.released.wait(0.3) or make_safe()  # noqa: E731
    monkeypatch.setattr(bench.backend, "make_safe", slowly)
    run = bench.watched(replace(PATIENT, first=0.1, giving_up=0.2, grace=LONG))
    assert "did not come back" not in bench.archive.endings[1].reason
    assert run.status is RunStatus.FAILED_TRIALS


def test_an_unsafe_bench_under_a_stuck_backend_has_its_exit_code(lab: Callable[..., Lab]) -> None:
    def never(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        assert live.released.wait(LONG)
        return COMPLETED

    bench = lab(once(never))
    bench.backend.state = SafeState.NOT_CONFIRMED
    run = bench.watched(replace(PATIENT, first=0.1, giving_up=0.1, grace=0.1))
    assert run.exit_code is ExitCode.NOT_SAFE
    assert bench.archive.endings[1].safe_state is SafeState.NOT_CONFIRMED


def test_a_limit_is_followed_by_make_safe_whatever_the_backend_says(
    lab: Callable[..., Lab],
) -> None:
    def exceeds(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 10, 2.0)
        assert stop()
        return COMPLETED

    bench = lab(once(exceeds))
    run = bench.watched()
    assert bench.backend.log[:4] == ["begins", "returns", "made safe", "begins"]
    assert bench.archive.endings[1].outcome is Outcome.LIMIT
    assert bench.archive.samples[1] == 1
    assert run.exit_code is ExitCode.LIMIT_OR_FAULT


def test_a_limit_that_the_backend_does_not_heed_is_enforced(lab: Callable[..., Lab]) -> None:
    def goes_on(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 10, 2.0)
        assert live.made_safe.wait(LONG)
        return COMPLETED

    bench = lab(once(goes_on))
    bench.watched(replace(PATIENT, grace=0.05))
    assert bench.backend.log[:4] == ["begins", "made safe", "returns", "made safe"]
    assert bench.archive.endings[1].outcome is Outcome.LIMIT


def test_a_backend_that_heeds_its_stop_has_its_grace(lab: Callable[..., Lab]) -> None:
    def brakes(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 10, 2.0)
        assert not live.made_safe.wait(0.2)
        return INTERRUPTED

    bench = lab(once(brakes))
    bench.watched()
    assert bench.backend.log[:3] == ["begins", "returns", "made safe"]


def test_arming_and_coming_to_rest_may_take_longer_than_silence(lab: Callable[..., Lab]) -> None:
    def slow(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        assert not live.made_safe.wait(0.3)
        hand_over(recorder, 0, 20)
        assert not live.made_safe.wait(0.3)
        return COMPLETED

    bench = lab(once(slow), 1)
    assert bench.watched(replace(PATIENT, silence=0.02)).status is RunStatus.COMPLETE


def test_a_stop_by_somebody_gives_the_backend_time_to_brake(lab: Callable[..., Lab]) -> None:
    def brakes(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        bench.stop.request("Ctrl-C")
        hand_over(recorder, 0, 10)
        assert not live.made_safe.wait(0.3)
        return INTERRUPTED

    bench = lab(once(brakes))
    assert bench.watched(replace(PATIENT, silence=0.02)).status is RunStatus.INTERRUPTED
    assert bench.archive.endings[1] == replace(
        INTERRUPTED, telemetry=bench.archive.endings[1].telemetry
    )


def test_a_stuck_backend_is_given_up_after_one_ctrl_c(lab: Callable[..., Lab]) -> None:
    def never(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        bench.stop.request("Ctrl-C")
        assert live.released.wait(LONG)
        return INTERRUPTED

    bench = lab(once(never))
    run = bench.watched(replace(PATIENT, closing=0.1, giving_up=0.1, grace=0.1))
    assert run.status is RunStatus.INTERRUPTED
    assert bench.archive.endings[1].fault is Fault.LOST_CONNECTION


def test_every_trial_has_its_own_stop_flag(lab: Callable[..., Lab]) -> None:
    flags = []

    def exceeds(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        flags.append(stop)
        hand_over(recorder, 0, 20, 2.0 if len(flags) == 2 else 0.0)
        return COMPLETED

    bench = lab(exceeds, 3)
    bench.watched()
    assert [flag() for flag in flags] == [False, True, False]
    assert [e.outcome for e in bench.archive.endings.values()] == [
        Outcome.COMPLETED, Outcome.LIMIT, Outcome.COMPLETED,
    ]  # fmt: skip


def test_errors_of_the_backends_thread_are_those_of_the_run(lab: Callable[..., Lab]) -> None:
    def gone(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        raise BackendError("the port closed")

    def full(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        raise ArchiveError("no space left")

    bench = lab(once(gone))
    assert bench.watched().status is RunStatus.FAULT
    assert bench.archive.endings[1].reason == "the port closed"
    with pytest.raises(ArchiveError, match="no space left"):
        lab(once(full)).watched()


def test_a_disk_that_hangs_leaves_no_bench_running(
    lab: Callable[..., Lab], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("campaign.execution.recorder.ARCHIVE_PATIENCE", 0.1)
    bench = lab(once(lambda live, recorder, stop: hand_over(recorder, 0, 10) or COMPLETED))
    begin = bench.archive.begin

    def begin_on_a_slow_disk(trial: Trial, keeping: object) -> MemoryTrial:
        file = begin(trial)
        file.append = lambda time, block: bench.backend.released.wait(LONG)  # type: ignore[assignment]
        return file

    bench.archive.begin = begin_on_a_slow_disk  # type: ignore[method-assign]
    with pytest.raises(ArchiveError, match="takes no samples"):
        bench.watched(replace(PATIENT, first=0.1, silence=0.1, giving_up=0.1, grace=0.1))
    assert bench.backend.log == ["begins", "made safe", "made safe"]
    assert bench.archive.endings == {}


# Time


def test_silence_is_counted_from_what_was_heard_last() -> None:
    watch = SilenceWatch(1.0, 100.0)
    assert watch.look(100.5, None) == 0.5
    assert watch.look(101.0, 100.75) == 0.25
    assert watch.look(101.5, 100.75) == 0.75


def test_the_sleep_of_this_program_is_nobodys_silence() -> None:
    """It was stopped for a minute: what came meanwhile waits to be taken."""
    watch = SilenceWatch(1.0, 100.0)
    assert watch.look(100.5, 100.5) == 0.0
    assert watch.look(160.5, 100.5) == 0.0
    assert watch.look(161.0, 100.5) == 0.5
    assert watch.look(162.0, 100.5) == 1.5  # and silence then counts


def pace(*hand_overs: tuple[float, float, float]) -> Pace:
    found = Pace()
    for each in hand_overs:
        found.handed_over(*each)
    return found


def test_the_longest_time_between_two_hand_overs() -> None:
    found = pace((10.0, 0.0, 0.1), (10.1, 0.1, 0.2), (10.6, 0.2, 0.7), (10.7, 0.7, 0.8))
    assert (found.longest, found.at) == (0.5, 0.2)
    assert found.is_of_the_wall_clock
    assert found.oldest == pytest.approx(0.0)


def test_a_sample_is_as_old_as_it_comes_later_than_the_timeliest_one() -> None:
    times = np.arange(1, 100) / 10
    found = pace(*((t + (0.15 if t > 5 else 0.0), t - 0.1, t) for t in times))
    assert found.oldest == pytest.approx(0.15)
    assert found.is_of_the_wall_clock


def test_at_another_speed_nothing_is_late() -> None:
    times = np.arange(1, 100) / 10
    assert not pace(*((t / 20, t - 0.1, t) for t in times)).is_of_the_wall_clock
    assert not pace(*((t * 4, t - 0.1, t) for t in times)).is_of_the_wall_clock


@pytest.mark.parametrize(("gap", "events"), [(0.19, 0), (0.21, 1)])
def test_samples_that_come_late_are_said_and_do_not_end_the_trial(gap: float, events: int) -> None:
    now = [0.0]
    supervision = Supervision(Source.HARDWARE, live=True, clock=lambda: now[0])
    [trial] = make_trials(1)
    file, stop = MemoryRecorder(), TrialStop(lambda: False)
    recorder = SupervisingRecorder(trial, file, stop, supervision)
    recorder.start((ANGLE,))
    for sample in range(20):
        now[0] = sample / 10 + (gap - 0.1 if sample == 7 else 0.0)
        hand_over(recorder, sample, sample + 1)
    assert not stop()
    ending = recorder.conclude(COMPLETED)
    assert ending.outcome is Outcome.COMPLETED
    assert ending.telemetry["longest_gap_s"] == pytest.approx(gap)
    found = file.recording(ending).events
    assert [event.text.startswith(LATE) for event in found] == [True] * events
    assert all(event.time == 0.7 for event in found)


def test_a_long_trial_tells_how_far_it_is(
    lab: Callable[..., Lab], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("campaign.execution.sequence.LOOK", 0.01)
    bench: Lab

    def half(live: Live, recorder: Recorder, stop: Callable[[], bool]) -> Ending:
        hand_over(recorder, 0, 11)
        while len(bench.progress) < 2:
            assert not live.made_safe.wait(0.01)
        hand_over(recorder, 11, 20)
        return COMPLETED

    bench = lab(once(half), 1)
    bench.watched()
    first, within = bench.progress[:2]
    assert first.time_left is None
    assert within.running
    assert within.under_way == 0.5
    assert within.time_left is None  # one sign of work is no pace
    assert (bench.progress[-1].under_way, bench.progress[-1].left) == (0.0, 0)
