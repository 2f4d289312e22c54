"""What of a recording that came back is found to be wrong, by its name; and what is not wrong."""

from __future__ import annotations

import numpy as np
import pytest

from campaign.backends.handover.acceptance import FEWEST, GO_ON, _until_stopped
from campaign.backends.handover.checks import clipped, wrong_command, wrong_length, wrong_motion
from campaign.backends.handover.returned_recording import ReturnedRecording
from campaign.channels import info
from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial

RATE = 500.0
MOVES = Polyline(
    times=(0.0, 0.5, 0.7, 2.0, 2.2, 2.6, 2.8, 4.1, 4.3),
    values=(0.0, 0.0, 0.2, 0.2, 0.0, 0.0, -0.2, -0.2, 0.0),
)
"""Out and back: with its sign changed, it is itself but later."""
TASK = Task(mode="rate", command=MOVES, duration=5.0, window=(0.0, 5.0), sample_rate=RATE)
TIME = np.arange(2500) / RATE
ASKED = MOVES.sample(TIME)
OTHERS = {
    "trial-00007": 0.5 * ASKED,
    "trial-00009": Sine(amplitude=0.3, frequency=1.0).sample(TIME),
}
CHANCE = np.random.default_rng(3)


def name_of(got: np.ndarray, asked: np.ndarray = ASKED) -> str:
    found = wrong_command(got, asked, RATE, OTHERS)
    return found.name if found else ""


def later(values: np.ndarray, by: int) -> np.ndarray:
    return np.concatenate([np.full(by, values[0]), values[: len(values) - by]])


def test_a_command_that_was_asked_is_good() -> None:
    assert name_of(ASKED) == ""
    assert name_of(ASKED + 0.001 * CHANCE.standard_normal(len(ASKED))) == ""
    assert name_of(np.round(ASKED, 3)) == ""
    assert name_of(later(ASKED, 1)) == ""  # a controller holds its own


@pytest.mark.parametrize(
    ("got", "name", "words"),
    [
        (-ASKED, "wrong sign", "negative"),
        (ASKED * 180 / np.pi, "wrong scale", "degrees and radians?"),
        (ASKED * 1e-3, "no command", "nothing was commanded"),
        (ASKED * 0.7, "wrong scale", "0.7 times"),
        (ASKED * -0.7, "wrong sign and scale", "-0.7 times"),
        (later(ASKED, 60), "late", "late by 0.12 s (60 samples)"),
        (ASKED[60:].tolist() + [0.0] * 60, "early", "early by 0.12 s (60 samples)"),
        (0.5 * ASKED, "another trial", "that of trial-00007"),
        (OTHERS["trial-00009"], "another trial", "that of trial-00009"),
        (np.minimum(ASKED, 0.1), "another command", "instead of"),
    ],
)
def test_another_command_is_named(got: np.ndarray, name: str, words: str) -> None:
    found = wrong_command(np.array(got), ASKED, RATE, OTHERS)
    assert found is not None
    assert found.name == name, found
    assert words in found.text


def test_where_nothing_is_commanded_nothing_may_be() -> None:
    nothing = np.zeros_like(ASKED)
    assert name_of(nothing, nothing) == ""
    assert name_of(nothing + 1e-4, nothing) == ""
    assert name_of(ASKED, nothing) == "another command"


def test_a_recording_ends_with_its_trial() -> None:
    assert wrong_length(TASK, 2500, stopped=False) is None
    assert wrong_length(TASK, 2499, stopped=False) is None
    assert wrong_length(TASK, 300, stopped=True) is None
    found = wrong_length(TASK, 1250, stopped=False)
    assert found is not None
    assert str(found) == "too short: it lasts 2.5 s and was asked to last 5 s (50% of it)"


def torque_of(rate: np.ndarray) -> np.ndarray:
    """Of an axis with friction: Coulomb, viscous, and some inertia."""
    return 5.0 * np.tanh(rate / 0.002) + 8.0 * rate + 2.0 * np.gradient(rate) * RATE


def motion(task: Task = TASK, **series: np.ndarray) -> str:
    found = wrong_motion(task, series, task.command.sample(TIME))
    return found.name if found else ""


def test_motion_is_held_against_the_command_by_its_sign() -> None:
    angle = np.cumsum(ASKED) / RATE - 0.1
    torque = torque_of(ASKED)
    assert motion(relative_rate=ASKED, relative_angle=angle, drive_torque=torque) == ""
    assert motion(relative_rate=later(ASKED, 20)) == ""
    assert motion(relative_rate=-ASKED) == "wrong sign"
    assert motion(gyro_rate=-ASKED) == "wrong sign"
    assert motion(relative_rate=ASKED * 180 / np.pi) == "wrong scale"
    assert motion(relative_rate=ASKED, relative_angle=-angle) == "wrong sign"
    assert motion(relative_rate=ASKED, drive_torque=-torque) == "wrong sign"
    assert motion(relative_rate=ASKED, motor_current=-torque / 3) == "wrong sign"


def test_an_axis_that_is_stuck_or_carries_a_weight_has_no_wrong_sign() -> None:
    noise = 1e-4 * CHANCE.standard_normal(len(TIME))
    assert motion(relative_rate=noise) == ""
    assert motion(relative_rate=ASKED, drive_torque=torque_of(ASKED) - 30.0) == ""


def test_the_motion_of_a_sine_may_be_late_by_any_phase() -> None:
    sine = TASK.model_copy(update={"command": Sine(amplitude=0.2, frequency=20.0)})
    against = -sine.command.sample(TIME)
    assert motion(sine, relative_rate=against) == ""


def test_the_rate_relative_to_a_hull_that_moves_is_not_the_commanded_one() -> None:
    rolling = TASK.model_copy(update={"base_acceleration": Sine(amplitude=0.3, frequency=0.5)})
    assert motion(rolling, relative_rate=-ASKED, gyro_rate=ASKED) == ""
    assert motion(rolling, relative_rate=ASKED, gyro_rate=-ASKED) == "wrong sign"


def test_an_open_loop_is_held_against_its_torque() -> None:
    ramp = Polyline(times=(0.0, 5.0), values=(0.0, 8.0))
    opened = TASK.model_copy(update={"mode": "torque", "command": ramp})
    torque = ramp.sample(TIME)
    assert motion(opened, drive_torque=torque) == ""
    assert motion(opened, drive_torque=-torque) == "wrong sign"


def clip(torque: np.ndarray, limit: float = np.inf) -> bool:
    series = {"drive_torque": torque, "relative_rate": ASKED}
    return clipped(TASK, series, ASKED, {"drive_torque": limit}) is not None


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_torque_that_is_cut_off_is_found(noise: float, sign: float) -> None:
    torque = torque_of(ASKED) + noise * CHANCE.standard_normal(len(TIME))
    assert not clip(sign * torque)
    cut = np.clip(torque, -5.8, 5.8)
    assert clip(sign * cut)
    assert clip(sign * np.clip(torque, -50, 5.8))
    assert not clip(sign * cut, limit=5.8)  # the bench's own limit holds it


def test_a_steady_torque_is_not_clipped() -> None:
    settling = 6.0 * (1.0 - np.exp(-TIME / 0.1))
    assert not clip(settling)
    assert not clip(np.round(settling, 6))
    assert not clip(np.round(settling / 0.05) * 0.05)
    assert not clip(np.round((settling + 0.02 * CHANCE.standard_normal(len(TIME))) / 0.01) * 0.01)
    assert not clip(np.zeros_like(TIME))


def test_a_drive_that_saturates_does_not_bring_the_motion_about() -> None:
    """It is at either end all the while: by itself, such a series may be a coarse one."""
    torque = 6.3 * np.sign(ASKED)
    slow = np.cumsum(torque) / RATE * 0.01
    held = {"drive_torque": 6.3}
    assert clipped(TASK, {"drive_torque": torque, "relative_rate": slow}, ASKED, {}) is not None
    assert clipped(TASK, {"drive_torque": torque, "relative_rate": slow}, ASKED, held) is None
    assert clipped(TASK, {"drive_torque": torque, "relative_rate": ASKED}, ASKED, {}) is None


def test_a_torque_that_does_not_rise_with_its_command_is_clipped() -> None:
    ramp = Polyline(times=(0.0, 5.0), values=(0.0, 8.0))
    task = TASK.model_copy(update={"mode": "torque", "command": ramp})
    torque = ramp.sample(TIME)
    assert clipped(task, {"drive_torque": np.minimum(torque, 5.0)}, torque, {}) is not None
    assert clipped(task, {"drive_torque": torque}, torque, {}) is None


def test_a_drive_that_is_off_is_not_clipped() -> None:
    """It brakes, and is at exactly zero before and after: that is an extreme, too."""
    torque = np.where((TIME > 1) & (TIME < 4), -6.0 + 0.3 * np.sin(40 * TIME), 0.0)
    assert not clip(torque)


def came_back(**series: np.ndarray) -> ReturnedRecording:
    """A recording of `TASK`'s rate, of nothing but these channels."""
    samples = np.array(list(series.values()))
    count = samples.shape[1]
    channels = tuple(info(name) for name in series)
    lost = np.zeros(count, dtype=bool)
    return ReturnedRecording(
        channels, np.arange(count) / RATE, samples, lost, RATE, count / RATE, ()
    )


def test_noise_of_a_differenced_position_ends_no_trial() -> None:
    """The rate that ends a trial is looked at in its mean, and by the gyro of a hull at rest."""
    trial = Trial(
        number=1,
        test="ramp",
        kind="breakaway",
        seed=1,
        bench={},
        task=TASK.model_copy(update={"stop_rate": 0.02}),
    )
    rng = np.random.default_rng(5)
    sliding = np.where(TIME > 3.0, 0.1, 0.0)
    noisy = sliding + 0.02 * rng.normal(size=len(TIME))
    for series in ({"relative_rate": noisy}, {"gyro_rate": sliding, "relative_rate": 5 * noisy}):
        cut, stopped = _until_stopped(trial, came_back(**series))
        assert stopped
        assert cut.time[-1] == pytest.approx(3.0, abs=0.1)
    quiet, stopped = _until_stopped(trial, came_back(gyro_rate=0.0 * sliding, relative_rate=noisy))
    assert not stopped
    assert len(quiet.time) == len(TIME)


RAMP = Trial(
    number=1,
    test="ramp",
    kind="breakaway",
    seed=1,
    bench={},
    task=TASK.model_copy(update={"stop_rate": 0.02}),
)


def rates(acceleration: float, growth: float = 0.0) -> np.ndarray:
    """Of a load that breaks away at 3 s: at once, or as an instability grows (1/s)."""
    after = np.maximum(TIME - 3.0, 0.0)
    return acceleration * (np.expm1(growth * after) / growth if growth else after)


def test_of_a_load_that_breaks_away_at_once_enough_is_kept() -> None:
    light = rates(40.0)
    cut, stopped = _until_stopped(RAMP, came_back(gyro_rate=light))
    assert stopped
    assert np.sum(cut["gyro_rate"] > 0.5 * cut["gyro_rate"][-1]) >= FEWEST
    assert len(cut.time) < np.argmax(light > 0.02) + GO_ON
    # Of a slow one nothing that is not needed: what it does later is another friction.
    slow = rates(1e-4, growth=4.0)
    cut, stopped = _until_stopped(RAMP, came_back(gyro_rate=slow))
    assert stopped
    assert cut["gyro_rate"][-1] < 1.1 * 0.02
    # Who ended it at once is told how little that is by the analysis, and is not refused.
    ended = int(np.argmax(light > 0.02)) + 5
    cut, stopped = _until_stopped(RAMP, came_back(gyro_rate=light[:ended]))
    assert stopped
    assert len(cut.time) == ended


def test_behind_the_rate_that_ends_a_trial_no_limit_is_broken() -> None:
    """It came to that rate within its limits, and there the trial was over."""
    limits = {"angle": 1.0, "rate": 5.0, "acceleration": 50.0, "torque": 9.0, "current": 9.0}
    trial = RAMP.model_copy(update={"bench": {"limits": {**limits, "duration": 60.0}}})
    light = rates(40.0)
    first = int(np.argmax(light > 0.02))
    whole, _ = _until_stopped(trial, came_back(gyro_rate=light))
    beyond = len(whole.time) - 2
    torque = np.where(np.arange(len(TIME)) >= beyond, 10.0, 5.0)
    cut, stopped = _until_stopped(trial, came_back(gyro_rate=light, drive_torque=torque))
    assert stopped
    assert len(cut.time) == beyond
    early = np.where(np.arange(len(TIME)) >= first - 7, 10.0, 5.0)
    cut, _ = _until_stopped(trial, came_back(gyro_rate=light, drive_torque=early))
    assert cut["drive_torque"][-1] == 10.0  # before it: the recorder ends the trial there
