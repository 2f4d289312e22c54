"""The simulated bench as a backend: what ends a trial, when, and what is kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.backends.sim import BACKEND, CHANNELS, SimBackend, SimOptions
from campaign.physics import lanes as lanes_module
from campaign.physics import simulate as simulate_module
from campaign.physics.bench import Bench
from campaign.physics.grid import make_grid
from campaign.recording import Ending, MemoryRecorder, Outcome, Recording, SafeState
from campaign.signals import Polyline, Sine
from campaign.trial import Task, Trial
from tests.physics.benches import KT, RATIO, bench, run, task

SWING = Sine(amplitude=float(np.deg2rad(18.0)), frequency=0.24)
WIDE = {"angle": "1e300 rad", "rate": "1e300 rad/s", "torque": "1e300 N m", "current": "1e300 A"}


def limited(**limits: str) -> Bench:
    return bench(lambda tree: tree["limits"].update(limits))


def trial(on: Bench, what: Task, seed: int = 1) -> Trial:
    return Trial(
        number=1, test="t", kind="k", seed=seed, bench=on.model_dump(mode="json"), task=what
    )


def execute(on: Bench, what: Task, stopped: Any = lambda: False) -> tuple[Ending, Recording]:
    recorder = MemoryRecorder()
    with BACKEND.open(SimOptions()) as backend:
        ending = backend.execute(trial(on, what), recorder, stopped)
    return ending, recorder.recording(ending)


def test_a_trial_that_completes_records_what_the_engine_computed() -> None:
    moving = task(base_acceleration=SWING, compensation="lugre")
    ending, recording = execute(bench(), moving)
    assert ending == Ending(Outcome.COMPLETED)
    assert ending.safe_state is SafeState.CONFIRMED
    assert tuple(recording.channels) == tuple(info.name for info in CHANNELS)
    _, out = run(bench(), moving, None)
    np.testing.assert_array_equal(recording["gyro_rate"], out["gyro_rate"])
    np.testing.assert_array_equal(recording["pointing_error"], out["pointing_angle"])
    np.testing.assert_allclose(recording["drive_torque"], out["motor_current"] * RATIO * KT)
    np.testing.assert_allclose(recording.time, np.arange(1000) * 1e-3, atol=1e-12)
    known = {info.name for info in CHANNELS if not info.measured}
    assert known == {"friction_torque", "load_rate"}


def test_a_plan_discretises_no_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    """Step and structure do not depend on it; executing does, once a trial."""
    real, steps = lanes_module.discretise, []

    def counted(a: Any, b: Any, step: float) -> Any:
        steps.append(step)
        return real(a, b, step)

    monkeypatch.setattr(lanes_module, "discretise", counted)
    planned = trial(bench(), task())
    with BACKEND.open(SimOptions()) as backend:
        assert backend.refuses(planned) is None
        cost = backend.cost(planned)
        assert backend.group(planned)
        assert steps == []
        backend.execute(planned, MemoryRecorder(), lambda: False)
    assert steps == [cost.step]


def test_a_bench_is_validated_once_though_each_trial_has_a_copy_of_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """As in a worker process, which receives a copy with each batch."""
    on, validated = bench(), []
    real = Bench.model_validate
    monkeypatch.setattr(
        Bench, "model_validate", lambda *a, **k: validated.append(a) or real(*a, **k)
    )
    with BACKEND.open(SimOptions()) as backend:
        costs = {backend.cost(trial(on, task(), seed)).step for seed in range(1, 4)}
    assert len(costs) == 1
    assert len(validated) == 1


def test_the_command_channel_has_the_unit_of_its_mode() -> None:
    _, closed = execute(bench(), task(command=Polyline(times=(0.0,), values=(0.1,))))
    _, opened = execute(bench(), task(mode="torque", command=Polyline(times=(0.0,), values=(3.0,))))
    assert closed.channels["command"].unit == "rad/s"
    assert opened.channels["command"].unit == "N m"
    np.testing.assert_array_equal(opened["command"], 3.0)


# 100 N m/s: breaks away at 0.37 s and ends at 75 deg/s, within all limits of the bench.
PUSH = task(mode="torque", command=Polyline(times=(0.0, 2.0), values=(0.0, 200.0)), duration=1.25)


@pytest.mark.parametrize(
    ("limit", "channel", "value", "said"),
    [
        ("angle", "relative_angle", np.deg2rad(2.0), ("2 deg", "angle limit")),
        ("rate", "relative_rate", np.deg2rad(10.0), ("10 deg/s", "rate limit")),
        ("torque", "drive_torque", 60.0, ("60 N·m", "torque limit")),
        ("current", "motor_current", 4.0, ("4 A", "current limit")),
    ],
)
def test_a_limit_ends_the_trial_at_its_first_sample_beyond(
    limit: str, channel: str, value: float, said: tuple[str, str]
) -> None:
    free, whole = execute(bench(), PUSH)
    assert free.outcome is Outcome.COMPLETED
    judged = whole[channel]
    if limit == "rate":  # by its mean over 10 ms; before the trial the bench was at rest
        judged = np.convolve(judged, np.full(10, 0.1))[: len(judged)]
    beyond = int(np.argmax(np.abs(judged) > value))
    ending, recording = execute(limited(**{limit: said[0]}), PUSH)
    assert ending.outcome is Outcome.LIMIT
    assert channel in ending.reason
    assert said[0] in ending.reason
    assert said[1] in ending.reason
    # The sample that broke it is kept, and is the last one.
    assert len(recording.time) == beyond + 1
    np.testing.assert_array_equal(recording[channel], whole[channel][: beyond + 1])
    (event,) = recording.events
    assert event.time == recording.time[-1]
    assert event.text == ending.reason


def test_of_several_limits_the_first_in_time_is_the_reason() -> None:
    both = limited(torque="60 N m", rate="10 deg/s")
    ending, _ = execute(both, PUSH)
    assert "torque limit" in ending.reason
    ending, _ = execute(limited(torque="150 N m", rate="10 deg/s"), PUSH)
    assert "rate limit" in ending.reason


def sampled_observer(tree: dict[str, Any]) -> None:
    """At 1 kHz: N K0 / J = 8067 rad/s, far beyond what a held output at 1 kHz can stabilise."""
    tree["controller"]["sample_rate"] = "1 kHz"
    tree["limits"] |= WIDE


def test_divergence_is_reported_and_nothing_infinite_is_kept() -> None:
    ending, recording = execute(
        bench(sampled_observer), task(base_acceleration=SWING, compensation="observer")
    )
    assert ending.outcome is Outcome.DIVERGED
    told = float(ending.reason.split("diverged at ")[1].split(" s")[0])
    assert told == pytest.approx(recording.time[-1] + 1e-3)  # the first sample not kept
    assert 0 < len(recording.time) < 1000
    for channel in recording.channels.values():
        assert np.all(np.isfinite(channel.samples))
    assert recording.events[0].text == ending.reason


def test_limits_stop_a_diverging_trial_long_before_infinity() -> None:
    def limits_kept(tree: dict[str, Any]) -> None:
        tree["controller"]["sample_rate"] = "1 kHz"

    ending, recording = execute(
        bench(limits_kept), task(base_acceleration=SWING, compensation="observer")
    )
    assert ending.outcome is Outcome.LIMIT
    assert len(recording.time) < 20


def test_the_stop_rate_completes_a_trial_early() -> None:
    _, whole = execute(bench(), PUSH)
    beyond = int(np.argmax(np.abs(whole["relative_rate"]) > 0.02))
    ending, recording = execute(bench(), PUSH.model_copy(update={"stop_rate": 0.02}))
    assert ending == Ending(Outcome.COMPLETED)
    assert len(recording.time) == beyond
    assert recording.events[0].time == pytest.approx(beyond * 1e-3)


def test_the_stop_rate_is_relative_to_the_hull() -> None:
    """The hull speeds up by 0.1 rad/s^2 under a load that stands still in space."""
    push_off = Polyline(times=(0.0,), values=(0.1,))
    ending, recording = execute(bench(), task(base_acceleration=push_off, stop_rate=0.05))
    assert ending == Ending(Outcome.COMPLETED)
    assert recording.time[-1] == pytest.approx(0.5, abs=0.02)
    assert np.max(np.abs(recording["gyro_rate"])) < 0.01


def test_a_limit_after_the_stop_rate_does_not_count() -> None:
    stops = PUSH.model_copy(update={"stop_rate": 0.02})
    ending, _ = execute(limited(rate="10 deg/s"), stops)
    assert ending.outcome is Outcome.COMPLETED


def test_somebody_can_stop_it_between_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    swinging = task(base_acceleration=SWING)
    per_sample = make_grid(bench(), swinging).every
    monkeypatch.setattr(simulate_module, "STRETCH_STEPS", 100 * per_sample)
    asked = iter([False, False, True])
    ending, recording = execute(bench(), swinging, lambda: next(asked))
    assert ending.outcome is Outcome.INTERRUPTED
    assert len(recording.time) == 300


def test_a_trial_is_looked_at_once_for_all_seeds_and_again_for_another_bench(monkeypatch) -> None:
    backend, looked = SimBackend(SimOptions()), []
    look_at = SimBackend._look_at

    def noting(self: SimBackend, each: Trial) -> Any:
        looked.append(each.seed)
        return look_at(self, each)

    monkeypatch.setattr(SimBackend, "_look_at", noting)
    first = trial(bench(), task())
    assert backend.refuses(first) is None
    assert backend.refuses(first.model_copy(update={"seed": first.seed + 1})) is None
    assert len(looked) == 1
    other = bench(lambda tree: tree["axis"].update(inertia="80 kg m^2"))
    for each in (trial(other, task()), trial(bench(), task(sample_rate=500.0))):
        assert backend.refuses(each) is None
    assert len(looked) == 3


def test_it_refuses_what_it_cannot_execute() -> None:
    backend = SimBackend(SimOptions())
    assert backend.refuses(trial(bench(), task())) is None
    reason = backend.refuses(trial(bench(), task(compensation="nonsense")))
    assert reason is not None
    assert "nonsense" in reason

    def sampled(tree: dict[str, Any]) -> None:
        tree["controller"]["sample_rate"] = "1 kHz"

    reason = backend.refuses(trial(bench(sampled), task(sample_rate=300.0)))
    assert reason is not None
    assert "300 Hz" in reason


def test_trials_do_not_know_of_each_other() -> None:
    """Every trial starts from rest at its own angle, whatever ran before."""
    backend = SimBackend(SimOptions())
    results = []
    for _ in range(2):
        recorder = MemoryRecorder()
        ending = backend.execute(trial(bench(), PUSH), recorder, lambda: False)
        results.append(recorder.recording(ending)["relative_angle"])
    np.testing.assert_array_equal(*results)
    _, turned = execute(bench(), PUSH.model_copy(update={"start_angle": 0.3}))
    np.testing.assert_allclose(turned["relative_angle"], results[0] + 0.3, atol=1e-12)
