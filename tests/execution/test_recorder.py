"""What stands between a backend and the archive: what it lets pass, and how it ends a trial."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from campaign.backends.interface import Source
from campaign.execution.recorder import SupervisingRecorder
from campaign.execution.supervision import Supervision, TrialStop
from campaign.recording import (
    ChannelInfo,
    Ending,
    Event,
    Fault,
    MemoryRecorder,
    Outcome,
    Recording,
    SafeState,
)
from campaign.trial import Task, Trial

RATE = 100.0
SAMPLES = 200
COMPLETED = Ending(Outcome.COMPLETED)
STOPPED = Ending(Outcome.INTERRUPTED, "stopped by the operator")
CHANNELS = tuple(
    ChannelInfo(name, unit, name, unit)
    for name, unit in (
        ("relative_angle", "rad"), ("relative_rate", "rad/s"), ("drive_torque", "N m"),
        ("motor_current", "A"),
    )
)  # fmt: skip
LIMITS = {
    "angle": 1.0, "rate": 0.5, "rate_time": 0.05, "acceleration": 1.0, "torque": 10.0,
    "current": 3.0, "duration": 60.0,
}  # fmt: skip


def make_trial(limits: dict[str, float] | None = LIMITS, **task: Any) -> Trial:
    told = {"mode": "rate", "duration": 2.0, "window": (0.0, 2.0), "sample_rate": RATE, **task}
    bench = {} if limits is None else {"limits": dict(limits)}
    return Trial(
        number=1, test="t", kind="move", seed=0, bench=bench, task=Task.model_validate(told)
    )


class Desk:
    """A recorder with a file in memory behind it, fed in blocks of 50."""

    def __init__(self, trial: Trial | None = None, source: Source = Source.HARDWARE) -> None:
        self.trial = trial or make_trial()
        self.file = MemoryRecorder()
        self.stop = TrialStop(lambda: False)
        self.blocks: list[int] = []
        supervision = Supervision(
            source,
            subscribers=(lambda trial, channels, time, block: self.blocks.append(len(time)),),
        )
        self.recorder = SupervisingRecorder(self.trial, self.file, self.stop, supervision)

    def feed(
        self,
        change: Callable[[np.ndarray, np.ndarray], Any] = lambda time, block: None,
        ending: Ending = COMPLETED,
        samples: int = SAMPLES,
        heeds: bool = True,
        channels: tuple[ChannelInfo, ...] = CHANNELS,
    ) -> tuple[Ending, Recording]:
        """`change` edits the whole trial's time and samples, or returns other ones."""
        time = np.arange(samples) / RATE
        block = np.zeros((len(channels), samples))
        time, block = change(time, block) or (time, block)
        self.recorder.start(channels)
        for first in range(0, len(time), 50):
            if heeds and self.stop():
                ending = STOPPED
                break
            self.recorder.append(time[first : first + 50], block[:, first : first + 50])
        return self.end(ending)

    def end(self, ending: Ending, **how: Any) -> tuple[Ending, Recording]:
        concluded = self.recorder.conclude(ending, **how)
        return concluded, self.file.recording(concluded)


def put(row: int, sample: int, value: float) -> Callable[[np.ndarray, np.ndarray], None]:
    def change(time: np.ndarray, block: np.ndarray) -> None:
        block[row, sample] = value

    return change


def test_a_good_trial_passes_as_it_is() -> None:
    desk = Desk()
    desk.recorder.event(Event(0.1, "under way"))
    ending, recording = desk.feed()
    assert ending == COMPLETED
    assert not desk.stop()
    assert len(recording.time) == SAMPLES
    assert recording.events == (Event(0.1, "under way"),)
    assert desk.blocks == [50, 50, 50, 50]


@pytest.mark.parametrize("heeds", [True, False])
@pytest.mark.parametrize(
    ("row", "value", "outcome", "said"),
    [
        (0, 1.001, Outcome.LIMIT, "relative_angle reached 57.3531 deg at 0.73 s; the angle limit"),
        (0, -1.001, Outcome.LIMIT, "relative_angle reached -57.3531 deg"),
        (1, 5.0, Outcome.LIMIT, "relative_rate reached 143.239 deg/s (mean of 20 ms) at 0.73 s"),
        (2, -11.0, Outcome.LIMIT, "drive_torque reached -11 N·m at 0.73 s; the torque limit is 10"),
        (3, 5000.0, Outcome.LIMIT, "motor_current reached 5000 A at 0.73 s; the current limit"),
        (2, np.nan, Outcome.DIVERGED, "drive_torque is nan at 0.73 s"),
        (3, -np.inf, Outcome.DIVERGED, "motor_current is -inf at 0.73 s"),
    ],
)
def test_the_first_bad_sample_is_the_last_one_whatever_the_backend_says(
    row: int, value: float, outcome: Outcome, said: str, heeds: bool
) -> None:
    """The rate is judged over 20 ms, 2 samples: 1 % of 1 rad at 0.5 rad/s."""
    desk = Desk()
    ending, recording = desk.feed(put(row, 73, value), heeds=heeds)
    assert ending.outcome is outcome
    assert ending.fault is None
    assert said in ending.reason
    assert ("the backend: completed" in ending.reason) is not heeds
    assert desk.stop()
    assert len(recording.time) == 74
    np.testing.assert_equal(recording[CHANNELS[row].name][73], value)
    (event,) = recording.events
    assert event.time == 0.73
    assert said in event.text


def test_of_what_is_wrong_the_first_in_time_counts() -> None:
    def both(time: np.ndarray, block: np.ndarray) -> None:
        block[2, 60] = 11.0
        block[0, 61] = np.nan

    ending, _ = Desk().feed(both)
    assert (ending.outcome, "0.6 s" in ending.reason) == (Outcome.LIMIT, True)


def test_a_bench_that_names_no_limits_is_not_judged_by_any() -> None:
    ending, _ = Desk(make_trial(None)).feed(put(0, 73, 100.0))
    assert ending == COMPLETED


def test_a_limit_that_no_channel_tells_of_is_named() -> None:
    desk = Desk()
    ending, _ = desk.feed(channels=(CHANNELS[0], CHANNELS[3]))
    assert ending.outcome is Outcome.COMPLETED
    assert desk.recorder.unwatched == ("rate", "torque")
    assert ending.telemetry == {"unwatched_limits": ["rate", "torque"]}


def stands(time: np.ndarray, block: np.ndarray) -> Any:
    time[120:] = time[119]


def runs_back(time: np.ndarray, block: np.ndarray) -> Any:
    time[120:] -= 0.5


def jumps(time: np.ndarray, block: np.ndarray) -> Any:
    time[120:] += 0.01


def drifts(time: np.ndarray, block: np.ndarray) -> Any:
    time *= 1 + 0.501 / 120  # half a sample off at number 120


def undefined(time: np.ndarray, block: np.ndarray) -> Any:
    time[120] = np.nan


@pytest.mark.parametrize("change", [stands, runs_back, jumps, drifts, undefined])
def test_a_time_base_that_is_none(change: Any) -> None:
    desk = Desk()
    ending, recording = desk.feed(change)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.RECORDING)
    assert "sample 120 is at" in ending.reason
    assert "instead of 1.2 s" in ending.reason
    assert len(recording.time) == (120 if change is undefined else 121)


def test_times_may_be_rounded_otherwise() -> None:
    def accumulated(time: np.ndarray, block: np.ndarray) -> Any:
        return np.concatenate([[0.0], np.cumsum(np.full(len(time) - 1, 1 / RATE))]), block

    assert Desk().feed(accumulated)[0] == COMPLETED


@pytest.mark.parametrize(
    ("samples", "stop_rate", "good"),
    [
        (200, None, True), (199, None, True), (198, None, False), (120, 0.1, True),
    ],
)  # fmt: skip
def test_a_completed_trial_has_all_its_samples(
    samples: int, stop_rate: float | None, good: bool
) -> None:
    ending, recording = Desk(make_trial(stop_rate=stop_rate)).feed(samples=samples)
    assert len(recording.time) == samples
    if good:
        assert ending == COMPLETED
    else:
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.RECORDING)
        assert f"{samples} samples instead of 200" in ending.reason
        assert len(recording.events) == 1


def test_a_trial_that_failed_may_be_short() -> None:
    failed = Ending(Outcome.FAULT, "hot", SafeState.CONFIRMED, Fault.OVER_TEMPERATURE)
    assert Desk().feed(samples=120, ending=failed)[0] == failed


def test_a_trial_that_does_not_end_is_ended() -> None:
    desk = Desk()
    ending, recording = desk.feed(samples=1000)
    assert ending.fault is Fault.RECORDING
    assert "goes on after the 2 s of the trial" in ending.reason
    assert len(recording.time) == 203  # one more than may be, and the one that is too many


@pytest.mark.parametrize(
    ("append", "said"),
    [
        (lambda r: r.append(np.zeros(3), np.zeros((3, 3))), "shape (3, 3)"),
        (lambda r: r.append(np.arange(3) / RATE, np.zeros((4, 2))), "shape (4, 2)"),
        (lambda r: r.append(np.zeros((3, 1)), np.zeros((4, 3))), "its time (3, 1)"),
        (lambda r: r.append(["a"], [["a"]] * 4), "no real numbers"),
        (lambda r: r.start(CHANNELS), "a second time"),
    ],
)
def test_what_cannot_be_archived_ends_the_trial(append: Any, said: str) -> None:
    for source in Source:
        desk = Desk(source=source)
        desk.recorder.start(CHANNELS)
        append(desk.recorder)
        assert desk.stop()
        ending, recording = desk.end(COMPLETED)
        assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.RECORDING)
        assert said in ending.reason
        assert len(recording.time) == 0


@pytest.mark.parametrize(
    ("channels", "said"),
    [((), "no channel"), ((CHANNELS[0], CHANNELS[0]), "two channels are called")],
)
def test_an_announcement_that_is_none(channels: Any, said: str) -> None:
    desk = Desk()
    desk.recorder.start(channels)
    assert desk.stop()
    assert said in desk.end(STOPPED)[0].reason


def test_samples_before_any_announcement() -> None:
    desk = Desk()
    desk.recorder.append(np.zeros(1), np.zeros((4, 1)))
    assert desk.stop()
    assert "before the channels were announced" in desk.end(COMPLETED)[0].reason
    assert "nothing was recorded" in Desk().end(COMPLETED)[0].reason


def test_a_channel_that_is_needed_and_missing_ends_the_trial_before_it_moves() -> None:
    plain = make_trial()
    wanted = ("motor_current", "gyro_rate", "command")
    desk = Desk(plain.model_copy(update={"requires": wanted}))
    desk.recorder.start(CHANNELS)
    assert desk.stop()
    ending, recording = desk.end(STOPPED)
    assert ending.fault is Fault.RECORDING
    assert "gyro_rate, command: not recorded, but move needs it" in ending.reason
    assert len(recording.time) == 0
    assert Desk(plain.model_copy(update={"requires": wanted[:1]})).feed()[0] == COMPLETED


OWN = Ending(Outcome.FAULT, "it tripped", SafeState.NOT_CONFIRMED, Fault.DRIVE)


def test_what_the_backend_itself_found_at_that_sample_is_kept() -> None:
    desk = Desk()
    desk.recorder.start(CHANNELS)
    time, block = np.arange(74) / RATE, np.zeros((4, 74))
    block[3, 73] = 4.0
    desk.recorder.append(time, block)
    ending, recording = desk.end(OWN)
    assert ending == OWN
    assert recording.events == ()


@pytest.mark.parametrize("why", ["it went on", "it was forced"])
def test_what_the_backend_found_later_or_under_force_is_not(why: str) -> None:
    desk = Desk()
    desk.recorder.start(CHANNELS)
    desk.recorder.append(np.arange(74) / RATE, np.full((4, 74), 4.0))
    if why == "it went on":
        desk.recorder.append(np.arange(74, 80) / RATE, np.zeros((4, 6)))
    ending, recording = desk.end(OWN, forced=why == "it was forced")
    assert (ending.outcome, ending.fault) == (Outcome.LIMIT, None)
    assert ending.safe_state is SafeState.NOT_CONFIRMED
    assert ending.reason.endswith("(the backend: fault, it tripped)")
    assert len(recording.time) == 1


def test_lost_samples_are_no_divergence_but_no_completed_trial_either() -> None:
    desk = Desk()
    desk.recorder.start(CHANNELS)
    desk.recorder.append(np.arange(50) / RATE, np.zeros((4, 50)))
    desk.recorder.lost(np.arange(50, 60) / RATE)
    desk.recorder.append(np.arange(60, 200) / RATE, np.zeros((4, 140)))
    assert not desk.stop()
    ending, recording = desk.end(COMPLETED)
    assert (ending.outcome, ending.fault) == (Outcome.FAULT, Fault.LOST_SAMPLES)
    assert np.isnan(recording["drive_torque"][50:60]).all()
    assert recording.events[0] == Event(0.5, "samples 50 to 59 were lost and are NaN")


@pytest.mark.parametrize(("first", "ends"), [(60, None), (59, 0.59)])
def test_the_window_of_the_rate_limit_does_not_close_over_lost_samples(
    first: int, ends: float | None
) -> None:
    """A mean of 2 samples: 0.6 rad/s beside a lost one is 0.3, beside another 0.6 too fast."""
    desk = Desk()
    block = np.zeros((4, SAMPLES))
    block[1, [49, 58, 60]] = 0.6
    block[1, first] = 0.6
    desk.recorder.start(CHANNELS)
    desk.recorder.append(np.arange(50) / RATE, block[:, :50])
    desk.recorder.lost(np.arange(50, 58) / RATE)
    desk.recorder.append(np.arange(58, SAMPLES) / RATE, block[:, 58:])
    ending, _ = desk.end(COMPLETED)
    if ends is None:
        assert ending.fault is Fault.LOST_SAMPLES
    else:
        assert ending.outcome is Outcome.LIMIT
        assert f"at {ends} s" in ending.reason


def test_the_first_verdict_stands() -> None:
    desk = Desk()
    desk.recorder.start(CHANNELS)
    desk.recorder.append(np.zeros(1), np.full((4, 1), 11.0))
    desk.recorder.silent(9.0)
    desk.recorder.start(CHANNELS)
    assert desk.end(COMPLETED)[0].outcome is Outcome.LIMIT


def test_nothing_is_archived_once_the_trial_is_concluded() -> None:
    desk = Desk()
    desk.feed()
    desk.recorder.append(np.arange(200, 201) / RATE, np.zeros((4, 1)))
    desk.recorder.event(Event(2.0, "late"))
    recording = desk.file.recording(COMPLETED)
    assert (len(recording.time), recording.events) == (SAMPLES, ())


def test_whoever_looks_on_harms_nothing() -> None:
    calls = []

    def fails(*what: Any) -> None:
        calls.append(what)
        raise RuntimeError("no display")

    desk = Desk()
    supervision = Supervision(Source.HARDWARE, subscribers=(fails, *[lambda *what: None]))
    desk.recorder = SupervisingRecorder(desk.trial, desk.file, desk.stop, supervision)
    assert desk.feed()[0] == COMPLETED
    assert len(calls) == 1


# What was recorded before


def test_a_recording_is_judged_and_not_ended() -> None:
    def change(time: np.ndarray, block: np.ndarray) -> None:
        block[2, 30:] = 11.0
        block[0, 60:] = 2.0
        block[1, 90:100] = np.nan
        time[150:] += 1.0

    desk = Desk(source=Source.RECORDING)
    ending, recording = desk.feed(change, samples=190)
    assert not desk.stop()
    assert ending.outcome is Outcome.COMPLETED
    assert len(recording.time) == 190
    judged = ending.telemetry["judged"]
    assert isinstance(judged, dict)
    assert set(judged) == {"limit", "undefined", "time", "length"}
    assert "drive_torque reached 11 N·m at 0.3 s" in str(judged["limit"])
    assert [event.text for event in recording.events] == list(judged.values())


def test_what_a_recording_says_itself_is_not_said_again() -> None:
    """A clean archive comes out as it went in."""
    desk = Desk(source=Source.RECORDING)
    ended = Ending(Outcome.LIMIT, "drive_torque reached 11 N m", telemetry={"resends": 3})
    ending, recording = desk.feed(put(2, 99, 11.0), samples=100, ending=ended)
    assert (ending, recording.events) == (ended, ())

    desk = Desk(source=Source.RECORDING)
    gap = Event(0.5, "samples 50 to 59 were lost and are NaN")
    desk.recorder.event(gap)
    lost = Ending(Outcome.FAULT, "lost", fault=Fault.LOST_SAMPLES)
    ending, recording = desk.feed(put(2, 55, np.nan), ending=lost)
    assert (ending, recording.events) == (lost, (gap,))


def test_a_limit_is_said_of_a_trial_that_failed_for_something_else() -> None:
    desk = Desk(source=Source.RECORDING)
    ended = Ending(Outcome.FAULT, "hot", fault=Fault.OVER_TEMPERATURE)
    ending, _ = desk.feed(put(2, 20, 11.0), samples=100, ending=ended)
    assert replace(ending, telemetry={}) == ended
    assert "judged" in ending.telemetry
