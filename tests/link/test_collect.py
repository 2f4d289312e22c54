"""Collecting a trial's records: every sample is right or NaN, and every ending has its words.

A session made of a script and a clock that only the script moves: nothing here takes time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from campaign.link.collect import ACKNOWLEDGE_EVERY, BRAKING, ENDING, STANDSTILL, Collector
from campaign.link.errors import RefusedError, SilenceError, ViolationError
from campaign.link.session import Traffic
from campaign.recording import (
    ChannelInfo,
    Ending,
    Fault,
    MemoryRecorder,
    Outcome,
    Recording,
    SafeState,
)
from campaign.wire.messages import (
    Channel,
    End,
    Event,
    Format,
    LostRecords,
    Resend,
    Samples,
    State,
    Status,
    Stop,
)
from campaign.wire.messages import Fault as FaultCode
from campaign.wire.messages import Outcome as OutcomeCode

RATE = 100.0
TRIAL = 7
CHANNELS = (
    Channel("angle", "rad", "deg", "Angle", True, Format.F64, 1.0),
    Channel("current", "A", "A", "Current", True, Format.I16, 0.25),
)
ROW = np.dtype([("angle", "<f8"), ("current", "<i2")])
LOOK = 0.02
"""s that a look takes in which nothing else is said."""

Step = Any
"""What one look brings: a message, several of them, or something to do."""


def samples(number: int, first: int, count: int = 10, trial: int = TRIAL) -> Samples:
    """Record `number`: sample n has the angle n / 8 and the current n / 4."""
    rows = np.zeros(count, ROW)
    rows["angle"] = np.arange(first, first + count) / 8
    rows["current"] = np.arange(first, first + count)
    return Samples(trial, number, first, count, rows.tobytes())


def end(number: int, count: int, **changes: Any) -> End:
    settings = {"outcome": OutcomeCode.COMPLETED, "fault": FaultCode.NONE, "safe": True}
    return End(TRIAL, number, samples=count, **{**settings, **changes})


def status(state: State = State.RUNNING, **changes: Any) -> Status:
    settings: dict[str, Any] = {
        "fault": FaultCode.NONE, "at_rest": False, "drive_on": True, "boot": 1, "clock": 0.0,
        "heartbeat": 0, "heartbeat_age": 0.0, "trial": TRIAL, "first_record": 0, "next_record": 0,
        "ring_used": 0, **changes,
    }  # fmt: skip
    return Status(state, **settings)


class Line:
    """A session that says what the script has for each look, and notes what is said to it."""

    def __init__(self, clock: list[float], *script: Step) -> None:
        self.clock, self.script = clock, iter(script)
        self.bad_frames = 5
        self.traffic: Any = None
        self.records: Callable[[Any], None] = lambda record: None
        self.status: Status | None = None
        self.sent: list[Any] = []
        self.acknowledged: list[tuple[int, int, bool]] = []
        self.made_safe: list[float] = []
        self.refuses = False

    def look(self) -> None:
        self.clock[0] += LOOK
        step = next(self.script, None)
        for message in step if isinstance(step, list) else [step]:
            if isinstance(message, Status):
                self.status = message
            elif callable(message):
                message()
            elif message is not None:
                self.records(message)

    def send(self, message: Any) -> None:
        self.sent.append(message)

    def command(self, message: Any) -> None:
        self.sent.append(message)
        if self.refuses:
            raise RefusedError("not now")

    def wanted(self, trial: int, record: int, *, at_once: bool) -> None:
        self.acknowledged.append((trial, record, at_once))

    def safe(self, deadline: float) -> bool:
        self.made_safe.append(deadline)
        return True


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [1000.0]
    monkeypatch.setattr("campaign.link.collect.time", SimpleNamespace(monotonic=lambda: now[0]))
    return now


def never() -> bool:
    return False


def collector(line: Line, longest: float = 1.0) -> tuple[Collector, MemoryRecorder]:
    recorder = MemoryRecorder()
    recorder.start(tuple(ChannelInfo(c.name, c.unit, c.label, c.display_unit) for c in CHANNELS))
    return Collector(line, TRIAL, RATE, CHANNELS, recorder, longest), recorder  # type: ignore[arg-type]


def collected(
    line: Line, longest: float = 1.0, stopped: Callable[[], bool] = never
) -> tuple[Ending, Recording, Collector]:
    mine, recorder = collector(line, longest)
    ending = mine.run(stopped)
    return ending, recorder.recording(ending), mine


def broken_off(line: Line, error: type[Exception], match: str) -> Recording:
    """What had been recorded when it was given up."""
    mine, recorder = collector(line)
    with pytest.raises(error, match=match):
        mine.run(never)
    return recorder.recording(Ending(Outcome.FAULT))


def check(recording: Recording, count: int, missing: range = range(0)) -> None:
    """Each of `count` samples is right, and NaN in every channel where it is `missing`."""
    n = np.arange(count)
    gone = np.isin(n, missing)
    assert recording.time.tolist() == (n / RATE).tolist()
    for name, true in (("angle", n / 8), ("current", n / 4)):
        np.testing.assert_array_equal(recording[name], np.where(gone, np.nan, true))


def told(recording: Recording) -> list[tuple[float, str]]:
    return [(event.time, event.text) for event in recording.events]


# What is recorded


def test_records_become_samples_in_their_units(clock: list[float]) -> None:
    ending, recording, mine = collected(
        Line(clock, samples(0, 0), [samples(1, 10), samples(2, 20)], end(3, 30))
    )
    assert ending == Ending(Outcome.COMPLETED, "", SafeState.CONFIRMED)
    check(recording, 30)
    assert told(recording) == []
    assert (mine.lost, mine.telemetry()["lost_samples"]) == (0, 0)


def test_each_look_is_recorded_at_once(clock: list[float]) -> None:
    """Whatever happens next, what has come is in the recorder."""
    line = Line(clock, samples(0, 0), lambda: seen.append(len(recorder._blocks)), end(1, 10))
    seen: list[int] = []
    mine, recorder = collector(line)
    mine.run(never)
    assert seen == [1]


def test_what_comes_twice_or_out_of_order_is_taken_once_in_order(clock: list[float]) -> None:
    _, recording, mine = collected(
        Line(clock, samples(1, 10), samples(1, 10), samples(0, 0), [samples(0, 0), end(2, 20)])
    )
    check(recording, 20)
    assert mine.lost == 0


def test_an_event_stands_between_the_samples_before_and_after_it(clock: list[float]) -> None:
    event = Event(TRIAL, 1, 0.1, "the axis\x1b[2J turns")
    line = Line(clock, [samples(0, 0), event, samples(2, 10)], end(3, 20))
    mine, recorder = collector(line)
    before: list[int] = []
    note = recorder.event
    recorder.event = lambda event: (before.append(len(recorder._blocks)), note(event))[1]  # type: ignore[method-assign]
    recording = recorder.recording(mine.run(never))
    check(recording, 20)
    assert before == [1]
    ((time, text),) = told(recording)
    assert time == 0.1
    assert text.startswith("the axis")
    assert "\x1b" not in text


def test_records_of_another_trial_are_nobodys(clock: list[float]) -> None:
    """A ring still holds what was before; so LOST of that, too."""
    other = Samples(TRIAL + 1, 0, 0, 1, bytes(10))
    ending, recording, mine = collected(
        Line(
            clock,
            other,
            LostRecords(TRIAL - 1, 0, 1),
            samples(0, 0),
            LostRecords(TRIAL + 1, 1, 1),
            end(1, 10),
        )
    )
    assert ending.outcome is Outcome.COMPLETED
    check(recording, 10)
    assert mine.lost == 0


def test_nothing_is_taken_when_it_is_over(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), end(1, 10))
    _, recording, mine = collected(line)
    assert line.records != mine._arrived  # which would keep it in mind for ever
    line.records(samples(2, 10))
    check(recording, 10)


def test_what_came_before_the_line_broke_is_recorded(clock: list[float]) -> None:
    def breaks() -> None:
        raise SilenceError("the connection was lost")

    line = Line(clock, samples(0, 0), [samples(1, 10), breaks])
    check(broken_off(line, SilenceError, "the connection was lost"), 20)


# What is lost


def test_lost_samples_are_nan_and_said_to_be(clock: list[float]) -> None:
    """Records 1 and 2 are gone for good: 20 samples in every channel, never zero or the last."""
    line = Line(clock, samples(0, 0), [samples(3, 30), LostRecords(TRIAL, 1, 2)], end(4, 40))
    ending, recording, mine = collected(line)
    check(recording, 40, range(10, 30))
    assert line.sent == []  # what is no more is not asked for again
    assert told(recording) == [
        (0.1, "2 records of the controller were lost"),
        (0.1, "samples 10 to 29 were lost and are NaN"),
    ]
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)
    assert ending.safe_state is SafeState.CONFIRMED
    assert ending.reason == (
        "samples were lost and are marked: 20 samples in 2 records (the controller: completed)"
    )
    told_too = mine.telemetry()
    assert (told_too["lost_records"], told_too["lost_samples"]) == (2, 20)


def test_a_lost_beginning_and_a_lost_end_are_marked_as_well(clock: list[float]) -> None:
    ending, recording, mine = collected(
        Line(
            clock,
            [samples(1, 10), LostRecords(TRIAL, 0, 1)],
            [end(3, 30), LostRecords(TRIAL, 2, 1)],
        )
    )
    assert np.isnan(recording["angle"]).tolist() == [True] * 10 + [False] * 10 + [True] * 10
    assert recording["current"][10:20].tolist() == [n / 4 for n in range(10, 20)]
    assert mine.telemetry()["lost_samples"] == 20
    assert ending.fault is Fault.LOST_SAMPLES


def test_lost_samples_stand_in_their_place_when_all_comes_at_once(clock: list[float]) -> None:
    everything = [samples(0, 0), samples(2, 20), LostRecords(TRIAL, 1, 1), end(3, 30)]
    _, recording, _ = collected(Line(clock, everything))
    check(recording, 30, range(10, 20))


def test_a_lost_event_is_a_fault_though_every_sample_is_there(clock: list[float]) -> None:
    """What it said cannot be known."""
    ending, recording, _ = collected(
        Line(clock, samples(0, 0), [samples(2, 10), LostRecords(TRIAL, 1, 1)], end(3, 20))
    )
    check(recording, 20)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)
    assert "0 samples in 1 records" in ending.reason


def test_samples_that_the_controller_skipped_are_marked(clock: list[float]) -> None:
    ending, recording, mine = collected(Line(clock, samples(0, 0), samples(1, 12), end(2, 22)))
    check(recording, 22, range(10, 12))
    assert ending.fault is Fault.LOST_SAMPLES
    assert mine.lost == 0
    assert "2 samples in 0 records" in ending.reason


def test_what_the_controller_says_of_its_trial_stays_with_it(clock: list[float]) -> None:
    """A fault keeps its name; of a limit, it is said; a stop by the operator is a fault now."""
    lost = [samples(1, 10), LostRecords(TRIAL, 0, 1)]
    ways: tuple[tuple[OutcomeCode, FaultCode, Fault], ...] = (
        (OutcomeCode.FAULT, FaultCode.SENSOR, Fault.SENSOR),
        (OutcomeCode.FAULT, FaultCode.NONE, Fault.OTHER),
        (OutcomeCode.LIMIT, FaultCode.NONE, Fault.LOST_SAMPLES),
        (OutcomeCode.INTERRUPTED, FaultCode.NONE, Fault.LOST_SAMPLES),
    )
    for outcome, code, named in ways:
        last = end(2, 20, outcome=outcome, fault=code, reason="so it was")
        ending, _, _ = collected(Line(clock, lost, last))
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, named)
        assert ending.reason.endswith(f" (the controller: {outcome.text}, so it was)")


def test_records_that_do_not_come_are_asked_for_again(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), [samples(2, 20)], None, samples(1, 10), end(3, 30))
    ending, recording, mine = collected(line)
    check(recording, 30)
    assert line.sent == [Resend(TRIAL, 1, 1)]
    assert ending.outcome is Outcome.COMPLETED
    assert mine.telemetry()["resend_requests"] == 1


def test_a_lost_tail_is_known_from_what_the_controller_says_it_has(clock: list[float]) -> None:
    """Only when it speaks of this trial."""
    others = status(trial=TRIAL - 1, next_record=99)
    line = Line(clock, samples(0, 0), others, None, status(next_record=3), samples(1, 10),
                [samples(2, 20), end(3, 30)])  # fmt: skip
    _, recording, _ = collected(line)
    check(recording, 30)
    assert line.sent == [Resend(TRIAL, 1, 2)]


# What breaks the protocol


def test_samples_of_another_size_are_refused(clock: list[float]) -> None:
    short = Samples(TRIAL, 1, 10, 10, bytes(90))
    recording = broken_off(
        Line(clock, samples(0, 0), short), ViolationError, "record 1 has samples of another size"
    )
    check(recording, 10)


def test_samples_that_go_back_are_refused(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), samples(1, 9))
    check(broken_off(line, ViolationError, "sample 9 cannot follow sample 9"), 10)


def test_an_end_before_the_samples_is_refused(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), end(1, 9))
    check(broken_off(line, ViolationError, "sample 9 cannot follow sample 9"), 10)


def test_a_trial_of_one_second_has_a_hundred_and_one_samples_at_most(clock: list[float]) -> None:
    """Both its ends count; one more is not believed, nor is the memory for it taken."""
    ending, recording, _ = collected(Line(clock, samples(0, 0, 101), end(1, 101)))
    check(recording, 101)
    assert ending.outcome is Outcome.COMPLETED
    broken_off(Line(clock, samples(0, 0, 102)), ViolationError, "longer than the trial can last")
    broken_off(Line(clock, samples(0, 101, 1)), ViolationError, "longer than the trial can last")
    broken_off(
        Line(clock, samples(0, 102, 1)), ViolationError, "sample 102 cannot follow sample -1"
    )
    broken_off(Line(clock, samples(0, 0), end(1, 102)), ViolationError, "sample 102 cannot follow")
    ending, recording, _ = collected(Line(clock, samples(0, 0), end(1, 101)))
    check(recording, 101, range(10, 101))


def test_a_length_that_is_no_binary_fraction_is_not_cut_short(clock: list[float]) -> None:
    """0.29 s at 100 Hz is 28.999... samples in floating point."""
    assert 0.29 * RATE < 29
    ending, recording, _ = collected(Line(clock, samples(0, 0, 30), end(1, 30)), longest=0.29)
    assert ending.outcome is Outcome.COMPLETED
    check(recording, 30)
    line = Line(clock, samples(0, 0, 31), end(1, 31))
    with pytest.raises(ViolationError, match="longer than the trial can last"):
        collected(line, longest=0.29)


# Acknowledging


def test_what_was_taken_is_acknowledged_with_the_heartbeats_and_at_times_at_once(
    clock: list[float],
) -> None:
    half = ACKNOWLEDGE_EVERY // 2
    first = [samples(n, n, 1) for n in range(half)]
    second = [samples(n, n, 1) for n in range(half, ACKNOWLEDGE_EVERY)]
    third = [samples(n, n, 1) for n in range(ACKNOWLEDGE_EVERY, ACKNOWLEDGE_EVERY + 1)]
    line = Line(clock, None, first, None, second, None, third, end(ACKNOWLEDGE_EVERY + 1, 65))
    collected(line)
    assert line.acknowledged == [
        (TRIAL, half, False),
        (TRIAL, half, False),
        (TRIAL, ACKNOWLEDGE_EVERY, True),
        (TRIAL, ACKNOWLEDGE_EVERY + 1, False),
        (TRIAL, ACKNOWLEDGE_EVERY + 2, False),
    ]


# Stopping


def stops_after(looks: int) -> Callable[[], bool]:
    asked: Iterator[bool] = iter([False] * looks)
    return lambda: next(asked, True)


def test_a_stop_is_said_once_and_the_end_is_waited_for(clock: list[float]) -> None:
    last = end(1, 10, outcome=OutcomeCode.INTERRUPTED, reason="stopped")
    line = Line(clock, samples(0, 0), None, None, None, last)
    ending, recording, _ = collected(line, stopped=stops_after(1))
    assert ending == Ending(Outcome.INTERRUPTED, "stopped", SafeState.CONFIRMED)
    assert line.sent == [Stop()]
    assert line.made_safe == []
    check(recording, 10)


def test_a_stop_that_is_refused_becomes_a_safe(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), None, end(1, 10))
    line.refuses = True
    collected(line, stopped=stops_after(1))
    assert line.made_safe == [pytest.approx(1000.0 + 2 * LOOK + BRAKING)]


def wait(clock: list[float], seconds: float) -> Callable[[], None]:
    def step() -> None:
        clock[0] += seconds

    return step


def test_what_does_not_brake_is_switched_off_again_and_again(clock: list[float]) -> None:
    """After the time for braking SAFE, and then after each time for SAFE and for braking."""
    running = status(state=State.RUNNING)
    script = [running, wait(clock, BRAKING - 1), wait(clock, 1), *[wait(clock, 1)] * 20, end(0, 0)]
    line = Line(clock, *script)
    collected(line, stopped=lambda: True)
    assert line.sent == [Stop()]
    assert len(line.made_safe) == 3
    said = line.made_safe[0] - BRAKING
    assert said == pytest.approx(1000 + BRAKING + 3 * LOOK)
    assert np.diff(line.made_safe) == pytest.approx([2 * BRAKING, 2 * BRAKING], abs=1.5)


# How it ends without an END


def test_a_trial_that_is_not_running_any_more_is_given_the_time_for_its_end(
    clock: list[float],
) -> None:
    """It came to its last record and then to nothing."""
    gone = status(state=State.ENDED, next_record=1)
    line = Line(clock, samples(0, 0), gone, wait(clock, ENDING - 1), *[None] * 1000)
    ending, recording, _ = collected(line)
    assert clock[0] == pytest.approx(1000 + ENDING, abs=0.2)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)
    assert ending.safe_state is SafeState.NOT_CONFIRMED
    assert ending.reason == ("the record of how the trial ended was lost: 0 samples in 0 records")
    check(recording, 10)


def test_while_it_has_more_to_send_it_is_not_given_up(clock: list[float]) -> None:
    more = status(state=State.ENDED, next_record=2)
    line = Line(clock, samples(0, 0), more, wait(clock, 10 * ENDING), None, end(1, 10))
    ending, _, _ = collected(line)
    assert ending.outcome is Outcome.COMPLETED


def test_the_records_of_another_trial_are_no_reason_to_wait(clock: list[float]) -> None:
    other = status(state=State.IDLE, trial=0, next_record=50)
    line = Line(clock, samples(0, 0), other, *[wait(clock, 1)] * 50)
    ending, _, _ = collected(line)
    assert clock[0] < 1000 + ENDING + 2
    assert ending.fault is Fault.LOST_SAMPLES


def test_a_pause_in_which_it_runs_again_begins_the_time_anew(clock: list[float]) -> None:
    over = status(state=State.ENDED, next_record=1)
    line = Line(
        clock, samples(0, 0), over, wait(clock, ENDING - 1), status(next_record=1), over,
        wait(clock, ENDING - 1), end(1, 10),
    )  # fmt: skip
    ending, _, _ = collected(line)
    assert ending.outcome is Outcome.COMPLETED


def test_a_late_record_after_the_end_begins_the_time_anew(clock: list[float]) -> None:
    """More was to come than it had said."""
    over, more = (status(state=State.ENDED, next_record=n) for n in (1, 2))
    line = Line(
        clock, samples(0, 0), over, wait(clock, ENDING - 1), more, samples(1, 10),
        wait(clock, ENDING - 1), end(2, 20),
    )  # fmt: skip
    ending, recording, _ = collected(line)
    assert ending.outcome is Outcome.COMPLETED
    check(recording, 20)


def test_a_running_trial_without_a_record_is_given_up(clock: list[float]) -> None:
    line = Line(
        clock, samples(0, 0), status(), wait(clock, STANDSTILL - 1), samples(1, 10),
        wait(clock, STANDSTILL - 1), *[None] * 1000,
    )  # fmt: skip
    recording = broken_off(line, SilenceError, "no record has come for 60 s")
    check(recording, 20)
    assert clock[0] == pytest.approx(1000 + 2 * STANDSTILL - 1, abs=0.2)


def test_another_trials_record_is_no_sign_of_life(clock: list[float]) -> None:
    line = Line(
        clock, samples(0, 0), wait(clock, STANDSTILL - 1), samples(0, 0, trial=TRIAL + 1),
        wait(clock, 2), None, end(1, 10),
    )  # fmt: skip
    broken_off(line, SilenceError, "no record has come")


@pytest.mark.parametrize(("safe", "state"), [
    (True, SafeState.CONFIRMED), (False, SafeState.NOT_CONFIRMED),
])  # fmt: skip
def test_the_end_says_whether_it_is_safe(clock: list[float], safe: bool, state: SafeState) -> None:
    ending, _, _ = collected(Line(clock, end(0, 0, safe=safe)))
    assert ending.safe_state is state
    assert ending.outcome is Outcome.COMPLETED


def test_the_words_of_a_controller_are_made_printable(clock: list[float]) -> None:
    last = end(0, 0, outcome=OutcomeCode.LIMIT, reason="angle \x1b[31m beyond\nits limit")
    ending, _, _ = collected(Line(clock, last))
    assert ending.reason.isprintable()
    assert "beyond" in ending.reason
    assert ending.fault is None


def test_a_fault_has_the_name_that_the_controller_gives_it(clock: list[float]) -> None:
    for code, named in ((FaultCode.DRIVE, Fault.DRIVE), (FaultCode.NONE, Fault.OTHER)):
        last = end(0, 0, outcome=OutcomeCode.FAULT, fault=code)
        ending, _, _ = collected(Line(clock, last))
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, named)


# What it tells of the line


def test_the_telemetry_is_that_of_this_trial(clock: list[float]) -> None:
    line = Line(clock, samples(0, 0), end(1, 10))
    line.traffic = Traffic(received=10**6)  # of what was before
    mine, _ = collector(line)
    line.traffic.round_trips += [0.001, 0.004, 0.0025]
    line.traffic.received, line.traffic.ring_used, line.traffic.repeated_commands = 123, 17, 2
    line.bad_frames += 4
    line.status = status(bad_frames=9)
    mine.run(never)
    assert mine.telemetry() == {
        "round_trip_ms_p50": 2.5,
        "round_trip_ms_max": 4.0,
        "ring_records_max": 17,
        "resend_requests": 0,
        "repeated_commands": 2,
        "lost_records": 0,
        "lost_samples": 0,
        "bad_frames_host": 4,
        "bad_frames_controller_since_start": 9,
        "bytes_received": 123,
    }


def test_what_was_not_measured_is_none(clock: list[float]) -> None:
    mine, _ = collector(Line(clock))
    told_of = mine.telemetry()
    assert told_of["round_trip_ms_p50"] is told_of["round_trip_ms_max"] is None
    assert told_of["bad_frames_controller_since_start"] is None


def test_round_trips_are_told_to_the_microsecond(clock: list[float]) -> None:
    mine, _ = collector(line := Line(clock))
    line.traffic.round_trips += [0.0012345678]
    assert mine.telemetry()["round_trip_ms_p50"] == 1.235
    assert mine.telemetry()["round_trip_ms_max"] == 1.235
