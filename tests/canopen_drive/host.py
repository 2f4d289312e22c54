"""A host as a process that a test kills: one long trial; prints how it ended."""

from __future__ import annotations

import json
import sys

from campaign.backends.canopen import BACKEND, CanopenOptions
from tests.canopen_drive.rig import execute, trial

SWING = {"shape": "sine", "amplitude": 0.8, "frequency": 0.5}


def main(options: str) -> None:
    chosen = CanopenOptions.model_validate(json.loads(options), context={"si": True})
    with BACKEND.open(chosen) as backend:
        ending, _ = execute(backend, trial(command=SWING, duration=90.0, window=(0.0, 90.0)))
        sys.stdout.write(f"{ending.fault} {backend.make_safe()}\n")


if __name__ == "__main__":
    main(sys.argv[1])
