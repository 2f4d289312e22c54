"""Archived recordings served again: which one answers which trial, and what is refused."""

from __future__ import annotations

import random
from pathlib import Path

import h5py
import numpy as np
import pytest

import campaign
from campaign.archive.reading.open_run import open_run
from campaign.backends.replay import BACKEND, ReplayOptions
from campaign.protocol import as_tree
from campaign.recording import (
    Channel,
    Ending,
    Event,
    Fault,
    MemoryRecorder,
    Outcome,
    Recording,
    SafeState,
)
from campaign.trial import Trial
from tests.archives import PROTOCOL, archived, executed, plan_of, simulated_run


def replay(path: Path):
    return BACKEND.open(ReplayOptions(run=str(path)))


def served(backend, trial: Trial) -> Recording:
    recorder = MemoryRecorder()
    return recorder.recording(backend.execute(trial, recorder, lambda: False))


def marked(value: float, ending: Ending | None = None) -> Recording:
    """A recording that can be told from others by its one sample."""
    channel = Channel("gyro_rate", "rad/s", "Rate", "deg/s", np.array([value]))
    events = (Event(0.5, "it moved"),)
    return Recording(
        np.array([0.25]), {"gyro_rate": channel}, events, ending or Ending(Outcome.COMPLETED)
    )


def mark_of(recording: Recording) -> float:
    return float(recording["gyro_rate"][0])


@pytest.fixture
def trial(tmp_path: Path) -> Trial:
    return plan_of(tmp_path).trials[0]


def changed(trial: Trial, **fields: object) -> Trial:
    return trial.model_copy(update=fields)


def test_a_replayed_run_has_the_samples_events_and_endings_of_the_first(tmp_path):
    first = simulated_run(tmp_path)
    plan = plan_of(tmp_path)
    second = executed(tmp_path / "results", plan.trials, replay(first))
    assert first != second
    for a, b in zip(open_run(first).trials, open_run(second).trials, strict=True):
        was, now = a.recording(), b.recording()
        assert list(was.channels) == list(now.channels)
        np.testing.assert_array_equal(was.time, now.time)
        for name, channel in was.channels.items():
            np.testing.assert_array_equal(channel.samples, now[name])
            assert vars(now.channels[name]) | {"samples": 0} == vars(channel) | {"samples": 0}
        assert (was.events, a.ending) == (now.events, b.ending)


def test_other_windows_give_other_results_from_the_same_samples(tmp_path):
    first = simulated_run(tmp_path)
    other = PROTOCOL.replace("settle_cycles = 1", "settle_cycles = 3").replace(
        "cycles = 3\n\n", "cycles = 1\n\n"
    )
    plan = plan_of(tmp_path, other)
    again = executed(tmp_path / "results", plan.trials, replay(first), as_tree(plan)["tests"])
    windows = [campaign.open(path).trial(1).trial.task.window for path in (first, again)]
    assert windows == [(0.5, 2.0), (1.5, 2.0)]
    tables = [
        campaign.open(path).test("stabilization").tables["stabilization-error"]["error"]
        for path in (first, again)
    ]
    samples = campaign.open(first).trial(1).window(1.5, 2.0).recording()["pointing_error"]
    assert tables[0][0] != tables[1][0]
    assert tables[1][0] == pytest.approx(np.std(samples), rel=1e-2)


def test_any_seed_will_do_but_the_same_one_is_preferred(tmp_path, trial):
    pairs = [(changed(trial, number=n, seed=100 + n), marked(n)) for n in (1, 2, 3)]
    backend = replay(archived(tmp_path, pairs))
    wanted = [changed(trial, number=1, seed=103), changed(trial, number=2, seed=7)]
    assert [backend.refuses(each) for each in wanted] == [None, None]
    assert mark_of(served(backend, wanted[0])) == 3
    assert mark_of(served(backend, wanted[1])) == 2  # of the two left, it has the number


@pytest.mark.parametrize("order", range(6))
def test_each_gets_its_own_whatever_the_order(tmp_path, trial, order):
    numbers = list(range(1, 9))
    pairs = [(changed(trial, number=n, seed=100 + n, repeat=n), marked(n)) for n in numbers]
    backend = replay(archived(tmp_path, pairs))
    wanted = [changed(trial, number=20 - n, seed=100 + n, repeat=n) for n in numbers[:6]]
    wanted += [changed(trial, number=n, seed=n) for n in (1, 2)]  # has the seed of none
    random.Random(order).shuffle(wanted)
    assert [backend.refuses(each) for each in wanted] == [None] * 8
    marks = {each.number: mark_of(served(backend, each)) for each in reversed(wanted)}
    assert {20 - n: marks[20 - n] for n in numbers[:6]} == {20 - n: n for n in numbers[:6]}
    assert sorted(marks.values()) == numbers


def test_each_is_served_once_but_to_the_same_trial_again(tmp_path, trial):
    backend = replay(archived(tmp_path, [(trial, marked(1))]))
    assert backend.refuses(trial) is None
    assert [mark_of(served(backend, trial)) for _ in range(2)] == [1, 1]  # another attempt
    second = changed(trial, number=2)
    assert backend.refuses(second) == (
        "2026-11-21T09-36-50-axis has no more such trials; all 1 are asked for"
    )
    assert served(backend, second).ending.fault is Fault.REFUSED


def test_a_refusal_names_the_fields_in_which_the_nearest_differs(tmp_path, trial):
    far = trial.task.model_copy(update={"duration": 9.0, "start_angle": 0.5, "sample_rate": 10.0})
    pairs = [(changed(trial, task=far), marked(1)), (changed(trial, number=2), marked(2))]
    backend = replay(archived(tmp_path, pairs))
    longer = trial.task.model_copy(update={"duration": 3.0})
    assert backend.refuses(changed(trial, task=longer)) == (
        "2026-11-21T09-36-50-axis has no such trial; the nearest, trial-00002 (stabilization "
        "[compensation=none]), differs in task.duration: 2.0 there, 3.0 here"
    )
    heavy = {**trial.bench, "axis": {**trial.bench["axis"], "inertia": 36.0}}
    assert "bench.axis.inertia: 35.0 there, 36.0 here" in backend.refuses(
        changed(trial, bench=heavy)
    )


def test_an_option_younger_than_the_archive_has_its_default(tmp_path, trial):
    old = {key: value for key, value in trial.bench.items() if key != "appendage"}
    backend = replay(archived(tmp_path, [(changed(trial, bench=old), marked(1))]))
    assert backend.refuses(trial) is None


def test_endings_are_copied_but_nothing_moves(tmp_path, trial):
    ending = Ending(
        Outcome.FAULT, "too hot", SafeState.NOT_CONFIRMED, Fault.OVER_TEMPERATURE, {"resends": 3}
    )
    recording = served(replay(archived(tmp_path, [(trial, marked(1, ending))])), trial)
    assert recording.ending == Ending(
        Outcome.FAULT, "too hot", SafeState.CONFIRMED, Fault.OVER_TEMPERATURE, {"resends": 3}
    )
    assert recording.events == (Event(0.5, "it moved"),)


def test_what_somebody_interrupted_is_not_served(tmp_path, trial):
    ending = Ending(Outcome.INTERRUPTED, "stopped by the operator")
    backend = replay(archived(tmp_path, [(trial, marked(1, ending))]))
    assert backend.refuses(trial) == "2026-11-21T09-36-50-axis has no recordings"


def test_a_damaged_recording_is_a_fault_that_names_the_channel(tmp_path, trial):
    path = archived(tmp_path, [(trial, marked(1))])
    with h5py.File(path, "r+") as file:
        file["trial_00001/data/gyro_rate"][0] = 2.0
    ending = served(replay(path), trial).ending
    assert ending.outcome is Outcome.FAULT
    assert "gyro_rate" in ending.reason


def test_it_is_not_live_and_may_run_several_trials_at_a_time():
    assert (BACKEND.live, BACKEND.several) == (False, True)


def test_the_channels_are_known_without_a_sample_being_read(tmp_path, monkeypatch):
    path = simulated_run(tmp_path)
    (first, second) = plan_of(tmp_path).trials
    backend = replay(path)
    announced = set(open_run(path).trials[0].recording().channels)

    def unread(*arguments: object) -> None:
        raise AssertionError("samples were read")

    monkeypatch.setattr("campaign.archive.reading.series.Series.read", unread)
    with pytest.raises(AssertionError, match="samples were read"):
        open_run(path).trials[0].recording()
    assert len(announced) == 11
    assert backend.channels(first) == backend.channels(second) == announced
    other = changed(first, task=first.task.model_copy(update={"duration": 9.0}))
    assert backend.channels(other) is None


def test_a_trial_that_recorded_nothing_says_nothing_of_its_channels(tmp_path, trial):
    """It ends again as it did then, and does not keep the others from being replayed."""
    path = archived(tmp_path / "results", [(trial, None)])
    backend = replay(path)
    asking = changed(trial, requires=("pointing_error",))
    assert backend.refuses(asking) is None
    assert backend.channels(asking) is None
    assert served(backend, asking).ending.reason == "no power at 5 °C"


def test_a_trial_whose_record_is_damaged_is_a_fault_that_names_it(tmp_path, trial):
    path = archived(tmp_path / "results", [(trial, marked(1.0))])
    assert replay(path).channels(trial) == {"gyro_rate"}
    with h5py.File(path, "r+") as file:
        for place in ("run/index/data", "trial_00001/record/json"):
            file[place][()] = file[place][()].replace(b"gyro_rate", b"gyro_rats")
    backend = replay(path)
    assert backend.channels(trial) is None
    ending = served(backend, trial).ending
    assert ending.fault is Fault.OTHER
    assert "trial-00001" in ending.reason
