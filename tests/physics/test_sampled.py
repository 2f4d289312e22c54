"""The sampled controller: convergence, sensors, delays, noise, and blocks."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from campaign.physics import simulate as simulate_module
from campaign.physics.bench import Bench
from campaign.physics.grid import make_grid
from campaign.signals import Polyline, Sine
from campaign.trial import Task
from tests.physics.benches import KT, RATIO, bench, run, task
from tests.physics.dry_cases import swing
from tests.physics.event_reference import THESIS_DRY, DryLoop, SampledBristles, simulate_sampled

SWING = Sine(amplitude=1.5, frequency=1.0, phase=np.pi / 2)
SENSORS = {"gyro": "rad/s", "encoder": "rad", "resolver": "rad", "current": "A"}


def sampled(rate: str = "1 kHz", sensors: Any = None, **controller: str) -> Bench:
    def edit(tree: dict[str, Any]) -> None:
        tree["controller"] |= {"sample_rate": rate, **controller}
        tree["sensors"] = sensors or {}

    return bench(edit)


@pytest.mark.parametrize("compensation", ["none", "lugre", "observer"])
def test_goes_to_the_continuous_controller_as_the_rate_rises(compensation: str) -> None:
    """Sampling, holding and a backward difference each cost half a sample: first order."""
    moving = task(base_acceleration=SWING, compensation=compensation)
    _, continuous = run(bench(), moving, 25e-6)
    errors = []
    for rate in ("20 kHz", "40 kHz"):
        _, out = run(sampled(rate), moving, 25e-6)
        difference = out["load_rate"] - continuous["load_rate"]
        errors.append(float(np.sqrt(np.mean(difference**2))))
    assert errors[1] < 0.25 * float(np.sqrt(np.mean(continuous["load_rate"] ** 2)))
    assert 0.8 < np.log2(errors[0] / errors[1]) < 1.2


def newest_static(rate: float) -> float:
    """Equation 4.6 with sgn(0) = 0 and the appendix' parameters, N m at the load."""
    return DryLoop().sliding(THESIS_DRY, int(np.sign(rate)), rate)


@pytest.mark.parametrize("compensation", ["static", "lugre"])
@pytest.mark.parametrize(("rate", "low_pass"), [(1000, 0.0), (1000, 3e-3), (200, 3e-3)])
def test_compensation_runs_on_the_newest_filtered_rate(
    compensation: str, rate: int, low_pass: float
) -> None:
    """Through a reversal, against scipy from sample to sample; 1e-6 of each output's rms.

    Of the load's rate, which is what compensation leaves, 1e-4.
    """
    compensate = newest_static if compensation == "static" else SampledBristles(1 / rate)
    loop = DryLoop(bristles=True, low_pass=low_pass, **swing(SWING))  # type: ignore[arg-type]
    expected = simulate_sampled(loop, round(0.7 * rate), 1 / rate, compensate)
    on = sampled(f"{rate} Hz", relative_rate_filter=f"{low_pass} s")
    moving = task(
        base_acceleration=SWING, compensation=compensation, duration=0.7, sample_rate=rate
    )
    _, out = run(on, moving, 1 / 16e3)
    for name in ("relative_rate", "compensation_torque", "motor_current", "load_rate"):
        error = np.std(out[name] - expected[name]) / np.std(expected[name])
        assert error < (1e-4 if name == "load_rate" else 1e-6), name


@pytest.mark.parametrize("low_pass", [0.0, 3e-3])
def test_loop_can_be_fed_by_the_encoder(low_pass: float) -> None:
    """Against scipy from sample to sample, as above; it is another loop than the gyro's."""
    loop = DryLoop(bristles=True, low_pass=low_pass, **swing(SWING))  # type: ignore[arg-type]
    expected = simulate_sampled(loop, 700, fed_by_encoder=True)
    feedback = {"relative_rate_filter": f"{low_pass} s", "rate_feedback": "encoder"}
    moving = task(base_acceleration=SWING, duration=0.7, sample_rate=1000)
    _, out = run(sampled(**feedback), moving, 1 / 16e3)
    for name in ("relative_rate", "motor_current", "load_rate"):
        error = np.std(out[name] - expected[name]) / np.std(expected[name])
        assert error < (1e-4 if name == "load_rate" else 1e-6), name
    np.testing.assert_array_equal(out["gyro_rate"], out["relative_rate"])
    _, by_gyro = run(sampled(), moving, 1 / 16e3)
    assert np.std(by_gyro["load_rate"] - out["load_rate"]) > 0.1 * np.std(out["load_rate"])


def test_readings_are_multiples_of_the_resolution() -> None:
    resolution = {"gyro": 2e-4, "encoder": 3e-5, "resolver": 1e-3, "current": 0.05}
    coarse = {name: {"resolution": f"{resolution[name]} {unit}"} for name, unit in SENSORS.items()}
    _, out = run(sampled(sensors=coarse), task(base_acceleration=SWING))
    rows = {"gyro_rate": "gyro", "relative_angle": "encoder", "motor_current": "current"}
    for row, name in rows.items():
        counts = out[row] / resolution[name]
        np.testing.assert_allclose(counts, np.rint(counts), atol=1e-6)
        assert len(np.unique(np.rint(counts))) > 5


def test_quantisation_rounds_to_the_nearest_count() -> None:
    fine = {"gyro": {"resolution": "0.002 rad/s"}}
    # Open loop: the readings change nothing about the motion.
    push = task(mode="torque", command=Polyline(times=(0.0, 1.0), values=(0.0, 80.0)))
    _, out = run(sampled(sensors=fine), push)
    assert np.max(np.abs(out["gyro_rate"] - out["load_rate"])) <= 0.001 * (1 + 1e-9)
    assert np.max(np.abs(out["gyro_rate"] - out["load_rate"])) > 0.0009


@pytest.mark.parametrize("late", ["gyro", "encoder", "current"])
def test_a_sensors_delay_shifts_its_own_channel_by_whole_samples(late: str) -> None:
    row = {"gyro": "gyro_rate", "encoder": "relative_angle", "current": "motor_current"}
    push = task(mode="torque", command=Polyline(times=(0.0, 1.0), values=(0.0, 80.0)))
    _, prompt = run(sampled(), push)
    _, delayed = run(sampled(sensors={late: {"delay": "3 ms"}}), push)
    for name, channel in row.items():
        if name == late:
            np.testing.assert_array_equal(delayed[channel][3:], prompt[channel][:-3])
            np.testing.assert_array_equal(delayed[channel][:3], prompt[channel][0])
        else:
            np.testing.assert_array_equal(delayed[channel], prompt[channel])


@pytest.mark.parametrize("corner", [0.0, 2.0])
def test_the_pointing_angle_is_the_trapezoidal_sum_of_the_gyro_readings(corner: float) -> None:
    """Behind a high-pass of 2 Hz the sum forgets by its pole from sample to sample."""
    swing = task(command=Sine(amplitude=0.2, frequency=3.0), duration=0.5)
    _, out = run(sampled(pointing_high_pass=f"{corner} Hz"), swing)
    rate, pole = out["gyro_rate"], np.exp(-2 * np.pi * corner * 1e-3)
    expected = np.zeros(len(rate))
    for n in range(1, len(rate)):
        expected[n] = pole * expected[n - 1] + 0.5e-3 * (rate[n - 1] + rate[n])
    np.testing.assert_allclose(out["pointing_angle"], expected, rtol=1e-9, atol=1e-12)
    by_rectangles = 1e-3 * np.cumsum(rate)  # which anybody would see, half a sample away
    assert np.max(np.abs(by_rectangles - expected)) > 1e-5


def test_the_output_delay_holds_every_command_back() -> None:
    """2 ms at 1 kHz are two samples; before the first command the current is zero."""
    push = task(mode="torque", command=Polyline(times=(0.0,), values=(60.0,)))
    _, prompt = run(sampled(), push)
    _, late = run(sampled(delay="2 ms"), push)
    np.testing.assert_array_equal(late["motor_current"][2:], prompt["motor_current"][:-2])
    np.testing.assert_array_equal(late["load_rate"][2:], prompt["load_rate"][:-2])
    np.testing.assert_array_equal(late["load_rate"][:3], 0.0)
    np.testing.assert_allclose(prompt["motor_current"][-1], 60.0 / (RATIO * KT), rtol=0.02)


def test_the_output_delay_need_not_be_whole_samples() -> None:
    """1.5 ms at 1 kHz: what a recording at 2 kHz of a 2 kHz controller shows three samples late."""
    push = task(mode="torque", sample_rate=1000.0, command=Polyline(times=(0.0,), values=(60.0,)))
    one, late = (run(sampled(delay=delay), push)[1] for delay in ("1 ms", "1.5 ms"))
    fine = task(mode="torque", sample_rate=2000.0, command=Polyline(times=(0.0,), values=(60.0,)))
    _, half = run(sampled("2 kHz"), fine)
    # An open loop answers a constant command alike, whenever it comes.
    np.testing.assert_allclose(
        late["load_rate"][2:], half["load_rate"][1:-3:2], rtol=1e-6, atol=1e-12
    )
    np.testing.assert_allclose(
        one["load_rate"][1:], half["load_rate"][0:-2:2], rtol=1e-6, atol=1e-12
    )


NOISY = {"gyro": 1e-3, "encoder": 2e-5, "resolver": 1e-3, "current": 0.02}
REST = task(mode="torque", duration=20.0)


def noisy() -> Bench:
    return sampled(
        sensors={name: {"noise": f"{NOISY[name]} {unit}"} for name, unit in SENSORS.items()}
    )


def test_noise_is_white_with_the_stated_deviation() -> None:
    """20 000 readings of an axis at rest: deviation within 2 %, no correlation beyond 3/sqrt(n)."""
    _, out = run(noisy(), REST)
    rows = {"gyro_rate": "gyro", "relative_angle": "encoder", "motor_current": "current"}
    for row, name in rows.items():
        values = out[row]
        assert np.std(values) == pytest.approx(NOISY[name], rel=0.02)
        assert abs(np.mean(values)) < 4 * NOISY[name] / np.sqrt(len(values))
        normal = (values - values.mean()) / values.std()
        for lag in (1, 2, 10):
            assert abs(np.mean(normal[lag:] * normal[:-lag])) < 3.5 / np.sqrt(len(values))
    gyro, encoder = out["gyro_rate"], out["relative_angle"]
    assert abs(np.corrcoef(gyro, encoder)[0, 1]) < 3.5 / np.sqrt(len(gyro))


def test_the_seed_is_all_there_is_to_chance() -> None:
    moving = task(base_acceleration=SWING, compensation="lugre")
    _, first = run(noisy(), moving, seed=5)
    _, again = run(noisy(), moving, seed=5)
    _, other = run(noisy(), moving, seed=6)
    for name, values in first.items():
        np.testing.assert_array_equal(values, again[name])
        assert not np.array_equal(values, other[name])


@pytest.mark.parametrize("compensation", ["none", "lugre", "observer"])
@pytest.mark.parametrize("controller", ["continuous", "sampled"])
def test_results_do_not_depend_on_the_blocks(
    monkeypatch: pytest.MonkeyPatch, compensation: str, controller: str
) -> None:
    # At 1 kHz the observer's 8067 rad/s are beyond stability; at 10 kHz all methods run.
    on = bench()
    if controller == "sampled":
        noise = {name: {"noise": f"{NOISY[name]} {unit}"} for name, unit in SENSORS.items()}
        on = sampled("10 kHz", {**noise, "gyro": {"noise": "1e-6 rad/s", "delay": "0.2 ms"}})
    moving = task(base_acceleration=SWING, compensation=compensation)
    _, whole = run(on, moving)
    monkeypatch.setattr(simulate_module, "STRETCH_STEPS", 370)
    time, parts = run(on, moving)
    assert len(time) == 1000
    for name, values in whole.items():
        np.testing.assert_array_equal(values, parts[name])
        assert np.all(np.isfinite(values))


def grid(controller: str | None, recording: float, **fields: Any) -> Any:
    on = bench() if controller is None else sampled(controller)
    return make_grid(on, Task(**{**task().model_dump(), "sample_rate": recording, **fields}))


def test_the_grid_divides_both_sample_times() -> None:
    plain = grid(None, 1000.0)
    assert plain.step * plain.every == pytest.approx(1e-3)
    assert (plain.per_control, plain.samples) == (0, 1000)
    both = grid("2 kHz", 500.0)
    assert both.step * both.per_control == pytest.approx(0.5e-3)
    assert both.every == 4 * both.per_control
    assert both.step <= 1e-3
    with pytest.raises(ValueError, match="whole multiple"):
        grid("1 kHz", 300.0)


def test_a_fast_sine_shortens_the_step() -> None:
    fast = grid(None, 1000.0, base_acceleration=Sine(amplitude=1.0, frequency=100.0))
    assert fast.step <= 1 / (80 * 100.0)
