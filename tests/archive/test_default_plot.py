"""A run opens in a viewer on its most telling trial and channel, and on one axis."""

from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray
from nexusformat.nexus import nxload

from campaign.archive.layout.header import PlannedTrial
from campaign.archive.layout.run_status import RunStatus
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.default_plot import leading_trial
from campaign.archive.writing.writer import RunWriter
from campaign.backends.sim import CHANNELS
from campaign.recording import Ending, Outcome
from campaign.signals import Sine
from campaign.trial import Role, Task, Trial

SHAKEN = Sine(amplitude=0.3, frequency=0.24)
TORQUES = {"friction_torque", "compensation_torque", "drive_torque"}


def trial(kit, number: int, mode: str = "rate", shaken: bool = False, **more: object) -> Trial:
    motion = {"base_acceleration": SHAKEN} if shaken else {}
    task = Task(mode=mode, duration=1.0, window=(0.0, 1.0), sample_rate=100.0, **motion)
    return kit.trial(number).model_copy(update={"task": task, **more})


def sealed(kit, results: Path, trials: list[Trial], outcomes: dict[int, Outcome] | None = None):
    writer = RunWriter.create(results, kit.header(trials=len(trials)), trials)
    for each in trials:
        samples = np.arange(9) / 100, np.ones((len(CHANNELS), 9)) * each.number
        outcome = (outcomes or {}).get(each.number, Outcome.COMPLETED)
        kit.recorded(writer, each, samples, CHANNELS, ending=Ending(outcome))
    return writer.seal(RunStatus.COMPLETE, ended="2026-11-21T09:40:00Z")


def opened(path: Path) -> tuple[str, str, set[str]]:
    """Trial, signal and what is on its axis, as the chain of defaults leads there."""
    with h5py.File(path) as file:
        entry = file[file.attrs["default"]]
        data = entry[entry.attrs["default"]]
        return (
            entry.name.lstrip("/"),
            str(data.attrs["signal"]),
            {str(name) for name in data.attrs.get("auxiliary_signals", ())},
        )


def planned(*facts: tuple[str, Role]) -> list[PlannedTrial]:
    return [
        PlannedTrial(number=n, test=test, kind="k", role=role, label="l", fingerprint="")
        for n, (test, role) in enumerate(facts, start=1)
    ]


M, W, C = Role.MEASUREMENT, Role.WARM_UP, Role.CHECK


@pytest.mark.parametrize(
    ("plan", "completed", "expected"),
    [
        ([("map", M)] * 5, {1, 2, 3, 4, 5}, 3),  # neither the slowest nor the fastest
        ([("map", M)] * 4, {1, 2, 3, 4}, 2),
        ([("map", W), ("map", C), ("map", M)], {1, 2, 3}, 3),
        ([("map", M)] * 5, {1, 4, 5}, 4),  # the others failed
        ([("a", W), ("b", M), ("b", M), ("b", M)], {1, 2, 3, 4}, 3),  # the first test with any
        ([("a", M), ("b", M), ("b", M), ("b", M)], {1, 2, 3, 4}, 1),
        ([("a", M), ("a", C)], {2}, 1),  # no measurement completed: the first with samples
    ],
)
def test_the_middle_completed_measurement_of_the_first_test(plan, completed, expected):
    trials = planned(*plan)
    assert leading_trial(trials, completed, [each.number for each in trials]) == expected


def test_a_trial_without_samples_is_never_opened():
    trials = planned(("a", M), ("a", M), ("a", M))
    assert leading_trial(trials, {1, 2, 3}, [3]) == 3
    assert leading_trial(trials, {1, 2, 3}, []) is None


@pytest.mark.parametrize(
    ("facts", "signal", "others"),
    [
        ({"shaken": True}, "pointing_error", set()),  # of the angles none is shown in mrad
        ({"requires": ("drive_torque", "gyro_rate")}, "drive_torque", TORQUES - {"drive_torque"}),
        ({"requires": ("gyro_rate",)}, "gyro_rate", None),
        ({"mode": "torque", "requires": ("drive_torque",)}, "relative_rate", None),
        ({"mode": "prescribed"}, "friction_torque", TORQUES - {"friction_torque"}),
    ],
)
def test_one_channel_and_what_has_its_unit(tmp_path, kit, facts, signal, others):
    path = sealed(kit, tmp_path, [trial(kit, 1, **facts)])
    _, shown, beside = opened(path)
    assert shown == signal
    units = {c.name: (c.unit, c.display_unit) for c in CHANNELS}
    assert all(units[name] == units[signal] for name in beside)
    if others is not None:
        assert beside == others & set(units)
    assert [p for p in verify_run(path).problems if "/data" in p.place] == []


def test_every_channel_has_the_time_in_xarray_and_the_default_in_nexusformat(tmp_path, kit):
    path = sealed(kit, tmp_path, [trial(kit, 1, shaken=True)])
    with xarray.open_dataset(path, engine="h5netcdf", group="/trial_00001/data") as data:
        assert all(data[channel.name].dims == ("time",) for channel in CHANNELS)
    with h5py.File(path) as file:
        group = file["trial_00001/data"]
        assert all(group[channel.name].dims[0][0] == group["time"] for channel in CHANNELS)
    found = nxload(path).get_default()
    assert (found.nxpath, found.nxsignal.nxname) == ("/trial_00001/data", "pointing_error")


@pytest.mark.parametrize(("signal", "good"), [("gyro_rate", True), ("motor_current", False)])
def test_runs_that_the_mode_alone_decided_about_still_verify(tmp_path, kit, signal, good):
    """Runs archived before open on the gyro's rate; on no other channel did any ever open."""
    path = sealed(kit, tmp_path, [trial(kit, 1, shaken=True)])
    with h5py.File(path, "r+") as file:
        file["trial_00001/data"].attrs["signal"] = signal
    told = [str(problem) for problem in verify_run(path).problems]
    assert any("channel to plot first" in line for line in told) is not good
