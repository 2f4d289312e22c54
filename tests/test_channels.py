"""The vocabulary of channels, and channels that have a rate of their own."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.archive.verification.verify_run import verify_run
from campaign.archive.writing.trial_file import TrialFile
from campaign.axis_kind import BOTH_ROTARY
from campaign.backends import sim
from campaign.backends.replay import BACKEND as REPLAY
from campaign.backends.replay import ReplayOptions
from campaign.channels import VOCABULARY, AxisKind, KnownBy, Side, explained, info, missing
from campaign.errors import BackendError
from campaign.recording import ChannelInfo, Ending, MemoryRecorder, Outcome, Recording
from campaign.units import factor
from tests.archives import archived, plan_of

RECORDED = {
    "base_rate": ("rad/s", "Rate of the hull", "deg/s", True),
    "gyro_rate": ("rad/s", "Rate of the load (gyro)", "deg/s", True),
    "relative_rate": ("rad/s", "Rate of the load relative to the hull", "deg/s", True),
    "relative_angle": ("rad", "Angle of the load relative to the hull", "deg", True),
    "motor_current": ("A", "Motor current", "A", True),
    "drive_torque": ("N m", "Drive torque at the load", "N m", True),
    "pointing_error": ("rad", "Integrated gyro rate", "mrad", True),
    "compensation_torque": ("N m", "Compensation torque", "N m", True),
    "friction_torque": ("N m", "True friction torque", "N m", False),
    "load_rate": ("rad/s", "True rate of the load", "deg/s", False),
}
"""What archives of the first release say of each channel, in their order, after the command."""

COMMANDED = {
    "rate": ("rad/s", "Commanded rate", "deg/s", True),
    "torque": ("N m", "Commanded torque", "N m", True),
    "prescribed": ("rad/s", "Prescribed relative rate", "deg/s", True),
    "spring": ("rad", "Angle of the spring's far end", "deg", True),
}


def test_the_simulated_bench_announces_what_its_archives_have_always_said() -> None:
    known = [(c.name, (c.unit, c.label, c.display_unit, c.measured)) for c in sim.CHANNELS[1:]]
    assert known == list(RECORDED.items())
    for mode, expected in COMMANDED.items():
        (c,) = sim.announced(["command"], mode, BOTH_ROTARY)
        assert (c.name, c.unit, c.label, c.display_unit, c.measured) == ("command", *expected)
    assert not any(channel.own_rate for channel in sim.CHANNELS)


def test_a_linear_axis_has_the_same_names_in_other_units() -> None:
    expected = {
        "relative_angle": ("m", "mm", "Position of the load relative to the hull"),
        "pointing_error": ("m", "um", "Integrated inertial rate"),
        "gyro_rate": ("m/s", "mm/s", "Rate of the load (inertial)"),
        "drive_torque": ("N", "N", "Drive force at the load"),
        "motor_current": ("A", "A", "Motor current"),
        "normal_load": ("N", "N", "Normal load"),
        "temperature": ("degC", "degC", "Temperature"),
    }
    for name, told in expected.items():
        found = info(name, axis=AxisKind.LINEAR)
        assert (found.unit, found.display_unit, found.label) == told
    force = info("command", "torque", axis=AxisKind.LINEAR)
    assert (force.unit, force.label) == ("N", "Commanded force")


@pytest.mark.parametrize("axis", AxisKind)
@pytest.mark.parametrize("name", sorted(VOCABULARY.keys() - {"command"}))
def test_every_name_can_be_archived_and_shown(name: str, axis: AxisKind) -> None:
    found, what = info(name, axis=axis), VOCABULARY[name]
    assert name == what.name == found.name
    assert found.unit == found.display_unit or factor(found.display_unit, found.unit) > 0
    assert what.meaning.endswith(".")
    assert found.measured is (what.known_by is not KnownBy.SIMULATOR)
    assert (what.side is Side.MOTOR) is name.startswith("motor_")


def test_what_is_missing_keeps_its_order_and_is_explained() -> None:
    assert missing(("load_rate", "command", "base_rate"), {"command"}) == ("load_rate", "base_rate")
    assert explained("base_rate") == "base_rate (rate of the hull in space, about the axis)"
    assert explained("vibration") == "vibration"
    with pytest.raises(KeyError):
        info("vibration")


SLOW = info("temperature", own_rate=10.0)
FAST = info("gyro_rate")


def recording() -> Recording:
    """A second at 100 Hz with a temperature that is held for ten samples each."""
    time = np.arange(100) / 100.0
    channels = {
        "gyro_rate": FAST.with_samples(np.sin(time)),
        "temperature": SLOW.with_samples(np.repeat(np.linspace(20.0, 21.0, 10), 10)),
    }
    return Recording(time, channels, (), Ending(Outcome.COMPLETED))


def test_only_a_channel_with_a_rate_of_its_own_says_so_in_an_archive(tmp_path: Path) -> None:
    trial = plan_of(tmp_path).trials[0]
    path = archived(tmp_path / "results", [(trial, recording())])
    with h5py.File(path) as file:
        record = json.loads(file["trial_00001/record/json"][()])
    fast, slow = record["channels"]
    about = {"display_unit": "deg/s", "label": "Rate of the load (gyro)", "unit": "rad/s"}
    assert fast == about | {"name": "gyro_rate", "sha256": fast["sha256"]}
    about = {"display_unit": "degC", "label": "Temperature", "unit": "degC", "own_rate": 10.0}
    assert slow == about | {"name": "temperature", "sha256": slow["sha256"]}
    assert verify_run(path).sound
    (item,) = open_run(path).trials
    assert item.channels() == (FAST, SLOW)
    assert item.channel_names() == {"gyro_rate", "temperature"}
    read = item.recording()
    assert [c.info for c in read.channels.values()] == [FAST, SLOW]
    assert read.window(0.2, 0.5).channels["temperature"].info == SLOW
    served = MemoryRecorder()
    ending = REPLAY.open(ReplayOptions(run=str(path))).execute(trial, served, lambda: False)
    assert served.recording(ending).channels["temperature"].info == SLOW


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_of_its_own_is_a_rate(tmp_path: Path, rate: float) -> None:
    trial = plan_of(tmp_path).trials[0]
    file = TrialFile(tmp_path, trial)
    with pytest.raises(BackendError, match="temperature: its own rate"):
        file.start((FAST, info("temperature", own_rate=rate)))
    file.discard()


def test_a_name_of_a_plug_in_is_archived_and_nothing_more(tmp_path: Path) -> None:
    trial = plan_of(tmp_path).trials[0]
    own = ChannelInfo("vibration", "m/s^2", "Vibration", "m/s^2")
    told = Recording(np.zeros(1), {"vibration": own.with_samples(np.ones(1))})
    (item,) = open_run(archived(tmp_path / "results", [(trial, told)])).trials
    assert item.channels() == (own,)
