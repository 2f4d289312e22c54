"""Processes that a test kills: a host with one long trial, which prints how it ended; its relay."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from campaign.backends.canopen import CanopenBackend, CanopenOptions
from tests.canopen_drive.rig import execute, quicken, trial

SWING = {"shape": "sine", "amplitude": 0.8, "frequency": 0.5}
SPEED = 2.5
"""Of the relay and its drive; no faster, as processes are not starved alike."""
RELAY = f"""
import os, sys
from campaign.canopen_drive.relay import main
from tests.canopen_drive.rig import quicken
quicken({SPEED})
os._exit(main(sys.argv[1]))
"""


def start_quick(address: str) -> Any:
    """As `start_process`, with a clock of `SPEED`."""
    process = subprocess.Popen(
        [sys.executable, "-c", RELAY, address],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        start_new_session=True,
    )
    return process.stdin, process.stdout, process.wait


def main(options: str) -> None:
    quicken(SPEED)
    chosen = CanopenOptions.model_validate(json.loads(options), context={"si": True})
    with CanopenBackend(chosen, start_quick) as backend:
        ending, _ = execute(backend, trial(command=SWING, duration=90.0, window=(0.0, 90.0)))
        sys.stdout.write(f"{ending.fault} {backend.make_safe()}\n")
