"""A run by hand: a rig in another language plays what is handed out, and once each time wrongly."""

from __future__ import annotations

import csv
import json
import math
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from campaign.archive.reading.open_run import open_run
from tests.forks import Begun
from tests.system.user import Process, campaign, command, environment, forks, write

AWK = shutil.which("awk")
RIG = Path(__file__).with_name("rig.awk")
COULOMB, VISCOUS = 6.0, 4.0
"""N m and N m s/rad: the rig's own, as `rig.awk` has them."""
WAITING = 600.0
"""s after which a test gives up."""

PROTOCOL = """\
title = "By hand"

[[test]]
name = "map"
kind = "velocity_map"
bench = "platform"
seed = 5
speeds = ["3 deg/s", "5 deg/s", "10 deg/s", "20 deg/s"]
max_travel = "20 deg"
max_time = "3 s"
warm_up_cycles = 0
sample_rate = "200 Hz"

[[test.operator]]
text = "Fit the long arm"

[faults]
recording = { do = "retry", times = 2 }

[columns.rig.time]
column = "t"
unit = "ms"
[columns.rig.command]
column = "Sollwert"
unit = "deg/s"
[columns.rig.relative_angle]
column = "Winkel"
[columns.rig.relative_rate]
column = "Drehzahl"
[columns.rig.drive_torque]
column = "Strom"
times = "3 N m/A"
"""
BY_HAND = ("--backend", "files", "--handover", "out")
AT_ONCE = ("--set", 'backend.wait="0 s"')

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(AWK is None, reason="no awk, in which the rig is written"),
]


def play(attempt: Path, fault: str = "") -> None:
    """What a person does: brings the axis to its place, plays the excitation, hands in."""
    told = json.loads((attempt / "manifest.json").read_text(encoding="utf-8"))["task"]
    settings = (f"fault={fault}", f"mode={told['mode']}", f"start={told['start_angle']}")
    returned = attempt / "returned"
    with (returned / "log 1.csv").open("wb") as file:
        chosen = [part for setting in settings for part in ("-v", setting)]
        subprocess.run(
            [str(AWK), *chosen, "-f", str(RIG), str(attempt / "excitation.csv")],
            stdout=file,
            check=True,
        )
    (returned / "done").touch()


def waited_for(path: Path, run: Process) -> Path:
    end = time.monotonic() + WAITING
    while not path.exists():
        assert run.poll() is None, run.communicate()
        assert time.monotonic() < end, path
        time.sleep(0.02)
    return path


@pytest.fixture
def run(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """A run that waits for recordings, in the folder of the test."""
    write(tmp_path, PROTOCOL)
    process = subprocess.Popen(
        command("run", "protocol.toml", *BY_HAND, "--report"),
        cwd=tmp_path,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        stdin=subprocess.DEVNULL,
        text=True,
    )
    yield process
    if process.poll() is None:
        process.kill()
    process.communicate()


def test_a_rig_of_its_own_from_protocol_to_report(
    tmp_path: Path, run: subprocess.Popen[str]
) -> None:
    wrong = {1: "sign", 2: "half", 3: "clip", 4: "late"}
    for number, fault in wrong.items():
        trial = tmp_path / "out" / f"trial-{number:05d}"
        play(waited_for(trial, run), fault)
        play(waited_for(trial / "attempt-2", run))
    out, err = run.communicate(timeout=WAITING)
    assert run.returncode == 0, err

    archive = open_run(tmp_path / out.splitlines()[-1])
    assert archive.header.source == "hardware"
    assert [trial.ending.outcome.value for trial in archive.trials] == ["completed"] * 4
    refused = [
        json.loads((tmp_path / "out" / f"trial-{number:05d}" / "verdict.json").read_text("utf-8"))
        for number in wrong
    ]
    names = [verdict["refused"].partition(":")[0] for verdict in refused]
    assert names == ["wrong sign", "too short", "clipped", "late"]
    for name in names:
        assert f"fault: {name}: " in err
    assert "described on the page of the trial" in archive.journal

    # What was found is the friction that the rig has.
    with next(tmp_path.glob("results/*-report/tables/map-map.csv")).open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8
    for row in rows:
        speed = math.radians(float(row["speed_deg_per_s"]))
        true = math.copysign(COULOMB, speed) + VISCOUS * speed
        assert float(row["torque_N_m"]) == pytest.approx(true, abs=0.02)


def test_a_run_that_does_not_wait_is_resumed(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL)
    done = campaign(tmp_path, "run", "protocol.toml", *BY_HAND, *AT_ONCE, code=130)
    assert "nothing is back yet in trial-00001/returned" in done.err
    assert "NOT CONFIRMED" not in done.err
    assert str(tmp_path / "out" / "index.html") in done.err.replace("\n", "")
    name = Path(done.last_line).stem

    play(tmp_path / "out" / "trial-00001")
    play(tmp_path / "out" / "trial-00002", "rate")
    done = campaign(tmp_path, "resume", name, code=130)
    assert "another rate: it was recorded at 100 Hz instead of 200 Hz" in done.err
    assert "nothing is back yet in trial-00002/attempt-2/returned" in done.err

    for attempt in ("trial-00002/attempt-2", "trial-00003", "trial-00004"):
        play(tmp_path / "out" / attempt)
    done = campaign(tmp_path, "resume", name)
    assert "complete: 4 trials done" in done.err
    first = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert first.count("taken") == 4 + 1  # and in what to do

    # Another run does not find the folder its own.
    done = campaign(tmp_path, "run", "protocol.toml", *BY_HAND, *AT_ONCE, code=2)
    assert f"is the hand-over of {name}" in done.err


def test_a_refused_recording_is_not_asked_for_again_unless_the_protocol_says_so(
    tmp_path: Path,
) -> None:
    write(tmp_path, PROTOCOL.replace("[faults]\nrecording", "[faults]\nsensor"))
    done = campaign(tmp_path, "run", "protocol.toml", *BY_HAND, *AT_ONCE, code=130)
    for number, fault in ((1, "sign"), (2, ""), (3, ""), (4, "")):
        play(tmp_path / "out" / f"trial-{number:05d}", fault)
    done = campaign(tmp_path, "resume", Path(done.last_line).stem, code=3)
    assert "3 trials done, 1 fault" in done.err


def test_a_plan_says_what_no_rig_can_do_and_writes_nothing(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL)
    done = campaign(tmp_path, "plan", "protocol.toml", *BY_HAND)
    assert "4" in done.out
    assert not (tmp_path / "out").exists()
    write(tmp_path, PROTOCOL.replace("[columns.rig.drive_torque]\n", "[columns.rig.motor_angle]\n"))
    done = campaign(tmp_path, "plan", "protocol.toml", *BY_HAND, code=2)
    assert "drive_torque" in done.err
    done = campaign(tmp_path, "run", "protocol.toml", "--backend", "files", code=2)
    assert "--handover" in done.err or "drive_torque" in done.err


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_the_wait_and_the_run_goes_on_later(tmp_path: Path) -> None:
    write(tmp_path, PROTOCOL)
    process = Begun(forks(), tmp_path, "run", "protocol.toml", *BY_HAND, environment=environment())
    waited_for(tmp_path / "out" / "trial-00004" / "manifest.json", process)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=WAITING)
    assert process.returncode == 130, err
    assert "interrupted (stopped by Ctrl-C)" in err
    for number in range(1, 5):
        play(tmp_path / "out" / f"trial-{number:05d}")
    campaign(tmp_path, "resume", Path(out.splitlines()[-1]).stem)
