"""Steps and sines that nobody planned, from samples of a second-order loop with known numbers."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from scipy.signal import lsim, lti

from campaign.estimate import Window
from campaign.estimation.step_response import NOT_SETTLED, step_characteristics
from campaign.experiments import experiments
from campaign.experiments.frequency_response.experiment import _point
from campaign.recording import Channel, Ending, Outcome, Recording
from campaign.result import Result
from campaign.trial import OfferedRecording, Trial
from tests.experiments.laboratory import Done, analyse, finding, table_of_estimates
from tests.physics.benches import bench

RATE = 500.0
TIME = np.arange(10000) / RATE
CORNER, DAMPING = 2 * np.pi * 8, 0.5
LOOP = lti([CORNER**2], [1, 2 * DAMPING * CORNER, CORNER**2])
OVERSHOOT = np.exp(-DAMPING * np.pi / np.sqrt(1 - DAMPING**2))
JUMP = (TIME >= 3.0).astype(float)
RESTS = (TIME >= 3.0) & (TIME < 17.0)
SINE = np.where(RESTS, np.sin(2 * np.pi * 2.0 * (TIME - 3.0)), 0.0)


def answer(command: np.ndarray) -> np.ndarray:
    return np.asarray(lsim(LOOP, command, TIME, interp=False)[1])


def noise(size: float) -> np.ndarray:
    return size * np.random.default_rng(1).normal(size=len(TIME))


def recorded(
    kind: str, command: np.ndarray, rate: np.ndarray, windows: tuple[Window, ...] = ()
) -> Done:
    """The one trial that is found in a recording."""
    signals: Mapping[str, Any] = {"command": command, "gyro_rate": rate}
    channels = {
        name: Channel(name, "rad/s", name, "deg/s", samples) for name, samples in signals.items()
    }
    recording = Recording(TIME[: len(command)], channels)
    duration = len(command) / RATE
    experiment = experiments()[kind]
    assert experiment.recorded is not None
    chosen, rig = experiment.options(), bench()
    offered = OfferedRecording(duration, RATE, frozenset(signals), {}, windows, lambda _: recording)
    (request,) = experiment.recorded(chosen, rig, offered)
    trial = Trial(
        number=1,
        test=kind,
        kind=kind,
        point=dict(request.point),
        options={**chosen.model_dump(mode="json"), **request.options},
        seed=1,
        bench=rig.model_dump(mode="json"),
        task=request.task,
        note=request.note,
        windows=request.windows,
    )
    return Done(trial, Ending(Outcome.COMPLETED), recording)


def step(command: np.ndarray, rate: np.ndarray) -> Result:
    return analyse("step_response", [recorded("step_response", command, rate)])


@pytest.mark.parametrize("size", [1.0, -1.0])
@pytest.mark.parametrize("level", [0.0, 0.3])
def test_a_jump_up_or_down(size: float, level: float):
    command = level + size * JUMP
    result = step(command, level + size * answer(JUMP))
    up = step(JUMP, answer(JUMP))
    assert finding(result, "overshoot").value == pytest.approx(OVERSHOOT, rel=0.01)
    for name in ("rise_time", "settling_time", "overshoot", "steady_state_error"):
        same = finding(up, name).value
        assert finding(result, name).value == pytest.approx(same, rel=1e-6, abs=1e-9), name
    assert not result.notes
    (band, *_) = result.figures[0].panels[0].marks
    assert band.y is not None
    assert band.until is not None
    assert band.y < level + size < band.until


def test_a_downward_step_that_falls_short_is_off_as_its_mirror_image():
    for size in (1.0, -1.0):
        result = step(size * JUMP, 0.9 * size * answer(JUMP))
        assert finding(result, "steady_state_error").value == pytest.approx(0.1, rel=1e-6)


def test_a_step_that_does_not_settle_is_told_with_its_band():
    result = step(JUMP, 0.9 * answer(JUMP))
    assert finding(result, "settling_time").known.reason in NOT_SETTLED
    assert any("does not stay within 2 % of the step." in note for note in result.notes)


def test_noise_within_the_band_does_not_put_off_settling():
    truth = step(JUMP, answer(JUMP))
    result = step(JUMP, answer(JUMP) + noise(0.005))
    for name, share in (("rise_time", 0.06), ("settling_time", 0.06), ("overshoot", 0.08)):
        assert finding(result, name).value == pytest.approx(finding(truth, name).value, rel=share)


def test_what_noise_hides_has_no_number_and_says_why():
    truth = step(JUMP, answer(JUMP))
    result = step(JUMP, answer(JUMP) + noise(0.05))
    rise = finding(truth, "rise_time").value
    # Four of its standard deviations, which are 5 % (next test).
    assert finding(result, "rise_time").value == pytest.approx(rise, rel=0.2)
    for name in ("settling_time", "overshoot"):
        estimate = finding(result, name).estimate
        assert np.isnan(estimate.value)
        assert "scatters by 5.1 % of the step" in str(estimate.reason)
    (row,) = table_of_estimates(result, "step-response").rows
    assert "scatters" in str(row["settling_time"].reason)  # type: ignore[union-attr]
    assert any("no settling time: the rate scatters" in note for note in result.notes)


def test_noise_does_not_shift_a_rise():
    """Noise of 5 % of the step; averages over a third of the rise lengthen it by 4 % at most."""
    clean = answer(JUMP)
    truth = step_characteristics(TIME, clean, 3.0, 1.0).rise_time
    noisy = [clean + 0.05 * np.random.default_rng(k).normal(size=len(TIME)) for k in range(40)]
    rises = [step_characteristics(TIME, each, 3.0, 1.0).rise_time for each in noisy]
    assert np.mean(rises) == pytest.approx(truth, rel=0.04)
    assert np.std(rises) < 0.08 * truth


def test_options_that_fit_no_step_are_told_in_words():
    done = recorded("step_response", JUMP, answer(JUMP))
    options = {**done.trial.options, "step": 0.0}
    wrong = Done(done.trial.model_copy(update={"options": options}), done.ending, done.samples)
    (note,) = analyse("step_response", [wrong]).notes
    assert "fit no step response: step" in note
    assert "pydantic" not in note
    assert "\n" not in note


def test_a_step_without_a_standstill_before_it_is_refused():
    command = (TIME[:700] >= 0.008).astype(float)
    with pytest.raises(ValueError, match="standstill"):
        recorded("step_response", command, command)


def test_several_steps_are_told_apart_from_one():
    twice = JUMP + (TIME >= 10.0)
    with pytest.raises(ValueError, match="start and stop choose one"):
        recorded("step_response", twice, answer(twice))


@pytest.mark.parametrize("windows", [(), (Window("steady", 5.0, 15.0),)])
def test_a_sine_between_rests(windows: tuple[Window, ...]):
    done = recorded("frequency_response", SINE, answer(SINE), windows)
    assert done.trial.point["frequency"] == pytest.approx(2.0, rel=1e-3)
    command = done.trial.task.command
    steady = (TIME >= 5.0) & (TIME < 15.0)
    assert command.sample(TIME[steady]) == pytest.approx(SINE[steady], abs=0.05)  # type: ignore[union-attr]
    (window,) = done.trial.windows
    assert 3.0 <= window.start < window.stop <= 17.0 + 1e-6
    row = _point(done).response
    expected = 1.0 / (1.0 - (2.0 / 8.0) ** 2 + 2j * DAMPING * 2.0 / 8.0)
    assert row == pytest.approx(expected, abs=2e-2)


@pytest.mark.parametrize(
    "command",
    [
        np.sin(2 * np.pi * 2.0 * TIME) + np.sin(2 * np.pi * 5.0 * TIME),
        np.sin(2 * np.pi * (0.5 + 0.2 * TIME) * TIME),
        np.sign(np.sin(2 * np.pi * TIME)),
        np.where((TIME > 8.0) & (TIME < 12.0), 0.0, SINE),
    ],
)
def test_what_is_no_sine_for_a_while_is_refused_with_a_remedy(command: np.ndarray):
    with pytest.raises(ValueError, match="windows name that part, or start and stop"):
        recorded("frequency_response", command, command)


@pytest.mark.parametrize(
    ("command", "rate", "said"),
    [(57.3, 1.0, "the units"), (1.0, -1.0, "the signs"), (1.0, 1.0, "")],
)
def test_a_wrong_unit_or_sign_of_a_loop_is_remarked(command: float, rate: float, said: str):
    done = recorded("frequency_response", command * SINE, rate * answer(SINE))
    notes = [n for n in analyse("frequency_response", [done]).notes if "lowest frequency" in n]
    assert len(notes) == bool(said)
    assert all(said in note for note in notes)


def test_a_sine_after_another_needs_a_window():
    both = np.where(RESTS, SINE, 0.8 * np.sin(2 * np.pi * 6.0 * TIME))
    with pytest.raises(ValueError, match="windows name that part"):
        recorded("frequency_response", both, both)
    done = recorded("frequency_response", both, both, (Window("steady", 4.0, 16.0),))
    assert done.trial.point["frequency"] == pytest.approx(2.0, rel=1e-3)
    assert "in the window 'steady', 4 to 16 s" in done.trial.note


def test_a_window_is_taken_by_its_name_and_not_by_its_place():
    both = np.where(RESTS, SINE, 0.8 * np.sin(2 * np.pi * 6.0 * TIME))
    windows = Window("rest", 0.0, 2.0), Window("steady", 4.0, 16.0)
    done = recorded("frequency_response", both, both, windows)
    assert done.trial.windows == (Window("steady", 4.0, 16.0),)
    assert done.trial.point["frequency"] == pytest.approx(2.0, rel=1e-3)
    with pytest.raises(ValueError, match="a window 'rest' has no meaning here; it is 'steady'"):
        recorded("frequency_response", both, both, windows[:1])


def test_what_somebody_named_is_taken_and_the_rest_is_found():
    rest = Window("rest", 0.1, 0.2)
    windows = {
        w.name: w for w in recorded("step_response", JUMP, answer(JUMP), (rest,)).trial.windows
    }
    found = {w.name: w for w in recorded("step_response", JUMP, answer(JUMP)).trial.windows}
    assert windows == {"rest": rest, "answer": found["answer"]}
