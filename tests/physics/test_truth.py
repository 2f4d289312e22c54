"""A bench is simulated that is not the one that is stated: which number is whose."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from campaign.backends.sim import SimBackend, SimOptions
from campaign.channels import DRIVE_TORQUE, FRICTION_TORQUE, GYRO_RATE, LOAD_RATE, MOTOR_CURRENT
from campaign.physics.bench import Bench
from campaign.physics.complete import complete
from campaign.physics.lanes import Lane
from campaign.physics.truth import digest, has, plant_of, settings, simulated, with_settings
from campaign.recording import MemoryRecorder, Recording
from campaign.signals import Polyline
from campaign.trial import Task, Trial
from tests.physics.benches import INERTIA, KE, KT, RATIO, Tree, bench, stribeck, task

STEADY = task(
    duration=4.0, command=Polyline(times=(0.0, 1.0, 4.0), values=(0.0, 0.2, 0.2)), window=(3.0, 4.0)
)
PUSHED = task(mode="torque", duration=0.5, command=Polyline(times=(0.0, 0.5), values=(9.0, 9.0)))


def sampled(tree: Tree) -> None:
    tree["controller"] |= {"sample_rate": "1 kHz", "delay": "0.5 ms"}


def nothing(tree: Tree) -> None:
    """A continuous controller, as the bench has it."""


def pair(controller: Callable[[Tree], None] = nothing) -> tuple[Bench, Bench]:
    """What is stated, without friction, and a truth that is 20 % and 5 % away from it."""

    def stated(tree: Tree) -> None:
        controller(tree)
        tree["friction"] = {}

    def true(tree: Tree) -> None:
        controller(tree)
        tree["friction"] = {"load": stribeck(20.0, 15.0, 3.0)}
        tree["axis"]["inertia"] = "28 kg m^2"
        tree["motor"]["torque_constant"] = "0.0903 N m/A"

    return bench(stated), bench(true)


def execute(stated: Bench, truth: Bench | None, what: Task) -> Recording:
    plant = None if truth is None else plant_of(truth)
    trial = Trial(
        number=1,
        test="t",
        kind="move",
        seed=3,
        bench=stated.model_dump(mode="json"),
        task=what,
        truth="" if plant is None else digest(plant),
    )
    backend, recorder = SimBackend(SimOptions()), MemoryRecorder()
    if plant is not None:
        backend.simulate_instead({trial.truth: plant})
    assert backend.refuses(trial) is None
    recording = recorder.recording(backend.execute(trial, recorder, lambda: False))
    assert frozenset(recording.channels) == backend.channels(trial)
    return recording


@pytest.mark.parametrize("controller", [nothing, sampled])
def test_steady_sliding_shows_the_true_friction_by_the_stated_torque_constant(controller) -> None:
    stated, truth = pair(controller)
    window = execute(stated, truth, STEADY).window(3.5, 4.0)
    friction = 15.0 + 5.0 * np.exp(-((0.2 / 0.03) ** 2)) + 3.0 * 0.2
    assert np.mean(window[MOTOR_CURRENT]) == pytest.approx(friction / (RATIO * 0.0903), rel=1e-4)
    assert np.mean(window[DRIVE_TORQUE]) == pytest.approx(friction * KT / 0.0903, rel=1e-4)


@pytest.mark.parametrize("controller", [nothing, sampled])
def test_a_torque_command_is_a_current_by_the_stated_constant(controller) -> None:
    """The true inertia is accelerated by 0.0903 / 0.086 of what was commanded.

    Less what back-EMF, which rises with the rate, leaves of error to the integral of the current
    loop: Ke N a / Kic amperes.
    """
    stated, truth = pair(controller)
    free = truth.with_friction({})
    rate = execute(stated, free, PUSHED)
    slope = np.polyfit(rate.time[200:], rate[GYRO_RATE][200:], 1)[0]
    lost = RATIO**2 * 0.0903 * KE / stated.controller.current.integral_gain
    assert slope == pytest.approx(9.0 * (0.0903 / KT) / (28.0 + lost), rel=1e-4)


def test_the_observer_reckons_with_the_stated_bench() -> None:
    """In steady sliding it has the whole friction, in newton metres of the stated Kt."""
    stated, truth = pair()
    what = STEADY.model_copy(update={"compensation": "observer"})
    torque = execute(stated, truth, what).window(3.5, 4.0)["compensation_torque"]
    friction = 15.0 + 5.0 * np.exp(-((0.2 / 0.03) ** 2)) + 3.0 * 0.2
    assert np.mean(torque) == pytest.approx(friction * KT / 0.0903, rel=1e-4)


def test_the_observer_is_built_for_the_stated_inertia() -> None:
    stated, truth = pair()
    what = STEADY.model_copy(update={"compensation": "observer"})
    block = Lane.of(truth, what, seed=1, stated=stated).compensator.linear
    assert block.b[0, 1] == pytest.approx(1.0 / INERTIA)


def test_a_truth_that_is_the_stated_bench_changes_no_sample() -> None:
    whole = bench()
    was, now = execute(whole, None, STEADY), execute(whole, whole, STEADY)
    assert {FRICTION_TORQUE, LOAD_RATE} == was.channels.keys() - now.channels.keys()
    for name in now.channels:
        assert now[name].tobytes() == was[name].tobytes()


def test_controller_compensation_and_limits_are_the_stated_ones() -> None:
    def other(tree: Tree) -> None:
        tree["controller"]["rate"]["proportional"] = "1 A s/deg"
        tree["limits"]["rate"] = "1 deg/s"
        del tree["compensation"]

    stated = bench()
    both = simulated(plant_of(bench(other)), stated)
    # What is known is said of the stated one.
    assert both == complete(stated.model_copy(update={"known": both.known}))


def test_teeth_are_counted() -> None:
    def coarse(tree: Tree) -> None:
        tree["gear"]["ratio"] = 100.0

    with pytest.raises(ValueError, match="gear ratio"):
        simulated(plant_of(bench(coarse)), bench())


def test_what_is_turned_at_the_rig_is_turned_at_the_truth() -> None:
    before = bench().model_dump(mode="json")
    after = {**before, "axis": {**before["axis"], "inertia": 40.0}}
    after["compensation"] = {}
    after["name"] = "another"
    turned = settings(before, after)
    assert turned == {("axis", "inertia"): 40.0}
    plant = plant_of(bench())
    assert with_settings(plant, turned)["axis"] == {**plant["axis"], "inertia": 40.0}
    assert plant["axis"]["inertia"] == INERTIA


def test_a_path_that_the_truth_lacks_is_refused() -> None:
    plant = plant_of(bench())
    assert has(plant, ("friction", "load", "coulomb_torque"))
    assert not has(plant, ("friction", "mesh", "coulomb_torque"))
    assert not has(plant, ("gear", "preload", "torque"))  # there is none
    with pytest.raises(ValueError, match=r"no 'gear\.preload\.torque'"):
        with_settings(plant, {("gear", "preload", "torque"): 30.0})
