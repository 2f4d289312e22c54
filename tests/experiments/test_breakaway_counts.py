"""Ramps that were recorded by an encoder alone, whose single count is faster than sliding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from campaign.estimate import Estimate
from campaign.experiments import experiments
from campaign.physics.bench import Bench
from campaign.protocol.bench_file import load_bench
from campaign.recording import Channel, Recording
from campaign.trial import OfferedRecording
from tests.experiments.laboratory import Done, Tree, execute, trials
from tests.physics.benches import bench

COUNT = 2 * np.pi / (4 * 4096)
"""rad, of 4 096 lines; at 1 kHz one of them is 0.38 rad/s."""


def servo(tree: Tree) -> None:
    """One interface of friction, and an inertia that slides off within a second."""
    tree["axis"]["inertia"] = "35 kg m^2"
    tree["friction"] = {"load": tree["friction"]["load"]}
    tree["limits"] = {**tree["limits"], "rate": "100 rad/s", "angle": "1000 rad"}


def counted(done: Done, count: float) -> Recording:
    """The ramp as an encoder alone shows it: its counts, and their difference as the rate."""
    angle = np.round(done.samples["relative_angle"] / count) * count
    step = float(np.mean(np.diff(done.samples.time)))
    rate = np.diff(angle, prepend=angle[0]) / step
    made = {
        "relative_angle": angle,
        "gyro_rate": rate,
        "drive_torque": done.samples["drive_torque"],
    }
    channels: dict[str, Channel] = {
        name: done.samples.channels[name].info.with_samples(values) for name, values in made.items()
    }
    return Recording(done.samples.time, channels)


def imported(done: Done, recording: Recording, **options: object) -> Done:
    """The ramp that is found in it."""
    experiment = experiments()["breakaway"]
    assert experiment.recorded is not None
    rate = 1000.0
    chosen = experiment.options.model_validate(options)
    offered = OfferedRecording(
        len(recording.time) / rate, rate, frozenset(recording.channels), {}, (), lambda _: recording
    )
    (request,) = experiment.recorded(chosen, bench(servo), offered)
    assert request.part is not None
    trial = done.trial.model_copy(
        update={
            "point": dict(request.point),
            "options": {**chosen.model_dump(mode="json"), **request.options},
            "task": request.task.model_copy(update={"sample_rate": rate}),
            "windows": request.windows,
            "note": request.note,
            "recording": {"file": "ramp.csv"},
        }
    )
    return Done(trial, done.ending, recording.window(*request.part))


def torque_of(done: Done) -> Estimate:
    """What the ramp says."""
    measure = experiments()["breakaway"].measure
    assert measure is not None
    return next(each for each in measure(done) if each.name == "breakaway_torque")


@pytest.fixture(scope="module")
def ramp() -> Done:
    """From rest to far into sliding; the simulated controller has a gyro."""
    options = {
        "positions": ["0 rad"],
        "directions": ["positive"],
        "torque_rate": "2 N m/s",
        "sliding_rate": "10 rad/s",
    }
    (done,) = execute(trials("breakaway", bench(servo), options))
    assert np.max(done.samples["gyro_rate"]) > 4.0
    return done


def test_counts_are_no_sliding(ramp: Done) -> None:
    """It is cut where the load slides, and so tells what a rate without counts tells, less what
    counts leave of the acceleration.
    """
    found, exact = (imported(ramp, each) for each in (counted(ramp, COUNT), ramp.samples))
    assert found.samples.time[-1] == pytest.approx(exact.samples.time[-1], abs=0.1)
    assert found.trial.options["sliding_rate"] == exact.trial.options["sliding_rate"] == 0.005
    true = torque_of(exact).value
    assert 0.9 * true < torque_of(found).value < 1.01 * true


def test_what_no_smoothing_resolves_raises_the_rate_that_is_sliding(ramp: Done) -> None:
    """An encoder of 300 lines: one and a half counts in 0.2 s are 0.039 rad/s."""
    coarse = 2 * np.pi / 1200
    found = imported(ramp, counted(ramp, coarse))
    least = float(str(found.trial.options["sliding_rate"]))
    assert least == pytest.approx(1.5 * coarse / 0.2, rel=0.05)
    assert "sliding is 2.26 deg/s" in found.trial.note
    assert torque_of(found).value > 0.8 * torque_of(imported(ramp, ramp.samples)).value


def by_counts() -> Bench:
    """One whose rate is the difference of its encoder's counts: 0.38 rad/s each."""
    platform = load_bench("platform")
    encoder, gyro = ({"resolution": size, "noise": 0.0} for size in (COUNT, 1000.0 * COUNT))
    sensors = platform.sensors.model_copy(
        update={
            "encoder": platform.sensors.encoder.model_copy(update=encoder),
            "gyro": platform.sensors.gyro.model_copy(update=gyro),
        }
    )
    limits = platform.limits.model_copy(update={"rate": 10.0})
    return platform.model_copy(update={"sensors": sensors, "limits": limits})


def test_an_executed_ramp_goes_by_the_same_counts() -> None:
    """It ends at two counts of the rate, and friction is told of the angle's."""
    options = {"positions": ["0 rad"], "directions": ["positive"], "torque_rate": "2 N m/s"}
    (planned,) = trials("breakaway", by_counts(), options)
    assert planned.task.stop_rate == pytest.approx(2000.0 * COUNT)
    (done,) = execute([planned])
    true = float(np.max(done.samples["friction_torque"]))
    assert torque_of(done).value == pytest.approx(true, rel=0.02)


def test_the_zero_of_a_torque_sensor_is_in_no_number_of_a_ramp() -> None:
    """A tenth of the friction: it is what the sensor shows at rest, where nothing is commanded."""
    rig: Bench = bench(servo)
    (done,) = execute(
        trials("breakaway", rig, {"positions": ["0 rad"], "directions": ["positive"]})
    )
    torque = done.samples.channels["drive_torque"]
    shifted = torque.info.with_samples(torque.samples + 3.0)
    samples = Recording(done.samples.time, {**done.samples.channels, "drive_torque": shifted})
    measure = experiments()["breakaway"].measure
    assert measure is not None
    exact, off = (
        {each.name: each.value for each in measure(one)}
        for one in (done, replace(done, samples=samples))
    )
    assert "bristle_stiffness" in exact
    for name in ("breakaway_torque", "bristle_stiffness"):
        assert off[name] == pytest.approx(exact[name], rel=1e-9), name


def test_friction_that_grows_with_speed_has_no_breakaway() -> None:
    """Its largest value is where the recording ends, and no number of the rig."""
    tree = by_counts().model_dump(mode="json")
    tree["sensors"]["encoder"]["resolution"] = COUNT / 10.0
    tree["sensors"]["gyro"]["resolution"] = 100.0 * COUNT
    name, load = next(iter(tree["friction"].items()))
    load |= {"static_torque": 0.85 * load["coulomb_torque"], "stribeck_velocity": 0.03}
    tree["friction"] = {name: load}
    growing = Bench.model_validate(tree, context={"si": True})
    options = {"positions": ["0 rad"], "directions": ["positive"], "torque_rate": "2 N m/s"}
    (done,) = execute(trials("breakaway", growing, options))
    found = torque_of(done)
    assert found.kind == "at least"
    assert found.value < float(np.max(done.samples["friction_torque"]))
