"""A rig of which a name, an axis and limits are known: every command tells what it lacks, or works.

The controller at the other end of the line has gains, motor and friction of its own.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from campaign.physics.complete import PURPOSES
from tests.link.controllers import controller
from tests.system.user import campaign

RIG = """\
name = "rig"
description = "what its laboratory knows of it"

[axis]
name = "azimuth"
"""
LIMITS = """
[limits]
angle = "45 deg"
rate = "30 deg/s"
acceleration = "360 deg/s^2"
torque = "200 N m"
current = "20 A"
duration = "5 min"
"""
PROTOCOL = """\
title = "A rig of which little is known"
published = "none"

[[test]]
name = "there"
kind = "move"
bench = "rig.toml"
angle = "5 deg"

[[test]]
name = "ramps"
kind = "breakaway"
bench = "rig.toml"
positions = ["0 deg"]
directions = ["positive"]
torque_rate = "20 N m/s"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    found = tmp_path_factory.mktemp("facts")
    (found / "bare.toml").write_text(RIG, encoding="utf-8")
    (found / "rig.toml").write_text(RIG + LIMITS, encoding="utf-8")
    (found / "p.toml").write_text(PROTOCOL, encoding="utf-8")
    return found


@pytest.fixture(scope="module")
def archive(folder: Path) -> Path:
    with controller("--speed", "max") as port:
        line = ("--backend", "serial", "--port", port, "--yes")
        done = campaign(folder, "run", "p.toml", *line)
    assert "its torque and current cannot be predicted" in done.err
    assert "the margins of its loops are not known" in done.err
    return folder / done.last_line


def test_a_simulation_is_refused_with_all_that_is_missing(folder: Path) -> None:
    for command in (("plan", "p.toml"), ("run", "p.toml")):
        told = campaign(folder, *command, code=2).err
        (line,) = [line for line in told.splitlines() if line.startswith("rig.toml:1:1: ")]
        assert all(f"{path} (" in line for path in PURPOSES if path != "limits")
        assert "limits (" not in line
    assert not (folder / "results").exists() or not list((folder / "results").glob("*.partial"))


CALIBRATION = """\
[[test]]
name = "sea"
kind = "stabilization"
bench = "rig.toml"
reproduces = ["5.2"]

[calibration]
bench = "rig.toml"
cells = ["5.2"]

[[calibration.parameter]]
name = "angle"
path = "limits.angle"
lower = "40 deg"
upper = "50 deg"
"""


def test_so_is_whatever_else_simulates(folder: Path) -> None:
    (folder / "fit.toml").write_text(CALIBRATION, encoding="utf-8")
    for command in (("calibrate", "fit.toml"), ("plan", "p.toml", "--truth", "simulink")):
        told = campaign(folder, *command, code=2).err
        (line,) = [line for line in told.splitlines() if line.startswith("rig.toml:1:1: ")]
        assert all(f"{path} (" in line for path in PURPOSES if path != "limits")


def test_a_bench_of_facts_is_checked_as_far_as_it_goes(folder: Path) -> None:
    told = campaign(folder, "check", "bare.toml")
    assert "no loops and no Bode picture: the bench does not say axis.inertia" in told.out
    assert not (folder / "bare-check.svg").exists()
    tree = json.loads(campaign(folder, "check", "rig.toml", "--json").out)
    assert tree["lacking"] == [path for path in PURPOSES if path != "limits"]
    assert tree["loops"] == []


def test_other_commands_take_it_or_say_what_they_miss(folder: Path) -> None:
    written = folder / "stated.toml"
    written.write_text(RIG, encoding="utf-8")
    campaign(folder, "fingerprint", "stated.toml")
    assert "fingerprint" in written.read_text(encoding="utf-8")
    told = campaign(folder, "init", "new", "--bench", "bare.toml", code=2).err
    assert "no velocity-map test suits it" in told
    assert "limits" in told
    assert not (folder / "new").exists()
    # Limits are all that it takes; what can be executed is by hand, and says so.
    done = campaign(folder, "init", "new", "--bench", "rig.toml")
    assert "campaign plan new/identify.toml --backend files --handover out" in done.out
    plan = ("plan", "new/identify.toml", "--backend", "files", "--handover", "out", "--details")
    told = campaign(folder, *plan)
    assert "the rate loop is not described" in told.out
    assert "its ramps give no breakaway torque" in told.err
    told = campaign(folder, "device", "--bench", "rig.toml", code=2).err
    assert all(path in told for path in PURPOSES if path != "limits")


@pytest.mark.slow
def test_what_was_recorded_is_archived_analysed_and_shown(folder: Path, archive: Path) -> None:
    run = open_run(archive)
    assert [trial.ending.outcome for trial in run.trials] == ["completed", "completed"]
    assert run.trials[0].trial.bench["motor"] is None
    campaign(folder, "verify", str(archive))
    campaign(folder, "report", str(archive), "--output", "page", "--trials", "all", code=6)
    page = (folder / "page" / "report.html").read_text(encoding="utf-8")
    assert "not analysed (1 of 1 trials)" in page
    assert "axis.inertia (what the torque accelerates)" in page
    assert "analysis failed" not in page
    trial = next((folder / "page" / "trials").glob("*.html")).read_text(encoding="utf-8")
    assert "motor:" not in trial
    assert "None" not in trial.split("</style>")[-1]


def test_it_is_replayed_and_not_simulated_again(folder: Path, archive: Path) -> None:
    campaign(folder, "run", "p.toml", "--backend", "replay", "--from", str(archive))
    told = campaign(folder, "rerun", archive.stem, "1", code=2).err
    assert all(path in told for path in PURPOSES if path != "limits")
