"""A ramp that another program recorded, one signal per file: what is stated of it, and what not."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from campaign.archive.reading.open_run import open_run
from campaign.cli.import_command import import_recordings
from campaign.cli.run_options import RunOptions
from campaign.errors import ExitCode

MAPPING = """\
published = "none"
[columns.rig.time]
column = "t"
unit = "s"
[columns.rig.relative_angle]
column = "value"
unit = "rad"
file = 1
[columns.rig.drive_torque]
column = "value"
unit = "N m"
file = 2
[columns.rig.gyro_rate]
derive = "relative_angle"
[[test]]
name = "ramp"
kind = "breakaway"
bench = "platform"
fit_share = 0.7
[[test.recording]]
file = ["pos.t", "tau.t"]
"""
SLOPE, SLIDES = 2.0, 4.0  # N m/s, N m


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ramp of 2 N m/s from 0.5 s on, on a spring of 5 kN m/rad that slides at 4 N m."""
    folder = tmp_path_factory.mktemp("ramp")
    time = np.arange(0, 3.5, 1e-3)
    torque = np.clip(SLOPE * (time - 0.5), 0.0, None)
    beyond = np.clip(torque - SLIDES, 0.0, None)
    angle = np.minimum(torque, SLIDES) / 5000 + np.cumsum(0.05 * beyond) * 1e-3
    for name, values in (("pos.t", angle), ("tau.t", torque)):
        rows = [f"{t:.3f}\t{value:.9g}" for t, value in zip(time, values, strict=True)]
        (folder / name).write_text("\n".join(["t\tvalue", *rows]))
    (folder / "m.toml").write_text(MAPPING)
    done = import_recordings([str(folder / "m.toml")], folder / "results", RunOptions(report=True))
    assert done is ExitCode.DONE
    return folder / "results"


def test_one_signal_per_file_is_told_by_the_number_of_the_file(folder: Path):
    """Both columns have one name: `file` says which of the list it is in."""
    (archive,) = (each for each in folder.glob("*.nxs") if "results" not in each.name)
    recording = open_run(archive).trials[0].recording()
    k = int(np.searchsorted(recording.time, 1.4995))
    assert recording["drive_torque"][k] == pytest.approx(2.0)
    np.testing.assert_allclose(recording["relative_angle"][k], 2.0 / 5000, rtol=1e-6)


def test_options_that_were_never_executed_are_not_stated(folder: Path):
    """What the mapping writes and what the recording shows; no default of a ramp of our own."""
    (archive,) = (each for each in folder.glob("*.nxs") if "results" not in each.name)
    run = open_run(archive)
    options = run.trials[0].trial.options
    assert options == {
        "fit_share": 0.7,
        "rest": pytest.approx(0.5, abs=0.01),
        "sliding_rate": 0.005,
        "torque_rate": pytest.approx(SLOPE),
    }
    (report,) = folder.glob("*-report/report.json")
    (told,) = json.loads(report.read_text("utf-8"))["tests"]
    assert set(told["options"]) == {"fit_share", "sliding_rate"}
    page = re.sub("<[^>]+>", " ", report.with_suffix(".html").read_text("utf-8"))
    assert "fit share" in page
    assert "peak torque" not in page
