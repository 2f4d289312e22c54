"""A multisine below breakaway by hand: a plant of its own plays it, and its numbers are found."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from campaign.archive.reading.open_run import open_run
from tests.estimation.bristle_plants import Interface, Truth
from tests.system.user import campaign, write

PLANT = Truth(2.0, 1.0, (Interface(5000.0, 60.0, 8.0, 6.0, 0.01),))
"""2 kg m^2, held by 5000 N m/rad and 60 + 1 N m s/rad."""
BENCH = """\
schema = 3
name = "tilt"

[axis]
name = "tilt"

[limits]
angle = "60 deg"
rate = "30 deg/s"
acceleration = "1500 deg/s^2"
torque = "20 N m"
current = "7 A"
duration = "1 min"

[friction.load]
model = "lugre"
viscous_friction = "1 N m s/rad"
coulomb_torque = "5 N m"
static_torque = "6 N m"
stribeck_velocity = "1 deg/s"
bristle_stiffness = "1000 N m/rad"
"""
PROTOCOL = """\
title = "Shaken by hand"

[[test]]
name = "shaken"
kind = "presliding_multisine"
bench = "./tilt.toml"
seed = 5
amplitudes = ["0.5 N m", "1 N m"]
lowest = "0.5 Hz"
highest = "40 Hz"
periods = 4
sample_rate = "500 Hz"

[columns.rig.time]
column = "t"
unit = "ms"
[columns.rig.command]
column = "asked"
unit = "N m"
[columns.rig.gyro_rate]
column = "gyro"
unit = "mrad/s"
[columns.rig.drive_torque]
column = "current"
unit = "A"
times = "3 N m/A"
"""

pytestmark = pytest.mark.slow


def play(attempt: Path, rng: np.random.Generator) -> None:
    """What a rig does with the excitation, in the units of its own logger."""
    told = json.loads((attempt / "manifest.json").read_text(encoding="utf-8"))["task"]
    assert told["mode"] == "torque"
    table = np.genfromtxt(attempt / "excitation.csv", delimiter=",", skip_header=1)
    time, asked = table[:, 0], table[:, 1]
    _, rate = PLANT.answer(CubicSpline(time, asked), time)
    count = len(time)
    rows = [
        1000.0 * time,
        asked,
        1000.0 * (rate + 1e-5 * rng.standard_normal(count)),
        (asked + 3e-3 * rng.standard_normal(count)) / 3.0,
    ]
    returned = attempt / "returned"
    np.savetxt(
        returned / "log.csv",
        np.column_stack(rows),
        delimiter=",",
        header="t,asked,gyro,current",
        comments="",
        fmt="%.9g",
    )
    (returned / "done").touch()


def test_a_multisine_is_handed_out_handed_in_and_identified(tmp_path: Path) -> None:
    write(tmp_path, BENCH, "tilt.toml")
    write(tmp_path, PROTOCOL)
    by_hand = ("--backend", "files", "--handover", "out", "--set", 'backend.wait="0 s"')
    done = campaign(tmp_path, "run", "protocol.toml", *by_hand, code=130)
    name = Path(done.last_line).stem
    rng = np.random.default_rng(3)
    for number in (1, 2):
        play(tmp_path / "out" / f"trial-{number:05d}", rng)
    done = campaign(tmp_path, "resume", name)
    assert "complete: 2 trials done" in done.err
    archive = open_run(tmp_path / "results" / f"{name}.nxs")
    assert archive.header.source == "hardware"

    words = ("--model", "presliding", "--output", "found.toml")
    page = tmp_path / campaign(tmp_path, "identify", name, *words).last_line
    text = page.with_suffix(".json").read_text(encoding="utf-8")
    (own,) = json.loads(text)["content"]["methods"]
    assert not own["problem"]
    told = {each["quantity"]: each for each in own["parameters"]}
    for number, true in (
        ("stiffness_at_rest", 5000.0),
        ("bristle_damping", 60.0),
        ("inertia", 2.0),
    ):
        low, high = told[number]["low"], told[number]["high"]
        assert low <= true <= high, told[number]
        assert high - low < 0.1 * true

    found = tomllib.loads((tmp_path / "found.toml").read_text(encoding="utf-8"))
    assert "inertia" in found["axis"]
    assert "bristle_damping" in found["friction"]["load"]
