"""What only a connected controller can say that it does not do: refused before anything moves."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from campaign.device.session import LONGEST_ARRAY
from campaign.errors import ExitCode
from tests.link.controllers import controller
from tests.system.user import campaign, write

PROTOCOL = """\
title = "A short sweep, then noise of more points than the controller takes"

[[test]]
name = "first"
kind = "excitation"
bench = "platform"
signal = "chirp"
lowest = "2 Hz"
highest = "10 Hz"
duration = "1 s"

[[test]]
name = "later"
kind = "excitation"
bench = "platform"
signal = "noise"
realisations = 2
highest = "100 Hz"
duration = "{duration:g} s"
"""
RATE = 1000
"""Hz: points of that noise per second."""


def run(folder: Path, duration: float, *, code: ExitCode) -> tuple[str, list[str]]:
    """What the run said, and the events of the controller in their order."""
    write(folder, PROTOCOL.format(duration=duration))
    log = folder / "device.log"
    log.touch()
    with controller("--speed", "max", "--log", str(log)) as port:
        line = ("--backend", "serial", "--port", port)
        done = campaign(folder, "run", "protocol.toml", *line, "--yes", code=code)
    lines = log.read_text(encoding="utf-8").splitlines()
    return done.err, [json.loads(line)["event"] for line in lines]


def test_a_command_longer_than_the_controller_takes_is_refused_before_the_first_trial(
    tmp_path: Path,
) -> None:
    said, events = run(tmp_path, 70.0, code=ExitCode.USAGE)
    assert "hello" in events  # only the controller can say how many it takes
    assert "drive on" not in events
    assert "later" in said
    assert f"task.command.times has {70 * RATE + 1} values" in said
    assert f"takes {LONGEST_ARRAY} at most" in said
    assert "ask for a shorter command" in said
    assert "nothing was moved" in said
    assert not list(tmp_path.glob("results/*.nxs"))
    assert not list(tmp_path.glob("results/*.partial"))


@pytest.mark.slow
def test_one_that_it_takes_is_executed(tmp_path: Path) -> None:
    _, events = run(tmp_path, 2.0, code=ExitCode.DONE)
    assert events.count("drive on") == 3
